#include "shadows/scene_frame.h"

#include <algorithm>

#include "halfshade/error.h"

namespace halfshade {

namespace {

double widest(const WorldBox& box) {
  const dvec3 extent = box.high - box.low;
  return std::max({extent.x, extent.y, extent.z});
}

/// The least one that is not below x > 0.
double power_of_two_from(double x) {
  int exponent = 0;
  if (std::frexp(x, &exponent) == 0.5) --exponent;
  return std::ldexp(1.0, exponent);
}

constexpr double kNoExtent = 0x1p-1000;

}  // namespace

LocalFrame make_scene_frame(const WorldBox& content, const WorldBox& lights) {
  LocalFrame frame;
  WorldBox all = content;
  all.add(lights);
  if (all.empty()) return frame;
  if (!(widest(all) <= 0x1p1000)) throw Error(ErrorCode::kBadInput, "the scene's extent is not below 2^1000");
  const WorldBox& inner = content.empty() ? lights : content;
  frame.box_min = inner.low;
  double half_width = 0.0;
  if (widest(inner) > kNoExtent) {
    half_width = power_of_two_from(widest(inner));
    const double cell = 0.25 * half_width;
    const dvec3 middle = inner.low + (inner.high - inner.low) * 0.5;
    for (int k = 0; k < 3; ++k) frame.box_min[k] = std::nearbyint(middle[k] / cell) * cell;
  }
  if (!lights.empty()) {
    const dvec3 farthest = glm::max(glm::abs(lights.low - frame.box_min), glm::abs(lights.high - frame.box_min));
    const double way = std::max({farthest.x, farthest.y, farthest.z});
    if (way > kNoExtent) half_width = std::max(half_width, power_of_two_from(2.0 * way));
  }
  if (half_width > 0.0) frame.scale = 1.0 / half_width;
  return frame;
}

}  // namespace halfshade
