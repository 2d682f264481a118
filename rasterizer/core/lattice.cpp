#include "rasterizer/core/lattice.h"

#include <algorithm>

#include "halfshade/error.h"

namespace halfshade {
namespace {

double max_abs(const dvec3& v) { return std::max({std::fabs(v.x), std::fabs(v.y), std::fabs(v.z)}); }

}  // namespace

LocalFrame make_local_frame(std::span<const dvec3> geometry, std::span<const dvec3> extra) {
  for (const std::span<const dvec3> points : {geometry, extra}) {
    for (const dvec3& p : points) {
      if (!is_finite(p)) throw Error(ErrorCode::kBadInput, "a position is not finite");
    }
  }
  const std::span<const dvec3> boxed = geometry.empty() ? extra : geometry;
  LocalFrame frame;
  if (boxed.empty()) return frame;
  dvec3 low = boxed[0], high = boxed[0];
  for (const dvec3& p : boxed) {
    low = glm::min(low, p);
    high = glm::max(high, p);
  }
  frame.box_min = low;
  frame.half_extent = (high - low) * 0.5;
  double reach = max_abs(frame.half_extent);
  for (const dvec3& p : extra) reach = std::max(reach, max_abs((p - low) - frame.half_extent));
  if (!std::isfinite(reach)) throw Error(ErrorCode::kBadInput, "the scene's extent is not finite");
  if (reach > 0.0) {
    int exponent = 0;
    if (std::frexp(reach, &exponent) == 0.5) --exponent;  // an exact power of two fills the frame
    // Below 2^-1023 the scene no longer fills the frame: the scale would not be a number.
    frame.scale = std::ldexp(1.0, std::min(-exponent, 1023));
  }
  return frame;
}

}  // namespace halfshade
