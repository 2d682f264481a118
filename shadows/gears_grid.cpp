#include "shadows/gears_grid.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "rasterizer/core/parallel.h"
#include "shadows/irregular_zbuffer.h"

namespace halfshade {
namespace {

constexpr std::uint32_t kTile = GearsNode::kTile;
constexpr std::uint32_t kReceiversPerCell = 16;
/// A cell is hot if it holds this many times the average over all cells, empty ones too, and more than four cells'
/// worth.
constexpr double kHotFactor = 4.0;
constexpr std::uint32_t kHotReceivers = 4 * kReceiversPerCell;
constexpr int kMaxDepth = 8;  // of grids within grids
/// Cells' rectangles are widened by this share of a cell against rounding; indices carry errors near 1e-13.
constexpr double kCellPad = 1e-9;

std::uint32_t clamp_index(double x, std::uint32_t count) {
  return !(x > 0.0) ? 0u : (x >= count - 1 ? count - 1 : static_cast<std::uint32_t>(x));
}

void fit_cells(const dvec2& low, const dvec2& high, std::uint32_t resolution, GearsCells& cells) {
  cells.columns = cells.rows = resolution;
  cells.low = low;
  for (int k = 0; k < 2; ++k) cells.cells_per_unit[k] = high[k] > low[k] ? resolution / (high[k] - low[k]) : 0.0;
  cells.node.assign(std::size_t{cells.columns} * cells.rows, kNone);
}

std::uint32_t column_of(const GearsCells& cells, double x) {
  return clamp_index((x - cells.low.x) * cells.cells_per_unit.x, cells.columns);
}
std::uint32_t row_of(const GearsCells& cells, double y) {
  return clamp_index((y - cells.low.y) * cells.cells_per_unit.y, cells.rows);
}

/// "We place eye C on the line connecting the center O [...] to the center of the light, with distance proportional to
/// the diagonal of the area light source" (section 4, A.1). O: centre of the box around light and receivers.
GearsCamera place_camera(const LightView& view, double diagonals) {
  dvec3 light = view.ball.radius > 0.0 ? view.ball.reach() : dvec3(0.0, 0.0, view.light_depth);
  for (const dvec3& l : view.light_points) light = glm::max(light, glm::abs(l));
  const dvec3 middle = (glm::min(view.receiver_low, -light) + glm::max(view.receiver_high, light)) * 0.5;
  const double length = glm::length(middle);
  if (!(length > 0.0)) return {};
  dvec3 eye = middle * (-diagonals * 2.0 * glm::length(light) / length);
  eye.z = std::min(eye.z, 0.0);
  return {eye};
}

/// The work of building, for one grid.
class Builder {
 public:
  Builder(GearsGrid& grid, const ReceiverArray& receivers, const GearsOptions& options)
      : grid_(grid), receivers_(receivers), options_(options) {}

  void build(const LightViewCells& cells) {
    place_receivers(cells);
    fit_root(options_.grid != 0 ? options_.grid : choose_gears_resolution(grid_.on_grid));
    sort_receivers(cells);
    add_tiles();
  }

 private:
  /// Images of the receivers that the view projects.
  void place_receivers(const LightViewCells& cells) {
    place_.resize(receivers_.size());
    parallel_ranges(place_.size(), 8192, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i != end; ++i) place_[i] = grid_.view.to_view(dvec3(receivers_.position[i]));
    });
    for (std::size_t i = 0; i < place_.size(); ++i) {
      if (cells.cell_of_receiver[i] >= cells.near_cell()) continue;
      const dvec2 image = grid_.camera.image(place_[i]);
      grid_.low = glm::min(grid_.low, image), grid_.high = glm::max(grid_.high, image);
      ++grid_.on_grid;
    }
  }

  void fit_root(std::uint32_t resolution) {
    grid_.cells.resize(1);
    fit_cells(grid_.low, grid_.high, grid_.on_grid != 0 ? resolution : 1, grid_.cells[0]);
    grid_.tile_columns = (grid_.cells[0].columns + kTile - 1) / kTile;
    grid_.tiles.assign(std::size_t{grid_.tile_columns} * grid_.tile_columns, kNone);
  }

  /// Lists in the order of the tiles, cells of a tile in a row; then the receivers too near.
  void sort_receivers(const LightViewCells& cells) {
    const GearsCells& root = grid_.cells[0];
    const auto list_count = static_cast<std::uint32_t>(grid_.tiles.size() * kTile * kTile);
    std::vector<std::uint32_t> list(receivers_.size(), kNone);
    parallel_ranges(list.size(), 8192, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i != end; ++i) {
        if (cells.cell_of_receiver[i] == kNone) continue;
        list[i] = list_count;
        if (cells.cell_of_receiver[i] == cells.near_cell()) continue;
        const dvec2 image = grid_.camera.image(place_[i]);
        const std::uint32_t x = column_of(root, image.x), y = row_of(root, image.y);
        list[i] = ((y / kTile * grid_.tile_columns + x / kTile) * kTile + y % kTile) * kTile + x % kTile;
      }
    });
    IrregularZBuffer lists;
    build_irregular_zbuffer(list, list_count + 1, lists);
    offsets_ = std::move(lists.offsets);
    grid_.order = std::move(lists.entries);
    grid_.position.resize(grid_.order.size());
    for (std::size_t i = 0; i < grid_.order.size(); ++i) grid_.position[i] = place_[grid_.order[i]];
  }

  void add_tiles() {
    const double average = grid_.on_grid / static_cast<double>(grid_.cells[0].node.size());
    hot_ = std::max(kHotReceivers, static_cast<std::uint32_t>(kHotFactor * average));
    for (std::uint32_t tile = 0; tile < grid_.tiles.size(); ++tile) {
      const std::uint32_t* lists = offsets_.data() + std::size_t{tile} * kTile * kTile;
      if (lists[0] == lists[kTile * kTile]) continue;
      const std::uint32_t node = add_node(lists[0], lists[kTile * kTile], kNone);
      grid_.tiles[tile] = node;
      grid_.nodes[node].leaf = false;
      for (std::uint32_t c = 0; c < kTile * kTile; ++c) {
        if (lists[c] == lists[c + 1]) continue;
        add_cell(0, tile % grid_.tile_columns * kTile + c % kTile, tile / grid_.tile_columns * kTile + c / kTile,
                 lists[c], lists[c + 1], node, 0);
      }
      include_parts(node);
    }
  }

  std::uint32_t add_node(std::uint32_t begin, std::uint32_t end, std::uint32_t parent) {
    grid_.nodes.push_back({.begin = begin, .end = end, .parent = parent});
    return static_cast<std::uint32_t>(grid_.nodes.size() - 1);
  }

  void add_cell(std::size_t cells, std::uint32_t x, std::uint32_t y, std::uint32_t begin, std::uint32_t end,
                std::uint32_t parent, int depth) {
    const std::uint32_t node = add_node(begin, end, parent);
    grid_.cells[cells].node[std::size_t{y} * grid_.cells[cells].columns + x] = node;
    fit_to_receivers(grid_.nodes[node]);
    if (options_.subdivide && end - begin > hot_ && depth < kMaxDepth) subdivide(node, depth);
    if (!options_.bounds) fit_to_cell(grid_.cells[cells], x, y, grid_.nodes[node]);
  }

  void fit_to_receivers(GearsNode& node) const {
    for (std::uint32_t i = node.begin; i < node.end; ++i) {
      const dvec2 image = grid_.camera.image(grid_.position[i]);
      const vec3& p = receivers_.position[grid_.order[i]];
      node.low = glm::min(node.low, image), node.high = glm::max(node.high, image);
      node.depth = std::max(node.depth, grid_.position[i].z);
      node.box_low = glm::min(node.box_low, p), node.box_high = glm::max(node.box_high, p);
    }
    node.nearness = 1.0 / (node.depth - grid_.camera.eye.z);
  }

  /// The cell's rectangle at any depth. A grid without extent along an axis has one line of cells there.
  static void fit_to_cell(const GearsCells& cells, std::uint32_t x, std::uint32_t y, GearsNode& node) {
    const dvec2 at(x, y);
    for (int k = 0; k < 2; ++k) {
      if (cells.cells_per_unit[k] == 0.0) continue;
      node.low[k] = std::min(node.low[k], cells.low[k] + (at[k] - kCellPad) / cells.cells_per_unit[k]);
      node.high[k] = std::max(node.high[k], cells.low[k] + (at[k] + 1.0 + kCellPad) / cells.cells_per_unit[k]);
    }
    node.depth = HUGE_VAL, node.nearness = 0.0;
    node.box_low = vec3(-HUGE_VALF), node.box_high = vec3(HUGE_VALF);
  }

  /// A tile's bounds from its cells, which follow it.
  void include_parts(std::uint32_t tile) {
    GearsNode& node = grid_.nodes[tile];
    for (std::size_t i = tile + 1; i < grid_.nodes.size(); ++i) {
      const GearsNode& part = grid_.nodes[i];
      node.low = glm::min(node.low, part.low), node.high = glm::max(node.high, part.high);
      if (part.depth > node.depth) node.depth = part.depth, node.nearness = part.nearness;
      node.box_low = glm::min(node.box_low, part.box_low), node.box_high = glm::max(node.box_high, part.box_high);
    }
  }

  /// Gives a hot cell a grid over the box of its receivers, unless they all project onto one point.
  void subdivide(std::uint32_t node, int depth) {
    const GearsNode hot = grid_.nodes[node];
    if (!(hot.high.x > hot.low.x) && !(hot.high.y > hot.low.y)) return;
    const std::uint32_t count = hot.end - hot.begin;
    const double side = std::sqrt(static_cast<double>(count) / kReceiversPerCell);
    const auto cells = static_cast<std::uint32_t>(grid_.cells.size());
    fit_cells(hot.low, hot.high, std::clamp(static_cast<std::uint32_t>(side), 2u, 64u), grid_.cells.emplace_back());
    grid_.nodes[node].cells = cells;
    grid_.nodes[node].leaf = false;
    ++grid_.subdivided;
    const std::uint32_t columns = grid_.cells[cells].columns;
    const std::vector<std::uint32_t> offsets = sort_run(hot.begin, hot.end, grid_.cells[cells]);
    for (std::uint32_t c = 0; c + 1 < offsets.size(); ++c) {
      if (offsets[c] == offsets[c + 1]) continue;
      add_cell(cells, c % columns, c / columns, hot.begin + offsets[c], hot.begin + offsets[c + 1], node, depth + 1);
    }
  }

  /// Sorts a run of receivers by cell, keeping their order within a cell.
  std::vector<std::uint32_t> sort_run(std::uint32_t begin, std::uint32_t end, const GearsCells& cells) {
    const std::vector<std::uint32_t> order(grid_.order.begin() + begin, grid_.order.begin() + end);
    const std::vector<dvec3> position(grid_.position.begin() + begin, grid_.position.begin() + end);
    std::vector<std::uint32_t> cell(order.size()), counts(cells.node.size(), 0), offsets;
    for (std::size_t i = 0; i < order.size(); ++i) {
      const dvec2 image = grid_.camera.image(position[i]);
      cell[i] = row_of(cells, image.y) * cells.columns + column_of(cells, image.x);
      ++counts[cell[i]];
    }
    exclusive_scan(counts, offsets);
    std::vector<std::uint32_t> next = offsets;
    for (std::size_t i = 0; i < order.size(); ++i) {
      const std::size_t to = begin + next[cell[i]]++;
      grid_.order[to] = order[i];
      grid_.position[to] = position[i];
    }
    return offsets;
  }

  GearsGrid& grid_;
  const ReceiverArray& receivers_;
  const GearsOptions& options_;
  std::vector<dvec3> place_;            // [receiver] view coordinates
  std::vector<std::uint32_t> offsets_;  // [list], then the receivers too near
  std::uint32_t hot_ = 0;               // receivers above which a cell is subdivided
};

}  // namespace

CellRange GearsCells::range(const dvec2& from, const dvec2& to) const {
  return {column_of(*this, from.x), column_of(*this, to.x), row_of(*this, from.y), row_of(*this, to.y)};
}

std::uint32_t choose_gears_resolution(std::size_t receivers) {
  const double side = std::sqrt(static_cast<double>(receivers) / kReceiversPerCell);
  return std::clamp(static_cast<std::uint32_t>(std::lround(side)), 32u, 256u);
}

GearsGrid make_gears_grid(LightViewCells&& cells, const ReceiverArray& receivers, const GearsOptions& options) {
  GearsGrid grid;
  grid.view = cells.view;
  if (grid.view.has_receivers) grid.camera = place_camera(grid.view, options.camera);
  Builder(grid, receivers, options).build(cells);
  return grid;
}

}  // namespace halfshade
