#include "shadows/light_lists.h"

#include "rasterizer/core/parallel.h"

namespace halfshade {
namespace {

constexpr std::size_t kRowBlocks = 64;  // pieces of the grid, each written by one task

void make_blocks(LightLists& lists) {
  const LightGrid& grid = lists.view.grid;
  const std::vector<std::uint32_t>& offsets = lists.zbuffer.offsets;
  const std::uint32_t total = offsets[lists.near_cell];
  lists.block_of_row.resize(grid.rows);
  for (std::uint32_t row = 0; row < grid.rows; ++row) {
    const std::uint32_t begin = offsets[row * grid.columns], end = offsets[(row + 1) * grid.columns];
    if (lists.blocks.empty() || lists.blocks.back().list_end - lists.blocks.back().list_begin >= total / kRowBlocks) {
      lists.blocks.push_back({begin, begin});
    }
    lists.blocks.back().list_end = end;
    lists.block_of_row[row] = static_cast<std::uint32_t>(lists.blocks.size() - 1);
  }
  lists.blocks.push_back({total, offsets[lists.near_cell + 1]});
}

void make_tiles(const ReceiverArray& receivers, LightLists& lists) {
  const LightGrid& grid = lists.view.grid;
  lists.tiles_per_row = (grid.columns + ReceiverTile::kCells - 1) / ReceiverTile::kCells;
  lists.tiles.assign(std::size_t{grid.rows} * lists.tiles_per_row, {});
  parallel_ranges(lists.tiles.size(), 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) {
      ReceiverTile& tile = lists.tiles[i];
      const auto [first, last] = lists.tile_range(i);
      for (std::uint32_t e = first; e != last; ++e) {
        const vec3& p = receivers.position[lists.zbuffer.entries[e]];
        tile.low = glm::min(tile.low, p), tile.high = glm::max(tile.high, p);
        tile.deepest = std::max(tile.deepest, lists.view.to_view(dvec3(p)).z);
      }
    }
  });
}

}  // namespace

std::pair<std::uint32_t, std::uint32_t> LightLists::tile_range(std::size_t tile) const {
  const std::size_t row = tile / tiles_per_row, first = tile % tiles_per_row * ReceiverTile::kCells;
  const std::size_t last = std::min<std::size_t>(first + ReceiverTile::kCells, view.grid.columns);
  return {zbuffer.offsets[row * view.grid.columns + first], zbuffer.offsets[row * view.grid.columns + last]};
}

LightLists make_light_lists(LightViewCells&& cells, const ReceiverArray& receivers) {
  LightLists lists;
  lists.near_cell = cells.near_cell();
  build_irregular_zbuffer(cells.cell_of_receiver, lists.near_cell + 1, lists.zbuffer);
  lists.view = std::move(cells.view);
  make_blocks(lists);
  make_tiles(receivers, lists);
  return lists;
}

}  // namespace halfshade
