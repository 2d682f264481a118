// Lights, camera and view as the user describes them, in world space.
#pragma once

#include <string>

#include "halfshade/export.h"
#include "halfshade/types.h"

namespace halfshade {

/// Shapes of lights, and which members of Light say where they are.
enum class LightShape {
  kPoint,      // center; always one sample
  kRectangle,  // center, u, v (full edge vectors); faces u x v
  kDisk,       // center, normal, radius; faces `normal`
  kSphere,     // center, radius
  kSamples,    // points: explicit, possibly volumetric, sample positions
  kEllipsoid,  // center, axes (half-axis vectors, not necessarily orthogonal): the image of the unit sphere under
               // p -> center + sum of axes[k] p[k]
  kPolygon,    // points: 3..64 corners of a flat, convex polygon; faces the side that sees them counter-clockwise
  kSun,        // normal (the way its light travels), angular_diameter_deg; a description that place_sun() makes a light
};

/// Colours of light over a rectangle, linear RGB >= 0. The image is seen as from the lit side with u to the right and v
/// upwards: row 0 is the edge at +v / 2.
struct EmissionImage {
  std::string name;                           // as written in the view file
  std::uint32_t width = 0, height = 0;        // pixels
  std::vector<vec3> rgb;                      // [height][width]
  bool empty() const { return rgb.empty(); }  // is there no image?
};

/// An area light. Which members count depends on `shape` (see LightShape). One-sided flat lights give no light to
/// receivers at or behind their plane.
struct Light {
  std::string name = "light";                                                 // for messages and files
  LightShape shape = LightShape::kRectangle;                                  // says which of the others count
  dvec3 center{0.0};                                                          // world space
  dvec3 u{1.0, 0.0, 0.0}, v{0.0, 0.0, 1.0};                                   // full edge vectors, world space
  dvec3 normal{0.0, -1.0, 0.0};                                               // of any length but 0
  double radius = 0.0;                                                        // world units, >= 0
  std::vector<dvec3> points;                                                  // world space
  bool two_sided = false;                                                     // flat shapes only
  vec3 emission{1.0f};                                                        // linear RGB >= 0
  std::array<dvec3, 3> axes{dvec3(1, 0, 0), dvec3(0, 1, 0), dvec3(0, 0, 1)};  // half axes, world space
  EmissionImage emission_image;         // kRectangle only: replaces `emission` unless empty (emission.h)
  double angular_diameter_deg = 0.533;  // kSun: of the disk as seen from the scene, 0 < angle <= 60
};

/// Distance of a placed sun from the middle of its box, in half diagonals of that box.
inline constexpr double kSunDistance = 4096.0;

/// The sun as a light with a place: a one-sided disk that faces the box's middle (world space, lowest and highest
/// corner) from kSunDistance half diagonals away and shows the angular diameter there. Everywhere in the box its centre
/// is seen within atan(1 / kSunDistance) = 0.014 degrees of its direction: the shadow of something at height h above a
/// surface lies within h / kSunDistance of where parallel light puts it. A box of size zero counts as one of half
/// diagonal 1. Lights of other shapes are returned as they are. Throws Error{kBadInput} for a direction of length zero,
/// an angle out of range or a box that is not finite.
HALFSHADE_API Light place_sun(const Light& light, const dvec3& low, const dvec3& high);

/// Pinhole camera, right-handed: looks from `eye` towards `target`; image row 0 is the top.
struct Camera {
  dvec3 eye{0.0, 0.0, 5.0}, target{0.0};  // world space
  dvec3 up{0.0, 1.0, 0.0};                // of any length, not parallel to the direction of view
  double fov_y_deg = 45.0;                // between the picture's lower and upper edge, 0 < angle < 180
};

/// What a view file holds.
struct View {
  Camera camera;              // one
  std::vector<Light> lights;  // any number
};

}  // namespace halfshade
