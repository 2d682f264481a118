#include "rasterizer/rasterizer.h"

#include <algorithm>
#include <atomic>
#include <cmath>

#include "halfshade/error.h"
#include "rasterizer/core/parallel.h"
#include "rasterizer/screen_pass.h"

namespace halfshade {
namespace {

constexpr std::uint32_t kMaxPictureSide = 16384;

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

/// Power of two, at least every |coordinate|.
double reach_of(const LatticeMesh& mesh) {
  float largest = 0.0f;
  for (const vec3& p : mesh.positions) {
    largest = std::max({largest, std::fabs(p.x), std::fabs(p.y), std::fabs(p.z)});
  }
  double reach = kLatticeUnit;
  while (reach < largest) reach *= 2.0;
  return reach;
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
  gbuffer.drawn = {};
}

void clear(GBuffer& gbuffer) { resize(gbuffer, {.width = 0, .height = 0, .window = {}, .subpixel_offset = {}}, {}); }

// ---- one tile -----------------------------------------------------------------------------------------------------

// What is nearest so far. 1/w grows towards the eye; 0 is infinitely far away.
struct VisibilityTile {
  std::array<double, kTileSize * kTileSize> inverse_w;        // [row][column]
  std::array<std::uint32_t, kTileSize * kTileSize> triangle;  // [row][column], or kNone
};

// Nearer wins; on a tie the triangle that came first stays. Returns the number of covered samples.
std::uint64_t draw_tile(const LatticeMesh& mesh, const CameraFrame& camera, TileCoverage& coverage,
                        VisibilityTile& visible) {
  std::uint64_t covered = 0;
  coverage.for_each([&](const ScreenTriangle& piece, const TileTriangle& part, const RowSpan* spans) {
    covered += draw_samples(
        mesh, camera, coverage.window(), piece, part, spans,
        [&](std::size_t sample, double inverse_w) { return inverse_w > visible.inverse_w[sample]; },
        [&](std::size_t sample, double inverse_w) {
          visible.inverse_w[sample] = inverse_w;
          visible.triangle[sample] = piece.triangle;
        });
  });
  return covered;
}

void draw_tiles(const LatticeMesh& mesh, const CameraFrame& camera, const ScreenPass& pass, GBuffer& gbuffer,
                RasterStats& stats) {
  std::atomic<std::uint64_t> samples_covered{0};
  parallel_tasks(pass.grid.size(), [&](std::size_t tile) {
    TileCoverage coverage(pass, tile);
    VisibilityTile visible;
    visible.inverse_w.fill(0.0);
    visible.triangle.fill(kNone);
    samples_covered.fetch_add(draw_tile(mesh, camera, coverage, visible), std::memory_order_relaxed);
    const PixelWindow& window = coverage.window();
    for (std::uint32_t row = 0; row != window.height(); ++row) {
      resolve_row(mesh, camera, window.x0, window.y0 + row, {&visible.triangle[row * kTileSize], window.width()},
                  gbuffer);
    }
  });
  stats.samples_covered = samples_covered.load();
}

// ---- a picture in pieces --------------------------------------------------------------------------------------------

std::size_t entry_of(const GBuffer& gbuffer, std::uint32_t x, std::uint32_t y) {
  return std::size_t{y - gbuffer.window.y0} * gbuffer.window.width() + (x - gbuffer.window.x0);
}

// The attributes of `count` entries that a triangle of this piece has won.
void resolve_run(const LatticeMesh& piece, const CameraFrame& camera, std::uint32_t first_triangle, std::uint32_t x,
                 std::uint32_t y, std::span<const std::uint32_t> triangles, GBuffer& gbuffer) {
  resolve_row(piece, camera, x, y, triangles, gbuffer);
  const std::size_t entry = entry_of(gbuffer, x, y);
  for (std::size_t i = 0; i != triangles.size(); ++i) gbuffer.triangle[entry + i] += first_triangle;
}

// Keeps what the piece has won in one row of a tile.
void merge_row(const LatticeMesh& piece, const CameraFrame& camera, std::uint32_t first_triangle, std::uint32_t x0,
               std::uint32_t y, std::span<const std::uint32_t> triangles, GBuffer& gbuffer) {
  for (std::size_t begin = 0; begin != triangles.size();) {
    std::size_t end = begin + 1;
    while (end != triangles.size() && (triangles[end] == kNone) == (triangles[begin] == kNone)) ++end;
    if (triangles[begin] != kNone) {
      resolve_run(piece, camera, first_triangle, x0 + static_cast<std::uint32_t>(begin), y,
                  triangles.subspan(begin, end - begin), gbuffer);
    }
    begin = end;
  }
}

void merge_tile(const LatticeMesh& piece, const CameraFrame& camera, std::uint32_t first_triangle,
                TileCoverage& coverage, PiecewisePicture& picture, std::uint64_t& covered) {
  const PixelWindow& window = coverage.window();
  VisibilityTile visible;
  visible.triangle.fill(kNone);
  const auto row_depths = [&](std::uint32_t row) {
    return picture.inverse_w.begin() +
           static_cast<std::ptrdiff_t>(entry_of(picture.gbuffer, window.x0, window.y0 + row));
  };
  for (std::uint32_t row = 0; row != window.height(); ++row) {
    std::copy_n(row_depths(row), window.width(), visible.inverse_w.begin() + row * kTileSize);
  }
  covered += draw_tile(piece, camera, coverage, visible);
  for (std::uint32_t row = 0; row != window.height(); ++row) {
    std::copy_n(visible.inverse_w.begin() + row * kTileSize, window.width(), row_depths(row));
    merge_row(piece, camera, first_triangle, window.x0, window.y0 + row,
              {&visible.triangle[row * kTileSize], window.width()}, picture.gbuffer);
  }
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

CameraFrame picture_frame(const Camera& camera, const LocalFrame& local, const RasterConfig& config) {
  CameraFrame frame = make_camera_frame(camera, local, config.width, config.height);
  // Projection and rays both go through the centre, so moving it moves them alike.
  frame.center_x_px -= config.subpixel_offset.x;
  frame.center_y_px -= config.subpixel_offset.y;
  return frame;
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
  const CameraFrame frame = picture_frame(camera, mesh.frame, config);
  const ScreenPass pass = make_screen_pass(mesh, frame, window);
  RasterStats counted;
  counted.triangles_in = mesh.triangles.size();
  counted.triangles_clipped = pass.counts.clipped;
  counted.triangles_binned = pass.counts.survived;
  counted.tile_entries = pass.bins.entries.size();
  try {
    resize(gbuffer, config, window);
    gbuffer.reach = reach_of(mesh);
    draw_tiles(mesh, frame, pass, gbuffer, counted);
  } catch (...) {
    clear(gbuffer);  // half a picture of this and half of the one before would pass for one
    throw;
  }
  if (stats != nullptr) *stats = counted;
}

PiecewisePicture begin_picture(const RasterConfig& config) {
  PiecewisePicture picture;
  GBuffer& gbuffer = picture.gbuffer;
  resize(gbuffer, config, checked_window(config));
  gbuffer.reach = kLatticeUnit;
  std::fill(gbuffer.triangle.begin(), gbuffer.triangle.end(), kNone);
  picture.inverse_w.assign(gbuffer.size(), 0.0);
  return picture;
}

void rasterize_piece(const LatticeMesh& piece, std::uint32_t first_triangle, const Camera& camera,
                     const RasterConfig& config, PiecewisePicture& picture, RasterStats& stats) {
  const FpEnvironment environment;
  const CameraFrame frame = picture_frame(camera, piece.frame, config);
  const ScreenPass pass = make_screen_pass(piece, frame, picture.gbuffer.window);
  picture.gbuffer.reach = std::max(picture.gbuffer.reach, reach_of(piece));
  std::vector<std::uint64_t> covered(pass.grid.size(), 0);
  parallel_tasks(pass.grid.size(), [&](std::size_t tile) {
    TileCoverage coverage(pass, tile);
    merge_tile(piece, frame, first_triangle, coverage, picture, covered[tile]);
  });
  stats.triangles_in += piece.triangles.size();
  stats.triangles_clipped += pass.counts.clipped;
  stats.triangles_binned += pass.counts.survived;
  stats.tile_entries += pass.bins.entries.size();
  for (const std::uint64_t c : covered) stats.samples_covered += c;
}

}  // namespace halfshade
