// Points along a Morton curve, so that runs of them are compact.
#pragma once

#include "halfshade/types.h"
#include "rasterizer/core/radix_sort.h"

namespace halfshade {

/// 10 bits of x with two zero bits between each.
inline std::uint32_t spread_bits(std::uint32_t x) {
  x = (x | x << 16) & 0x030000ffu;
  x = (x | x << 8) & 0x0300f00fu;
  x = (x | x << 4) & 0x030c30c3u;
  return (x | x << 2) & 0x09249249u;
}

/// Kept from call to call so that ordering again allocates nothing.
struct MortonScratch {
  using Key = std::pair<std::uint32_t, std::uint32_t>;  // code, index
  std::vector<Key> keys, scratch;
  RadixCounts counts;
};

/// Indices of the points for which keep(index) holds, by their place among 1024^3 cells of the box around all points;
/// within a cell by index.
template <class Keep>
void morton_order(std::span<const vec3> points, const Keep& keep, MortonScratch& scratch,
                  std::vector<std::uint32_t>& order) {
  constexpr std::uint32_t kDropped = 1u << 30;  // behind all codes
  auto& keys = scratch.keys;
  keys.resize(points.size());
  vec3 low(2.0f), high(-2.0f);
  for (const vec3& p : points) low = glm::min(low, p), high = glm::max(high, p);
  const vec3 scale = 1023.0f / glm::max(high - low, vec3(1e-30f));
  parallel_ranges(points.size(), 8192, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) {
      const vec3 q = (points[i] - low) * scale;
      const auto index = static_cast<std::uint32_t>(i);
      keys[i] = {!keep(index) ? kDropped
                              : spread_bits(static_cast<std::uint32_t>(q.x)) |
                                    spread_bits(static_cast<std::uint32_t>(q.y)) << 1 |
                                    spread_bits(static_cast<std::uint32_t>(q.z)) << 2,
                 index};
    }
  });
  const auto code = [](const MortonScratch::Key& key) { return key.first; };
  parallel_radix_sort(keys, scratch.scratch, kDropped + 1, code, scratch.counts);
  order.clear();
  order.reserve(points.size());
  for (const auto& key : keys) {
    if (key.first == kDropped) break;
    order.push_back(key.second);
  }
}

template <class Keep>
std::vector<std::uint32_t> morton_order(std::span<const vec3> points, const Keep& keep) {
  MortonScratch scratch;
  std::vector<std::uint32_t> order;
  morton_order(points, keep, scratch, order);
  return order;
}

}  // namespace halfshade
