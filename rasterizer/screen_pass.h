// What the camera's picture and the maps seen from a light have in common: triangles through clip, set-up and binning,
// then, tile by tile, the samples that each of them covers.
#pragma once

#include "rasterizer/attributes.h"
#include "rasterizer/binning.h"
#include "rasterizer/coverage_kernel.h"

namespace halfshade {

/// A mesh made ready for drawing as seen by one camera.
struct ScreenPass {
  TileGrid grid;
  TriangleChunks chunks;
  TileBins bins;
  SetupCounts counts;
};

/// Parallel; equal for any number of threads. `camera` may look anywhere, but its centre must lie within 8192 px of the
/// picture's top left corner and the picture within the guard band (clip.h).
ScreenPass make_screen_pass(const LatticeMesh& mesh, const CameraFrame& camera, const PixelWindow& window);

/// The triangles of one tile with their covered rows, in the order of the mesh.
class TileCoverage {
 public:
  TileCoverage(const ScreenPass& pass, std::size_t tile) : pass_(pass), tile_(tile), window_(pass.grid.tile(tile)) {}

  const PixelWindow& window() const { return window_; }

  /// draw(piece, part, spans): spans[j] are the covered columns of row part.row + j, part.height of them.
  template <class Draw>
  void for_each(const Draw& draw) {
    for (std::size_t chunk = 0; chunk != pass_.bins.chunk_count; ++chunk) {
      const std::vector<ScreenTriangle>& pieces = pass_.chunks[chunk];
      const std::uint32_t end = pass_.bins.offset(tile_, chunk + 1);
      for (std::uint32_t i = pass_.bins.offset(tile_, chunk); i != end; ++i) {
        // A tile's pieces lie scattered over the chunk: ask for them ahead of time.
        if (i + kPrefetchDistance < end) __builtin_prefetch(&pieces[pass_.bins.entries[i + kPrefetchDistance]]);
        add(pieces[pass_.bins.entries[i]], draw);
      }
    }
    flush(draw);
  }

 private:
  static constexpr std::size_t kBatch = 64;              // triangles per call of the coverage kernel
  static constexpr std::uint32_t kPrefetchDistance = 8;  // entries of a tile's list

  template <class Draw>
  void add(const ScreenTriangle& piece, const Draw& draw) {
    if (!make_tile_triangle(piece, window_, parts_[batched_])) return;
    pieces_[batched_++] = &piece;
    if (batched_ == kBatch) flush(draw);
  }

  template <class Draw>
  void flush(const Draw& draw) {
    cover_rows({parts_.data(), batched_}, spans_);
    const RowSpan* spans = spans_.data();
    for (std::size_t i = 0; i != batched_; ++i) {
      draw(*pieces_[i], parts_[i], spans);
      spans += parts_[i].height;
    }
    batched_ = 0;
  }

  const ScreenPass& pass_;
  const std::size_t tile_;
  const PixelWindow window_;
  std::array<TileTriangle, kBatch> parts_;
  std::array<const ScreenTriangle*, kBatch> pieces_;
  std::array<RowSpan, kBatch * kTileSize> spans_;
  std::size_t batched_ = 0;
};

/// The samples of a tile that a triangle covers, row by row: take(sample, 1/w) for those that wanted(sample, 1/w) asks
/// for and whose texel is opaque. `sample` = row * kTileSize + column. Returns the number of covered samples.
template <class Wanted, class Take>
std::uint64_t draw_samples(const LatticeMesh& mesh, const CameraFrame& camera, const PixelWindow& tile,
                           const ScreenTriangle& piece, const TileTriangle& part, const RowSpan* spans,
                           const Wanted& wanted, const Take& take) {
  std::uint64_t covered = 0;
  const auto rows = [&](const auto& passes) {
    for (std::uint32_t j = 0; j != part.height; ++j) {
      const std::uint32_t row = part.row + j, begin = span_begin(spans[j]), end = span_end(spans[j]);
      const double y_px = tile.y0 + row + 0.5;
      const double row_term = piece.depth.row_term(y_px);
      for (std::uint32_t column = begin; column != end; ++column) {
        const double x_px = tile.x0 + column + 0.5;
        const double inverse_w = piece.depth.at(x_px, row_term);
        const std::size_t sample = row * kTileSize + column;
        if (wanted(sample, inverse_w) && passes(x_px, y_px)) take(sample, inverse_w);
      }
      covered += end - begin;
    }
  };
  if (piece.alpha_map == kNone) {
    rows([](double, double) { return true; });
  } else {
    const AlphaTest test(mesh, camera, piece.triangle, piece.alpha_map);
    rows([&](double x, double y) { return test.passes(camera.ray(x, y)); });
  }
  return covered;
}

}  // namespace halfshade
