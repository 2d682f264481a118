// A scene as the user describes it: triangles in world space (double), materials and textures.
#pragma once

#include <string>

#include "halfshade/types.h"

namespace halfshade {

/// 8-bit sRGB colour texture, row 0 is the top of the picture (v = 1). Repeats outside 0..1.
struct ColorMap {
  std::string name;                     // of the file, for messages
  std::uint32_t width = 0, height = 0;  // texels
  std::vector<std::uint8_t> rgb;        // [height][width][3]
};

/// 8-bit opacity texture, row 0 is the top of the picture (v = 1). Repeats outside 0..1.
struct AlphaMap {
  std::string name;                     // of the file, for messages
  std::uint32_t width = 0, height = 0;  // texels
  std::vector<std::uint8_t> alpha;      // [height][width]
};

/// Lambert surface. A texel is opaque where alpha / 255 >= alpha_cutoff.
///
/// Translucent surfaces do not block light samples: each crossing multiplies the light by a transmittance per channel,
/// (1 - opacity) * transmittance * transmittance_map; the alpha map of such a surface is no test but says how much of
/// it there is: 1 - a + a * transmittance (halfshade/transmittance.h).
struct Material {
  std::string name;                         // for messages
  vec3 diffuse{0.8f};                       // Kd, linear RGB
  float opacity = 1.0f;                     // d: share of the light that the surface stops; 1 = all
  vec3 transmittance{1.0f};                 // Tf, linear RGB: what the surface leaves of the rest; above 1 counts as 1
  std::uint32_t color_map = kNone;          // index into Scene::color_maps (map_Kd)
  std::uint32_t alpha_map = kNone;          // index into Scene::alpha_maps (map_d)
  float alpha_cutoff = 0.5f;                // 0..1
  std::uint32_t transmittance_map = kNone;  // index into Scene::color_maps (map_Tf); nearest texel

  /// Does light pass through it, tinted?
  bool translucent() const {
    return opacity < 1.0f && (transmittance.x > 0.0f || transmittance.y > 0.0f || transmittance.z > 0.0f);
  }
};

/// Indexed triangles. Positions are finite; indices are in range (the loaders and solves check, Scene does not).
struct Scene {
  std::string name;                                     // for messages
  std::vector<dvec3> positions;                         // world space
  std::vector<std::array<std::uint32_t, 3>> triangles;  // [triangle] -> positions, counter-clockwise seen from outside
  std::vector<std::uint32_t> triangle_materials;        // [triangle] -> materials
  std::vector<std::array<vec2, 3>> triangle_uvs;        // [triangle][corner], or empty when no triangle has any
  std::vector<std::array<vec3, 3>> triangle_normals;  // [triangle][corner] unit shading normals (zero = none), or empty
  std::vector<Material> materials;                    // at least one if there are triangles
  std::vector<ColorMap> color_maps;                   // that materials name by number
  std::vector<AlphaMap> alpha_maps;                   // likewise
};

}  // namespace halfshade
