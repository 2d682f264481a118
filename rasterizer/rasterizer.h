// The rasterizer, top to bottom: lattice triangles -> clip -> setup -> bin -> coverage and depth -> G-buffer.
#pragma once

#include "halfshade/light.h"
#include "halfshade/rasterizer.h"
#include "rasterizer/core/mesh.h"

namespace halfshade {

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
