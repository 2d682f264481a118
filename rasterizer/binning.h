// Triangles to tiles, in submission order: count, scan, fill (as in Aila, Laine and Karras's cudaraster, 2011).
//
// Triangles come in chunks, in mesh order. Counts are kept per (tile, chunk) and scanned tile by tile, so every list
// has its final place before anybody writes to it and is ordered by triangle, whoever does the work.
#pragma once

#include "rasterizer/setup.h"

namespace halfshade {

/// The tiles of the picture that the window touches. Tiles are aligned to the picture, not to the window.
struct TileGrid {
  PixelWindow window;
  std::uint32_t first_column = 0, first_row = 0;  // in tiles
  std::uint32_t columns = 0, rows = 0;

  std::size_t size() const { return std::size_t{columns} * rows; }
  PixelWindow tile(std::size_t index) const;  // clipped to the window
};

TileGrid make_tile_grid(const PixelWindow& window);

using TriangleChunks = std::vector<std::vector<ScreenTriangle>>;

/// The pieces that touch tile t, as indices into chunk c, are entries[offset(t, c) .. offset(t, c + 1)).
struct TileBins {
  std::size_t chunk_count = 0;
  std::vector<std::uint32_t> offsets;  // [tile][chunk], and the total at the end
  std::vector<std::uint32_t> entries;

  std::uint32_t offset(std::size_t tile, std::size_t chunk) const { return offsets[tile * chunk_count + chunk]; }
};

/// Throws Error{kLimit} when the lists would need more than 2^32 - 1 entries.
TileBins bin_triangles(const TriangleChunks& chunks, const TileGrid& grid);

}  // namespace halfshade
