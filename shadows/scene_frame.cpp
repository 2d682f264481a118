#include "shadows/scene_frame.h"

#include <algorithm>

#include "halfshade/error.h"

namespace halfshade {

LocalFrame make_scene_frame(const WorldBox& box) {
  LocalFrame frame;
  if (box.empty()) return frame;
  const dvec3 extent = box.high - box.low;
  const double widest = std::max({extent.x, extent.y, extent.z});
  if (!(widest <= 0x1p1000)) throw Error(ErrorCode::kBadInput, "the scene's extent is not below 2^1000");
  if (widest <= 0x1p-1000) {
    frame.box_min = box.low;
    return frame;
  }
  int exponent = 0;
  if (std::frexp(widest, &exponent) == 0.5) --exponent;  // a power of two is its own half-width
  const double half_width = std::ldexp(1.0, exponent), cell = 0.25 * half_width;
  const dvec3 middle = box.low + extent * 0.5;
  for (int k = 0; k < 3; ++k) frame.box_min[k] = std::nearbyint(middle[k] / cell) * cell;
  frame.scale = 1.0 / half_width;
  return frame;
}

}  // namespace halfshade
