#include "shadows/alpha.h"

#include <algorithm>
#include <cmath>

namespace halfshade {
namespace {

__extension__ using UInt128 = unsigned __int128;

/// 256-bit two's complement sum of products of 128-bit integers; only its sign is read.
class WideSum {
 public:
  void add_product(Int128 x, Int128 y) {
    const bool negative = (x < 0) != (y < 0);
    const UInt128 a = x < 0 ? -static_cast<UInt128>(x) : static_cast<UInt128>(x);
    const UInt128 b = y < 0 ? -static_cast<UInt128>(y) : static_cast<UInt128>(y);
    const UInt128 a0 = static_cast<std::uint64_t>(a), a1 = a >> 64, b0 = static_cast<std::uint64_t>(b), b1 = b >> 64;
    const UInt128 p00 = a0 * b0, p01 = a0 * b1, p10 = a1 * b0, p11 = a1 * b1;
    const UInt128 middle = (p00 >> 64) + static_cast<std::uint64_t>(p01) + static_cast<std::uint64_t>(p10);
    const UInt128 low = (middle << 64) | static_cast<std::uint64_t>(p00);
    const UInt128 high = p11 + (p01 >> 64) + (p10 >> 64) + (middle >> 64);
    negative ? add(~high + (low == 0), -low) : add(high, low);
  }
  bool is_negative() const { return (high_ >> 127) != 0; }

 private:
  void add(UInt128 high, UInt128 low) {
    low_ += low;
    high_ += high + (low_ < low);
  }
  UInt128 high_ = 0, low_ = 0;
};

struct Weights {
  std::array<double, 3> value;  // w_i >= 0 up to `error`
  double error;                 // bound on |value - exact|, the same for all three
};

/// det(p-r, q-r, l-r) for the three edges, opposite to corner 0, 1, 2. Differences are exact; see predicate.h.
Weights edge_weights(const std::array<vec3, 3>& corner, const vec3& r, const vec3& l) {
  const dvec3 origin(r), s = dvec3(l) - origin;
  const std::array<dvec3, 3> p = {dvec3(corner[0]) - origin, dvec3(corner[1]) - origin, dvec3(corner[2]) - origin};
  Weights w{};
  double size = 0.0;
  for (int i = 0; i < 3; ++i) {
    const dvec3 &a = p[(i + 1) % 3], &b = p[(i + 2) % 3];
    w.value[i] = glm::dot(glm::cross(a, b), s);
    const dvec3 m = glm::abs(a), n = glm::abs(b);
    const dvec3 permanent(m.y * n.z + m.z * n.y, m.z * n.x + m.x * n.z, m.x * n.y + m.y * n.x);
    size = std::max(size, glm::dot(permanent, glm::abs(s)));
  }
  w.error = 8.0 * 0x1p-53 * size;
  return w;
}

/// The three weights as integers, signed so that their sum is positive.
std::array<Int128, 3> exact_weights(const std::array<vec3, 3>& corner, const vec3& r, const vec3& l) {
  std::array<Int128, 3> w;
  for (int i = 0; i < 3; ++i) w[i] = orient3d_exact(corner[(i + 1) % 3], corner[(i + 2) % 3], l, r);
  if (w[0] < 0 || w[1] < 0 || w[2] < 0) {
    for (Int128& x : w) x = -x;
  }
  return w;
}

/// floor(sum(w_i c_i) / sum(w_i) * size), exactly: the largest k with sum(w_i (c_i size - k)) >= 0.
std::int64_t exact_texel(const std::array<Int128, 3>& w, const std::array<std::int64_t, 3>& c, std::uint32_t size) {
  const auto texel_of = [size](std::int64_t x) { return static_cast<std::int64_t>((Int128{x} * size) >> 32); };
  std::int64_t low = texel_of(std::min({c[0], c[1], c[2]})), high = texel_of(std::max({c[0], c[1], c[2]})) + 1;
  while (high - low > 1) {
    const std::int64_t k = low + (high - low) / 2;
    WideSum sum;
    for (int i = 0; i < 3; ++i) sum.add_product(w[i], Int128{c[i]} * size - (Int128{k} << 32));
    (sum.is_negative() ? high : low) = k;
  }
  return low;
}

std::uint32_t wrap(std::int64_t texel, std::uint32_t size) {
  if (texel >= 0 && texel < static_cast<std::int64_t>(size)) return static_cast<std::uint32_t>(texel);
  const std::int64_t m = texel % static_cast<std::int64_t>(size);
  return static_cast<std::uint32_t>(m < 0 ? m + size : m);
}

/// |x| < 2^62. Without the library call that std::floor is on processors before SSE 4.1.
std::int64_t floor_of(double x) {
  const auto truncated = static_cast<std::int64_t>(x);
  return truncated - (x < static_cast<double>(truncated));
}

/// One coordinate of the texel: double where the bound leaves one integer, else exact.
class TexelFinder {
 public:
  TexelFinder(const TexturedTriangle& triangle, const vec3& r, const vec3& l)
      : triangle_(triangle), r_(r), l_(l), weights_(edge_weights(triangle.corners, r, l)) {
    sum_ = weights_.value[0] + weights_.value[1] + weights_.value[2];
  }

  std::int64_t find(const std::array<std::int64_t, 3>& c, std::uint32_t size, std::uint64_t* exact_fallbacks) const {
    double numerator = 0.0, magnitude = 0.0;
    for (int i = 0; i < 3; ++i) {
      const double x = static_cast<double>(c[i]);
      numerator += weights_.value[i] * x;
      magnitude = std::max(magnitude, std::fabs(x));
    }
    const double scale = size / kUvUnitsPerOne, total = std::fabs(sum_);
    const double texel = numerator / sum_ * scale;
    // |w_i| errors move numerator and sum by 3 error each; the remaining roundings are below 16 units of the last
    // place.
    const double error = (7.0 * weights_.error / total + 16.0 * 0x1p-53) * magnitude * scale * 2.0;
    const double low = std::floor(texel - error), high = std::floor(texel + error);
    if (total > 16.0 * weights_.error && low == high) return static_cast<std::int64_t>(low);
    if (exact_fallbacks != nullptr) ++*exact_fallbacks;
    return exact_texel(exact_weights(triangle_.corners, r_, l_), c, size);
  }

 private:
  const TexturedTriangle& triangle_;
  const vec3 &r_, &l_;
  Weights weights_;
  double sum_ = 0.0;
};

}  // namespace

std::uint32_t opaque_threshold(float cutoff) {
  for (std::uint32_t alpha = 0; alpha < 256; ++alpha) {
    if (static_cast<double>(alpha) >= static_cast<double>(cutoff) * 255.0) return alpha;
  }
  return 256;
}

TexturedTriangle make_textured_triangle(const LatticeMesh& mesh, std::uint32_t triangle, std::uint32_t width,
                                        std::uint32_t height) {
  TexturedTriangle result;
  result.corners = mesh.corners(triangle);
  for (int i = 0; i < 3; ++i) {
    const vec2 uv = mesh.scene->triangle_uvs[triangle][i];
    result.u[i] = static_cast<std::int64_t>(std::nearbyint(static_cast<double>(uv.x) * kUvUnitsPerOne));
    result.v[i] = static_cast<std::int64_t>(std::nearbyint(static_cast<double>(uv.y) * kUvUnitsPerOne));
  }
  result.width = width, result.height = height;
  return result;
}

AlphaTriangle make_alpha_triangle(const LatticeMesh& mesh, std::uint32_t triangle) {
  const Scene& scene = *mesh.scene;
  const Material& material = scene.materials[scene.triangle_materials[triangle]];
  const AlphaMap& map = scene.alpha_maps[material.alpha_map];
  return {make_textured_triangle(mesh, triangle, map.width, map.height), &map, opaque_threshold(material.alpha_cutoff)};
}

std::array<std::uint32_t, 2> texel_at_hit(const TexturedTriangle& triangle, const vec3& r, const vec3& l,
                                          std::uint64_t* exact_fallbacks) {
  const TexelFinder finder(triangle, r, l);
  const std::uint32_t column = wrap(finder.find(triangle.u, triangle.width, exact_fallbacks), triangle.width);
  const std::uint32_t up = wrap(finder.find(triangle.v, triangle.height, exact_fallbacks), triangle.height);
  return {column, triangle.height - 1 - up};
}

TexelLookup::TexelLookup(const TexturedTriangle& triangle, const vec3& receiver)
    : triangle_(triangle), receiver_(receiver) {
  const auto norm1 = [](const dvec3& v) { return std::fabs(v.x) + std::fabs(v.y) + std::fabs(v.z); };
  const dvec3 origin(receiver);
  double size = 0.0, reach = 0.0;
  for (int i = 0; i < 3; ++i) {
    const dvec3 a = dvec3(triangle.corners[(i + 1) % 3]) - origin, b = dvec3(triangle.corners[(i + 2) % 3]) - origin;
    const dvec3 weight = glm::cross(a, b);
    const double u = static_cast<double>(triangle.u[i]) * (triangle.width / kUvUnitsPerOne);
    const double v = static_cast<double>(triangle.v[i]) * (triangle.height / kUvUnitsPerOne);
    planes_.u += weight * u, planes_.v += weight * v, planes_.sum += weight;
    size += norm1(a) * norm1(b);
    reach = std::max({reach, std::fabs(u), std::fabs(v)});
  }
  // Each term is a product of three or four factors with one rounding each, summed: below 12 units of 2^-53 of the sum
  // of magnitudes, for numerator (times the largest coordinate) and denominator alike; 16 with room.
  planes_.error = 16.0 * 0x1p-53 * size;
  planes_.reach = reach;
}

std::array<std::uint32_t, 2> TexelLookup::texel(const vec3& l, std::uint64_t& exact_fallbacks) const {
  const dvec3 s = dvec3(l) - dvec3(receiver_);
  const double sum = glm::dot(planes_.sum, s),
               spread = planes_.error * (std::fabs(s.x) + std::fabs(s.y) + std::fabs(s.z));
  const double error = planes_.reach * (2.0 * spread / std::fabs(sum) + 8.0 * 0x1p-53) * 2.0;
  if (!(std::fabs(sum) > 4.0 * spread)) return texel_at_hit(triangle_, receiver_, l, &exact_fallbacks);
  // Near a mean of the corners' coordinates, which are below 2^46 texels: they fit into integers.
  const double u = glm::dot(planes_.u, s) / sum, v = glm::dot(planes_.v, s) / sum;
  const std::int64_t column = floor_of(u), up = floor_of(v);
  const double in_column = u - static_cast<double>(column), in_row = v - static_cast<double>(up);
  const double from_border = std::min({in_column, 1.0 - in_column, in_row, 1.0 - in_row});
  if (!(from_border > error)) return texel_at_hit(triangle_, receiver_, l, &exact_fallbacks);
  return {wrap(column, triangle_.width), triangle_.height - 1 - wrap(up, triangle_.height)};
}

bool opaque_at_hit(const AlphaTriangle& triangle, const vec3& r, const vec3& l, std::uint64_t* exact_fallbacks) {
  const auto [column, row] = texel_at_hit(triangle, r, l, exact_fallbacks);
  return triangle.map->alpha[std::size_t{row} * triangle.map->width + column] >= triangle.threshold;
}

}  // namespace halfshade
