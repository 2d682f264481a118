#include "rasterizer/screen_pass.h"

#include <algorithm>

#include "rasterizer/core/parallel.h"

namespace halfshade {
namespace {

constexpr std::size_t kTrianglesPerChunk = 4096;
constexpr std::size_t kMaxTileCounters = std::size_t{1} << 22;  // (tile, chunk) pairs: 16 MiB of counts

std::vector<PixelPoint> project_vertices(const LatticeMesh& mesh, const CameraFrame& camera) {
  std::vector<PixelPoint> points(mesh.positions.size());
  parallel_ranges(points.size(), 8192, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) points[i] = camera.project(dvec3(mesh.positions[i]));
  });
  return points;
}

TriangleChunks set_up(const LatticeMesh& mesh, const CameraFrame& camera, const TileGrid& grid, SetupCounts& total) {
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
    total.clipped += c.clipped;
    total.survived += c.survived;
  }
  return chunks;
}

}  // namespace

ScreenPass make_screen_pass(const LatticeMesh& mesh, const CameraFrame& camera, const PixelWindow& window) {
  ScreenPass pass;
  pass.grid = make_tile_grid(window);
  pass.chunks = set_up(mesh, camera, pass.grid, pass.counts);
  pass.bins = bin_triangles(pass.chunks, pass.grid);
  return pass;
}

}  // namespace halfshade
