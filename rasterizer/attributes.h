// What a sample of the G-buffer holds besides its triangle: position, normals, albedo, depth; and the alpha test.
//
// Both interpolate with the weights of the ray through the sample's centre in the true, unsnapped triangle.
#pragma once

#include "rasterizer/camera_frame.h"
#include "rasterizer/core/mesh.h"
#include "rasterizer/gbuffer.h"

namespace halfshade {

/// Barycentric weights as ratios of linear functions of the ray: the rows of the inverse of the matrix whose columns
/// are the corners seen from the eye (Olano and Greer 1997). No division by w, so corners behind the eye are no case.
struct BarycentricPlanes {
  dvec3 determinant{0.0}, second{0.0}, third{0.0};

  /// Weights of the three corners for a ray from the eye: none negative, sum 1 within rounding. A ray that misses the
  /// triangle by the rounding of its outline gets a point on the border.
  dvec3 weights(const dvec3& ray) const;
};

BarycentricPlanes make_barycentric_planes(const std::array<vec3, 3>& corners, const dvec3& eye);

/// Is the texel under (u, v) opaque? Nearest texel, repeated: column floor(u W) mod W, row H - 1 - floor(v H) mod H.
bool is_opaque(const AlphaMap& map, double u, double v, float cutoff);

/// The alpha test of one triangle of a mesh with a scene.
class AlphaTest {
 public:
  /// `alpha_map` is mesh.alpha_map(triangle), not kNone.
  AlphaTest(const LatticeMesh& mesh, const CameraFrame& camera, std::uint32_t triangle, std::uint32_t alpha_map);
  bool passes(const dvec3& ray) const;

 private:
  BarycentricPlanes planes_;
  const std::array<vec2, 3>& uvs_;
  const AlphaMap& map_;
  float cutoff_;
};

/// Fills the entries of row y, columns x0 .. x0 + triangles.size(), in picture coordinates.
void resolve_row(const LatticeMesh& mesh, const CameraFrame& camera, std::uint32_t x0, std::uint32_t y,
                 std::span<const std::uint32_t> triangles, GBuffer& gbuffer);

}  // namespace halfshade
