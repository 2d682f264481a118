#include "shadows/shadow_map_per_sample.h"

#include "rasterizer/core/parallel.h"
#include "rasterizer/core/stopwatch.h"
#include "shadows/light_maps.h"
#include "shadows/solver.h"

namespace halfshade {
namespace {

/// Sets bit `sample` of those receivers that the maps of this sample show to be hidden.
void look_up(const ReceiverArray& receivers, std::span<const std::uint32_t> some, const LightMaps& maps,
             const ShadowMapOptions& options, std::uint32_t sample, VisibilityMasks& masks) {
  parallel_ranges(some.size(), 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k != end; ++k) {
      const std::uint32_t i = some[k];
      const std::optional<MapReceiver> place = place_in_maps(maps, receivers, i, options);
      const bool hidden = place && place->hidden_at_own_lexel();
      masks.words[i * masks.words_per_receiver + sample / 64] |= std::uint64_t{hidden} << (sample % 64);
    }
  });
}

}  // namespace

void solve_shadow_maps(const LatticeMesh& mesh, const ReceiverArray& receivers, const LightSamples& samples,
                       const ShadowConfig& config, VisibilityMasks& masks, ShadowStats& stats) {
  const ShadowMapOptions& options = config.shadow_map;
  check_shadow_map_options(options);
  masks.reset(receivers.size(), samples.count);
  const MapAxes axes = make_map_axes(samples, receivers);
  LightMaps maps;
  std::uint64_t map_count = 0, lexels = 0;
  Stopwatch watch;
  for (std::uint32_t set = 0; set < samples.sets; ++set) {
    const std::vector<std::uint32_t> some = receivers_of_set(receivers, set);
    for (std::uint32_t s = 0; s < samples.count && !some.empty(); ++s) {
      report_progress(config, (set + static_cast<double>(s) / samples.count) / samples.sets);
      make_light_maps(
          mesh, receivers,
          {.eye = dvec3(samples.set(set)[s]), .axes = axes, .resolution = options.resolution, .receivers = some}, maps);
      map_count += maps.maps(), lexels += maps.lexels();
      stats.bytes = std::max(stats.bytes, maps.bytes());
      stats.index_ms += watch.lap();
      look_up(receivers, some, maps, options, s, masks);
      stats.test_ms += watch.lap();
    }
  }
  stats.details.emplace_back("map.maps", static_cast<double>(map_count));
  stats.details.emplace_back("map.lexels", static_cast<double>(lexels));
}

std::string assumptions_of_shadow_maps(const ShadowConfig& config) {
  return "one map of up to " + std::to_string(config.shadow_map.resolution) +
         " lexels a side for each light sample (six around a sample that the receivers surround); " +
         assumptions_of_lookups(config.shadow_map);
}

}  // namespace halfshade
