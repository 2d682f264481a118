// Hot loop of the rasterizer: edge functions to coverage, for many triangles of one tile per call.
//
// A triangle is convex, so the pixels it covers in a row are one span. Instead of testing pixels against the edges
// (Pineda 1988), each lane takes one row and divides: every edge bounds the span from one side at floor(E / |A|). A
// long thin triangle then costs as little as a small one, and depth runs over contiguous pixels. The division is a
// float estimate corrected in integers, so spans are exact and equal on every instruction set.
#pragma once

#include <array>
#include <cstdint>
#include <span>

namespace halfshade {

inline constexpr std::uint32_t kTileSize = 64;  // pixels per side

/// One triangle's part of a tile. A pixel (column + i, row + j), i < width, j < height, is covered exactly when
/// e[k] + i * a[k] + j * b[k] >= 0 for all three k.
/// Bounds, from the guard band (setup.h): |a|, |b| <= 2^23, |a| + |b| <= 2^24, |e + i a + j b| < 2^30 inside the box.
struct TileTriangle {
  std::array<std::int32_t, 3> e{}, a{}, b{};
  std::uint8_t column = 0, row = 0;    // first pixel of the bounding box, relative to the tile
  std::uint8_t width = 0, height = 0;  // 1..64; column + width <= 64, row + height <= 64
};

/// The covered columns of one row, relative to the tile: begin <= column < end, packed as begin | end << 16.
/// A row without covered pixels is 0.
using RowSpan = std::uint32_t;
inline std::uint32_t span_begin(RowSpan span) { return span & 0xffffu; }
inline std::uint32_t span_end(RowSpan span) { return span >> 16; }

/// Writes the spans of all triangles, height of them each, one triangle after the other. `spans` must hold the sum of
/// heights; nothing else is written.
void cover_rows(std::span<const TileTriangle> triangles, std::span<RowSpan> spans);

/// The Highway target that cover_rows runs on now.
std::int64_t coverage_kernel_target();

}  // namespace halfshade
