// Soft shadow volume of a triangle: everything that it may hide some part of the light from (Forest, Barthe, Paulin
// 2009, section 2.2).
//
// Algorithm: the front cap is the triangle itself. Each of its edges carries the outer quad of its penumbra wedge: a
// plane through the edge that supports the light, which lies on one side of it while the triangle lies on the other.
// Two adjacent outer quads meet in a ray from the corner they share, along the cross product of their normals; the back
// cap joins the three rays where they have left the receivers' box.
//
// A receiver r hidden from l by the point p of the triangle lies at l + s (p - l), s >= 1. If n . l <= b for the whole
// light and n . t >= b for the whole triangle then n . r >= b: that is all that is asked of a plane, and a plane is
// kept only where its rounded numbers show it. So a volume may be too large, never too small. Degenerate configurations
// (an edge that points at the light, a sliver, a corner inside the light) lose planes instead of turning inside out.
//
// Where the triangle's plane cuts the light, each side of the triangle is lit by a part of it and shadows the other
// side: two volumes, each for its own part of the light (section 6 of the paper).
#pragma once

#include "shadows/penumbra_volume.h"

namespace halfshade {

struct LatticeBox {
  vec3 low{2.0f}, high{-2.0f};
  void add(const vec3& p) { low = glm::min(low, p), high = glm::max(high, p); }
};

/// Six vertices, four planes: front cap and three outer quads (plane 1 + k belongs to the edge from corner k).
struct SoftShadowVolume {
  static constexpr std::size_t kPlanes = 4;
  std::array<dvec3, kPlanes> normal{};   // unit, pointing into the volume; zero where there is no plane
  std::array<double, kPlanes> offset{};  // inside: normal . p >= offset; -1 where there is no plane
  int light_side = 0;                    // of the blocker's plane; 0 = the volume stands for both sides
  bool closed = false;                   // all planes are there and the back cap exists: `vertex` is valid
  std::array<dvec3, 6> vertex{};         // front cap 0, 1, 2; back cap 3, 4, 5, where 3 + k is extruded from k
  dvec3 low{-HUGE_VAL}, high{HUGE_VAL};  // box around the closed volume
};

/// The closed volume as a triangle strip of ten vertices (figure 6).
inline constexpr std::array<std::uint8_t, 10> kSoftShadowVolumeStrip = {3, 4, 5, 2, 3, 0, 4, 1, 2, 0};

/// The volume of the part of the light that lies on one side of the blocker's plane: above it (along the normal of its
/// winding) for light_side = 1, below for -1. False where no part of the light does. `receivers` is what the volume is
/// clamped to.
bool make_soft_shadow_volume(const LightHull& hull, const std::array<vec3, 3>& blocker, int light_side,
                             const LatticeBox& receivers, SoftShadowVolume& volume);

}  // namespace halfshade
