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

/// The part of a blocker that a grid can hold, or why there is none.
struct ProjectedBlocker {
  InfluenceRegion::Kind kind = InfluenceRegion::Kind::kNowhere;
  std::array<dvec3, 4> corner;  // kRows: the part beyond view.clip_z
  int count = 0;
};

/// `corners` are the blocker's vertices in view coordinates.
ProjectedBlocker clip_blocker(const LightView& view, const std::array<dvec3, 3>& corners);

/// Slopes at which the rays from the light's bound through v end on the far plane; requires clip_z <= v.z < far_z.
/// Returns how far outside the hull of all these points (in slopes) a ray's end can lie.
double add_far_images(const LightView& view, const dvec3& v, std::vector<dvec2>& points);

/// `corners` are the blocker's vertices in view coordinates.
void find_influence_region(const LightView& view, const std::array<dvec3, 3>& corners, InfluenceRegion& region);

/// Calls run(row, first column, last column) for each run of cells of the region.
template <class Run>
void for_each_run(const LightView& view, const InfluenceRegion& region, const Run& run) {
  if (region.kind == InfluenceRegion::Kind::kEverywhere) {
    for (std::uint32_t row = 0; row < view.grid.rows; ++row) run(row, 0u, view.grid.columns - 1);
  }
  if (region.kind != InfluenceRegion::Kind::kRows) return;
  for (std::size_t i = 0; i < region.rows.size(); ++i) {
    const RowSpan& row = region.rows[i];
    if (row.first <= row.last) run(region.first_row + static_cast<std::uint32_t>(i), row.first, row.last);
  }
}

/// Convex hull, counter-clockwise, by Graham's scan in Andrew's left-to-right order. Sorts `points`.
void convex_hull(std::vector<dvec2>& points, std::vector<dvec2>& hull);

}  // namespace halfshade
