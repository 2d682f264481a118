#include "shadows/alias_free_shadow_map.h"

#include <algorithm>
#include <cmath>

#include "rasterizer/core/parallel.h"
#include "rasterizer/core/stopwatch.h"
#include "shadows/closed_components.h"
#include "shadows/influence_region.h"
#include "shadows/irregular_zbuffer.h"
#include "shadows/solver.h"
#include "shadows/visibility_kernel.h"

namespace halfshade {
namespace {

constexpr std::size_t kTrianglesPerPart = 256;
constexpr std::size_t kPartsPerRound = 16;  // bounds the memory of the spans
constexpr std::size_t kRowBlocks = 64;      // pieces of the grid, each written by one task

/// Rows of the grid that one task owns: receivers list_begin..list_end of the sorted order.
struct RowBlock {
  std::uint32_t list_begin = 0, list_end = 0;
};

/// The lists of one view: receivers in list order, and which block of rows owns which part of them.
struct ViewLists {
  LightView view;
  IrregularZBuffer zbuffer;
  std::uint32_t near_cell = 0;
  std::vector<RowBlock> blocks;  // the last one holds the receivers that are too near to project
  std::vector<std::uint32_t> block_of_row;
};

void make_blocks(ViewLists& lists) {
  const LightGrid& grid = lists.view.grid;
  const std::vector<std::uint32_t>& offsets = lists.zbuffer.offsets;
  const std::uint32_t total = offsets[lists.near_cell];
  lists.block_of_row.resize(grid.rows);
  for (std::uint32_t row = 0; row < grid.rows; ++row) {
    const std::uint32_t begin = offsets[row * grid.columns], end = offsets[(row + 1) * grid.columns];
    if (lists.blocks.empty() || lists.blocks.back().list_end - lists.blocks.back().list_begin >= total / kRowBlocks) {
      lists.blocks.push_back({begin, begin});
    }
    lists.blocks.back().list_end = end;
    lists.block_of_row[row] = static_cast<std::uint32_t>(lists.blocks.size() - 1);
  }
  lists.blocks.push_back({total, offsets[lists.near_cell + 1]});
}

ViewLists make_lists(LightViewCells&& cells) {
  ViewLists lists;
  lists.near_cell = cells.near_cell();
  build_irregular_zbuffer(cells.cell_of_receiver, lists.near_cell + 1, lists.zbuffer);
  lists.view = std::move(cells.view);
  make_blocks(lists);
  return lists;
}

/// Spans of one part of the triangles, by row block; `everywhere` counts triangles without a bounded region.
struct PartSpans {
  std::vector<std::vector<BlockerSpan>> of_block;
  InfluenceRegion region;
  std::uint64_t everywhere = 0;
};

void add_span(std::vector<BlockerSpan>& spans, const BlockerSpan& span) {
  if (span.begin != span.end) spans.push_back(span);
}

void add_rows(const ViewLists& lists, std::uint32_t triangle, PartSpans& part) {
  const std::uint32_t columns = lists.view.grid.columns;
  for (std::size_t i = 0; i < part.region.rows.size(); ++i) {
    const RowSpan& row = part.region.rows[i];
    if (row.first > row.last) continue;
    const std::uint32_t y = part.region.first_row + static_cast<std::uint32_t>(i);
    const std::uint32_t* offsets = lists.zbuffer.offsets.data() + std::size_t{y} * columns;
    add_span(part.of_block[lists.block_of_row[y]], {triangle, offsets[row.first], offsets[row.last + 1]});
  }
}

/// Where in the lists may each triangle of [begin, end) hide a sample? Conservative rasterization of section 3.2.
void find_spans(const LatticeMesh& mesh, const std::vector<dvec3>& view_positions, const ViewLists& lists,
                std::size_t begin, std::size_t end, PartSpans& part) {
  part.of_block.resize(lists.blocks.size());
  for (auto& spans : part.of_block) spans.clear();
  for (std::size_t t = begin; t != end; ++t) {
    const auto triangle = static_cast<std::uint32_t>(t);
    const auto& index = mesh.triangles[t];
    if (lists.view.has_receivers) {
      find_influence_region(lists.view, {view_positions[index[0]], view_positions[index[1]], view_positions[index[2]]},
                            part.region);
      if (part.region.kind == InfluenceRegion::Kind::kRows) add_rows(lists, triangle, part);
      if (part.region.kind == InfluenceRegion::Kind::kEverywhere) {
        ++part.everywhere;
        for (std::size_t b = 0; b + 1 < lists.blocks.size(); ++b) {
          add_span(part.of_block[b], {triangle, lists.blocks[b].list_begin, lists.blocks[b].list_end});
        }
      }
    }
    add_span(part.of_block.back(), {triangle, lists.blocks.back().list_begin, lists.blocks.back().list_end});
  }
}

std::vector<dvec3> view_positions_of(const LatticeMesh& mesh, const LightView& view) {
  std::vector<dvec3> positions(mesh.positions.size());
  parallel_ranges(positions.size(), 8192, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) positions[i] = view.to_view(dvec3(mesh.positions[i]));
  });
  return positions;
}

void count_lists(const ViewLists& lists, ShadowStats& stats) {
  for (std::uint32_t cell = 0; cell < lists.near_cell; ++cell) {
    const std::uint64_t length = lists.zbuffer.offsets[cell + 1] - lists.zbuffer.offsets[cell];
    stats.lists_occupied += length != 0;
    stats.lists_longest = std::max(stats.lists_longest, length);
  }
}

/// Position of one view among the views of a solve, for progress.
struct ViewTurn {
  std::size_t index, count;
  double share(double done) const { return (static_cast<double>(index) + done) / static_cast<double>(count); }
};

/// All blockers against the receivers of one view. Rounds of triangles: first their spans, in parallel over triangles;
/// then the tests, in parallel over blocks of rows, so that every mask has one writer.
void solve_view(const LatticeMesh& mesh, const ReceiverArray& receivers, const KernelSamples& samples,
                LightViewCells&& cells, const ShadowConfig& config, ViewTurn turn, VisibilityMasks& masks,
                ShadowStats& stats) {
  Stopwatch watch;
  const ViewLists lists = make_lists(std::move(cells));
  KernelReceivers kernel = gather_receivers(receivers, lists.zbuffer.entries, masks.words_per_receiver);
  count_lists(lists, stats);
  stats.index_ms += watch.lap();
  const std::vector<dvec3> view_positions = view_positions_of(mesh, lists.view);
  const std::size_t part_count = (mesh.triangles.size() + kTrianglesPerPart - 1) / kTrianglesPerPart;
  std::vector<PartSpans> parts(std::min(part_count, kPartsPerRound));
  std::vector<KernelCounters> counters(lists.blocks.size());
  stats.cull_ms += watch.lap();
  for (std::size_t first = 0; first < part_count; first += parts.size()) {
    const std::size_t active = std::min(parts.size(), part_count - first);
    report_progress(config, turn.share(static_cast<double>(first) / static_cast<double>(part_count)));
    parallel_tasks(active, [&](std::size_t p) {
      const std::size_t begin = (first + p) * kTrianglesPerPart;
      find_spans(mesh, view_positions, lists, begin, std::min(mesh.triangles.size(), begin + kTrianglesPerPart),
                 parts[p]);
    });
    stats.cull_ms += watch.lap();
    parallel_tasks(lists.blocks.size(), [&](std::size_t b) {
      for (std::size_t p = 0; p < active; ++p) test_blockers(mesh, samples, parts[p].of_block[b], kernel, counters[b]);
    });
    stats.test_ms += watch.lap();
  }
  scatter_masks(kernel, samples, lists.zbuffer.entries, masks);
  KernelCounters total;
  for (const KernelCounters& c : counters) total.add(c);
  for (const PartSpans& part : parts) {
    stats.everywhere_blockers += part.everywhere;
    for (const auto& spans : part.of_block) stats.bytes += spans.capacity() * sizeof(BlockerSpan);
  }
  stats.bytes += view_positions.size() * sizeof(dvec3) + kernel.x.size() * 21 + kernel.masks.size() * 8 +
                 (lists.zbuffer.offsets.size() + lists.zbuffer.entries.size()) * 4;
  add_to_stats(total, stats);
  stats.test_ms += watch.lap();
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
  KernelSamples kernel_samples = make_kernel_samples(samples, bound);
  ClosedComponents closed;
  certify(mesh, config, closed, kernel_samples, stats);
  stats.build_ms += watch.lap();
  std::vector<LightViewCells> views = make_light_views(bound, samples, receivers, config.grid_resolution);
  stats.index_ms += watch.lap();
  for (std::size_t i = 0; i < views.size(); ++i) {
    solve_view(mesh, receivers, kernel_samples, std::move(views[i]), config, {i, views.size()}, masks, stats);
  }
}

}  // namespace halfshade
