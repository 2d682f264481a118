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

/// Receivers of a task, at most: two clusters.
constexpr std::size_t kTaskReceivers = 2 * kClusterReceivers;

/// Few receivers are shared out as well: each of them may take as long as a packet elsewhere.
std::size_t receivers_per_task(std::size_t count) {
  constexpr std::size_t kLeast = 16, kTasksPerThread = 8;
  return std::clamp(count / (kTasksPerThread * concurrency()) / kLeast * kLeast, kLeast, kTaskReceivers);
}

/// Receivers nearer to the light's plane than this are not projected onto it: they go to the alias-free shadow map.
constexpr double kGrazing = 1e-5;

/// As are those that lie no farther above a light without plane than this share of its height.
constexpr double kNear = 0.1;

constexpr std::uint8_t kNoSide = 0xff, kUnlit = 0xfe;

/// The side of the light that a receiver is on; kUnlit behind a light that shines to one side only.
std::uint8_t side_of(const ExactLight& light, const vec3& position) {
  double best = -HUGE_VAL, least = kGrazing;
  std::uint8_t side = kNoSide;
  for (std::size_t k = 0; k < light.count; ++k) {
    const double z = light.sides[k].frame.to_frame(dvec3(position)).z;
    if (z <= best) continue;
    best = z, side = static_cast<std::uint8_t>(k);
    if (!light.bound.flat) least = std::max(kGrazing, (1.0 + kNear) * double{light.sides[k].cloud.high.z});
  }
  if (best > least) return side;
  return light.count == 1 && best < -kGrazing ? kUnlit : kNoSide;
}

/// Receivers of a side along Hilbert's curve through their positions: the packets and clusters that they form must be
/// compact.
void order_receivers(const ReceiverArray& receivers, std::uint8_t side, ExactWork& work) {
  order_along<HilbertCurve>(
      receivers.position, [&](std::uint32_t i) { return work.side[i] == side; }, work.curve, work.order);
}

void add_counters(const ScratchPool& scratches, ShadowStats& stats) {
  KernelCounters total;
  for (const auto& s : scratches.all()) {
    total.add(s->counters);
    stats.leaves_listed += s->leaves_listed;
    stats.leaves_tested += s->leaves_tested;
    stats.clusters_lit += s->clusters_lit, stats.clusters_by_sample += s->clusters_by_sample;
  }
  add_to_stats(total, stats);
}

/// The tree as this side sees it, unless it is so already.
void fit_side(const ExactBlockers& blockers, const KernelSamples& samples, ExactSide& side) {
  if (side.fitted && side.usable == samples.closed_usable) return;
  side.fitted = false;
  fit_blocker_tree(blockers.mesh, *blockers.tree, samples, side.frame, side.fit);
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
void solve_side(const ExactBlockers& blockers, const ReceiverArray& receivers, const ShadowConfig& config,
                ExactLight& kept, std::uint8_t number, ExactWork& work, VisibilityMasks& masks, ShadowStats& stats) {
  Stopwatch watch;
  ExactSide& side = kept.sides[number];
  order_receivers(receivers, number, work);
  const std::vector<std::uint32_t>& order = work.order;
  if (order.empty()) return;
  KernelReceivers& kernel = work.receivers;
  const KernelSamples& samples = kept.samples;
  gather_receivers(receivers, order, 0, kernel);  // no masks but the caller's
  kernel.words = masks.words_per_receiver;
  kernel.mask_at.resize(order.size());
  parallel_ranges(order.size(), 16384, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) kernel.mask_at[i] = masks.words.data() + order[i] * kernel.words;
  });
  stats.index_ms += watch.lap();
  fit_side(blockers, samples, side);
  stats.cull_ms += watch.lap();
  const SampleCloud* const cloud = kept.bound.flat ? nullptr : &side.cloud;
  const bool beams = kept.tiles.count != 0 && side.fit.alpha.empty();
  const ExactScene scene{blockers.tree, &side.fit, &samples,   beams ? &kept.tiles : nullptr,
                         &kept.rows,    cloud,     side.frame, work.beams};
  constexpr std::size_t kTasksPerRound = 128;
  const std::size_t per_task = receivers_per_task(order.size()), tasks = (order.size() + per_task - 1) / per_task;
  work.scratches.start(concurrency(), *blockers.tree, kept, beams);
  for (std::size_t first = 0; first < tasks; first += kTasksPerRound) {
    report_progress(config, static_cast<double>(first) / static_cast<double>(tasks));
    parallel_tasks(std::min(kTasksPerRound, tasks - first), [&](std::size_t t) {
      const ScratchLoan scratch(work.scratches);
      const std::size_t task_end = std::min(order.size(), (first + t + 1) * per_task);
      for (std::size_t begin = (first + t) * per_task; begin < task_end; begin += kClusterReceivers) {
        check_run();
        solve_cluster(scene, begin, std::min(task_end, begin + kClusterReceivers), kernel, *scratch);
      }
    });
  }
  add_counters(work.scratches, stats);
  stats.bytes = std::max<std::uint64_t>(stats.bytes, blockers.tree->bytes() + side.fit.bytes() + kernel.x.size() * 21);
  stats.test_ms += watch.lap();
}

void solve_grazing(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                   const LightSamples& samples, const std::vector<std::uint8_t>& side, const ShadowConfig& config,
                   VisibilityMasks& masks, ShadowStats& stats) {
  ReceiverArray grazing;
  std::vector<std::uint32_t> order;
  for (std::uint32_t i = 0; i < receivers.size(); ++i) {
    if (side[i] != kNoSide) continue;
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

void ScratchPool::start(std::size_t threads, const BlockerTree& tree, const ExactLight& light, bool beams) {
  const std::size_t nodes = tree.nodes.size();
  while (scratches_.size() < threads) scratches_.push_back(std::make_unique<ExactScratch>());
  const std::size_t groups = nodes + KernelReceivers::kLanePadding;
  std::size_t edges = 0, facing = 0, turning = 0;
  for (const auto& s : scratches_) {
    facing = std::max(facing, s->facing.capacity());
    turning = std::max(turning, s->turning.capacity());
    edges = std::max(edges, s->net_edges.vertex[0].size());
  }
  // How long these lists get depends on which thread met what before: twice the longest so far is room enough.
  const auto with_room = [](std::size_t longest, std::size_t& room) {
    if (longest > room) room = 2 * longest;
    return room;
  };
  facing = with_room(facing, facing_room_), turning = with_room(turning, turning_room_);
  edges = with_room(edges, edges_room_);
  const bool is_cloud = !light.bound.flat;
  const std::size_t cells = cells_anywhere(light.samples.count, light.samples.sets);
  free_.clear();
  for (const auto& s : scratches_) {
    s->stack.reserve(nodes), s->group.reserve(groups), s->keys.reserve(groups);
    s->groups.reserve(nodes), s->gain.assign(nodes, 0.0f), s->own_places.reserve(kClusterReceivers),
        s->net_edges.reserve(edges);
    s->facing.reserve(facing), s->turning.reserve(turning);
    s->old_group.reserve(groups), s->old_bound.reserve(groups);
    for (int k = 0; k < 3; ++k) s->low[k].reserve(groups), s->high[k].reserve(groups);
    if (is_cloud || light.samples.sets > 1) s->places.place.reserve(cells), s->places.bounds.reserve(cells);
    if (is_cloud) s->rows.reserve_cells(light.samples.sets, cells), s->wanted.reserve(light.samples.sets);
    if (beams) s->beams.reserve(tree.leaves.size(), light.samples.count);
    s->lines.placed = PictureLines::kNothing;
    s->counters = {};
    s->leaves_listed = s->leaves_tested = s->clusters_lit = s->clusters_by_sample = 0;
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

void ExactWork::reserve(std::size_t count) {
  const std::size_t padded = count + KernelReceivers::kLanePadding;
  curve.reserve(count);
  side.reserve(count), order.reserve(count);
  receivers.x.reserve(padded), receivers.y.reserve(padded), receivers.z.reserve(padded);
  receivers.own.reserve(padded), receivers.open.reserve(padded), receivers.set.reserve(padded);
  receivers.mask_at.reserve(count);
}

void prepare_exact_light(const Light& light, const LightSamples& samples, ExactLight& kept) {
  kept.unfit();
  kept.bound = make_light_bound(light, samples, std::move(kept.bound));
  prepare_exact_samples(samples, kept);
}

void prepare_exact_samples(const LightSamples& samples, ExactLight& kept) {
  kept.front = {dvec3(kept.bound.center), samples.axis_u, samples.axis_v, samples.axis_n};
  kept.samples = make_kernel_samples(samples, kept.bound, SampleOrder::kAsGiven, std::move(kept.samples));
  const auto& [center, u, v, n] = kept.front;
  const LightFrame frames[6] = {{center, u, v, n},  {center, u, v, -n}, {center, v, n, u},
                                {center, v, n, -u}, {center, n, u, v},  {center, n, u, -v}};
  kept.count = samples.one_sided ? 1 : samples.flat ? 2 : 6;
  for (std::size_t k = 0; k < kept.count; ++k) {
    ExactSide& side = kept.sides[k];
    side.frame = frames[k];
    if (!samples.flat) side.cloud = make_sample_cloud(kept.samples, side.frame, std::move(side.cloud));
  }
  if (samples.flat) kept.rows = find_sample_rows(samples, kept.samples, kept.front, std::move(kept.rows));
  if (samples.flat && samples.sets == 1) {
    kept.tiles = make_kernel_samples(samples, kept.bound, SampleOrder::kNeighboursTogether, std::move(kept.tiles));
  } else {
    kept.tiles.count = 0;
  }
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
  Stopwatch watch;
  work.side.resize(receivers.size());
  parallel_ranges(receivers.size(), 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) work.side[i] = side_of(kept, receivers.position[i]);
  });
  stats.index_ms += watch.lap();
  for (std::size_t k = 0; k < kept.count; ++k) {
    const auto side = static_cast<std::uint8_t>(k);
    if (std::find(work.side.begin(), work.side.end(), side) != work.side.end())
      solve_side(blockers, receivers, config, kept, side, work, masks, stats);
  }
  solve_grazing(blockers.mesh, receivers, light, samples, work.side, config, masks, stats);
}

void KeptExact::build(const LatticeMesh& mesh, bool certificates) {
  if (certificates && !has_closed) closed = find_closed_components(mesh), has_closed = true;
  if (!has_tree) build_blocker_tree(mesh, tree), has_tree = true;
}

void solve_exact(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                 const LightSamples& samples, const ShadowConfig& config, KeptExact& kept, VisibilityMasks& masks,
                 ShadowStats& stats) {
  Stopwatch watch;
  kept.build(mesh, config.back_face_casters);
  stats.build_ms += watch.lap();
  prepare_exact_light(light, samples, kept.light);
  stats.index_ms += watch.lap();
  const ExactBlockers blockers{mesh, config.back_face_casters ? &kept.closed : nullptr, &kept.tree};
  solve_exact(blockers, receivers, light, samples, config, kept.light, kept.work, masks, stats);
}

}  // namespace halfshade
