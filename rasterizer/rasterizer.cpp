#include "rasterizer/rasterizer.h"

#include <hwy/cache_control.h>
#include <algorithm>
#include <atomic>
#include <cmath>

#include "halfshade/error.h"
#include "rasterizer/attributes.h"
#include "rasterizer/binning.h"
#include "rasterizer/core/parallel.h"

namespace halfshade {
namespace {

constexpr std::uint32_t kMaxPictureSide = 16384;
constexpr std::size_t kTrianglesPerChunk = 4096;
constexpr std::size_t kMaxTileCounters = std::size_t{1} << 22;  // (tile, chunk) pairs: 16 MiB of counts
constexpr std::size_t kBatch = 64;                              // triangles per call of the coverage kernel
constexpr std::uint32_t kPrefetchDistance = 8;                  // entries of a tile's list

// ---- checks -----------------------------------------------------------------------------------------------------

void check_side(const char* name, std::uint32_t value) {
  if (value >= 1 && value <= kMaxPictureSide) return;
  throw Error(ErrorCode::kUsage, std::string("rasterize: ") + name + " is " + std::to_string(value) +
                                     ", allowed: 1 to " + std::to_string(kMaxPictureSide));
}

void check_range(const char* axis, std::uint32_t begin, std::uint32_t end, std::uint32_t side) {
  if (begin < end && end <= side) return;
  throw Error(ErrorCode::kUsage, std::string("rasterize: window ") + axis + " is " + std::to_string(begin) + " to " +
                                     std::to_string(end) + ", allowed: a non-empty range within 0 to " +
                                     std::to_string(side));
}

void check_offset(const dvec2& offset) {
  if (std::fabs(offset.x) <= 1.0 && std::fabs(offset.y) <= 1.0) return;
  throw Error(ErrorCode::kUsage, "rasterize: subpixel_offset is (" + std::to_string(offset.x) + ", " +
                                     std::to_string(offset.y) + "), allowed: -1 to 1");
}

PixelWindow checked_window(const RasterConfig& config) {
  check_side("width", config.width);
  check_side("height", config.height);
  check_offset(config.subpixel_offset);
  const PixelWindow& window = config.window;
  if ((window.x0 | window.x1 | window.y0 | window.y1) == 0) return {0, config.width, 0, config.height};
  check_range("x", window.x0, window.x1, config.width);
  check_range("y", window.y0, window.y1, config.height);
  return window;
}

void resize(GBuffer& gbuffer, const RasterConfig& config, const PixelWindow& window) {
  const std::size_t count = std::size_t{window.width()} * window.height();
  gbuffer.triangle.resize(count);
  gbuffer.position.resize(count);
  gbuffer.geometric_normal.resize(count);
  gbuffer.shading_normal.resize(count);
  gbuffer.albedo.resize(count);
  gbuffer.depth.resize(count);
  gbuffer.width = config.width;
  gbuffer.height = config.height;
  gbuffer.window = window;
}

// ---- stage 1: vertices to pixels, triangles to screen triangles ---------------------------------------------------

std::vector<PixelPoint> project_vertices(const LatticeMesh& mesh, const CameraFrame& camera) {
  std::vector<PixelPoint> points(mesh.positions.size());
  parallel_ranges(points.size(), 8192, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) points[i] = camera.project(dvec3(mesh.positions[i]));
  });
  return points;
}

TriangleChunks set_up(const LatticeMesh& mesh, const CameraFrame& camera, const TileGrid& grid, RasterStats& stats) {
  const std::vector<PixelPoint> points = project_vertices(mesh, camera);
  const std::size_t count = mesh.triangles.size();
  const std::size_t most = std::max<std::size_t>(1, kMaxTileCounters / grid.size());
  const std::size_t chunk_count = std::clamp<std::size_t>(count / kTrianglesPerChunk, 1, most);
  TriangleChunks chunks(chunk_count);
  std::vector<SetupCounts> counts(chunk_count);
  parallel_tasks(chunk_count, [&](std::size_t chunk) {
    const std::size_t begin = count * chunk / chunk_count, end = count * (chunk + 1) / chunk_count;
    chunks[chunk].reserve(end - begin);
    set_up_triangles(mesh, camera, points, grid.window, begin, end, chunks[chunk], counts[chunk]);
  });
  for (const SetupCounts& c : counts) {
    stats.triangles_clipped += c.clipped;
    stats.triangles_binned += c.survived;
  }
  return chunks;
}

// ---- stage 2: one tile ----------------------------------------------------------------------------------------------

// What is nearest so far. 1/w grows towards the eye; 0 is infinitely far away.
struct VisibilityTile {
  std::array<double, kTileSize * kTileSize> inverse_w;        // [row][column]
  std::array<std::uint32_t, kTileSize * kTileSize> triangle;  // [row][column], or kNone
};

class TileRasterizer {
 public:
  TileRasterizer(const LatticeMesh& mesh, const CameraFrame& camera, const PixelWindow& tile)
      : mesh_(mesh), camera_(camera), tile_(tile) {
    visible_.inverse_w.fill(0.0);
    visible_.triangle.fill(kNone);
  }

  void add(const ScreenTriangle& piece) {
    if (!make_tile_triangle(piece, tile_, parts_[batched_])) return;
    pieces_[batched_++] = &piece;
    if (batched_ == kBatch) flush();
  }

  /// Coverage, then depth, for the triangles added since the last call, in the order they were added.
  void flush() {
    cover_rows({parts_.data(), batched_}, spans_);
    const RowSpan* spans = spans_.data();
    for (std::size_t i = 0; i != batched_; ++i) {
      if (pieces_[i]->alpha_map == kNone) {
        draw(*pieces_[i], parts_[i], spans, [](double, double) { return true; });
      } else {
        const AlphaTest test(mesh_, camera_, pieces_[i]->triangle, pieces_[i]->alpha_map);
        draw(*pieces_[i], parts_[i], spans, [&](double x, double y) { return test.passes(camera_.ray(x, y)); });
      }
      spans += parts_[i].height;
    }
    batched_ = 0;
  }

  void resolve(GBuffer& gbuffer) const {
    for (std::uint32_t row = 0; row != tile_.height(); ++row) {
      resolve_row(mesh_, camera_, tile_.x0, tile_.y0 + row, {&visible_.triangle[row * kTileSize], tile_.width()},
                  gbuffer);
    }
  }

  std::uint64_t samples_covered() const { return samples_covered_; }

 private:
  // Nearer wins; on a tie the triangle that came first stays.
  template <class Passes>
  void draw(const ScreenTriangle& piece, const TileTriangle& part, const RowSpan* spans, const Passes& passes) {
    for (std::uint32_t j = 0; j != part.height; ++j) {
      const std::uint32_t row = part.row + j, begin = span_begin(spans[j]), end = span_end(spans[j]);
      const double y_px = tile_.y0 + row + 0.5;
      const double row_term = piece.depth.row_term(y_px);
      for (std::uint32_t column = begin; column != end; ++column) {
        const double x_px = tile_.x0 + column + 0.5;
        const double inverse_w = piece.depth.at(x_px, row_term);
        const std::size_t sample = row * kTileSize + column;
        if (!(inverse_w > visible_.inverse_w[sample]) || !passes(x_px, y_px)) continue;
        visible_.inverse_w[sample] = inverse_w;
        visible_.triangle[sample] = piece.triangle;
      }
      samples_covered_ += end - begin;
    }
  }

  const LatticeMesh& mesh_;
  const CameraFrame& camera_;
  const PixelWindow tile_;
  VisibilityTile visible_;
  std::array<TileTriangle, kBatch> parts_;
  std::array<const ScreenTriangle*, kBatch> pieces_;
  std::array<RowSpan, kBatch * kTileSize> spans_;
  std::size_t batched_ = 0;
  std::uint64_t samples_covered_ = 0;
};

void draw_tiles(const LatticeMesh& mesh, const CameraFrame& camera, const TriangleChunks& chunks, const TileGrid& grid,
                const TileBins& bins, GBuffer& gbuffer, RasterStats& stats) {
  std::atomic<std::uint64_t> samples_covered{0};
  parallel_tasks(grid.size(), [&](std::size_t tile) {
    TileRasterizer rasterizer(mesh, camera, grid.tile(tile));
    for (std::size_t chunk = 0; chunk != bins.chunk_count; ++chunk) {
      const std::vector<ScreenTriangle>& pieces = chunks[chunk];
      const std::uint32_t end = bins.offset(tile, chunk + 1);
      for (std::uint32_t i = bins.offset(tile, chunk); i != end; ++i) {
        // A tile's pieces lie scattered over the chunk: ask for them ahead of time.
        if (i + kPrefetchDistance < end) hwy::Prefetch(&pieces[bins.entries[i + kPrefetchDistance]]);
        rasterizer.add(pieces[bins.entries[i]]);
      }
    }
    rasterizer.flush();
    rasterizer.resolve(gbuffer);
    samples_covered.fetch_add(rasterizer.samples_covered(), std::memory_order_relaxed);
  });
  stats.samples_covered = samples_covered.load();
}

// The digits of `index` in `base`, mirrored at the point (van der Corput): in [0, 1). Exact up to the division.
double radical_inverse(std::uint32_t index, std::uint32_t base) {
  std::uint64_t mirrored = 0, scale = 1;
  for (; index != 0; index /= base) {
    mirrored = mirrored * base + index % base;
    scale *= base;
  }
  return static_cast<double>(mirrored) / static_cast<double>(scale);
}

double centered(double unit) { return unit < 0.5 ? unit : unit - 1.0; }

}  // namespace

// Halton's sequence in bases 3 and 5: the sets of light samples follow a sequence in base 2, and pictures average over
// both at once, so the two must not move in step.
dvec2 subpixel_jitter(std::uint32_t frame) {
  return {centered(radical_inverse(frame, 3)), centered(radical_inverse(frame, 5))};
}

void rasterize(const LatticeMesh& mesh, const Camera& camera, const RasterConfig& config, GBuffer& gbuffer,
               RasterStats* stats) {
  const FpEnvironment environment;
  const PixelWindow window = checked_window(config);
  CameraFrame frame = make_camera_frame(camera, mesh.frame, config.width, config.height);
  // Projection and rays both go through the centre, so moving it moves them alike.
  frame.center_x_px -= config.subpixel_offset.x;
  frame.center_y_px -= config.subpixel_offset.y;
  const TileGrid grid = make_tile_grid(window);

  RasterStats counted;
  counted.triangles_in = mesh.triangles.size();
  const TriangleChunks chunks = set_up(mesh, frame, grid, counted);
  const TileBins bins = bin_triangles(chunks, grid);
  counted.tile_entries = bins.entries.size();
  resize(gbuffer, config, window);
  draw_tiles(mesh, frame, chunks, grid, bins, gbuffer, counted);
  if (stats != nullptr) *stats = counted;
}

}  // namespace halfshade
