// The texel of a textured triangle under a shadow segment, and so the opacity of an alpha-tested one: exact.
//
// The hit divides the triangle by the three edge determinants w_i = det(edge_i, l - r), integers on the lattice; the
// texture coordinate is the rational number sum(w_i uv_i) / sum(w_i). The texel under it is floor(u W) mod W, decided
// in double where the error bound allows, otherwise by comparing 256-bit integers, so that every method, thread and
// instruction set reads the same texel (stability.md b and B7).
#pragma once

#include "rasterizer/core/mesh.h"
#include "rasterizer/core/predicate.h"

namespace halfshade {

/// Texture coordinates live on multiples of 2^-32, |uv| <= 2^30.
inline constexpr double kUvUnitsPerOne = 0x1p32;

/// Smallest alpha (0..255) that counts as opaque: alpha / 255 >= cutoff.
std::uint32_t opaque_threshold(float cutoff);

/// Where the texels of a texture lie on a triangle.
struct TexturedTriangle {
  std::array<vec3, 3> corners;
  std::array<std::int64_t, 3> u, v;  // texture coordinates of the corners in 2^-32
  std::uint32_t width = 1, height = 1;
};

/// For a scene with texture coordinates.
TexturedTriangle make_textured_triangle(const LatticeMesh& mesh, std::uint32_t triangle, std::uint32_t width,
                                        std::uint32_t height);

/// An alpha-tested triangle, gathered for repeated lookups. References the scene's map.
struct AlphaTriangle : TexturedTriangle {
  const AlphaMap* map = nullptr;
  std::uint32_t threshold = 128;
};

AlphaTriangle make_alpha_triangle(const LatticeMesh& mesh, std::uint32_t triangle);

/// Texel (column, row; row 0 = top) where the segment r-l crosses the triangle. Requires blocks(corners, r, l).
/// `exact_fallbacks`, if given, is incremented for each coordinate that double could not decide.
std::array<std::uint32_t, 2> texel_at_hit(const TexturedTriangle& triangle, const vec3& r, const vec3& l,
                                          std::uint64_t* exact_fallbacks = nullptr);

/// Same requirement; true where the texel under the hit is opaque.
bool opaque_at_hit(const AlphaTriangle& triangle, const vec3& r, const vec3& l,
                   std::uint64_t* exact_fallbacks = nullptr);

/// Lookups for one receiver and many samples: texture coordinates as ratios of three linear functions of the sample,
/// in double with an error bound; what that leaves open goes to texel_at_hit. The same texels, faster.
class TexelLookup {
 public:
  TexelLookup(const TexturedTriangle& triangle, const vec3& receiver);

  /// Requires blocks(corners, receiver, l).
  std::array<std::uint32_t, 2> texel(const vec3& l, std::uint64_t& exact_fallbacks) const;

  /// Coordinate = dot(u, l - r) / dot(sum, l - r), in texels; numerators and denominator are within error |l - r|_1,
  /// times `reach` (largest coordinate of a corner) for the numerators.
  struct Planes {
    dvec3 u{0.0}, v{0.0}, sum{0.0};
    double error = 0.0, reach = 0.0;
  };
  const Planes& planes() const { return planes_; }

 private:
  const TexturedTriangle& triangle_;
  vec3 receiver_;
  Planes planes_;
};

class AlphaLookup {
 public:
  AlphaLookup(const AlphaTriangle& triangle, const vec3& receiver) : triangle_(triangle), lookup_(triangle, receiver) {}

  /// Requires blocks(corners, receiver, l). True where the texel under the hit is opaque.
  bool opaque(const vec3& l, std::uint64_t& exact_fallbacks) const {
    const auto [column, row] = lookup_.texel(l, exact_fallbacks);
    return triangle_.map->alpha[std::size_t{row} * triangle_.width + column] >= triangle_.threshold;
  }

 private:
  const AlphaTriangle& triangle_;
  TexelLookup lookup_;
};

}  // namespace halfshade
