// Camera and grid of GEARS (Wang et al. 2014, section 4, steps A.1 and A.2): receivers projected from a point behind
// the light onto a regular grid along the light's axes.
//
// Cells are nodes of a shallow tree over one sorted array of receivers, so that a list of blockers may be noted at any
// of them: a tile holds 8x8 cells, and a cell with many receivers a grid of its own (section 5.4: "secondary grid
// subdivision of the hot grid cells").
#pragma once

#include "shadows/light_view.h"

namespace halfshade {

/// Camera C, in coordinates of a light view: a point at or behind the light's centre, looking along +z.
struct GearsCamera {
  dvec3 eye{0.0};
  dvec2 image(const dvec3& p) const { return (dvec2(p) - dvec2(eye)) / (p.z - eye.z); }
};

/// Receivers order[begin .. end) and what is known of them. Bounds hold all of them, or more.
struct GearsNode {
  static constexpr std::uint32_t kTile = 8;  // cells per side
  std::uint32_t begin = 0, end = 0;
  std::uint32_t parent = kNone;                   // node
  std::uint32_t cells = kNone;                    // the node's own grid, if it is subdivided
  dvec2 low{HUGE_VAL}, high{-HUGE_VAL};           // images
  double depth = -HUGE_VAL;                       // of the farthest receiver, view coordinates
  double nearness = 0.0;                          // 1 / (depth - eye.z)
  vec3 box_low{HUGE_VALF}, box_high{-HUGE_VALF};  // positions
  bool leaf = true;                               // a cell that is not subdivided
};

/// Columns and rows first..last, inclusive.
struct CellRange {
  std::uint32_t first_column, last_column, first_row, last_row;
};

/// A regular grid over images.
struct GearsCells {
  std::uint32_t columns = 1, rows = 1;
  dvec2 low{0.0}, cells_per_unit{0.0};
  std::vector<std::uint32_t> node;  // [row][column], kNone where no receiver projects

  /// Monotone in every bound: the range of a box holds the cell of every image in the box.
  CellRange range(const dvec2& from, const dvec2& to) const;
};

struct GearsGrid {
  LightView view;
  GearsCamera camera;
  dvec2 low{HUGE_VAL}, high{-HUGE_VAL};  // images of all receivers on the grid
  std::uint32_t on_grid = 0;             // receivers with a cell; the others in `order` are too near to the light
  std::vector<std::uint32_t> order;      // receivers: by node, then those too near
  std::vector<dvec3> position;           // [place in order] view coordinates
  std::vector<GearsNode> nodes;          // a node before its parts, runs ascending
  std::uint32_t tile_columns = 0;
  std::vector<std::uint32_t> tiles;  // [row][column] -> nodes, kNone where empty
  std::vector<GearsCells> cells;     // [0] the grid itself, then those of subdivided cells
  std::uint32_t subdivided = 0;      // cells with a grid of their own
};

/// Grid over the receivers of one view. `options.grid` 0 chooses the resolution.
GearsGrid make_gears_grid(LightViewCells&& cells, const ReceiverArray& receivers, const GearsOptions& options);

/// Resolution for that many receivers: 16 to a cell, 32..256.
std::uint32_t choose_gears_resolution(std::size_t receivers);

}  // namespace halfshade
