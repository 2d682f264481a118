// Which local frame a scene that changes is rounded in (docs/decisions/0003).
#pragma once

#include "rasterizer/core/lattice.h"

namespace halfshade {

/// Axis-aligned box in world space; empty unless something was added.
struct WorldBox {
  dvec3 low{HUGE_VAL}, high{-HUGE_VAL};

  bool empty() const { return !(low.x <= high.x); }
  void add(const dvec3& p) { low = glm::min(low, p), high = glm::max(high, p); }
  void add(const WorldBox& box) { low = glm::min(low, box.low), high = glm::max(high, box.high); }
  bool operator==(const WorldBox&) const = default;
};

/// A cube around the content, its centre on a coarse grid, its half-width a power of two at least as large as the
/// content is wide and twice as large as the way to the farthest light: a pure function of the boxes that changes
/// rarely when they move. Whatever lies in the cube gets coordinates |x| <= 1. Far lights make it wider but leave the
/// content in its middle, where floats are finest. Without content, lights are it; without extent, the half-width is 1.
/// Throws Error{kBadInput} when the extents overflow.
LocalFrame make_scene_frame(const WorldBox& content, const WorldBox& lights);

/// World-space half-width of the cube.
inline double frame_half_width(const LocalFrame& frame) { return 1.0 / frame.scale; }

/// Is the point inside the cube?
inline bool in_reach(const LocalFrame& frame, const dvec3& world) {
  const dvec3 p = glm::abs(frame.to_local(world));
  return p.x <= 1.0 && p.y <= 1.0 && p.z <= 1.0;  // false for NaN
}

}  // namespace halfshade
