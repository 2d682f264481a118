// Sine, cosine and random numbers whose bits are the same on every platform.
//
// The built-in scenes feed tests and benchmarks that compare hashes between machines. The libm functions differ in their
// last bit from library to library, so a scene is built from + - * / and sqrt alone, which IEEE 754 rounds correctly.
#pragma once

#include <cmath>
#include <cstdint>

#include "halfshade/types.h"

namespace halfshade {

struct CosSin {
  double cos = 1.0, sin = 0.0;
};

/// Cosine and sine of a number of full turns; exact at multiples of a quarter turn, elsewhere within 2 ulp or so.
/// Taylor series on an eighth of a turn: the first term left out is below 2^-56.
inline CosSin cos_sin_turns(double turns) {
  const double quarter = std::floor((turns - std::floor(turns)) * 4.0 + 0.5);  // 0..4
  const double x = ((turns - std::floor(turns)) - quarter * 0.25) * 6.283185307179586477;
  const double x2 = x * x;
  double s = -1.0 / 1307674368000.0, c = -1.0 / 87178291200.0;
  s = s * x2 + 1.0 / 6227020800.0;
  s = s * x2 - 1.0 / 39916800.0;
  s = s * x2 + 1.0 / 362880.0;
  s = s * x2 - 1.0 / 5040.0;
  s = s * x2 + 1.0 / 120.0;
  s = s * x2 - 1.0 / 6.0;
  s = x + x * x2 * s;
  c = c * x2 + 1.0 / 479001600.0;
  c = c * x2 - 1.0 / 3628800.0;
  c = c * x2 + 1.0 / 40320.0;
  c = c * x2 - 1.0 / 720.0;
  c = c * x2 + 1.0 / 24.0;
  c = c * x2 - 0.5;
  c = 1.0 + x2 * c;
  switch (static_cast<int>(quarter) & 3) {
    case 1: return {-s, c};
    case 2: return {-c, -s};
    case 3: return {s, -c};
    default: return {c, s};
  }
}

/// PCG32 (O'Neill 2014). One generator per object, made from the object's index, so that objects can be made in any
/// order and by any number of threads.
class Random {
 public:
  Random(std::uint32_t seed, std::uint32_t index)
      : state_((std::uint64_t{seed} << 32 | index) * 0x9e3779b97f4a7c15u + 0x853c49e6748fea9bu) {
    bits();
    bits();
  }
  std::uint32_t bits() {
    const std::uint64_t old = state_;
    state_ = old * 6364136223846793005u + 1442695040888963407u;
    const auto shifted = static_cast<std::uint32_t>(((old >> 18) ^ old) >> 27);
    const auto rotation = static_cast<std::uint32_t>(old >> 59);
    return (shifted >> rotation) | (shifted << ((32u - rotation) & 31u));
  }
  double uniform() { return static_cast<double>(bits() >> 8) * 0x1p-24; }  // [0, 1)
  double range(double low, double high) { return low + (high - low) * uniform(); }
  /// Uniform on the unit sphere.
  dvec3 direction() {
    const double y = range(-1.0, 1.0);
    const double radius = std::sqrt(1.0 - y * y);
    const CosSin angle = cos_sin_turns(uniform());
    return {radius * angle.cos, y, radius * angle.sin};
  }

 private:
  std::uint64_t state_;
};

}  // namespace halfshade
