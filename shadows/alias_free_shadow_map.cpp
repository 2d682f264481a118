#include "shadows/alias_free_shadow_map.h"

#include <algorithm>
#include <memory>

#include "rasterizer/core/parallel.h"
#include "rasterizer/core/stopwatch.h"
#include "shadows/blocker_spans.h"
#include "shadows/half_plane_table.h"
#include "shadows/solver.h"

namespace halfshade {
namespace {

constexpr std::size_t kTrianglesPerPart = 256;
constexpr std::size_t kPartsPerRound = 16;  // bounds the memory of the spans

/// What all views of a solve share.
struct Solve {
  const LatticeMesh& mesh;
  const ReceiverArray& receivers;
  const ShadowConfig& config;
  KernelSamples samples;
  ClosedComponents closed;
  LightFacing facing;
  SilhouetteEdges silhouettes;
  std::unique_ptr<HalfPlaneTable> table;  // afsm-lut
};

/// What the views count for ShadowStats::details.
struct Totals {
  std::uint64_t cells = 0, tiles_skipped = 0, settled_pairs = 0, settled_receivers = 0, exact_pairs = 0;
  double penumbra_tiles = 0.0;  // share, summed over views
  std::size_t stencil_views = 0;
};

/// Position of one view among the views of a solve, for progress.
struct ViewTurn {
  std::size_t index, count;
  double share(double done) const { return (static_cast<double>(index) + done) / static_cast<double>(count); }
};

std::vector<dvec3> view_positions_of(const LatticeMesh& mesh, const LightView& view) {
  std::vector<dvec3> positions(mesh.positions.size());
  parallel_ranges(positions.size(), 8192, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) positions[i] = view.to_view(dvec3(mesh.positions[i]));
  });
  return positions;
}

void count_lists(const LightLists& lists, ShadowStats& stats) {
  for (std::uint32_t cell = 0; cell < lists.near_cell; ++cell) {
    const std::uint64_t length = lists.zbuffer.offsets[cell + 1] - lists.zbuffer.offsets[cell];
    stats.lists_occupied += length != 0;
    stats.lists_longest = std::max(stats.lists_longest, length);
  }
}

/// Pairs that a table has no answer for (alpha-tested blockers) and that go to the exact tests.
std::uint64_t perforated_pairs(const LatticeMesh& mesh, const std::vector<BlockerSpan>& spans) {
  std::uint64_t pairs = 0;
  for (const BlockerSpan& span : spans) {
    if (mesh.alpha_map(span.triangle) != kNone) pairs += span.end - span.begin;
  }
  return pairs;
}

/// All blockers against the receivers of one view. Rounds of triangles: first their spans, by find(begin, end, part),
/// in parallel over triangles; then test(block, spans, counters), in parallel over blocks of rows, so that every mask
/// has one writer. Returns the pairs tested.
template <class Find, class Test, class Report>
std::uint64_t run_rounds(const Solve& solve, const LightLists& lists, const Find& find, const Test& test,
                         const Report& report, Totals& totals, ShadowStats& stats) {
  Stopwatch watch;
  const std::size_t count = solve.mesh.triangles.size();
  const std::size_t part_count = (count + kTrianglesPerPart - 1) / kTrianglesPerPart;
  std::vector<PartSpans> parts(std::min(part_count, kPartsPerRound));
  std::vector<KernelCounters> counters(lists.blocks.size());
  for (std::size_t first = 0; first < part_count; first += parts.size()) {
    const std::size_t active = std::min(parts.size(), part_count - first);
    report(static_cast<double>(first) / static_cast<double>(part_count));
    parallel_tasks(active, [&](std::size_t p) {
      const std::size_t begin = (first + p) * kTrianglesPerPart;
      find(begin, std::min(count, begin + kTrianglesPerPart), parts[p]);
    });
    for (std::size_t p = 0; solve.table != nullptr && p < active; ++p) {
      for (const auto& spans : parts[p].of_block) totals.exact_pairs += perforated_pairs(solve.mesh, spans);
    }
    stats.cull_ms += watch.lap();
    parallel_tasks(lists.blocks.size(), [&](std::size_t b) {
      for (std::size_t p = 0; p < active; ++p) test(b, parts[p].of_block[b], counters[b]);
    });
    stats.test_ms += watch.lap();
  }
  KernelCounters total;
  for (const KernelCounters& c : counters) total.add(c);
  add_to_stats(total, stats);
  for (const PartSpans& part : parts) {
    stats.everywhere_blockers += part.everywhere;
    totals.cells += part.cells, totals.tiles_skipped += part.tiles_skipped;
    for (const auto& spans : part.of_block) stats.bytes += spans.capacity() * sizeof(BlockerSpan);
  }
  return total.pairs_tested;
}

/// Receivers that are hidden from the whole light.
void fill_hidden(const KernelSamples& samples, const SettledReceivers& settled, KernelReceivers& kernel,
                 Totals& totals) {
  for (std::size_t i = 0; i < kernel.count; ++i) {
    if (settled.hidden[i] == 0) continue;
    std::copy(samples.valid.begin(), samples.valid.end(), kernel.mask(i));
    kernel.open[i] = 0;
    ++totals.settled_receivers;
  }
}

/// The hard shadow pass of section 4.3 (silhouettes.h).
template <class Report>
void settle(const Solve& solve, const BlockerView& blockers, const Report& report, PenumbraStencils& stencils,
            KernelReceivers& kernel, Totals& totals, ShadowStats& stats) {
  const LightLists& lists = *blockers.lists;
  const vec3 sample = solve.samples.points[0];
  const dvec3 in_view = lists.view.to_view(dvec3(sample));
  SettledReceivers settled;
  settled.hidden.assign(kernel.count, 0);
  settled.from_front.resize(lists.blocks.size());
  const auto find = [&](std::size_t begin, std::size_t end, PartSpans& part) {
    find_settled_spans(blockers, in_view, begin, end, part);
  };
  const auto test = [&](std::size_t block, const std::vector<BlockerSpan>& spans, KernelCounters& counters) {
    test_one_sample(solve.mesh, solve.samples, sample, spans, kernel, block, settled, counters);
  };
  totals.settled_pairs += run_rounds(solve, lists, find, test, report, totals, stats);
  Stopwatch watch;
  mark_undecided(solve.mesh, solve.samples, lists, kernel, settled, stencils);
  fill_hidden(solve.samples, settled, kernel, totals);
  stats.test_ms += watch.lap();
}

void solve_view(const Solve& solve, LightViewCells&& cells, ViewTurn turn, VisibilityMasks& masks, Totals& totals,
                ShadowStats& stats) {
  Stopwatch watch;
  const LightLists lists = make_light_lists(std::move(cells), solve.receivers);
  KernelReceivers kernel = gather_receivers(solve.receivers, lists.zbuffer.entries, masks.words_per_receiver);
  count_lists(lists, stats);
  stats.index_ms += watch.lap();
  const std::vector<dvec3> positions = view_positions_of(solve.mesh, lists.view);
  PenumbraStencils stencils(lists, solve.silhouettes, positions);
  const BlockerView blockers{&solve.mesh,   &lists,    &positions,       &solve.samples,
                             &solve.facing, &stencils, solve.config.afsm};
  stats.cull_ms += watch.lap();
  if (stencils.any()) {
    totals.penumbra_tiles += stencils.penumbra_share(), ++totals.stencil_views;
    settle(
        solve, blockers, [&](double done) { report_progress(solve.config, turn.share(0.2 * done)); }, stencils, kernel,
        totals, stats);
  }
  const auto find = [&](std::size_t begin, std::size_t end, PartSpans& part) {
    find_spans(blockers, begin, end, part);
  };
  const auto test = [&](std::size_t, const std::vector<BlockerSpan>& spans, KernelCounters& counters) {
    test_blockers(solve.mesh, solve.samples, spans, kernel, counters);
  };
  run_rounds(
      solve, lists, find, test, [&](double done) { report_progress(solve.config, turn.share(0.2 + 0.8 * done)); },
      totals, stats);
  watch.lap();
  scatter_masks(kernel, solve.samples, lists.zbuffer.entries, masks);
  stats.bytes += positions.size() * sizeof(dvec3) + kernel.x.size() * 21 + kernel.masks.size() * 8 + stencils.bytes() +
                 (lists.zbuffer.offsets.size() + lists.zbuffer.entries.size()) * 4 +
                 lists.tiles.size() * sizeof(ReceiverTile);
  stats.test_ms += watch.lap();
}

/// Certificates, facing, silhouette edges: what does not depend on the view.
void prepare(const LightSamples& light, Solve& solve, ShadowStats& stats) {
  const AliasFreeOptions& options = solve.config.afsm;
  std::vector<EdgeUse> edges;
  certify(solve.mesh, solve.receivers, solve.config, solve.closed, solve.samples, stats,
          options.silhouettes ? &edges : nullptr);
  solve.facing = find_facing(solve.mesh, solve.samples);
  if (solve.samples.closed == nullptr || !options.silhouettes || light.count < 2) return;
  solve.silhouettes = find_silhouette_edges(solve.mesh, solve.samples, solve.facing, edges);
}

/// The table of afsm-lut; none for a light that is a point, which leaves nothing to look up: the exact tests are used.
void prepare_table(const LightSamples& light, Solve& solve, ShadowStats& stats) {
  Stopwatch watch;
  const std::uint32_t size = solve.config.afsm.table;
  if (size < 4 || size > 1024) {
    throw Error(ErrorCode::kUsage, "afsm.table: " + std::to_string(size) + " is not in 4..1024");
  }
  if (solve.samples.reach > 0.0f) solve.table = std::make_unique<HalfPlaneTable>(light, solve.samples, size);
  solve.samples.table = solve.table.get();
  stats.details.emplace_back("afsm-lut.table_bytes", solve.table ? static_cast<double>(solve.table->bytes()) : 0.0);
  stats.details.emplace_back("afsm-lut.table_ms", watch.lap());
}

void note(const Solve& solve, const Totals& totals, ShadowStats& stats) {
  const auto add = [&](const char* name, auto value) { stats.details.emplace_back(name, static_cast<double>(value)); };
  add("afsm.region_cells", totals.cells);
  add("afsm.tiles_skipped", totals.tiles_skipped);
  add("afsm.edges_of_closed_meshes", solve.silhouettes.total);
  add("afsm.silhouette_edges", solve.silhouettes.edges.size());
  add("afsm.penumbra_tile_percent",
      totals.stencil_views == 0 ? 100.0 : 100.0 * totals.penumbra_tiles / static_cast<double>(totals.stencil_views));
  add("afsm.settled_pairs", totals.settled_pairs);
  add("afsm.settled_hidden_receivers", totals.settled_receivers);
  if (solve.config.method != ShadowMethod::kAliasFreeLookupTable) return;
  add("afsm-lut.pairs_tested_exactly", solve.table ? totals.exact_pairs : stats.pairs_tested);
}

}  // namespace

void solve_alias_free_shadow_map(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                                 const LightSamples& samples, const ShadowConfig& config, VisibilityMasks& masks,
                                 ShadowStats& stats) {
  if (config.grid_resolution != 0 && (config.grid_resolution < 16 || config.grid_resolution > 2048)) {
    throw Error(ErrorCode::kUsage,
                "grid resolution: " + std::to_string(config.grid_resolution) + " is not in 16..2048");
  }
  Stopwatch watch;
  masks.reset(receivers.size(), samples.count);
  const LightBound bound = make_light_bound(light, samples);
  Solve solve{mesh, receivers, config, make_kernel_samples(samples, bound), {}, {}, {}, nullptr};
  prepare(samples, solve, stats);
  if (config.method == ShadowMethod::kAliasFreeLookupTable) prepare_table(samples, solve, stats);
  stats.build_ms += watch.lap();
  const AliasFreeOptions& options = config.afsm;
  std::vector<LightViewCells> views =
      make_light_views(bound, samples, receivers, config.grid_resolution,
                       {options.region, options.fit ? nullptr : &mesh, options.far_fit ? nullptr : &mesh});
  stats.index_ms += watch.lap();
  Totals totals;
  for (std::size_t i = 0; i < views.size(); ++i) {
    solve_view(solve, std::move(views[i]), {i, views.size()}, masks, totals, stats);
  }
  note(solve, totals, stats);
}

std::string assumptions_of_lookup_table(const ShadowConfig& config) {
  return "planes rounded to a table of " + std::to_string(config.afsm.table) +
         " steps per axis: samples near an edge may go either way; alpha-tested blockers are tested exactly";
}

}  // namespace halfshade
