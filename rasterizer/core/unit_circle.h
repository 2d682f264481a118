// Sine and cosine whose bits do not depend on the platform's mathematics library: additions and products only.
#pragma once

#include <cmath>

#include "halfshade/types.h"

namespace halfshade {

/// (cos, sin) of 2 pi `turns`; error below 1e-15. The angle is reduced to one eighth of a turn, where the Taylor series
/// to the 17th power is exact to the last bits of a double.
inline dvec2 unit_circle(double turns) {
  const double quarter = std::floor(turns * 4.0 + 0.5);
  const double x = (turns - quarter * 0.25) * 6.283185307179586476925;  // in [-pi/4, pi/4]
  const double x2 = x * x;
  double s = 1.0, c = 1.0;
  for (int k = 16; k >= 2; k -= 2) s = 1.0 - s * x2 / (k * (k + 1.0));
  for (int k = 17; k >= 1; k -= 2) c = 1.0 - c * x2 / (k * (k + 1.0));
  s *= x;
  switch (static_cast<long long>(quarter) & 3) {
    case 0:
      return {c, s};
    case 1:
      return {-s, c};
    case 2:
      return {-c, -s};
    default:
      return {s, -c};
  }
}

}  // namespace halfshade
