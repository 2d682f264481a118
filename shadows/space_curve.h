// Points along a curve that fills space, so that runs of them are compact.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <span>
#include <utility>
#include <vector>

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

/// By the bits of all three axes in turn: every second step jumps. Cells are stretched with the box around the points.
struct MortonCurve {
  static vec3 cells(const vec3& extent) { return 1023.0f / glm::max(extent, vec3(1e-30f)); }
  static std::uint32_t code(std::uint32_t x, std::uint32_t y, std::uint32_t z) {
    return spread_bits(x) | spread_bits(y) << 1 | spread_bits(z) << 2;
  }
};

/// Three bits.
constexpr std::uint32_t rotated_left(std::uint32_t b, std::uint32_t by) {
  return ((b << by % 3) | (b >> (3 - by % 3))) & 7;
}

/// Hilbert's curve: neighbours along it are neighbours in space. Cells are cubes.
///
/// Level by level an octant's number along the curve follows from where the curve enters and leaves the cell, and both
/// are found for the octant (C. Hamilton, "Compact Hilbert Indices", 2006, section 2). Two levels are one step here.
class HilbertCurve {
 public:
  static vec3 cells(const vec3& extent) { return vec3(1023.0f / std::max({extent.x, extent.y, extent.z, 1e-30f})); }
  static std::uint32_t code(std::uint32_t x, std::uint32_t y, std::uint32_t z) {
    const std::uint32_t bits = MortonCurve::code(x, y, z);
    std::uint32_t code = 0, state = 0;
    for (int shift = 24; shift >= 0; shift -= 6) {
      const Step step = kSteps[64 * state + (bits >> shift & 63)];
      code = code << 6 | step.digit;
      state = step.state;
    }
    return code;
  }

 private:
  struct Step {
    std::uint8_t digit, state;  // of 24: corner of entry + 8 x axis of exit
  };
  static constexpr Step step(std::uint32_t state, std::uint32_t octant) {
    const std::uint32_t entry = state % 8, axis = state / 8;
    const std::uint32_t gray = rotated_left(octant ^ entry, 3 - (axis + 1) % 3);
    const std::uint32_t w = gray ^ gray >> 1 ^ gray >> 2;  // the octant's place along the curve
    const std::uint32_t even = w == 0 ? 0 : (w - 1) / 2 * 2, to_entry = even ^ even >> 1;
    const auto to_axis = w == 0 ? 0u : static_cast<std::uint32_t>(std::countr_one(w % 2 == 0 ? w - 1 : w)) % 3;
    const std::uint32_t next_entry = entry ^ rotated_left(to_entry, axis + 1), next_axis = (axis + to_axis + 1) % 3;
    return {static_cast<std::uint8_t>(w), static_cast<std::uint8_t>(next_entry + 8 * next_axis)};
  }
  static constexpr auto make_steps() {
    std::array<Step, 24 * 64> steps{};
    for (std::uint32_t state = 0; state < 24; ++state) {
      for (std::uint32_t octants = 0; octants < 64; ++octants) {
        const Step first = step(state, octants >> 3), second = step(first.state, octants & 7);
        steps[64 * state + octants] = {static_cast<std::uint8_t>(first.digit << 3 | second.digit), second.state};
      }
    }
    return steps;
  }
  static const std::array<Step, 24 * 64> kSteps;
};
inline constexpr std::array<HilbertCurve::Step, 24 * 64> HilbertCurve::kSteps = HilbertCurve::make_steps();

/// Kept from call to call so that ordering again allocates nothing.
struct CurveScratch {
  using Key = std::pair<std::uint32_t, std::uint32_t>;  // code, index
  std::vector<Key> keys, scratch;
  RadixCounts counts;

  void reserve(std::size_t count) { keys.reserve(count), scratch.reserve(count), counts.reserve(count); }
};

/// Indices of the points for which keep(index) holds, by the place of their cell along the curve through 1024^3 cells
/// around all points; within a cell by index.
template <class Curve, class Keep>
void order_along(std::span<const vec3> points, const Keep& keep, CurveScratch& scratch,
                 std::vector<std::uint32_t>& order) {
  constexpr std::uint32_t kDropped = 1u << 30;  // behind all codes
  auto& keys = scratch.keys;
  keys.resize(points.size());
  vec3 low(2.0f), high(-2.0f);
  for (const vec3& p : points) low = glm::min(low, p), high = glm::max(high, p);
  const vec3 scale = Curve::cells(high - low);
  parallel_ranges(points.size(), 8192, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) {
      const vec3 q = (points[i] - low) * scale;
      const auto index = static_cast<std::uint32_t>(i);
      keys[i] = {!keep(index) ? kDropped
                              : Curve::code(static_cast<std::uint32_t>(q.x), static_cast<std::uint32_t>(q.y),
                                            static_cast<std::uint32_t>(q.z)),
                 index};
    }
  });
  const auto code = [](const CurveScratch::Key& key) { return key.first; };
  parallel_radix_sort(keys, scratch.scratch, kDropped + 1, code, scratch.counts);
  const auto end =
      std::partition_point(keys.begin(), keys.end(), [](const auto& key) { return key.first != kDropped; });
  order.reserve(points.size());  // whatever share of them is kept in the next frame
  order.resize(static_cast<std::size_t>(end - keys.begin()));
  parallel_ranges(order.size(), 16384, [&](std::size_t begin, std::size_t last) {
    for (std::size_t i = begin; i != last; ++i) order[i] = keys[i].second;
  });
}

template <class Curve, class Keep>
std::vector<std::uint32_t> order_along(std::span<const vec3> points, const Keep& keep) {
  CurveScratch scratch;
  std::vector<std::uint32_t> order;
  order_along<Curve>(points, keep, scratch, order);
  return order;
}

}  // namespace halfshade
