#include "shadows/transmittance.h"

#include <bit>

#include "rasterizer/core/parallel.h"
#include "rasterizer/core/stopwatch.h"
#include "shadows/light_view.h"
#include "shadows/shaft.h"
#include "shadows/solver.h"
#include "shadows/space_curve.h"
#include "shadows/transmittance_kernel.h"

namespace halfshade {
namespace {

constexpr std::size_t kMostTileWords = std::size_t{1} << 18;  // attenuations of one tile: 1 MiB
constexpr std::size_t kTilesPerTask = 8, kTasksPerRound = 16;

/// What all tiles share.
struct TransmittancePass {
  const Panes& panes;
  const ReceiverArray& receivers;
  const LightSamples& samples;
  const VisibilityMasks& masks;
  std::span<const vec3> weights;
  KernelSamples kernel;
  std::vector<std::uint32_t> position;  // [set][sample] -> place in the kernel's order
  BlockerTree tree;                     // over panes.mesh
  BlockerFit fit;
  Box light;  // around all samples

  TransmittancePass(const Panes& p, const ReceiverArray& r, const LightSamples& s, const VisibilityMasks& m,
                    std::span<const vec3> w)
      : panes(p), receivers(r), samples(s), masks(m), weights(w) {}
  std::span<const std::uint64_t> mask(std::uint32_t receiver) const {
    return masks.words.empty() ? std::span<const std::uint64_t>() : masks.mask(receiver);
  }
};

void prepare(const Light& light, TransmittancePass& pass) {
  const LightSamples& samples = pass.samples;
  pass.kernel = make_kernel_samples(samples, make_light_bound(light, samples));
  pass.position.resize(samples.points.size());
  for (std::size_t set = 0; set < samples.sets; ++set) {
    for (std::uint32_t i = 0; i < samples.count; ++i) {
      pass.position[set * samples.count + pass.kernel.order[set * pass.kernel.padded + i]] = i;
    }
  }
  for (const vec3& p : samples.points) pass.light.add(p);
  build_blocker_tree(pass.panes.mesh, pass.tree);
  fit_blocker_tree(pass.panes.mesh, pass.tree, pass.kernel, LightFrame(), pass.fit);
}

void make_room(const TransmittancePass& pass, std::size_t size, TransmittanceTile& tile) {
  KernelReceivers& r = tile.receivers;
  const std::size_t padded = size + KernelReceivers::kLanePadding;
  r.words = pass.kernel.padded / 64;
  r.x.resize(padded), r.y.resize(padded), r.z.resize(padded);
  r.own.resize(padded), r.open.resize(padded), r.set.resize(padded);
  r.masks.resize(size * r.words);
  tile.everywhere.resize(size), tile.touched.resize(size);
  tile.attenuation.resize(size * 3 * pass.kernel.padded);
}

/// The opaque scene's mask in the kernel's order of samples; false where nothing is left open.
bool open_mask(const TransmittancePass& pass, std::uint32_t receiver, std::uint64_t* words) {
  const std::span<const std::uint64_t> mask = pass.mask(receiver);
  const std::size_t first = std::size_t{pass.receivers.set[receiver]} * pass.samples.count;
  std::fill_n(words, pass.kernel.padded / 64, 0);
  std::uint32_t blocked = 0;
  for (std::uint32_t w = 0; w < mask.size(); ++w) {
    for (std::uint64_t rest = mask[w]; rest != 0; rest &= rest - 1, ++blocked) {
      const std::uint32_t at = pass.position[first + 64 * w + static_cast<std::uint32_t>(std::countr_zero(rest))];
      words[at / 64] |= std::uint64_t{1} << (at % 64);
    }
  }
  return blocked < pass.samples.count;
}

/// Puts the receivers into the tile; returns the box around those with open samples.
Box fill_tile(const TransmittancePass& pass, std::span<const std::uint32_t> members, TransmittanceTile& tile) {
  KernelReceivers& r = tile.receivers;
  r.count = members.size();
  Box box;
  for (std::size_t i = 0; i < members.size(); ++i) {
    const std::uint32_t member = members[i], own = pass.receivers.triangle[member];
    const vec3& p = pass.receivers.position[member];
    const bool open = open_mask(pass, member, r.mask(i));
    r.x[i] = p.x, r.y[i] = p.y, r.z[i] = p.z;
    r.own[i] = own == kNone ? kNone : pass.panes.of_triangle[own];
    r.open[i] = open ? ~0u : 0u;
    r.set[i] = pass.receivers.set[member];
    tile.everywhere[i] = {}, tile.touched[i] = 0;
    if (open) box.add(p);
  }
  return box;
}

/// Leaves of the tree that meet the hull of tile and light.
void find_leaves(const BlockerFit& fit, const Shaft& shaft, TransmittanceTile& tile) {
  tile.leaves.clear();
  tile.stack.assign(1, 0);
  while (!tile.stack.empty()) {
    const BlockerTree::Node& node = fit.nodes[tile.stack.back()];
    tile.stack.pop_back();
    for (std::uint32_t i = 0; i < node.count; ++i) {
      const Box box{{node.low[0][i], node.low[1][i], node.low[2][i]},
                    {node.high[0][i], node.high[1][i], node.high[2][i]}};
      if (!shaft.may_meet(box)) continue;
      const std::uint32_t child = node.child[i];
      child& BlockerTree::kLeafBit ? tile.leaves.push_back(child & ~BlockerTree::kLeafBit)
                                   : tile.stack.push_back(child);
    }
  }
}

vec3 resolve(const TransmittancePass& pass, std::uint32_t receiver, std::size_t i, TransmittanceTile& tile) {
  const std::uint32_t count = pass.samples.count;
  const std::size_t first = std::size_t{pass.receivers.set[receiver]} * count;
  const std::span<const std::uint64_t> mask = pass.mask(receiver);
  LightSum light(count, pass.weights.empty() ? pass.weights : pass.weights.subspan(first, count));
  RgbAttenuation attenuation = tile.everywhere[i];
  if (tile.touched[i] == 0 && pass.weights.empty()) {
    std::uint32_t blocked = 0;
    for (const std::uint64_t word : mask) blocked += static_cast<std::uint32_t>(std::popcount(word));
    light.add_alike(attenuation, count - blocked);
    return light.value();
  }
  for (std::uint32_t s = 0; s < count; ++s) {
    if (!mask.empty() && ((mask[s / 64] >> (s % 64)) & 1)) continue;
    for (std::size_t c = 0; c < 3 && tile.touched[i] != 0; ++c) {
      attenuation[c] =
          add_attenuation(tile.everywhere[i][c], tile.channel(i, c, pass.kernel)[pass.position[first + s]]);
    }
    light.add(attenuation, s);
  }
  return light.value();
}

void solve_tile(const TransmittancePass& pass, std::span<const std::uint32_t> members, TransmittanceTile& tile,
                std::vector<vec3>& reaching) {
  const Box box = fill_tile(pass, members, tile);
  if (!box.is_empty()) {
    find_leaves(pass.fit, Shaft(box, pass.light), tile);
    cross_panes(pass.panes, pass.tree, pass.fit, tile.leaves, pass.kernel, tile);
  }
  for (std::size_t i = 0; i < members.size(); ++i) {
    reaching[members[i]] = tile.receivers.open[i] != 0 ? resolve(pass, members[i], i, tile) : vec3(0.0f);
  }
}

void note(const Panes& panes, const std::vector<TransmittanceTile>& tiles, double milliseconds, ShadowStats& stats) {
  KernelCounters total;
  std::uint64_t crossings = 0, bytes = 0;
  for (const TransmittanceTile& tile : tiles) {
    total.add(tile.counters);
    crossings += tile.crossings;
    bytes += tile.attenuation.size() * sizeof(Attenuation) + tile.receivers.masks.size() * 8;
  }
  const auto detail = [&](const char* name, auto value) {
    stats.details.emplace_back(name, static_cast<double>(value));
  };
  detail("transmittance.triangles", panes.translucent);
  detail("transmittance.repeated_triangles", panes.translucent - panes.triangle.size());
  detail("transmittance.ms", milliseconds);
  detail("transmittance.pairs_tested", total.pairs_tested);
  detail("transmittance.sample_tests", total.sample_tests);
  detail("transmittance.exact_fallbacks", total.exact_fallbacks);
  detail("transmittance.crossings", crossings);
  detail("transmittance.tile_bytes", bytes);
}

}  // namespace

void LightSum::add(const RgbAttenuation& attenuation, std::uint32_t sample) {
  for (std::size_t c = 0; c < 3; ++c) {  // neighbours are often behind the same panes
    if (attenuation[c] != last_[c]) of_last_[c] = transmittance_of(last_[c] = attenuation[c]);
    sum_[c] += of_last_[c];
  }
  if (weights_.empty()) return;
  weighted_ += dvec3(weights_[sample]) * (dvec3(static_cast<double>(of_last_[0]), static_cast<double>(of_last_[1]),
                                                static_cast<double>(of_last_[2])) *
                                          0x1p-32);
}

void LightSum::add_alike(const RgbAttenuation& attenuation, std::uint32_t samples) {
  for (std::size_t c = 0; c < 3; ++c) sum_[c] += samples * transmittance_of(attenuation[c]);
}

vec3 LightSum::value() const {
  if (!weights_.empty()) return vec3(weighted_);
  const dvec3 sum(static_cast<double>(sum_[0]), static_cast<double>(sum_[1]), static_cast<double>(sum_[2]));
  return vec3(sum * 0x1p-32 / static_cast<double>(count_));
}

void solve_transmittance(const Panes& panes, const ReceiverArray& receivers, const Light& light,
                         const LightSamples& samples, const ShadowConfig& config, const VisibilityMasks& masks,
                         std::span<const vec3> weights, std::vector<vec3>& reaching, ShadowStats& stats,
                         std::size_t tile) {
  const FpEnvironment environment;
  Stopwatch watch;
  reaching.assign(receivers.size(), vec3(0.0f));
  TransmittancePass pass(panes, receivers, samples, masks, weights);
  prepare(light, pass);
  if (panes.empty()) pass.fit.nodes.emplace_back();  // a root without children
  const std::size_t size = std::clamp<std::size_t>(kMostTileWords / (3 * pass.kernel.padded), 1, tile);
  const std::vector<std::uint32_t> order =
      order_along<HilbertCurve>(receivers.position, [](std::uint32_t) { return true; });
  const std::size_t per_task = size * kTilesPerTask, tasks = (order.size() + per_task - 1) / per_task;
  std::vector<TransmittanceTile> tiles(std::min(tasks, kTasksPerRound));
  for (std::size_t first = 0; first < tasks; first += tiles.size()) {
    report_progress(config, static_cast<double>(first) / static_cast<double>(tasks));
    parallel_tasks(std::min(tiles.size(), tasks - first), [&](std::size_t t) {
      make_room(pass, size, tiles[t]);
      const std::size_t end = std::min(order.size(), (first + t + 1) * per_task);
      for (std::size_t begin = (first + t) * per_task; begin < end; begin += size) {
        solve_tile(pass, std::span(order).subspan(begin, std::min(size, end - begin)), tiles[t], reaching);
      }
    });
  }
  note(panes, tiles, watch.lap(), stats);
}

void solve_reaching_light(const Panes& panes, const ReceiverArray& receivers, const Light& light,
                          const LightSamples& samples, const ShadowConfig& config, const VisibilityMasks& masks,
                          std::span<const float> visibility, std::vector<vec3>& reaching, ShadowStats& stats) {
  std::vector<vec3> weights;
  if (!light.emission_image.empty()) weights = sample_emission(light.emission_image, samples);
  if (config.method == ShadowMethod::kOracle) {
    reaching.resize(receivers.size());
    parallel_ranges(receivers.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i != end; ++i) {
        reaching[i] = reference_transmittance(panes, receivers, i, samples, masks.mask(i), weights);
      }
    });
    return;
  }
  solve_transmittance(panes, receivers, light, samples, config, masks, weights, reaching, stats);
  if (traits_of(config.method).masks) return;
  for (std::size_t i = 0; i < receivers.size(); ++i) reaching[i] *= visibility[i];
  if (!panes.empty()) {
    stats.details.emplace_back("translucent_triangles_approximated", static_cast<double>(panes.translucent));
  }
}

}  // namespace halfshade
