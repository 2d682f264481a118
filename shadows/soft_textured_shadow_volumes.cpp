#include "shadows/soft_textured_shadow_volumes.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "rasterizer/core/parallel.h"
#include "rasterizer/core/stopwatch.h"
#include "shadows/exact_engine.h"
#include "shadows/opacity_average.h"
#include "shadows/solver.h"
#include "shadows/volume_kernel.h"

namespace halfshade {
namespace {

constexpr std::size_t kBlocksPerRound = 16;

/// Everything that the kernel reads.
struct Volumes {
  LightBound bound;
  KernelSamples samples;
  ReceiverTiles tiles;
  std::map<std::pair<const AlphaMap*, std::uint32_t>, OpacityBits> opacity;  // by map and threshold
  std::vector<VolumeBlocker> blockers;
  VolumeLanes lanes;
  std::uint64_t open_volumes = 0;

  VolumeScene scene(bool use_textures = true) const { return {blockers, &lanes, &samples, &tiles, use_textures}; }
};

void add_blocker(const LatticeMesh& mesh, std::uint32_t triangle, Volumes& v) {
  VolumeBlocker& b = v.blockers.emplace_back();
  b.blocker = make_blocker(mesh, v.samples, triangle);
  if (!b.blocker.perforated) return;
  b.alpha = make_alpha_triangle(mesh, triangle);
  b.texels = make_corner_texels(b.alpha);
  const auto [at, is_new] = v.opacity.try_emplace({b.alpha.map, b.alpha.threshold});
  if (is_new) at->second = make_opacity_bits(*b.alpha.map, b.alpha.threshold);
  b.opacity = &at->second;
}

/// Volumes of all blockers, one per side of the triangle that some part of the light sees.
void extrude_volumes(const LightHull& hull, Volumes& v) {
  struct Extruded {
    std::array<SoftShadowVolume, 2> volume;
    std::array<bool, 2> exists;
  };
  constexpr std::size_t kRound = 4096;
  std::vector<Extruded> round(std::min(kRound, v.blockers.size()));
  for (std::size_t first = 0; first < v.blockers.size(); first += kRound) {
    const std::size_t count = std::min(kRound, v.blockers.size() - first);
    parallel_ranges(count, 64, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i != end; ++i) {
        for (std::size_t k = 0; k < 2; ++k) {
          round[i].exists[k] = make_soft_shadow_volume(hull, v.blockers[first + i].blocker.corner, k == 0 ? 1 : -1,
                                                       v.tiles.box, round[i].volume[k]);
        }
      }
    });
    for (std::size_t i = 0; i < count; ++i) {
      for (std::size_t k = 0; k < 2; ++k) {
        if (!round[i].exists[k]) continue;
        v.lanes.add(round[i].volume[k], static_cast<std::uint32_t>(first + i));
        v.open_volumes += !round[i].volume[k].closed;
      }
    }
  }
  v.lanes.pad();
}

void make_volumes(const LatticeMesh& mesh, std::span<const std::uint32_t> triangles, const ReceiverArray& receivers,
                  const Light& light, const LightSamples& samples, Volumes& v, ShadowStats& stats) {
  Stopwatch watch;
  v.tiles = make_receiver_tiles(receivers);
  stats.index_ms += watch.lap();
  v.bound = make_light_bound(light, samples);
  v.samples = make_kernel_samples(samples, v.bound);
  v.blockers.reserve(triangles.size());
  for (const std::uint32_t t : triangles) add_blocker(mesh, t, v);
  for (VolumeBlocker& b : v.blockers) b.blocker.alpha = &b.alpha;
  extrude_volumes(make_light_hull(v.bound, samples, v.samples), v);
  stats.cull_ms += watch.lap();
}

/// Opaque and perforated triangles.
struct Division {
  std::vector<std::uint32_t> opaque, perforated;
};

Division divide(const LatticeMesh& mesh) {
  Division d;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto [a, b, c] = mesh.corners(t);
    if (a == b || b == c || c == a) continue;  // blocks nothing, and its volume would be all of space
    (mesh.alpha_map(t) == kNone ? d.opaque : d.perforated).push_back(t);
  }
  return d;
}

/// Share of the work for progress.
ShadowConfig part_of(const ShadowConfig& config, double from, double share) {
  ShadowConfig part = config;
  if (config.progress) part.progress = [&config, from, share](double x) { return config.progress(from + share * x); };
  return part;
}

/// Opaque triangles alone, by the exact engine.
void solve_opaque(const LatticeMesh& mesh, const Division& division, const ReceiverArray& receivers, const Light& light,
                  const LightSamples& samples, const ShadowConfig& config, VisibilityMasks& masks, ShadowStats& stats) {
  if (division.opaque.empty()) {
    masks.reset(receivers.size(), samples.count);
    return;
  }
  KeptExact kept;
  if (division.perforated.empty()) {
    solve_exact(mesh, receivers, light, samples, config, kept, masks, stats);
    return;
  }
  LatticeMesh part;  // without a scene no triangle has a texture
  part.frame = mesh.frame;
  part.positions = mesh.positions;
  std::vector<std::uint32_t> place(mesh.triangles.size(), kNone);
  for (const std::uint32_t t : division.opaque) {
    place[t] = static_cast<std::uint32_t>(part.triangles.size());
    part.triangles.push_back(mesh.triangles[t]);
  }
  ReceiverArray same = receivers;
  for (std::uint32_t& own : same.triangle) own = own == kNone ? kNone : place[own];
  solve_exact(part, same, light, samples, config, kept, masks, stats);
}

/// What is blocked already, in the kernel's order of receivers and samples.
void load_masks(const VisibilityMasks& masks, const Volumes& v, KernelReceivers& kernel) {
  parallel_ranges(kernel.count, 1024, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) {
      const std::span<const std::uint64_t> from = masks.mask(v.tiles.order[i]);
      if (std::all_of(from.begin(), from.end(), [](std::uint64_t w) { return w == 0; })) continue;
      const std::uint32_t* order = v.samples.order.data() + std::size_t{kernel.set[i]} * v.samples.padded;
      std::uint64_t* to = kernel.mask(i);
      for (std::uint32_t s = 0; s < v.samples.count; ++s) {
        to[s / 64] |= ((from[order[s] / 64] >> (order[s] % 64)) & 1) << (s % 64);
      }
      if (std::equal(v.samples.valid.begin(), v.samples.valid.end(), to)) kernel.open[i] = 0;
    }
  });
}

/// body(block, scratch) for all blocks of tiles, in parallel; adds up what was counted.
template <class Body>
void for_each_block(const Volumes& v, const ShadowConfig& config, ShadowStats& stats, const Body& body) {
  std::vector<VolumeScratch> scratches(kBlocksPerRound);
  const std::size_t blocks = v.tiles.blocks.size();
  for (std::size_t first = 0; first < blocks; first += kBlocksPerRound) {
    report_progress(config, static_cast<double>(first) / static_cast<double>(blocks));
    parallel_tasks(std::min(kBlocksPerRound, blocks - first), [&](std::size_t i) { body(first + i, scratches[i]); });
  }
  KernelCounters total;
  std::uint64_t listed = 0, tested = 0;
  for (const VolumeScratch& s : scratches) {
    total.add(s.counters);
    listed += s.volumes_listed, tested += s.receivers_tested;
  }
  add_to_stats(total, stats);
  stats.details.emplace_back("stsv.blockers", static_cast<double>(v.blockers.size()));
  stats.details.emplace_back("stsv.volumes", static_cast<double>(v.lanes.size()));
  stats.details.emplace_back("stsv.volumes_without_back_cap", static_cast<double>(v.open_volumes));
  stats.details.emplace_back("stsv.volumes_at_tiles", static_cast<double>(listed));
  stats.details.emplace_back("stsv.receivers_tested", static_cast<double>(tested));
}

void note_bytes(const Volumes& v, const KernelReceivers& kernel, std::uint64_t sample_buffer, ShadowStats& stats) {
  constexpr std::size_t kBytesPerVolume = 22 * sizeof(float) + sizeof(std::int8_t) + sizeof(std::uint32_t);
  stats.bytes += sample_buffer + kernel.x.size() * 21 + v.tiles.order.size() * sizeof(std::uint32_t) +
                 (v.tiles.tiles.size() + v.tiles.blocks.size()) * sizeof(LatticeBox) +
                 v.blockers.size() * sizeof(VolumeBlocker) + v.lanes.size() * kBytesPerVolume;
  stats.details.emplace_back("stsv.light_sample_buffer_bytes", static_cast<double>(sample_buffer));
  stats.details.emplace_back("stsv.sample_pattern_bytes", static_cast<double>(v.samples.points.size() * sizeof(vec3)));
}

}  // namespace

void solve_soft_textured_shadow_volumes(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                                        const LightSamples& samples, const ShadowConfig& config, VisibilityMasks& masks,
                                        ShadowStats& stats) {
  if (!yields_masks(config)) throw Error(ErrorCode::kUsage, "stsv.filter: 'filtered' yields no masks; use nearest");
  Division division = divide(mesh);
  if (config.stsv.opaque == OpaqueBlockers::kVolumes) {
    division.perforated.insert(division.perforated.end(), division.opaque.begin(), division.opaque.end());
    std::sort(division.perforated.begin(), division.perforated.end());
    division.opaque.clear();
  }
  solve_opaque(mesh, division, receivers, light, samples, part_of(config, 0.0, 0.5), masks, stats);
  if (division.perforated.empty() || receivers.size() == 0) return;
  Volumes v;
  make_volumes(mesh, division.perforated, receivers, light, samples, v, stats);
  Stopwatch watch;
  KernelReceivers kernel = gather_receivers(receivers, v.tiles.order, masks.words_per_receiver);
  load_masks(masks, v, kernel);
  stats.index_ms += watch.lap();
  const VolumeScene scene = v.scene();
  for_each_block(v, part_of(config, 0.5, 0.5), stats, [&](std::size_t block, VolumeScratch& scratch) {
    solve_volume_block(scene, block, kernel, nullptr, scratch);
  });
  scatter_masks(kernel, v.samples, v.tiles.order, masks);
  note_bytes(v, kernel, kernel.masks.size() * sizeof(std::uint64_t), stats);
  stats.test_ms += watch.lap();
}

namespace {

/// Opaque triangles with the corners of an earlier one are left out (stability.md b10).
std::vector<std::uint32_t> different_triangles(const LatticeMesh& mesh) {
  using Key = std::array<std::array<float, 3>, 3>;
  std::vector<std::pair<Key, std::uint32_t>> keys;
  std::vector<std::uint32_t> kept;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    if (mesh.alpha_map(t) != kNone) {
      kept.push_back(t);
      continue;
    }
    Key key;
    const auto corners = mesh.corners(t);
    for (std::size_t i = 0; i < 3; ++i) key[i] = {corners[i].x + 0.0f, corners[i].y + 0.0f, corners[i].z + 0.0f};
    std::sort(key.begin(), key.end());
    keys.emplace_back(key, t);
  }
  std::sort(keys.begin(), keys.end());
  for (std::size_t i = 0; i < keys.size(); ++i) {
    if (i == 0 || keys[i].first != keys[i - 1].first) kept.push_back(keys[i].second);
  }
  std::sort(kept.begin(), kept.end());
  return kept;
}

class CountSink : public VolumeSink {
 public:
  CountSink(const Volumes& v, const KernelReceivers& kernel, DepthComplexity& counts)
      : v_(v), kernel_(kernel), counts_(counts) {}

  void add(const VolumeBlocker&, std::size_t place, const SampleProjection&, std::size_t first,
           std::uint64_t bits) override {
    const std::uint32_t* order = v_.samples.order.data() + std::size_t{kernel_.set[place]} * v_.samples.padded + first;
    std::uint32_t* counts = counts_.counts.data() + std::size_t{v_.tiles.order[place]} * counts_.sample_count;
    for (; bits != 0; bits &= bits - 1) ++counts[order[std::countr_zero(bits)]];
  }

 private:
  const Volumes& v_;
  const KernelReceivers& kernel_;
  DepthComplexity& counts_;
};

}  // namespace

float DepthComplexity::visibility(std::size_t receiver) const {
  const auto first = counts.begin() + static_cast<std::ptrdiff_t>(receiver * sample_count);
  return static_cast<float>(std::count(first, first + sample_count, 0u)) / static_cast<float>(sample_count);
}

void count_depth_complexity(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                            const LightSamples& samples, const ShadowConfig& config, DepthComplexity& counts,
                            ShadowStats& stats) {
  counts = {receivers.size(), samples.count, std::vector<std::uint32_t>(receivers.size() * samples.count, 0)};
  if (mesh.triangles.empty() || receivers.size() == 0) return;
  Volumes v;
  make_volumes(mesh, different_triangles(mesh), receivers, light, samples, v, stats);
  Stopwatch watch;
  KernelReceivers kernel = gather_receivers(receivers, v.tiles.order, (samples.count + 63) / 64);
  CountSink sink(v, kernel, counts);
  const VolumeScene scene = v.scene();
  for_each_block(v, config, stats, [&](std::size_t block, VolumeScratch& scratch) {
    solve_volume_block(scene, block, kernel, &sink, scratch);
  });
  note_bytes(v, kernel, counts.counts.size() * sizeof(std::uint32_t), stats);
  stats.test_ms += watch.lap();
}

namespace {

/// A sample stands for its cell of the light: the half axes of the light's bound, divided among the samples.
std::vector<dvec3> cell_axes(const LightBound& bound, std::uint32_t count) {
  double longest = 0.0;
  for (const dvec3& h : bound.half_axes) longest = std::max(longest, glm::length(h));
  std::vector<dvec3> axes;
  for (const dvec3& h : bound.half_axes) {
    if (glm::length(h) > 1e-3 * longest) axes.push_back(2.0 * h);
  }
  for (dvec3& a : axes) a *= std::pow(static_cast<double>(count), -1.0 / static_cast<double>(axes.size()));
  return axes;
}

/// What the perforated triangles let through to each sample of one block's receivers.
class FilterSink : public VolumeSink {
 public:
  FilterSink(const Volumes& v, const KernelReceivers& kernel,
             const std::map<const OpacityBits*, OpacityAverage>& averages, std::size_t first_place, std::size_t count)
      : v_(v),
        kernel_(kernel),
        averages_(averages),
        axes_(cell_axes(v.bound, v.samples.count)),
        first_place_(first_place),
        passed_(count * v.samples.padded, 1.0f) {}

  void add(const VolumeBlocker& b, std::size_t place, const SampleProjection& j, std::size_t first,
           std::uint64_t bits) override {
    const OpacityAverage& average = averages_.at(b.opacity);
    const std::size_t set = std::size_t{kernel_.set[place]} * v_.samples.padded + first;
    float* passed = passed_.data() + (place - first_place_) * v_.samples.padded + first;
    for (; bits != 0; bits &= bits - 1) {
      const auto i = static_cast<std::size_t>(std::countr_zero(bits));
      const dvec3 offset(v_.samples.x[set + i], v_.samples.y[set + i], v_.samples.z[set + i]);
      passed[i] *= 1.0f - static_cast<float>(opacity(b.texels, j, offset, average));
    }
  }

  float visibility(std::size_t place, const std::uint64_t* blocked) const {
    const float* passed = passed_.data() + (place - first_place_) * v_.samples.padded;
    double sum = 0.0;
    for (std::size_t s = 0; s < v_.samples.count; ++s) {
      if (((blocked[s / 64] >> (s % 64)) & 1) == 0) sum += double{passed[s]};
    }
    return static_cast<float>(sum / v_.samples.count);
  }

 private:
  /// The footprint's sides follow from the derivatives of the texture coordinates, quotients of linear functions of the
  /// sample's place on the light.
  double opacity(const CornerTexels& texels, const SampleProjection& j, const dvec3& offset,
                 const OpacityAverage& average) const {
    dvec3 u_slope(0.0), v_slope(0.0), sum_slope(0.0);
    double u = 0.0, v = 0.0, sum = 0.0;
    for (std::size_t k = 0; k < 3; ++k) {
      const double weight = glm::dot(j.normal[k], offset) + j.offset[k];
      const double texel_u = texels.u[(k + 2) % 3], texel_v = texels.v[(k + 2) % 3];
      u += texel_u * weight, v += texel_v * weight, sum += weight;
      u_slope += texel_u * j.normal[k], v_slope += texel_v * j.normal[k], sum_slope += j.normal[k];
    }
    if (!(sum > 0.0)) return 1.0;  // no room between edges for rounding: the triangle is a line seen from here
    u /= sum, v /= sum;
    double width = 0.0, height = 0.0;
    for (const dvec3& a : axes_) {
      width += std::fabs(glm::dot(u_slope - sum_slope * u, a)) / sum;
      height += std::fabs(glm::dot(v_slope - sum_slope * v, a)) / sum;
    }
    return average.average(u, v, width, height);
  }

  const Volumes& v_;
  const KernelReceivers& kernel_;
  const std::map<const OpacityBits*, OpacityAverage>& averages_;
  std::vector<dvec3> axes_;
  std::size_t first_place_;
  std::vector<float> passed_;  // [receiver of the block][padded], kernel order
};

}  // namespace

void solve_filtered_shadow_volumes(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                                   const LightSamples& samples, const ShadowConfig& config,
                                   std::vector<float>& visibility, ShadowStats& stats) {
  const Division division = divide(mesh);
  VisibilityMasks masks;
  solve_opaque(mesh, division, receivers, light, samples, part_of(config, 0.0, 0.5), masks, stats);
  visibility.resize(receivers.size());
  Volumes v;
  make_volumes(mesh, division.perforated, receivers, light, samples, v, stats);
  Stopwatch watch;
  std::map<const OpacityBits*, OpacityAverage> averages;
  for (const auto& [key, opacity] : v.opacity) averages.emplace(&opacity, OpacityAverage(opacity));
  KernelReceivers kernel = gather_receivers(receivers, v.tiles.order, masks.words_per_receiver);
  load_masks(masks, v, kernel);
  stats.index_ms += watch.lap();
  const VolumeScene scene = v.scene(false);
  for_each_block(v, part_of(config, 0.5, 0.5), stats, [&](std::size_t block, VolumeScratch& scratch) {
    const std::size_t begin = block * ReceiverTiles::kBlock,
                      end = std::min(kernel.count, begin + ReceiverTiles::kBlock);
    FilterSink sink(v, kernel, averages, begin, end - begin);
    solve_volume_block(scene, block, kernel, &sink, scratch);
    for (std::size_t i = begin; i != end; ++i) visibility[v.tiles.order[i]] = sink.visibility(i, kernel.mask(i));
  });
  note_bytes(v, kernel, kBlocksPerRound * ReceiverTiles::kBlock * v.samples.padded * sizeof(float), stats);
  stats.test_ms += watch.lap();
}

}  // namespace halfshade
