// The rasterizer, top to bottom: lattice triangles -> clip -> setup -> bin -> coverage and depth -> G-buffer.
#pragma once

#include "halfshade/light.h"
#include "rasterizer/core/mesh.h"
#include "rasterizer/gbuffer.h"

namespace halfshade {

struct RasterConfig {
  std::uint32_t width = 512,
                height = 512;  // whole picture in samples (pixels times subsamples per axis); 1..16384 each
  PixelWindow window;          // part to render, in samples; all zero = whole picture
  /// Moves the centres of all samples: sample (x, y) looks through (x + 0.5, y + 0.5) + offset. In samples, each axis
  /// in
  /// [-1, 1]. Another offset in every frame, averaged, smooths edges (box filter for offsets all over [-0.5, 0.5)^2).
  dvec2 subpixel_offset{0.0};
};

/// Element `frame` of a low-discrepancy sequence of offsets in [-0.5, 0.5)^2; element 0 is (0, 0).
dvec2 subpixel_jitter(std::uint32_t frame);

struct RasterStats {
  std::uint64_t triangles_in = 0;
  std::uint64_t triangles_clipped = 0;  // crossed the near plane or the guard band
  std::uint64_t triangles_binned = 0;   // survived set-up
  std::uint64_t tile_entries = 0;       // (tile, triangle) pairs
  std::uint64_t samples_covered = 0;    // coverage bits before the depth test
};

/// Draws `mesh` as seen from `camera` (world space) into `gbuffer`. Runs in the calling thread's TBB arena.
/// Equal inputs give equal bits for any number of threads, any instruction set and any window.
/// Throws Error{kUsage} for a size or window out of range or a degenerate camera.
void rasterize(const LatticeMesh& mesh, const Camera& camera, const RasterConfig& config, GBuffer& gbuffer,
               RasterStats* stats = nullptr);

/// A picture of a scene that comes in pieces: the same G-buffer as of the whole scene, if pieces are drawn in order.
struct PiecewisePicture {
  GBuffer gbuffer;                // `triangle` counts through all pieces
  std::vector<double> inverse_w;  // [entry] of what is nearest so far, 0 = nothing
};

/// Nothing drawn yet. Throws as rasterize.
PiecewisePicture begin_picture(const RasterConfig& config);

/// Draws a piece whose first triangle has number `first_triangle`. The frame of all pieces must be the same.
void rasterize_piece(const LatticeMesh& piece, std::uint32_t first_triangle, const Camera& camera,
                     const RasterConfig& config, PiecewisePicture& picture, RasterStats& stats);

}  // namespace halfshade
