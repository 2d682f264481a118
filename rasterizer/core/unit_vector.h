// Directions of vectors whose squares do not fit a double.
#pragma once

#include <cmath>

#include "halfshade/types.h"

namespace halfshade {

/// `v` times a power of two, its largest component in [1, 2): the same direction to the last bit, and lengths and
/// products that neither overflow nor vanish. `v` is finite; zero stays zero.
inline dvec3 near_one(const dvec3& v) {
  const double largest = std::fmax(std::fabs(v.x), std::fmax(std::fabs(v.y), std::fabs(v.z)));
  if (largest == 0.0) return v;
  const int exponent = -std::ilogb(largest);
  return {std::scalbn(v.x, exponent), std::scalbn(v.y, exponent), std::scalbn(v.z, exponent)};
}

/// `v` is finite and not zero.
inline dvec3 unit_vector(const dvec3& v) { return glm::normalize(near_one(v)); }

}  // namespace halfshade
