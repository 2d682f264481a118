// Exact visibility of one light sample behind one triangle: the only definition of "blocked" in the project.
//
// blocks(T, r, l): r and l lie strictly on opposite sides of T's plane and the segment r-l meets the closed triangle,
// in exact arithmetic. All points are on the lattice (lattice.h): differences are exact in double, products are not, so
// a double filter with a forward error bound decides nearly all cases and 128-bit integers decide the rest
// (Shewchuk 1997, "Adaptive Precision Floating-Point Arithmetic", stage A; the fallback is plain integer arithmetic).
#pragma once

#include <cmath>
#include <cstdint>

#include "rasterizer/core/lattice.h"

namespace halfshade {

__extension__ using Int128 = __int128;

inline constexpr int kUndecided = 2;

/// Sign of det(a-d, b-d, c-d) where the rounding errors of `Real` cannot change it, else kUndecided.
/// `Real` is float or double. The bound holds with or without fused multiply-adds.
template <class Real>
int orient3d_filtered(const vec3& a, const vec3& b, const vec3& c, const vec3& d) {
  constexpr Real kUnit = sizeof(Real) == 4 ? Real(0x1p-24) : Real(0x1p-53);
  constexpr Real kBound = (Real(7) + Real(56) * kUnit) * kUnit;  // of the permanent below
  const Real ax = Real(a.x) - Real(d.x), ay = Real(a.y) - Real(d.y), az = Real(a.z) - Real(d.z);
  const Real bx = Real(b.x) - Real(d.x), by = Real(b.y) - Real(d.y), bz = Real(b.z) - Real(d.z);
  const Real cx = Real(c.x) - Real(d.x), cy = Real(c.y) - Real(d.y), cz = Real(c.z) - Real(d.z);
  const Real det = az * (bx * cy - by * cx) + bz * (cx * ay - cy * ax) + cz * (ax * by - ay * bx);
  const Real permanent = std::fabs(az) * (std::fabs(bx * cy) + std::fabs(by * cx)) +
                         std::fabs(bz) * (std::fabs(cx * ay) + std::fabs(cy * ax)) +
                         std::fabs(cz) * (std::fabs(ax * by) + std::fabs(ay * bx));
  const Real error = kBound * permanent;
  return det > error ? 1 : (-det > error ? -1 : kUndecided);
}

/// det(a-d, b-d, c-d) in lattice units cubed. |coordinate| <= 2, so differences stay below 2^40 units,
/// 2x2 minors below 2^81 and the sum below 2^123.
Int128 orient3d_exact(const vec3& a, const vec3& b, const vec3& c, const vec3& d);

inline int sign_of(Int128 value) { return value > 0 ? 1 : (value < 0 ? -1 : 0); }

/// Sign of det(a-d, b-d, c-d): -1, 0 or 1. Exact.
inline int orient3d(const vec3& a, const vec3& b, const vec3& c, const vec3& d) {
  const int sign = orient3d_filtered<double>(a, b, c, d);
  return sign != kUndecided ? sign : sign_of(orient3d_exact(a, b, c, d));
}

/// Does triangle (a, b, c) block the segment from receiver r to light sample l? Exact; ties as defined above.
/// Independent of the order of the corners and of the direction of the segment.
inline bool blocks(const vec3& a, const vec3& b, const vec3& c, const vec3& r, const vec3& l) {
  const int side = orient3d(a, b, c, r);
  if (side == 0 || orient3d(a, b, c, l) != -side) return false;
  return side * orient3d(a, b, l, r) >= 0 && side * orient3d(b, c, l, r) >= 0 && side * orient3d(c, a, l, r) >= 0;
}

}  // namespace halfshade
