#include "shadows/alpha.h"
#include "shadows/crossing.h"
#include "shadows/transmittance.h"

namespace halfshade {
namespace {

/// Texel of a map under the crossing; any without a map.
template <class Map>
std::array<std::uint32_t, 2> texel_of(const Panes& panes, std::uint32_t pane, const Map* map, const vec3& r,
                                      const vec3& l) {
  if (map == nullptr) return {0, 0};
  return texel_at_hit(make_textured_triangle(*panes.source, panes.triangle[pane], map->width, map->height), r, l);
}

RgbAttenuation attenuation_between(const Panes& panes, std::uint32_t own_pane, const vec3& r, const vec3& l) {
  RgbAttenuation sum{};
  for (std::uint32_t pane = 0; pane < panes.triangle.size(); ++pane) {
    const auto [a, b, c] = panes.mesh.corners(pane);
    if (pane == own_pane || !crosses(a, b, c, r, l)) continue;
    const SurfaceFilter& filter = panes.filter_of(pane);
    const RgbAttenuation at = filter.at(texel_of(panes, pane, filter.alpha_map(), r, l),
                                        texel_of(panes, pane, filter.transmittance_map(), r, l));
    for (std::size_t k = 0; k < 3; ++k) sum[k] = add_attenuation(sum[k], at[k]);
  }
  return sum;
}

}  // namespace

vec3 reference_transmittance(const Panes& panes, const ReceiverArray& receivers, std::size_t receiver,
                             const LightSamples& samples, std::span<const std::uint64_t> mask,
                             std::span<const vec3> weights) {
  const std::uint32_t own = receivers.triangle[receiver], set = receivers.set[receiver];
  const std::uint32_t own_pane = own == kNone ? kNone : panes.of_triangle[own];
  const std::span<const vec3> points = samples.set(set);
  LightSum light(samples.count,
                 weights.empty() ? weights : weights.subspan(std::size_t{set} * samples.count, samples.count));
  for (std::uint32_t s = 0; s < samples.count; ++s) {
    if (!mask.empty() && ((mask[s / 64] >> (s % 64)) & 1)) continue;
    light.add(attenuation_between(panes, own_pane, receivers.position[receiver], points[s]), s);
  }
  return light.value();
}

}  // namespace halfshade
