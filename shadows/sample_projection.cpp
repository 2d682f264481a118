#include "shadows/sample_projection.h"

#include <algorithm>
#include <cmath>

namespace halfshade {
namespace {

double norm1(const dvec3& v) { return std::fabs(v.x) + std::fabs(v.y) + std::fabs(v.z); }

void fit_coordinate(const std::array<std::int64_t, 3>& c, std::uint32_t size, std::array<double, 3>& texels) {
  const std::int64_t repetition = std::min({c[0], c[1], c[2]}) >> 32;  // rounds down
  for (std::size_t i = 0; i < 3; ++i) {
    texels[i] = static_cast<double>(c[i] - (repetition << 32)) * (size / kUvUnitsPerOne);
  }
}

}  // namespace

OpacityBits make_opacity_bits(const AlphaMap& map, std::uint32_t threshold) {
  OpacityBits opacity{map.width, map.height, {}};
  const std::size_t count = std::size_t{map.width} * map.height;
  opacity.bits.assign((count + 31) / 32, 0);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t row = map.height - 1 - i / map.width;
    const bool opaque = map.alpha[row * map.width + i % map.width] >= threshold;
    opacity.bits[i / 32] |= std::uint32_t{opaque} << (i % 32);
  }
  return opacity;
}

CornerTexels make_corner_texels(const AlphaTriangle& triangle) {
  CornerTexels s;
  fit_coordinate(triangle.u, triangle.map->width, s.u);
  fit_coordinate(triangle.v, triangle.map->height, s.v);
  for (std::size_t i = 0; i < 3; ++i) s.reach = std::max({s.reach, s.u[i], s.v[i]});
  return s;
}

SampleProjection make_sample_projection(const Blocker& blocker, const KernelSamples& samples, const vec3& receiver,
                                        int side) {
  constexpr double kFloat = 0x1p-24, kDouble = 0x1p-53;
  const dvec3 origin(receiver), to_center = dvec3(samples.center) - origin;
  const double reach = samples.reach, distance = norm1(to_center) + reach;
  SampleProjection j;
  for (std::size_t k = 0; k < 3; ++k) {
    const dvec3 to_corner = dvec3(blocker.corner[k]) - origin;
    const dvec3 edge = dvec3(blocker.corner[(k + 1) % 3]) - dvec3(blocker.corner[k]);
    j.normal[k] = glm::cross(to_corner, edge) * static_cast<double>(side);
    j.offset[k] = glm::dot(j.normal[k], to_center);
    // In float: rounded normal and rounded offset of the sample, one rounding of each product, three of the sums: 6
    // units on the products, 4 on the constant; 7 with room. In double: the differences are exact, cross and dot
    // product stay below 8 units of the product of norms.
    j.error[k] = 7.0 * kFloat * (norm1(j.normal[k]) * reach + std::fabs(j.offset[k])) +
                 16.0 * kDouble * norm1(to_corner) * norm1(edge) * distance + 0x1p-120;
  }
  return j;
}

}  // namespace halfshade
