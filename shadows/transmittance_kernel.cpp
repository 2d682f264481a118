#include "shadows/transmittance_kernel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "shadows/transmittance_kernel.cpp"
#include <hwy/foreach_target.h>

#include "shadows/crossing.h"
#include "shadows/edge_planes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace halfshade {
namespace HWY_NAMESPACE {

/// Open samples of one receiver whose segments cross the blocker, as mask words in `crossed`; false if there are none.
HWY_INLINE bool FindCrossings(const Blocker& blocker, const KernelSamples& samples, const ScaledPlanes& planes,
                              std::size_t receiver, KernelReceivers& receivers, KernelCounters& counters,
                              std::uint64_t* crossed) {
  const vec3 r(receivers.x[receiver], receivers.y[receiver], receivers.z[receiver]);
  std::fill_n(crossed, receivers.words, 0);
  bool any = false;
  ForEachPossibleGroup(samples, planes, receiver, receivers, receivers.mask(receiver), nullptr, counters,
                       [&](std::size_t word, std::size_t shift, std::size_t first, std::uint64_t inside,
                           std::uint64_t doubtful) HWY_ATTR {
                         for (; doubtful != 0; doubtful &= doubtful - 1) {
                           const auto bit = static_cast<std::size_t>(std::countr_zero(doubtful));
                           const auto& [a, b, c] = blocker.corner;
                           ++counters.exact_fallbacks;
                           if (crosses(a, b, c, r, samples.points[first + bit])) inside |= std::uint64_t{1} << bit;
                         }
                         crossed[word] |= inside << shift;
                         any = any || inside != 0;
                       });
  return any;
}

void CrossPane(const Panes& panes, const Blocker& blocker, const KernelSamples& samples, TransmittanceTile& tile) {
  const std::size_t lanes = hn::Lanes(Tag());
  KernelReceivers& receivers = tile.receivers;
  EdgePlanes planes;
  std::array<std::uint64_t, 64> crossed;  // words of 4096 samples
  tile.counters.pairs_tested += receivers.count;
  for (std::size_t i = 0; i < receivers.count; i += lanes) {
    const BatchResult batch =
        TestBatch(blocker, samples, receivers, i, std::min<std::size_t>(lanes, receivers.count - i), planes);
    for (std::uint64_t rest = batch.candidates; rest != 0; rest &= rest - 1) {
      const auto lane = static_cast<std::size_t>(std::countr_zero(rest));
      TestCandidate(
          blocker, samples, batch, planes, lane, i + lane, receivers, tile.counters, [&](const ScaledPlanes& p) {
            if (!FindCrossings(blocker, samples, p, i + lane, receivers, tile.counters, crossed.data())) {
              return false;
            }
            filter_samples(panes, blocker.triangle, samples, i + lane, std::span(crossed).first(receivers.words), tile);
            return true;
          });
    }
  }
}

void CrossPanes(const Panes& panes, const BlockerTree& tree, const BlockerFit& fit,
                std::span<const std::uint32_t> leaves, const KernelSamples& samples, TransmittanceTile& tile) {
  for (const std::uint32_t l : leaves) {
    for (std::uint32_t i = 0; i < tree.leaves[l].count; ++i) {
      Blocker pane = blocker_at(tree, fit, l, i, samples);
      pane.perforated = true;  // not the shortcut that marks a receiver as hidden: each of its samples is to be settled
      CrossPane(panes, pane, samples, tile);
    }
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace halfshade
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace halfshade {
namespace {

/// Looks up what a textured pane does to a segment from one receiver.
class FilterLookup {
 public:
  FilterLookup(const Panes& panes, std::uint32_t pane, const vec3& receiver)
      : filter_(panes.filter_of(pane)),
        alpha_(place(panes, pane, filter_.alpha_map())),
        color_(place(panes, pane, filter_.transmittance_map())),
        alpha_texel_(alpha_, receiver),
        color_texel_(color_, receiver) {}
  FilterLookup(const FilterLookup&) = delete;
  FilterLookup& operator=(const FilterLookup&) = delete;

  RgbAttenuation at(const vec3& l, std::uint64_t& exact_fallbacks) const {
    std::array<std::uint32_t, 2> alpha{}, color{};
    if (filter_.alpha_map() != nullptr) alpha = alpha_texel_.texel(l, exact_fallbacks);
    if (filter_.transmittance_map() != nullptr) color = color_texel_.texel(l, exact_fallbacks);
    return filter_.at(alpha, color);
  }

 private:
  template <class Map>
  static TexturedTriangle place(const Panes& panes, std::uint32_t pane, const Map* map) {
    return make_textured_triangle(*panes.source, panes.triangle[pane], map != nullptr ? map->width : 1,
                                  map != nullptr ? map->height : 1);
  }

  const SurfaceFilter& filter_;
  TexturedTriangle alpha_, color_;
  TexelLookup alpha_texel_, color_texel_;
};

/// Makes the receiver's attenuation per sample count.
void touch(const KernelSamples& samples, std::size_t receiver, TransmittanceTile& tile) {
  if (tile.touched[receiver] != 0) return;
  tile.touched[receiver] = 1;
  std::fill_n(tile.channel(receiver, 0, samples), 3 * std::size_t{samples.padded}, 0);
}

template <class Visit>
void for_each_bit(std::span<const std::uint64_t> words, const Visit& visit) {
  for (std::size_t w = 0; w < words.size(); ++w) {
    for (std::uint64_t rest = words[w]; rest != 0; rest &= rest - 1) {
      visit(64 * w + static_cast<std::size_t>(std::countr_zero(rest)));
    }
  }
}

void filter_uniformly(const RgbAttenuation& filter, const KernelSamples& samples, std::size_t receiver,
                      std::span<const std::uint64_t> crossed, TransmittanceTile& tile) {
  const std::uint64_t* mask = tile.receivers.mask(receiver);
  bool all = true;
  for (std::size_t w = 0; w < crossed.size(); ++w) all = all && crossed[w] == (samples.valid[w] & ~mask[w]);
  if (!all) touch(samples, receiver, tile);
  for (std::size_t c = 0; c < 3; ++c) {
    if (filter[c] == 0) continue;
    if (all) {
      Attenuation& common = tile.everywhere[receiver][c];
      common = add_attenuation(common, filter[c]);
      continue;
    }
    Attenuation* of_sample = tile.channel(receiver, c, samples);
    for_each_bit(crossed, [&](std::size_t i) { of_sample[i] = add_attenuation(of_sample[i], filter[c]); });
  }
}

}  // namespace

HWY_EXPORT(CrossPanes);

void cross_panes(const Panes& panes, const BlockerTree& tree, const BlockerFit& fit,
                 std::span<const std::uint32_t> leaves, const KernelSamples& samples, TransmittanceTile& tile) {
  HWY_DYNAMIC_DISPATCH(CrossPanes)(panes, tree, fit, leaves, samples, tile);
}

void filter_samples(const Panes& panes, std::uint32_t pane, const KernelSamples& samples, std::size_t receiver,
                    std::span<const std::uint64_t> crossed, TransmittanceTile& tile) {
  for (const std::uint64_t word : crossed) tile.crossings += static_cast<std::uint64_t>(std::popcount(word));
  const SurfaceFilter& filter = panes.filter_of(pane);
  if (filter.is_uniform()) return filter_uniformly(filter.uniform(), samples, receiver, crossed, tile);
  const KernelReceivers& r = tile.receivers;
  const FilterLookup lookup(panes, pane, vec3(r.x[receiver], r.y[receiver], r.z[receiver]));
  touch(samples, receiver, tile);
  const std::span<const vec3> points = samples.set_points(r.set[receiver]);
  for_each_bit(crossed, [&](std::size_t i) {
    const RgbAttenuation at = lookup.at(points[i], tile.counters.exact_fallbacks);
    for (std::size_t c = 0; c < 3; ++c) {
      Attenuation& of_sample = tile.channel(receiver, c, samples)[i];
      of_sample = add_attenuation(of_sample, at[c]);
    }
  });
}

}  // namespace halfshade
#endif
