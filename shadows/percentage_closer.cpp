#include "shadows/percentage_closer.h"

#include <cmath>

#include "rasterizer/core/stopwatch.h"
#include "shadows/light_maps.h"

namespace halfshade {
namespace {

/// Half the side of a square of the area of a disk of radius 1.
constexpr double kSquareOfDisk = 0.88622692545275801365;

float closer_in_box(const MapReceiver& r, int radius) {
  const int column = r.map->column(r.x_px), row = r.map->row(r.y_px);
  int hidden = 0;
  for (int y = row - radius; y <= row + radius; ++y) {
    for (int x = column - radius; x <= column + radius; ++x) hidden += r.hidden_by(x, y);
  }
  const auto side = static_cast<float>(2 * radius + 1);
  return 1.0f - static_cast<float>(hidden) / (side * side);
}

/// What a regular grid of lookups finds in the square of half side `reach_px` around the receiver.
struct Found {
  std::uint32_t hidden = 0, lookups = 0;
  double depth_sum = 0.0;  // of the lexels that hide
};

Found look_around(const MapReceiver& r, double reach_px, std::uint32_t per_axis) {
  Found found;
  found.lookups = per_axis * per_axis;
  const auto lexel = [&](double center, std::uint32_t i) {
    return static_cast<int>(std::floor(center + reach_px * ((2.0 * i + 1.0) / per_axis - 1.0)));
  };
  for (std::uint32_t j = 0; j < per_axis; ++j) {
    for (std::uint32_t i = 0; i < per_axis; ++i) {
      const int x = lexel(r.x_px, i), y = lexel(r.y_px, j);
      if (!r.hidden_by(x, y)) continue;
      ++found.hidden;
      found.depth_sum += 1.0 / double{r.inverse_w(x, y)};
    }
  }
  return found;
}

/// Half side in lexels of the light of that radius, seen from the receiver through the plane at that depth.
double light_through(const MapReceiver& r, double radius, double depth) {
  return std::max(0.0, kSquareOfDisk * radius * (1.0 / depth - 1.0 / r.w) * r.map->camera.focal_px);
}

float soft_share(const MapReceiver& r, double radius, double plane, const ShadowMapOptions& options) {
  const Found blockers = look_around(r, light_through(r, radius, plane), options.pcss_search);
  if (blockers.hidden == 0) return 1.0f;
  const double mean_depth = blockers.depth_sum / blockers.hidden;
  const Found filtered = look_around(r, light_through(r, radius, mean_depth), options.pcss_filter);
  return 1.0f - static_cast<float>(filtered.hidden) / static_cast<float>(filtered.lookups);
}

}  // namespace

void solve_pcf(const LatticeMesh& mesh, const ReceiverArray& receivers, const LightSamples& samples,
               const ShadowConfig& config, std::vector<float>& visibility, ShadowStats& stats) {
  const ShadowMapOptions& options = config.shadow_map;
  check_shadow_map_options(options);
  Stopwatch watch;
  LightMaps maps;
  make_center_maps(mesh, receivers, samples, options.pcf_radius, options, maps, stats);
  stats.index_ms += watch.lap();
  visibility.assign(receivers.size(), 1.0f);
  for_each_receiver(receivers, config, [&](std::size_t i) {
    const std::optional<MapReceiver> place = place_in_maps(maps, receivers, i, options);
    if (place) visibility[i] = closer_in_box(*place, static_cast<int>(options.pcf_radius));
  });
  stats.test_ms += watch.lap();
}

void solve_pcss(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                const LightSamples& samples, const ShadowConfig& config, std::vector<float>& visibility,
                ShadowStats& stats) {
  const ShadowMapOptions& options = config.shadow_map;
  check_shadow_map_options(options);
  Stopwatch watch;
  const double radius = equivalent_radius(light) * mesh.frame.scale;
  const SearchMaps search = make_search_maps(mesh, receivers, samples, radius, 0.0, 1, options);
  note_maps(search.maps, stats);
  stats.details.emplace_back("pcss.lexels_before_plane", static_cast<double>(search.before_plane));
  stats.index_ms += watch.lap();
  visibility.assign(receivers.size(), 1.0f);
  for_each_receiver(receivers, config, [&](std::size_t i) {
    const std::optional<MapReceiver> place = place_in_maps(search.maps, receivers, i, options);
    if (place) visibility[i] = soft_share(*place, radius, search.plane, options);
  });
  stats.test_ms += watch.lap();
}

std::string assumptions_of_pcf(const ShadowConfig& config) {
  const ShadowMapOptions& o = config.shadow_map;
  return "penumbras are everywhere " + std::to_string(2 * o.pcf_radius + 1) +
         " lexels wide, whatever the light's size; one map of up to " + std::to_string(o.resolution) +
         " lexels a side from the light's centre; " + assumptions_of_lookups(o);
}

std::string assumptions_of_pcss(const ShadowConfig& config, const Light& light) {
  const ShadowMapOptions& o = config.shadow_map;
  return assumptions_of_equivalent_light(light) +
         "; all blockers of a receiver at their mean depth, parallel to the map, and seen by the light's centre; " +
         std::to_string(o.pcss_search) + "x" + std::to_string(o.pcss_search) + " lookups for them, " +
         std::to_string(o.pcss_filter) + "x" + std::to_string(o.pcss_filter) + " for the shadow; " +
         assumptions_of_lookups(o);
}

}  // namespace halfshade
