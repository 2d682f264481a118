#include "rasterizer/binning.h"

#include <algorithm>
#include <limits>
#include <numeric>

#include "halfshade/error.h"
#include "rasterizer/core/parallel.h"

namespace halfshade {
namespace {

using ChunkCounts = std::vector<std::vector<std::uint32_t>>;  // [chunk][tile]

// visit(tile index) for every tile that the piece may touch. Where the bounding box spans tiles in both directions the
// edges are asked too: a long thin triangle crosses few of them.
template <class Visit>
void for_each_tile(const ScreenTriangle& piece, const TileGrid& grid, const Visit& visit) {
  const PixelWindow box = covered_box(piece, grid.window);
  const std::uint32_t x0 = box.x0 / kTileSize - grid.first_column, x1 = (box.x1 - 1) / kTileSize - grid.first_column;
  const std::uint32_t y0 = box.y0 / kTileSize - grid.first_row, y1 = (box.y1 - 1) / kTileSize - grid.first_row;
  const bool ask_edges = x0 != x1 && y0 != y1;
  for (std::uint32_t y = y0; y <= y1; ++y) {
    for (std::uint32_t x = x0; x <= x1; ++x) {
      const std::size_t tile = std::size_t{y} * grid.columns + x;
      TileTriangle part;
      if (!ask_edges || make_tile_triangle(piece, grid.tile(tile), part)) visit(tile);
    }
  }
}

ChunkCounts count_entries(const TriangleChunks& chunks, const TileGrid& grid) {
  ChunkCounts counts(chunks.size());
  parallel_tasks(chunks.size(), [&](std::size_t chunk) {
    counts[chunk].assign(grid.size(), 0);
    for (const ScreenTriangle& piece : chunks[chunk]) {
      for_each_tile(piece, grid, [&](std::size_t tile) { ++counts[chunk][tile]; });
    }
  });
  return counts;
}

void check_total(const ChunkCounts& counts) {
  std::uint64_t total = 0;
  for (const auto& tiles : counts) total = std::accumulate(tiles.begin(), tiles.end(), total);
  constexpr std::uint64_t kLimit = std::numeric_limits<std::uint32_t>::max();
  if (total > kLimit) {
    throw Error(ErrorCode::kLimit, "rasterize: " + std::to_string(total) + " (tile, triangle) pairs, at most " +
                                       std::to_string(kLimit) + "; render a smaller window");
  }
}

std::vector<std::uint32_t> scan_tile_major(const ChunkCounts& counts, const TileGrid& grid) {
  std::vector<std::uint32_t> transposed(grid.size() * counts.size()), offsets;
  parallel_ranges(grid.size(), 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t tile = begin; tile != end; ++tile) {
      for (std::size_t c = 0; c != counts.size(); ++c) transposed[tile * counts.size() + c] = counts[c][tile];
    }
  });
  exclusive_scan(transposed, offsets);
  return offsets;
}

}  // namespace

PixelWindow TileGrid::tile(std::size_t index) const {
  const auto x = (first_column + static_cast<std::uint32_t>(index % columns)) * kTileSize;
  const auto y = (first_row + static_cast<std::uint32_t>(index / columns)) * kTileSize;
  return {std::max(x, window.x0), std::min(x + kTileSize, window.x1), std::max(y, window.y0),
          std::min(y + kTileSize, window.y1)};
}

TileGrid make_tile_grid(const PixelWindow& window) {
  TileGrid grid;
  grid.window = window;
  grid.first_column = window.x0 / kTileSize;
  grid.first_row = window.y0 / kTileSize;
  grid.columns = (window.x1 + kTileSize - 1) / kTileSize - grid.first_column;
  grid.rows = (window.y1 + kTileSize - 1) / kTileSize - grid.first_row;
  return grid;
}

TileBins bin_triangles(const TriangleChunks& chunks, const TileGrid& grid) {
  ChunkCounts counts = count_entries(chunks, grid);
  check_total(counts);
  TileBins bins;
  bins.chunk_count = chunks.size();
  bins.offsets = scan_tile_major(counts, grid);
  bins.entries.resize(bins.offsets.back());
  parallel_tasks(chunks.size(), [&](std::size_t chunk) {
    std::vector<std::uint32_t>& cursor = counts[chunk];  // the counts have served; now: where the next entry goes
    for (std::size_t tile = 0; tile != grid.size(); ++tile) cursor[tile] = bins.offset(tile, chunk);
    for (std::uint32_t i = 0; i != chunks[chunk].size(); ++i) {
      for_each_tile(chunks[chunk][i], grid, [&](std::size_t tile) { bins.entries[cursor[tile]++] = i; });
    }
  });
  return bins;
}

}  // namespace halfshade
