// The receivers of one light view in the lists of its grid, and what the lists' cells hold: what blockers are sent to.
#pragma once

#include "rasterizer/core/mesh.h"
#include "shadows/irregular_zbuffer.h"
#include "shadows/light_view.h"

namespace halfshade {

/// Rows of the grid that one task owns: receivers list_begin..list_end of the sorted order.
struct RowBlock {
  std::uint32_t list_begin = 0, list_end = 0;
};

/// Up to kCells neighbouring cells of a row: where their receivers are.
struct ReceiverTile {
  static constexpr std::uint32_t kCells = 8;  // at about two receivers per cell one vector's worth
  vec3 low{HUGE_VALF}, high{-HUGE_VALF};      // box of the receivers, local frame
  double deepest = -HUGE_VAL;                 // their largest depth in the view
  bool empty() const { return low.x > high.x; }
};

/// The lists of one view: receivers in list order, and which block of rows owns which part of them.
struct LightLists {
  LightView view;
  IrregularZBuffer zbuffer;
  std::uint32_t near_cell = 0;   // after the grid's cells: receivers that are too near to project
  std::vector<RowBlock> blocks;  // the last one holds those of near_cell
  std::vector<std::uint32_t> block_of_row;
  std::uint32_t tiles_per_row = 0;
  std::vector<ReceiverTile> tiles;  // [row][tile]

  std::size_t tile_index(std::uint32_t row, std::uint32_t column) const {
    return std::size_t{row} * tiles_per_row + column / ReceiverTile::kCells;
  }
  /// First and last + 1 of the tile's receivers in the sorted order.
  std::pair<std::uint32_t, std::uint32_t> tile_range(std::size_t tile) const;
};

LightLists make_light_lists(LightViewCells&& cells, const ReceiverArray& receivers);

}  // namespace halfshade
