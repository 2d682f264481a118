#include "shadows/shadow_map.h"

#include <atomic>
#include <cstdio>

#include "rasterizer/core/parallel.h"
#include "rasterizer/core/stopwatch.h"
#include "rasterizer/screen_pass.h"
#include "shadows/light_maps.h"

namespace halfshade {
namespace {

using DepthTile = std::array<float, kTileSize * kTileSize>;  // [row][column]

void copy_to_layer(const DepthTile& tile, const PixelWindow& window, std::uint32_t width, std::vector<float>& layer) {
  for (std::uint32_t row = 0; row != window.height(); ++row) {
    std::copy_n(tile.begin() + row * kTileSize, window.width(),
                layer.begin() + std::size_t{window.y0 + row} * width + window.x0);
  }
}

/// What was drawn there in the layer before; infinitely near for the first layer.
void copy_from_layer(const std::vector<float>* layer, const PixelWindow& window, std::uint32_t width, DepthTile& tile) {
  tile.fill(HUGE_VALF);
  for (std::uint32_t row = 0; layer != nullptr && row != window.height(); ++row) {
    std::copy_n(layer->begin() + std::size_t{window.y0 + row} * width + window.x0, window.width(),
                tile.begin() + row * kTileSize);
  }
}

/// The nearest of what lies beyond `before`. Depths are compared as they are stored, so that equal ones are peeled
/// together. False when nothing is left.
bool draw_layer(const LatticeMesh& mesh, const ScreenPass& pass, const std::vector<float>* before, DepthMap& map,
                std::vector<float>& layer) {
  layer.resize(std::size_t{map.width} * map.height);
  std::atomic<bool> any{false};
  parallel_tasks(pass.grid.size(), [&](std::size_t tile) {
    TileCoverage coverage(pass, tile);
    DepthTile nearest, limit;
    nearest.fill(0.0f);
    copy_from_layer(before, coverage.window(), map.width, limit);
    bool drawn = false;
    coverage.for_each([&](const ScreenTriangle& piece, const TileTriangle& part, const RowSpan* spans) {
      draw_samples(
          mesh, map.camera, coverage.window(), piece, part, spans,
          [&](std::size_t sample, double inverse_w) {
            const auto stored = static_cast<float>(inverse_w);
            return stored > nearest[sample] && stored < limit[sample];
          },
          [&](std::size_t sample, double inverse_w) {
            nearest[sample] = static_cast<float>(inverse_w);
            drawn = true;
          });
    });
    copy_to_layer(nearest, coverage.window(), map.width, layer);
    if (drawn) any.store(true, std::memory_order_relaxed);
  });
  return any.load();
}

void check_range(const char* name, double value, double low, double high) {
  if (value >= low && value <= high) return;
  throw Error(ErrorCode::kUsage, std::string(name) + ": " + short_number(value) + " is not in " + short_number(low) +
                                     ".." + short_number(high));
}

}  // namespace

void draw_depth_map(const LatticeMesh& mesh, std::uint32_t layer_limit, DepthMap& map) {
  const ScreenPass pass = make_screen_pass(mesh, map.camera, {0, map.width, 0, map.height});
  map.layers.resize(std::max<std::size_t>(map.layers.size(), layer_limit));
  std::size_t drawn = 0;
  for (; drawn < layer_limit; ++drawn) {
    const std::vector<float>* before = drawn == 0 ? nullptr : &map.layers[drawn - 1];
    if (!draw_layer(mesh, pass, before, map, map.layers[drawn])) break;
  }
  map.layers.resize(std::max<std::size_t>(drawn, 1));
}

MapReceiver place_in_map(const DepthMap& map, const vec3& position, const vec3& normal,
                         const ShadowMapOptions& options) {
  const CameraFrame& camera = map.camera;
  const dvec3 d = dvec3(position) - camera.eye;
  MapReceiver r;
  r.map = &map;
  r.w = glm::dot(d, camera.forward);
  r.x_px = camera.center_x_px + camera.focal_px * glm::dot(d, camera.right) / r.w;
  r.y_px = camera.center_y_px - camera.focal_px * glm::dot(d, camera.up) / r.w;
  const double lexel = r.w / camera.focal_px;  // its width at the receiver's distance
  r.nearest_w = r.w - options.bias * lexel;
  dvec3 n(normal);
  if (normal == vec3(0.0f)) n = -camera.forward;
  if (glm::dot(n, d) > 0.0) n = -n;  // the side of the tangent plane that the light's point is on
  r.tangent.x = glm::dot(n, camera.right) / camera.focal_px;
  r.tangent.y = -glm::dot(n, camera.up) / camera.focal_px;
  r.tangent.z = glm::dot(n, camera.forward) - r.tangent.x * camera.center_x_px - r.tangent.y * camera.center_y_px;
  r.height = -glm::dot(n, d) - options.slope_bias * lexel;
  return r;
}

void check_shadow_map_options(const ShadowMapOptions& o) {
  check_range("map.resolution", o.resolution, 16, 8192);
  check_range("map.bias", double{o.bias}, 0, 64);
  check_range("map.slope-bias", double{o.slope_bias}, 0, 64);
  check_range("pcf.radius", o.pcf_radius, 0, 64);
  check_range("pcss.search", o.pcss_search, 1, 64);
  check_range("pcss.filter", o.pcss_filter, 1, 64);
  check_range("shadow-accumulation.kernel", o.kernel, 1, 64);
  check_range("shadow-accumulation.layers", o.layers, 1, 64);
  if (o.plane != 0.0f) check_range("shadow-accumulation.plane", double{o.plane}, 1, 1e6);
}

void solve_shadow_map(const LatticeMesh& mesh, const ReceiverArray& receivers, const LightSamples& samples,
                      const ShadowConfig& config, std::vector<float>& visibility, ShadowStats& stats) {
  const ShadowMapOptions& options = config.shadow_map;
  check_shadow_map_options(options);
  Stopwatch watch;
  LightMaps maps;
  make_center_maps(mesh, receivers, samples, 0, options, maps, stats);
  stats.index_ms += watch.lap();
  visibility.resize(receivers.size());
  parallel_ranges(receivers.size(), 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) {
      const std::optional<MapReceiver> place = place_in_maps(maps, receivers, i, options);
      visibility[i] = place && place->hidden_at_own_lexel() ? 0.0f : 1.0f;
    }
  });
  stats.test_ms += watch.lap();
}

std::string short_number(double x) {
  char text[32];
  std::snprintf(text, sizeof text, "%.5g", x);
  return text;
}

std::string assumptions_of_lookups(const ShadowMapOptions& options) {
  return "the centre of a lexel answers for all of it; bias " + short_number(options.bias) + ", slope bias " +
         short_number(options.slope_bias) + " lexels";
}

std::string assumptions_of_shadow_map(const ShadowConfig& config) {
  return "a point light at the light's centre: no penumbra; one map of up to " +
         std::to_string(config.shadow_map.resolution) + " lexels a side; " + assumptions_of_lookups(config.shadow_map);
}

}  // namespace halfshade
