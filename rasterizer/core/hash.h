// Integer hash for everything "random" that must be the same on every machine.
#pragma once

#include <cstdint>

namespace halfshade {

/// A 32-bit mixer with full avalanche (multiply-xorshift; constants from C. Wellons' hash prospector, 2018).
constexpr std::uint32_t hash32(std::uint32_t x) {
  x ^= x >> 16;
  x *= 0x7feb352du;
  x ^= x >> 15;
  x *= 0x846ca68bu;
  x ^= x >> 16;
  return x;
}

constexpr std::uint32_t hash32(std::uint32_t a, std::uint32_t b) { return hash32(a ^ (hash32(b) + 0x9e3779b9u)); }

/// [0, 1) in steps of 2^-24.
constexpr double hash_unit(std::uint32_t a, std::uint32_t b) { return (hash32(a, b) >> 8) * 0x1p-24; }

}  // namespace halfshade
