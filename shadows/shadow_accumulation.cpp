#include "shadows/shadow_accumulation.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "rasterizer/core/stopwatch.h"
#include "shadows/light_maps.h"

namespace halfshade {
namespace {

constexpr double kPi = 3.14159265358979323846;

/// One pass over the K x K lookups of a kernel. Places are relative to the receiver's own and in units of the light's
/// radius on the map plane, so that the light is the unit disk.
struct Kernel {
  const MapReceiver& r;
  double reach_px;      // that unit in lexels
  double plane_term;    // 1/n - 1/w
  std::uint32_t count;  // K
  double half_side;     // lookups fill the square of this half side

  /// visit(place, size) for every caster that hides something, of every layer.
  template <class Visit>
  void for_each_caster(const Visit& visit) const {
    for (std::uint32_t j = 0; j < count; ++j) {
      for (std::uint32_t i = 0; i < count; ++i) {
        const dvec2 place = half_side * (dvec2(2.0 * i + 1.0, 2.0 * j + 1.0) / double(count) - 1.0);
        const auto column = static_cast<int>(std::floor(r.x_px + reach_px * place.x));
        const auto row = static_cast<int>(std::floor(r.y_px + reach_px * place.y));
        for (std::size_t layer = 0; layer < r.map->layers.size(); ++layer) {
          const double inverse_w = r.inverse_w(column, row, layer);
          if (!(inverse_w * r.nearest_w > 1.0)) break;  // this layer and all after it lie beyond the receiver
          if (r.hidden_by(column, row, layer)) visit(place, plane_term / (inverse_w - 1.0 / r.w));
        }
      }
    }
  }

  /// Half side of the square that holds all casters able to hide something, as far as this kernel sees: a caster that
  /// is seen `size` times as large hides parts of the light only from within 1 / size.
  double needed_half_side() const {
    double smallest = HUGE_VAL;
    for_each_caster([&](const dvec2&, double size) { smallest = std::min(smallest, size); });
    return std::min(half_side, 1.0 / smallest);
  }

  /// Equations 2 and 3: areas of the casters whose centres are seen before the light, over the light's. The paper's
  /// last line is off by units (stability.md E4); a lookup stands for (2 half_side / K)^2 of the unit disk's pi.
  double sum() const {
    double s = 0.0;
    for_each_caster([&](const dvec2& place, double size) {
      if (glm::dot(place, place) * size * size < 1.0) s += size * size;
    });
    return s * 4.0 * half_side * half_side / (kPi * count * count);
  }

  /// Equation 1: K x K bits over the square around the light; each caster sets those that its square holds.
  double share_of_bits() const {
    std::array<std::uint64_t, 64> rows{};
    for_each_caster([&](const dvec2& place, double size) {
      const double reach = size * half_side / count * (1.0 + 1e-9);  // closed: neighbours leave no gap
      const std::uint64_t columns = bits_between(place.x * size - reach, place.x * size + reach);
      const std::uint64_t touched = columns == 0 ? 0 : bits_between(place.y * size - reach, place.y * size + reach);
      for (std::uint64_t left = touched; left != 0; left &= left - 1) rows[std::countr_zero(left)] |= columns;
    });
    int hidden = 0, total = 0;
    for (std::uint32_t j = 0; j < count; ++j) {
      const double y = bit_center(j), half_width = std::sqrt(std::max(0.0, 1.0 - y * y));
      const std::uint64_t disk = bits_between(-half_width, half_width);
      hidden += std::popcount(rows[j] & disk);
      total += std::popcount(disk);
    }
    return static_cast<double>(hidden) / total;
  }

  double bit_center(std::uint32_t i) const { return (2.0 * i + 1.0) / count - 1.0; }

  /// Bits whose centres lie in [low, high].
  std::uint64_t bits_between(double low, double high) const {
    const auto index = [this](double x) { return (x + 1.0) * 0.5 * count - 0.5; };
    const double first = std::max(0.0, std::ceil(index(low)));
    const double last = std::min(count - 1.0, std::floor(index(high)));
    if (first > last) return 0;
    const auto width = static_cast<std::uint32_t>(last - first) + 1;
    return (width == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << width) - 1) << static_cast<std::uint32_t>(first);
  }
};

/// A light without extent: what its only direction meets.
double point_factor(const MapReceiver& r) { return r.hidden_at_own_lexel() ? 1.0 : 0.0; }

void note_sums(std::span<const float> sums, ShadowStats& stats) {
  std::uint64_t clamped = 0;
  float largest = 0.0f;
  for (const float s : sums) clamped += s > 1.0f, largest = std::max(largest, s);
  stats.details.emplace_back("shadow-accumulation.clamped", static_cast<double>(clamped));
  stats.details.emplace_back("shadow-accumulation.largest_sum", double{largest});
}

std::uint64_t most_layers(const LightMaps& maps) {
  std::size_t most = 0;
  for (const DepthMap& map : maps.faces) most = std::max(most, map.empty() ? 0 : map.layers.size());
  return most;
}

}  // namespace

double shadowing_factor(const MapReceiver& receiver, double radius, double plane, const ShadowMapOptions& options) {
  if (radius == 0.0) return point_factor(receiver);
  const double plane_term = 1.0 / plane - 1.0 / receiver.w;
  if (!(plane_term > 0.0)) return 0.0;
  const double reach_px = radius * plane_term * receiver.map->camera.focal_px;
  Kernel kernel{receiver, reach_px, plane_term, options.kernel, 1.0};
  if (options.refine) kernel.half_side = kernel.needed_half_side();
  return options.form == AccumulationForm::kSum ? kernel.sum() : kernel.share_of_bits();
}

void solve_shadow_accumulation(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                               const LightSamples& samples, const ShadowConfig& config, std::vector<float>& visibility,
                               ShadowStats& stats) {
  const ShadowMapOptions& options = config.shadow_map;
  check_shadow_map_options(options);
  Stopwatch watch;
  const double radius = equivalent_radius(light) * mesh.frame.scale;
  const SearchMaps search =
      make_search_maps(mesh, receivers, samples, radius, double{options.plane} * radius, options.layers, options);
  note_maps(search.maps, stats);
  stats.details.emplace_back("shadow-accumulation.layers", static_cast<double>(most_layers(search.maps)));
  stats.details.emplace_back("shadow-accumulation.lexels_before_plane", static_cast<double>(search.before_plane));
  stats.index_ms += watch.lap();
  std::vector<float> sums(receivers.size(), 0.0f);
  for_each_receiver(receivers, config, [&](std::size_t i) {
    const std::optional<MapReceiver> place = place_in_maps(search.maps, receivers, i, options);
    if (place) sums[i] = static_cast<float>(shadowing_factor(*place, radius, search.plane, options));
  });
  note_sums(sums, stats);
  visibility.resize(receivers.size());
  for (std::size_t i = 0; i < sums.size(); ++i) visibility[i] = 1.0f - std::min(sums[i], 1.0f);
  stats.test_ms += watch.lap();
}

std::string assumptions_of_shadow_accumulation(const ShadowConfig& config, const Light& light) {
  const ShadowMapOptions& o = config.shadow_map;
  const std::string casters = o.layers == 1 ? "only what the light's centre sees casts shadows"
                                            : "up to " + std::to_string(o.layers) + " layers cast shadows";
  const std::string overlap =
      o.form == AccumulationForm::kSum ? "casters do not overlap as seen from the receiver" : "overlaps count once";
  return assumptions_of_equivalent_light(light) + "; " + casters + "; " + overlap + "; " + std::to_string(o.kernel) +
         "x" + std::to_string(o.kernel) + " lookups; " + assumptions_of_lookups(o);
}

}  // namespace halfshade
