// Transmittance in fixed point: products as sums of integers.
//
// Multiplication in fixed point rounds, and so depends on the order of the factors; addition of integers does not. A
// transmittance T is kept as its attenuation -log2(T) in units of 2^-16, rounded to the nearest once per material or
// texel; a product of any number of factors is a sum of integers, in any order, and is turned back once.
//
// Bound: n factors are off by at most n / 2 units together, so the product by a factor of at most 2^(n 2^-17), that is
// by less than n * 5.3e-6 of itself; factors below 2^-24 count as zero (6e-8); turning back adds 2^-32 at most.
#pragma once

#include <algorithm>
#include <cstdint>

namespace halfshade {

/// -log2(T) in 2^-16; kNoLight and above stand for T = 0.
using Attenuation = std::uint32_t;

inline constexpr Attenuation kNoLight = 1u << 30;
inline constexpr double kAttenuationUnit = 0x1p-16;

/// Of a transmittance; 0 from 1 upwards, kNoLight below 2^-24 and for NaN. No call whose bits vary by platform.
Attenuation attenuation_of(double transmittance);

/// Of the product. Sums stop at kNoLight: min(x + y, limit) of non-negative integers is as associative as x + y.
inline Attenuation add_attenuation(Attenuation a, Attenuation b) { return std::min(a + b, kNoLight); }

/// 2^32 T, rounded to the nearest: 2^32 for an attenuation of 0.
std::uint64_t transmittance_of(Attenuation attenuation);

}  // namespace halfshade
