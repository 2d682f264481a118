// Influence region of a blocker: the part of the light view outside of which it cannot hide any sample from any
// receiver (Sintorn, Eisemann, Assarsson 2008, section 4.1).
//
// A receiver r that a point v of the blocker hides from a sample l lies on the ray from l through v, beyond v. Seen
// from the light's centre it moves on a straight line from the image of v to the image of the ray's end on the far
// plane (the plane of the farthest receiver). For a fixed l that end is a projective map of v, so the convex hull of
// the images of the blocker's corners and of the light's bound projected through them holds every such r.
//
// Corners at or behind the light's plane have no such image. The blocker is clipped at a small depth in front of the
// light; the rest of it can matter only inside a box around the light, and if it meets that box the region is the whole
// view (stability.md A5, case S10).
#pragma once

#include "shadows/light_view.h"

namespace halfshade {

/// Columns first..last (inclusive) of one row; empty where first > last.
struct RowSpan {
  std::uint32_t first = 1, last = 0;
};

/// Region of one blocker on a view's grid. Reused between blockers: no allocation after warm-up.
struct InfluenceRegion {
  enum class Kind { kNowhere, kRows, kEverywhere };
  Kind kind = Kind::kNowhere;
  std::uint32_t first_row = 0;
  std::vector<RowSpan> rows;  // from first_row on

  std::vector<dvec2> points, hull;  // scratch; after a kRows result `hull` is the region's outline in slopes
  std::vector<dvec2> extent;        // scratch
};

/// `corners` are the blocker's vertices in view coordinates.
void find_influence_region(const LightView& view, const std::array<dvec3, 3>& corners, InfluenceRegion& region);

/// Convex hull, counter-clockwise, by Graham's scan in Andrew's left-to-right order. Sorts `points`.
void convex_hull(std::vector<dvec2>& points, std::vector<dvec2>& hull);

}  // namespace halfshade
