#include "shadows/gears.h"

#include <algorithm>
#include <cmath>

#include "rasterizer/core/parallel.h"
#include "rasterizer/core/stopwatch.h"
#include "shadows/closed_components.h"
#include "shadows/gears_pairs.h"
#include "shadows/solver.h"
#include "shadows/visibility_pair.h"

namespace halfshade {
namespace {

constexpr std::size_t kBatchBlockers = 1 << 15;  // prepared at once: 5 MB, which caches hold
constexpr std::size_t kBlocks = 256;             // pieces of the receivers, each written by one task
constexpr std::size_t kBlocksPerRound = 32;      // between two reports of progress
constexpr std::uint32_t kSmallestBlock = 256;
constexpr std::uint32_t kSpansPerCall = 64;  // blockers of one cell between two looks whether the cell is dark

/// What one view adds to the details; sums and largest values over views, averages at the end.
struct Study {
  std::uint64_t views = 0, tiles = 0, cells = 0, subdivided = 0, pairs = 0, most_pairs = 0, batches = 0;
  std::uint64_t receivers = 0, most_receivers = 0, listed = 0, most_listed = 0, near = 0;
  std::uint64_t assignments = 0, necessary = 0, in_box = 0, in_hull = 0, in_frustum = 0;
  std::uint32_t resolution = 0;
};

void check_options(const GearsOptions& o) {
  const auto refuse = [](const std::string& what) { throw Error(ErrorCode::kUsage, "gears: " + what); };
  if (o.grid != 0 && (o.grid < 8 || o.grid > 1024)) refuse("grid " + std::to_string(o.grid) + " is not in 8..1024");
  if (!(o.camera >= 0.0 && o.camera <= 16.0)) refuse("camera " + std::to_string(o.camera) + " is not in 0..16");
  if (o.pair_budget < 1 || o.pair_budget > 1u << 31)
    refuse("pair budget " + std::to_string(o.pair_budget) + " is not in 1..2147483648");
}

/// Blockers as the kernel wants them, for one batch.
struct PreparedBlockers {
  std::vector<Blocker> blockers;
  std::vector<AlphaTriangle> alpha;  // [blocker], if any is alpha-tested

  void prepare(const LatticeMesh& mesh, const KernelSamples& samples, std::span<const std::uint32_t> triangles) {
    blockers.resize(triangles.size());
    if (mesh.scene != nullptr && !mesh.scene->alpha_maps.empty()) alpha.resize(triangles.size());
    parallel_ranges(triangles.size(), 1024, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i != end; ++i) {
        blockers[i] = make_blocker(mesh, samples, triangles[i]);
        if (!blockers[i].perforated) continue;
        alpha[i] = make_alpha_triangle(mesh, triangles[i]);
        blockers[i].alpha = &alpha[i];
      }
    });
  }
  std::uint64_t bytes() const {
    return blockers.capacity() * sizeof(Blocker) + alpha.capacity() * sizeof(AlphaTriangle);
  }
};

/// All blockers against the receivers of one view.
class ViewSolver {
 public:
  ViewSolver(const LatticeMesh& mesh, const ReceiverArray& receivers, const KernelSamples& samples, GearsGrid&& grid,
             const ShadowConfig& config, std::size_t words, Study& study)
      : mesh_(mesh),
        samples_(samples),
        config_(config),
        grid_(std::move(grid)),
        kernel_(gather_receivers(receivers, grid_.order, words)),
        study_(study) {
    block_size_ = std::max(kSmallestBlock, static_cast<std::uint32_t>((grid_.on_grid + kBlocks - 1) / kBlocks));
    nodes_of_block_.resize((grid_.on_grid + block_size_ - 1) / block_size_);
    for (std::uint32_t n = 0; n < grid_.nodes.size(); ++n) {
      const GearsNode& node = grid_.nodes[n];
      for (std::uint32_t b = node.begin / block_size_; b <= (node.end - 1) / block_size_; ++b) {
        nodes_of_block_[b].push_back(n);
      }
    }
    counters_.resize(std::max<std::size_t>(1, nodes_of_block_.size()));
    listed_.assign(grid_.nodes.size(), 0);
    if (config.gears.study) alone_ = kernel_;
  }

  void solve(std::size_t view, std::size_t views, ShadowStats& stats) {
    Stopwatch watch;
    const auto progress = [&](double done) {
      report_progress(config_, (static_cast<double>(view) + done) / static_cast<double>(views));
    };
    const auto begun = [&] { progress(0.0); };
    begun();
    const GearsAssigner assigner(mesh_, samples_, grid_, config_.gears);
    const GearsDemand demand = grid_.on_grid != 0 ? assigner.count() : GearsDemand{};
    for (const std::uint64_t n : demand.in_box) study_.in_box += n;
    for (const std::uint64_t n : demand.in_hull) study_.in_hull += n;
    for (const std::uint64_t n : demand.in_frustum) study_.in_frustum += n;
    stats.cull_ms += watch.lap();
    solve_everywhere(demand.everywhere, begun);
    solve_near(begun);
    stats.test_ms += watch.lap();
    const std::size_t total = demand.touching.size();
    for (std::size_t first = 0; first < total;) {
      const std::size_t count = batch_size(demand, first);
      assigner.assign({demand.touching.data() + first, count}, {demand.count.data() + first, count}, pairs_);
      note_pairs();
      stats.cull_ms += watch.lap();
      prepared_.prepare(mesh_, samples_, {demand.touching.data() + first, count});
      for (std::size_t b = 0; b < nodes_of_block_.size(); b += kBlocksPerRound) {
        progress((static_cast<double>(first) +
                  static_cast<double>(count * b) / static_cast<double>(nodes_of_block_.size())) /
                 static_cast<double>(total));
        parallel_tasks(std::min(kBlocksPerRound, nodes_of_block_.size() - b),
                       [&](std::size_t k) { test_block(b + k); });
      }
      if (config_.gears.study) count_necessary({demand.touching.data() + first, count});
      first += count;
      stats.test_ms += watch.lap();
    }
    note_lists(demand.everywhere.size(), stats);
    stats.bytes += assigner.bytes() + demand.touching.capacity() * 8 + mesh_.triangles.size() * 4;
  }

  void finish(VisibilityMasks& masks, ShadowStats& stats) const {
    scatter_masks(kernel_, samples_, grid_.order, masks);
    KernelCounters total;
    for (const KernelCounters& c : counters_) total.add(c);
    add_to_stats(total, stats);
    stats.bytes += prepared_.bytes() + (pairs_.pairs.capacity() + pairs_.scratch.capacity()) * sizeof(GearsPair) +
                   grid_.nodes.size() * sizeof(GearsNode) + grid_.position.size() * (sizeof(dvec3) + 4) +
                   kernel_.x.size() * 21 + kernel_.masks.size() * 8;
  }

 private:
  /// As many blockers from `first` on as the pair budget and the caches hold; at least one.
  std::size_t batch_size(const GearsDemand& demand, std::size_t first) const {
    std::uint64_t pairs = demand.count[first];
    std::size_t count = 1;
    while (count < kBatchBlockers && first + count < demand.count.size()) {
      pairs += demand.count[first + count];
      if (pairs > config_.gears.pair_budget) break;
      ++count;
    }
    return count;
  }

  /// Blockers that may hide receivers anywhere in the view.
  template <class AfterBatch>
  void solve_everywhere(std::span<const std::uint32_t> triangles, const AfterBatch& after_batch) {
    for (std::size_t first = 0; first < triangles.size(); first += kBatchBlockers) {
      const auto batch = triangles.subspan(first, std::min(kBatchBlockers, triangles.size() - first));
      prepared_.prepare(mesh_, samples_, batch);
      parallel_tasks(nodes_of_block_.size(), [&](std::size_t b) {
        const std::uint32_t begin = static_cast<std::uint32_t>(b) * block_size_;
        const std::uint32_t end = std::min(grid_.on_grid, begin + block_size_);
        test_list(
            batch.size(), [](std::size_t i) { return static_cast<std::uint32_t>(i); }, begin, end, counters_[b]);
      });
      after_batch();
    }
    study_.assignments += std::uint64_t{grid_.on_grid} * triangles.size();
  }

  /// Receivers too near to the light to be projected: every blocker may hide it from them.
  template <class AfterBatch>
  void solve_near(const AfterBatch& after_batch) {
    const auto begin = grid_.on_grid, end = static_cast<std::uint32_t>(grid_.order.size());
    const std::uint32_t count = end - begin;
    study_.near += count;
    if (count == 0) return;
    const std::size_t parts = (count + kSmallestBlock - 1) / kSmallestBlock;
    std::vector<KernelCounters> counters(parts);
    std::vector<std::uint32_t> batch;
    for (std::size_t first = 0; first < mesh_.triangles.size(); first += kBatchBlockers) {
      batch.resize(std::min(kBatchBlockers, mesh_.triangles.size() - first));
      for (std::size_t i = 0; i < batch.size(); ++i) batch[i] = static_cast<std::uint32_t>(first + i);
      prepared_.prepare(mesh_, samples_, batch);
      parallel_tasks(parts, [&](std::size_t p) {
        const std::uint32_t from = begin + static_cast<std::uint32_t>(p) * kSmallestBlock;
        test_list(
            batch.size(), [](std::size_t i) { return static_cast<std::uint32_t>(i); }, from,
            std::min(end, from + kSmallestBlock), counters[p]);
      });
      after_batch();
    }
    for (const KernelCounters& c : counters) counters_[0].add(c);
  }

  /// Receivers of one block against the lists of the nodes they lie in.
  void test_block(std::size_t block) {
    const std::uint32_t from = static_cast<std::uint32_t>(block) * block_size_;
    const std::uint32_t to = std::min(grid_.on_grid, from + block_size_);
    for (const std::uint32_t n : nodes_of_block_[block]) {
      const GearsNode& node = grid_.nodes[n];
      const GearsPair* list = pairs_.pairs.data() + pairs_.offsets[n];
      test_list(
          pairs_.offsets[n + 1] - pairs_.offsets[n], [&](std::size_t i) { return list[i].blocker; },
          std::max(from, node.begin), std::min(to, node.end), counters_[block]);
    }
  }

  /// Prepared blockers at(0 .. count) against receivers [begin, end), until none of those is lit any more.
  template <class At>
  void test_list(std::size_t count, const At& at, std::uint32_t begin, std::uint32_t end, KernelCounters& counters) {
    std::array<BlockerSpan, kSpansPerCall> spans;
    for (std::size_t first = 0; first < count; first += kSpansPerCall) {
      const auto open = kernel_.open.begin();
      if (std::all_of(open + begin, open + end, [](std::uint32_t o) { return o == 0; })) return;
      const std::size_t now = std::min<std::size_t>(kSpansPerCall, count - first);
      for (std::size_t i = 0; i < now; ++i) spans[i] = {at(first + i), begin, end};
      test_prepared_blockers(prepared_.blockers, samples_, {spans.data(), now}, kernel_, counters);
    }
  }

  void note_pairs() {
    ++study_.batches;
    study_.pairs += pairs_.pairs.size();
    study_.most_pairs = std::max<std::uint64_t>(study_.most_pairs, pairs_.pairs.size());
    for (std::size_t n = 0; n < listed_.size(); ++n) {
      const std::uint32_t list = pairs_.offsets[n + 1] - pairs_.offsets[n];
      listed_[n] += list;
      study_.assignments += std::uint64_t{list} * (grid_.nodes[n].end - grid_.nodes[n].begin);
    }
  }

  /// Lengths of the lists of cells (tables 5 and 6): a cell has its own blockers and those of the nodes around it.
  void note_lists(std::size_t everywhere, ShadowStats& stats) {
    ++study_.views;
    study_.subdivided += grid_.subdivided;
    study_.receivers += grid_.on_grid;
    study_.resolution = std::max(study_.resolution, grid_.cells[0].columns);
    stats.everywhere_blockers += everywhere;
    for (std::size_t n = 0; n < grid_.nodes.size(); ++n) {
      const GearsNode& node = grid_.nodes[n];
      listed_[n] += node.parent == kNone ? everywhere : listed_[node.parent];
      if (!node.leaf) continue;
      ++study_.cells;
      ++stats.lists_occupied;
      study_.listed += listed_[n];
      study_.most_listed = std::max(study_.most_listed, listed_[n]);
      study_.most_receivers = std::max<std::uint64_t>(study_.most_receivers, node.end - node.begin);
    }
    stats.lists_longest = std::max(stats.lists_longest, study_.most_receivers);
  }

  /// Table 6: pairs of blocker and receiver in which the blocker hides a sample, each by itself and without
  /// certificates.
  void count_necessary(std::span<const std::uint32_t> triangles) {
    KernelSamples plain = samples_;
    plain.closed = nullptr;
    prepared_.prepare(mesh_, plain, triangles);
    std::vector<KernelCounters> counters(nodes_of_block_.size());
    parallel_tasks(nodes_of_block_.size(), [&](std::size_t b) {
      const std::uint32_t from = static_cast<std::uint32_t>(b) * block_size_;
      const std::uint32_t to = std::min(grid_.on_grid, from + block_size_);
      for (const std::uint32_t n : nodes_of_block_[b]) {
        const std::uint32_t begin = std::max(from, grid_.nodes[n].begin), end = std::min(to, grid_.nodes[n].end);
        for (std::uint32_t i = pairs_.offsets[n]; i < pairs_.offsets[n + 1]; ++i) {
          const BlockerSpan span{pairs_.pairs[i].blocker, begin, end};
          test_prepared_blockers(prepared_.blockers, plain, {&span, 1}, alone_, counters[b]);
          std::fill(alone_.open.begin() + begin, alone_.open.begin() + end, ~0u);
          std::fill(alone_.masks.begin() + static_cast<std::ptrdiff_t>(begin * alone_.words),
                    alone_.masks.begin() + static_cast<std::ptrdiff_t>(end * alone_.words), 0);
        }
      }
    });
    for (const KernelCounters& c : counters) study_.necessary += c.pairs_necessary;
  }

  const LatticeMesh& mesh_;
  const KernelSamples& samples_;
  const ShadowConfig& config_;
  const GearsGrid grid_;
  KernelReceivers kernel_, alone_;  // alone_: scratch of the study
  Study& study_;
  std::uint32_t block_size_ = 0;
  std::vector<std::vector<std::uint32_t>> nodes_of_block_;
  std::vector<KernelCounters> counters_;  // [block]
  std::vector<std::uint64_t> listed_;     // [node] blockers
  PreparedBlockers prepared_;
  GearsPairs pairs_;
};

/// What all views of a solve share.
struct Scope {
  const LatticeMesh& mesh;
  const LightBound& bound;
  const LightSamples& samples;
  const KernelSamples& kernel_samples;
  const ShadowConfig& config;
  Study& study;
};

/// Takes the receivers that were too near to the light for the grid out of it.
ReceiverArray take_near(const ReceiverArray& receivers, GearsGrid& grid, std::vector<std::uint32_t>& near) {
  near.assign(grid.order.begin() + grid.on_grid, grid.order.end());
  grid.order.resize(grid.on_grid);
  grid.position.resize(grid.on_grid);
  ReceiverArray part;
  for (const std::uint32_t i : near) {
    part.push_back(receivers.position[i], receivers.normal[i], receivers.triangle[i], receivers.sample[i],
                   receivers.set[i]);
  }
  return part;
}

void solve_part(const Scope& scope, const ReceiverArray& receivers, int depth, VisibilityMasks& masks,
                ShadowStats& stats);

/// Receivers too near to the light for a grid that also holds the farthest ones: if there are many, they get views of
/// their own, whose far plane is a thousand times nearer. Without that, one receiver far away would make every other
/// one be tested against all blockers.
void solve_near_apart(const Scope& scope, const ReceiverArray& receivers, int depth, double done, GearsGrid& grid,
                      VisibilityMasks& masks, ShadowStats& stats) {
  constexpr std::size_t kFew = 256;
  constexpr int kMaxDepth = 8;
  const std::size_t count = grid.order.size() - grid.on_grid;
  if (count <= kFew || count == receivers.size() || depth == kMaxDepth) return;
  std::vector<std::uint32_t> near;
  const ReceiverArray part = take_near(receivers, grid, near);
  VisibilityMasks part_masks;
  part_masks.reset(part.size(), masks.sample_count);
  ShadowConfig config = scope.config;
  if (config.progress) config.progress = [&](double) { return scope.config.progress(done); };
  solve_part({scope.mesh, scope.bound, scope.samples, scope.kernel_samples, config, scope.study}, part, depth + 1,
             part_masks, stats);
  for (std::size_t i = 0; i < near.size(); ++i) {
    const auto mask = part_masks.mask(i);
    std::copy(mask.begin(), mask.end(), masks.words.begin() + static_cast<std::ptrdiff_t>(near[i] * mask.size()));
  }
}

void solve_part(const Scope& scope, const ReceiverArray& receivers, int depth, VisibilityMasks& masks,
                ShadowStats& stats) {
  Stopwatch watch;
  std::vector<LightViewCells> views = make_light_views(scope.bound, scope.samples, receivers, 16);
  for (std::size_t i = 0; i < views.size(); ++i) {
    GearsGrid grid = make_gears_grid(std::move(views[i]), receivers, scope.config.gears);
    stats.index_ms += watch.lap();
    solve_near_apart(scope, receivers, depth, static_cast<double>(i) / static_cast<double>(views.size()), grid, masks,
                     stats);
    watch.lap();
    ViewSolver solver(scope.mesh, receivers, scope.kernel_samples, std::move(grid), scope.config,
                      masks.words_per_receiver, scope.study);
    stats.index_ms += watch.lap();
    solver.solve(i, views.size(), stats);
    watch.lap();
    solver.finish(masks, stats);
    stats.test_ms += watch.lap();
  }
}

void note_details(const Study& s, const GearsOptions& options, ShadowStats& stats) {
  const auto note = [&](const char* name, auto value) {
    stats.details.emplace_back(std::string("gears.") + name, static_cast<double>(value));
  };
  const double cells = std::max(1.0, static_cast<double>(s.cells));
  note("grid", s.resolution);
  note("cells", s.cells);
  note("cells_subdivided", s.subdivided);
  note("receivers_near", s.near);
  note("receivers_per_cell_max", s.most_receivers);
  note("receivers_per_cell_average", static_cast<double>(s.receivers) / cells);
  note("triangles_per_cell_max", s.most_listed);
  note("triangles_per_cell_average", static_cast<double>(s.listed) / cells);
  note("batches", s.batches);
  note("pairs", s.pairs);
  note("pairs_in_flight_max", s.most_pairs);
  note("assignments", s.assignments);
  if (!options.study) return;
  note("assignments_necessary", s.necessary);
  note("samples_in_box", s.in_box);
  note("samples_in_hull", s.in_hull);
  note("samples_in_frustum", s.in_frustum);
}

}  // namespace

void solve_gears(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                 const LightSamples& samples, const ShadowConfig& config, VisibilityMasks& masks, ShadowStats& stats) {
  check_options(config.gears);
  Stopwatch watch;
  masks.reset(receivers.size(), samples.count);
  const LightBound light_bound = make_light_bound(light, samples);
  KernelSamples kernel_samples = make_kernel_samples(samples, light_bound);
  ClosedComponents closed;
  certify(mesh, receivers, config, closed, kernel_samples, stats);
  stats.build_ms += watch.lap();
  Study study;
  solve_part({mesh, light_bound, samples, kernel_samples, config, study}, receivers, 0, masks, stats);
  note_details(study, config.gears, stats);
}

}  // namespace halfshade
