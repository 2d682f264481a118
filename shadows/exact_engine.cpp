#include "shadows/exact_engine.h"

#include <algorithm>
#include <cmath>

#include "rasterizer/core/parallel.h"
#include "rasterizer/core/reuse.h"
#include "rasterizer/core/stopwatch.h"
#include "shadows/alias_free_shadow_map.h"
#include "shadows/light_view.h"
#include "shadows/solver.h"

namespace halfshade {
namespace {

constexpr std::size_t kCluster = 256;  // receivers that share a list of leaves
constexpr std::size_t kClustersPerTask = 2;

/// Receivers nearer to the light's plane than this are not projected onto it: they go to the alias-free shadow map.
constexpr double kGrazing = 1e-5;

/// Receivers in front of the light on its z > 0 side, along Hilbert's curve through their positions: the packets and
/// clusters that they form must be compact.
void order_receivers(const ReceiverArray& receivers, const LightFrame& frame, ExactWork& work) {
  order_along<HilbertCurve>(
      receivers.position, [&](std::uint32_t i) { return frame.to_frame(dvec3(receivers.position[i])).z > kGrazing; },
      work.curve, work.order);
}

/// One set into its bins: counted, then placed in order.
void fill_bins(const KernelSamples& samples, const LightFrame& frame, std::uint32_t set, SampleRectangles& r) {
  constexpr std::uint32_t kBins = SampleRectangles::kBins;
  const std::size_t first = std::size_t{set} * samples.padded, before = r.binned.size();
  std::array<std::uint32_t, kBins * kBins + 1> begin{};
  for (std::uint32_t i = 0; i < samples.count; ++i) {
    const dvec2 p(frame.to_frame(dvec3(samples.points[first + i])));
    const dvec2 place = (p - dvec2(r.bins_low)) * dvec2(r.bins_per_unit);
    const auto column = static_cast<std::uint32_t>(std::clamp(place.x, 0.0, kBins - 1.0));
    const auto row = static_cast<std::uint32_t>(std::clamp(place.y, 0.0, kBins - 1.0));
    r.occupied[set][row] |= 1u << column;
    r.bin_of_sample[first + i] = static_cast<std::uint16_t>(row * kBins + column);
    ++begin[row * kBins + column + 1];
  }
  for (std::size_t bin = 1; bin < begin.size(); ++bin) begin[bin] += begin[bin - 1];
  for (const std::uint32_t b : begin) r.bin_begin.push_back(static_cast<std::uint32_t>(before) + b);
  r.binned.resize(before + samples.count);
  for (std::uint32_t i = 0; i < samples.count; ++i) {
    r.binned[before + begin[r.bin_of_sample[first + i]]++] = static_cast<std::uint16_t>(i);
  }
}

/// Bins over the bounding rectangle of all sets.
void sort_into_bins(const KernelSamples& samples, const LightFrame& frame, SampleRectangles& r) {
  dvec2 low(HUGE_VAL), high(-HUGE_VAL);
  for (const vec3& p : samples.points) {
    const dvec2 q(frame.to_frame(dvec3(p)));
    low = glm::min(low, q), high = glm::max(high, q);
  }
  r.bins_low = vec2(low);
  r.bins_per_unit = vec2(double{SampleRectangles::kBins} / glm::max(high - low, dvec2(1e-12)));
  r.occupied.assign(samples.sets, {});
  r.bin_of_sample.assign(samples.points.size(), 0);
  for (std::uint32_t set = 0; set < samples.sets; ++set) fill_bins(samples, frame, set, r);
}

SampleRectangles make_rectangles(const KernelSamples& samples, const LightFrame& frame, SampleRectangles reuse) {
  SampleRectangles r;
  r.low_u = emptied(reuse.low_u), r.low_v = emptied(reuse.low_v);
  r.high_u = emptied(reuse.high_u), r.high_v = emptied(reuse.high_v);
  r.occupied = emptied(reuse.occupied), r.bin_of_sample = emptied(reuse.bin_of_sample);
  r.bin_begin = emptied(reuse.bin_begin), r.binned = emptied(reuse.binned);
  const std::size_t count = samples.group_x.size(), groups = samples.padded / KernelSamples::kGroup;
  r.low_u.assign(count, 0.0f), r.low_v.assign(count, 0.0f), r.high_u.assign(count, 0.0f), r.high_v.assign(count, 0.0f);
  for (std::uint32_t set = 0; set < samples.sets; ++set) {
    for (std::size_t g = 0; g < groups; ++g) {
      dvec3 low(HUGE_VAL), high(-HUGE_VAL);
      for (const vec3& p : samples.set_points(set).subspan(g * KernelSamples::kGroup, KernelSamples::kGroup)) {
        const dvec3 q = frame.to_frame(dvec3(p));
        low = glm::min(low, q), high = glm::max(high, q);
      }
      const std::size_t at = std::size_t{set} * samples.group_stride + g;
      r.low_u[at] = static_cast<float>(low.x - 1e-7), r.high_u[at] = static_cast<float>(high.x + 1e-7);
      r.low_v[at] = static_cast<float>(low.y - 1e-7), r.high_v[at] = static_cast<float>(high.y + 1e-7);
      r.whole_low = glm::min(r.whole_low, vec2(r.low_u[at], r.low_v[at]));
      r.whole_high = glm::max(r.whole_high, vec2(r.high_u[at], r.high_v[at]));
      r.thickness = std::max({r.thickness, static_cast<float>(-low.z), static_cast<float>(high.z)});
    }
  }
  r.thickness += 1e-7f;
  sort_into_bins(samples, frame, r);
  return r;
}

void add_counters(const ScratchPool& scratches, ShadowStats& stats) {
  KernelCounters total;
  for (const auto& s : scratches.all()) {
    total.add(s->counters);
    stats.leaves_listed += s->leaves_listed;
    stats.leaves_tested += s->leaves_tested;
    stats.clusters_lit += s->clusters_lit;
  }
  add_to_stats(total, stats);
}

/// The tree as this side sees it, unless it is so already.
void fit_side(const ExactBlockers& blockers, const KernelSamples& samples, const LightFrame& frame, ExactSide& side) {
  if (side.fitted && side.usable == samples.closed_usable) return;
  side.fitted = false;
  fit_blocker_tree(blockers.mesh, *blockers.tree, samples, frame, side.fit);
  side.usable = samples.closed_usable;
  side.fitted = true;
}

/// A scratch for as long as this lives.
class ScratchLoan {
 public:
  explicit ScratchLoan(ScratchPool& pool) : pool_(pool), scratch_(pool.take()) {}
  ~ScratchLoan() { pool_.give(scratch_); }
  ScratchLoan(const ScratchLoan&) = delete;
  ScratchLoan& operator=(const ScratchLoan&) = delete;
  ExactScratch& operator*() const { return scratch_; }

 private:
  ScratchPool& pool_;
  ExactScratch& scratch_;
};

/// All receivers on one side of the light.
void solve_side(const ExactBlockers& blockers, const ReceiverArray& receivers, const LightFrame& frame,
                const ShadowConfig& config, const ExactLight& kept, ExactSide& side, ExactWork& work,
                VisibilityMasks& masks, ShadowStats& stats) {
  Stopwatch watch;
  order_receivers(receivers, frame, work);
  const std::vector<std::uint32_t>& order = work.order;
  if (order.empty()) return;
  KernelReceivers& kernel = work.receivers;
  const KernelSamples& samples = kept.samples;
  const SampleRows& rows = kept.rows;
  if (rows.empty()) {
    gather_receivers(receivers, order, masks.words_per_receiver, kernel);
  } else {  // bits are in the order of the samples: no masks but the caller's
    gather_receivers(receivers, order, 0, kernel);
    kernel.words = masks.words_per_receiver;
    kernel.mask_at.resize(order.size());
    for (std::size_t i = 0; i < order.size(); ++i) kernel.mask_at[i] = masks.words.data() + order[i] * kernel.words;
  }
  stats.index_ms += watch.lap();
  fit_side(blockers, samples, frame, side);
  stats.cull_ms += watch.lap();
  const ExactScene scene{blockers.tree, &side.fit, &samples, &kept.rectangles, &rows, frame};
  const auto solve = rows.empty() ? solve_cluster : solve_packets;
  constexpr std::size_t kPerTask = kCluster * kClustersPerTask, kTasksPerRound = 128;
  const std::size_t tasks = (order.size() + kPerTask - 1) / kPerTask;
  const std::size_t nodes = blockers.tree->nodes.size();
  work.scratches.start(concurrency(), nodes, rows.empty() ? blockers.tree->leaves.size() : nodes);
  for (std::size_t first = 0; first < tasks; first += kTasksPerRound) {
    report_progress(config, static_cast<double>(first) / static_cast<double>(tasks));
    parallel_tasks(std::min(kTasksPerRound, tasks - first), [&](std::size_t t) {
      const ScratchLoan scratch(work.scratches);
      const std::size_t task_end = std::min(order.size(), (first + t + 1) * kPerTask);
      for (std::size_t begin = (first + t) * kPerTask; begin < task_end; begin += kCluster) {
        check_run();
        solve(scene, begin, std::min(task_end, begin + kCluster), kernel, *scratch);
      }
    });
  }
  if (rows.empty()) scatter_masks(kernel, samples, order, masks);
  add_counters(work.scratches, stats);
  stats.bytes = std::max<std::uint64_t>(
      stats.bytes, blockers.tree->bytes() + side.fit.bytes() + kernel.x.size() * 21 + kernel.masks.size() * 8);
  stats.test_ms += watch.lap();
}

void solve_grazing(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                   const LightSamples& samples, const LightFrame& frame, const ShadowConfig& config,
                   VisibilityMasks& masks, ShadowStats& stats) {
  ReceiverArray grazing;
  std::vector<std::uint32_t> order;
  for (std::uint32_t i = 0; i < receivers.size(); ++i) {
    if (!(std::fabs(frame.to_frame(dvec3(receivers.position[i])).z) <= kGrazing)) continue;
    grazing.push_back(receivers.position[i], receivers.normal[i], receivers.triangle[i], receivers.sample[i],
                      receivers.set[i]);
    order.push_back(i);
  }
  if (order.empty()) return;
  VisibilityMasks solved;
  solve_alias_free_shadow_map(mesh, grazing, light, samples, config, solved, stats);
  for (std::size_t i = 0; i < order.size(); ++i) {
    const std::span<const std::uint64_t> mask = solved.mask(i);
    std::copy(mask.begin(), mask.end(), masks.words.begin() + order[i] * masks.words_per_receiver);
  }
}

}  // namespace

void ScratchPool::start(std::size_t threads, std::size_t nodes, std::size_t listed) {
  while (scratches_.size() < threads) scratches_.push_back(std::make_unique<ExactScratch>());
  const std::size_t leaves = listed + KernelReceivers::kLanePadding;
  std::size_t edges = 0, facing = 0, turning = 0;
  for (const auto& s : scratches_) {
    facing = std::max(facing, s->facing.capacity());
    turning = std::max(turning, s->turning.capacity());
    edges = std::max(edges, s->net_edges.vertex[0].size());
  }
  free_.clear();
  for (const auto& s : scratches_) {
    s->stack.reserve(nodes), s->leaf.reserve(leaves), s->keys.reserve(leaves);
    s->groups.reserve(nodes), s->own_places.reserve(kCluster), s->net_edges.reserve(edges);
    s->facing.reserve(facing), s->turning.reserve(turning);
    s->old_leaf.reserve(leaves), s->old_bound.reserve(leaves);
    for (int k = 0; k < 3; ++k) s->low[k].reserve(leaves), s->high[k].reserve(leaves);
    s->lines.placed = PictureLines::kNothing;
    s->counters = {};
    s->leaves_listed = s->leaves_tested = s->clusters_lit = 0;
    free_.push_back(s.get());
  }
}

ExactScratch& ScratchPool::take() {
  const std::lock_guard lock(mutex_);
  if (free_.empty()) {  // more threads than we were told
    scratches_.push_back(std::make_unique<ExactScratch>());
    free_.reserve(scratches_.size());
    return *scratches_.back();
  }
  ExactScratch& scratch = *free_.back();
  free_.pop_back();
  return scratch;
}

void ScratchPool::give(ExactScratch& scratch) {
  const std::lock_guard lock(mutex_);
  free_.push_back(&scratch);
}

void ExactWork::reserve(std::size_t count, std::size_t words) {
  const std::size_t padded = count + KernelReceivers::kLanePadding;
  curve.reserve(count);
  order.reserve(count);
  receivers.x.reserve(padded), receivers.y.reserve(padded), receivers.z.reserve(padded);
  receivers.own.reserve(padded), receivers.open.reserve(padded), receivers.set.reserve(padded);
  receivers.masks.reserve(count * words), receivers.mask_at.reserve(count);
}

void prepare_exact_light(const Light& light, const LightSamples& samples, ExactLight& kept) {
  kept.unfit();
  kept.bound = make_light_bound(light, samples, std::move(kept.bound));
  prepare_exact_samples(samples, kept);
}

void prepare_exact_samples(const LightSamples& samples, ExactLight& kept) {
  const auto samples_in = [&](SampleOrder order) {
    kept.samples = make_kernel_samples(samples, kept.bound, order, std::move(kept.samples));
  };
  kept.front = {dvec3(kept.bound.center), samples.axis_u, samples.axis_v, samples.axis_n};
  samples_in(SampleOrder::kAsGiven);
  kept.rows = find_sample_rows(samples, kept.samples, kept.front, std::move(kept.rows));
  if (kept.rows.empty()) samples_in(SampleOrder::kNeighboursTogether);
  kept.rectangles = make_rectangles(kept.samples, kept.front, std::move(kept.rectangles));
}

void solve_exact(const ExactBlockers& blockers, const ReceiverArray& receivers, const Light& light,
                 const LightSamples& samples, const ShadowConfig& config, ExactLight& kept, ExactWork& work,
                 VisibilityMasks& masks, ShadowStats& stats) {
  masks.reset(receivers.size(), samples.count);
  if (blockers.mesh.triangles.empty()) return;
  if (blockers.closed != nullptr) {
    apply_certificates(blockers.mesh, receivers, *blockers.closed, kept.samples, stats);
  } else {
    kept.samples.closed = nullptr;
    kept.samples.closed_usable.clear();
  }
  solve_side(blockers, receivers, kept.front, config, kept, kept.sides[0], work, masks, stats);
  solve_grazing(blockers.mesh, receivers, light, samples, kept.front, config, masks, stats);
  if (samples.one_sided) return;
  const LightFrame back{kept.front.origin, kept.front.u, kept.front.v, -kept.front.n};
  solve_side(blockers, receivers, back, config, kept, kept.sides[1], work, masks, stats);
}

void solve_exact(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                 const LightSamples& samples, const ShadowConfig& config, VisibilityMasks& masks, ShadowStats& stats) {
  if (!samples.flat) {
    solve_alias_free_shadow_map(mesh, receivers, light, samples, config, masks, stats);
    return;
  }
  Stopwatch watch;
  ExactLight kept;
  ExactWork work;
  ClosedComponents closed;
  prepare_exact_light(light, samples, kept);
  if (config.back_face_casters) closed = find_closed_components(mesh);
  BlockerTree tree;
  build_blocker_tree(mesh, tree);
  stats.build_ms += watch.lap();
  const ExactBlockers blockers{mesh, config.back_face_casters ? &closed : nullptr, &tree};
  solve_exact(blockers, receivers, light, samples, config, kept, work, masks, stats);
}

}  // namespace halfshade
