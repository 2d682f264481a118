// Random numbers for the built-in scenes: the same bits on every platform.
//
// Tests and benchmarks compare hashes of the scenes' shadows between machines. The libm functions differ in their last
// bit from library to library, so a scene is built from + - * / and sqrt alone, which IEEE 754 rounds correctly
// (sine and cosine: core/unit_circle.h).
#pragma once

#include "rasterizer/core/hash.h"
#include "rasterizer/core/unit_circle.h"

namespace halfshade {

/// One generator per object, made from the object's index, so that objects can be made in any order by any thread.
class Random {
 public:
  Random(std::uint32_t seed, std::uint32_t index) : key_(hash32(index, seed)) {}
  std::uint32_t bits() { return hash32(key_, count_++); }
  double uniform() { return hash_unit(key_, count_++); }  // [0, 1)
  double range(double low, double high) { return low + (high - low) * uniform(); }
  /// Uniform on the unit sphere.
  dvec3 direction() {
    const double y = range(-1.0, 1.0);
    const double radius = std::sqrt(1.0 - y * y);
    const dvec2 angle = unit_circle(uniform());
    return {radius * angle.x, y, radius * angle.y};
  }

 private:
  std::uint32_t key_, count_ = 0;
};

}  // namespace halfshade
