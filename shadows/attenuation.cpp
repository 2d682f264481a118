#include "shadows/attenuation.h"

#include <array>
#include <cmath>

namespace halfshade {
namespace {

__extension__ using UInt128 = unsigned __int128;

constexpr int kFractionBits = 63;  // of the tables

constexpr std::uint64_t multiply(std::uint64_t a, std::uint64_t b) {
  return static_cast<std::uint64_t>((UInt128{a} * b) >> kFractionBits);
}

/// Largest root with root^2 <= x 2^63, for x <= 2^63.
constexpr std::uint64_t square_root(std::uint64_t x) {
  const UInt128 wanted = UInt128{x} << kFractionBits;
  std::uint64_t root = 0;
  for (int bit = kFractionBits; bit >= 0; --bit) {
    const std::uint64_t larger = root | std::uint64_t{1} << bit;
    if (UInt128{larger} * larger <= wanted) root = larger;
  }
  return root;
}

/// 2^-(i / steps) for i = 0..255, in 2^-63; steps is a power of two. From repeated square roots of 1/2.
constexpr std::array<std::uint64_t, 256> make_powers(std::uint32_t steps) {
  std::uint64_t power_of_bit[8] = {};
  std::uint64_t power = std::uint64_t{1} << (kFractionBits - 1);  // 2^-1
  for (std::uint32_t fraction = 1; fraction < steps; fraction *= 2) {
    power = square_root(power);
    const std::uint32_t index = steps / 2 / fraction;  // power is 2^-(index / steps)
    for (std::uint32_t bit = 0; bit < 8; ++bit) {
      if (index == 1u << bit) power_of_bit[bit] = power;
    }
  }
  std::array<std::uint64_t, 256> table{};
  for (std::uint32_t i = 0; i < 256; ++i) {
    table[i] = std::uint64_t{1} << kFractionBits;
    for (std::uint32_t bit = 0; bit < 8; ++bit) {
      if ((i >> bit) & 1) table[i] = multiply(table[i], power_of_bit[bit]);
    }
  }
  return table;
}

constexpr std::array<std::uint64_t, 256> kCoarse = make_powers(256);  // 2^-(i / 2^8)
constexpr std::array<std::uint64_t, 256> kFine = make_powers(65536);  // 2^-(i / 2^16)

/// log2(x) for x in [sqrt(1/2), sqrt(2)], by the series of the inverse hyperbolic tangent; error below 1e-14.
double log2_near_one(double x) {
  const double s = (x - 1.0) / (x + 1.0), s2 = s * s;  // |s| <= 0.1716
  double sum = 0.0;
  for (int k = 15; k >= 1; k -= 2) sum = sum * s2 + 1.0 / k;
  return sum * s * 2.88539008177792681472;  // 2 / ln 2
}

}  // namespace

Attenuation attenuation_of(double transmittance) {
  if (transmittance >= 1.0) return 0;
  if (!(transmittance >= 0x1p-24)) return kNoLight;
  int exponent = 0;
  double mantissa = std::frexp(transmittance, &exponent);  // in [1/2, 1), exact
  if (mantissa < 0.70710678118654752) mantissa *= 2.0, --exponent;
  return static_cast<Attenuation>(std::floor((-exponent - log2_near_one(mantissa)) / kAttenuationUnit + 0.5));
}

std::uint64_t transmittance_of(Attenuation attenuation) {
  const std::uint32_t shift = (attenuation >> 16) + kFractionBits - 32;
  if (shift > 63) return 0;
  const std::uint64_t power = multiply(kCoarse[(attenuation >> 8) & 255], kFine[attenuation & 255]);
  return (power + (std::uint64_t{1} << (shift - 1))) >> shift;
}

}  // namespace halfshade
