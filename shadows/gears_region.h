// Where on the grid of GEARS the shadow volume of a blocker projects to (Wang et al. 2014, section 4, step A.3, and
// section 5.3).
//
// The light's bounding box along the grid's axes projects each corner of the blocker to a rectangle on the far plane:
// the paper's 12 extrusion points for a rectangular light, a bound of the same shape for all others. Their images and
// those of the corners hold every receiver that the blocker can hide: such a receiver lies between a point v of the
// blocker and the end F of a ray from a light point l through v. v is in the hull of the corners; F is, for fixed l, a
// projective map of v and, for fixed v, moves along a box as l does. Seen from any C in front of which all this lies,
// the segment from v to F runs between their images. This is the paper's appendix without its assumption that l and C
// lie in special places; corners at or behind the light's plane are cut off beforehand (influence_region.h).
#pragma once

#include <glm/common.hpp>

#include "shadows/gears_grid.h"
#include "shadows/influence_region.h"

namespace halfshade {

struct GearsBlocker {
  InfluenceRegion::Kind kind = InfluenceRegion::Kind::kNowhere;  // kRows: the members below hold
  dvec2 low{0.0}, high{0.0};                                     // box of the images of corners and extrusion points
  dvec2 corner_low{0.0}, corner_high{0.0};                       // of the corners alone
  double depth = 0.0;                                            // no receiver nearer to the light than this is hidden
  double far_nearness = 0.0, per_nearness = 0.0;                 // see box_at
  std::vector<dvec3> edges;  // of the convex hull: inside where x * image.x + y * image.y + z >= 0; empty: no hull
  bool boxed = false;        // only receivers in the box below, in the local frame, can be hidden
  vec3 box_low{0.0f}, box_high{0.0f};

  std::vector<dvec2> points, hull;  // scratch
};

class GearsProjector {
 public:
  /// Refers to `grid`.
  explicit GearsProjector(const GearsGrid& grid);

  /// `corners` in view coordinates; `with_hull` finds the edges too.
  void project(const std::array<dvec3, 3>& corners, bool with_hull, GearsBlocker& blocker) const;

  /// Is the point, in view coordinates, inside the frustum around the shadow volume (figure 11)?
  bool in_frustum(const GearsBlocker& blocker, const dvec3& p) const;

 private:
  void add_corner(const dvec3& v, GearsBlocker& blocker) const;
  void find_hull(const ProjectedBlocker& polygon, GearsBlocker& blocker) const;

  const GearsGrid& grid_;
  dvec3 light_low_{0.0}, light_high_{0.0};  // view coordinates
};

/// Box of the images of what the blocker can hide down to the depth whose inverse distance from C is `nearness`. Images
/// of the frustum's sides (figure 11) are linear in that inverse: from the corners' own box where the blocker begins to
/// the whole one on the far plane.
inline std::array<dvec2, 2> box_at(const GearsBlocker& blocker, double nearness) {
  const double share = std::clamp((nearness - blocker.far_nearness) * blocker.per_nearness, 0.0, 1.0);
  return {glm::mix(blocker.low, blocker.corner_low, share), glm::mix(blocker.high, blocker.corner_high, share)};
}

/// May the node hold a receiver that the blocker hides? False only if it certainly does not.
bool meets(const GearsBlocker& blocker, const GearsNode& node);

/// Is every receiver of the node inside the region?
bool covers(const GearsBlocker& blocker, const GearsNode& node);

/// Is the image inside all edges of a hull?
bool in_hull(std::span<const dvec3> edges, const dvec2& image);

/// Calls take(node) for nodes that together hold every receiver that the blocker may hide, each receiver once. With
/// `coarse`, nodes that are covered are taken as a whole.
template <class Take>
void visit_nodes(const GearsGrid& grid, const GearsBlocker& blocker, bool coarse, const Take& take);

namespace gears_detail {

template <class Take>
void visit_cells(const GearsGrid& grid, const GearsBlocker& blocker, bool coarse, const GearsCells& cells,
                 const CellRange& range, const Take& take) {
  for (std::uint32_t y = range.first_row; y <= range.last_row; ++y) {
    for (std::uint32_t x = range.first_column; x <= range.last_column; ++x) {
      const std::uint32_t index = cells.node[std::size_t{y} * cells.columns + x];
      if (index == kNone) continue;
      const GearsNode& node = grid.nodes[index];
      if (!meets(blocker, node)) continue;
      if (node.leaf || (coarse && covers(blocker, node))) {
        take(index);
      } else {
        const GearsCells& inner = grid.cells[node.cells];
        visit_cells(grid, blocker, coarse, inner, inner.range(blocker.low, blocker.high), take);
      }
    }
  }
}

}  // namespace gears_detail

template <class Take>
void visit_nodes(const GearsGrid& grid, const GearsBlocker& blocker, bool coarse, const Take& take) {
  constexpr std::uint32_t kTile = GearsNode::kTile;
  if (blocker.high.x < grid.low.x || blocker.low.x > grid.high.x || blocker.high.y < grid.low.y ||
      blocker.low.y > grid.high.y) {
    return;
  }
  const GearsCells& root = grid.cells[0];
  const CellRange range = root.range(blocker.low, blocker.high);
  for (std::uint32_t ty = range.first_row / kTile; ty <= range.last_row / kTile; ++ty) {
    for (std::uint32_t tx = range.first_column / kTile; tx <= range.last_column / kTile; ++tx) {
      const std::uint32_t index = grid.tiles[ty * grid.tile_columns + tx];
      if (index == kNone || !meets(blocker, grid.nodes[index])) continue;
      if (coarse && covers(blocker, grid.nodes[index])) {
        take(index);
        continue;
      }
      gears_detail::visit_cells(
          grid, blocker, coarse, root,
          {std::max(range.first_column, tx * kTile), std::min(range.last_column, tx * kTile + kTile - 1),
           std::max(range.first_row, ty * kTile), std::min(range.last_row, ty * kTile + kTile - 1)},
          take);
    }
  }
}

}  // namespace halfshade
