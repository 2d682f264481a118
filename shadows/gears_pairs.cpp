#include "shadows/gears_pairs.h"

#include <algorithm>

#include "rasterizer/core/radix_sort.h"
#include "shadows/closed_components.h"
#include "shadows/visibility_pair.h"

namespace halfshade {
namespace {

constexpr std::size_t kGrain = 256;  // blockers

}  // namespace

GearsAssigner::GearsAssigner(const LatticeMesh& mesh, const KernelSamples& samples, const GearsGrid& grid,
                             const GearsOptions& options)
    : mesh_(mesh), samples_(samples), grid_(grid), options_(options), projector_(grid) {
  view_positions_.resize(mesh.positions.size());
  parallel_ranges(view_positions_.size(), 8192, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) view_positions_[i] = grid.view.to_view(dvec3(mesh.positions[i]));
  });
}

void GearsAssigner::project(std::uint32_t triangle, bool with_hull, GearsBlocker& blocker) const {
  const auto& index = mesh_.triangles[triangle];
  projector_.project({view_positions_[index[0]], view_positions_[index[1]], view_positions_[index[2]]}, with_hull,
                     blocker);
  blocker.boxed = false;
  if (blocker.kind != InfluenceRegion::Kind::kRows || samples_.closed == nullptr) return;
  const std::uint32_t component = samples_.closed->of_triangle[triangle];
  if (component == kNone || !samples_.closed_usable[component]) return;
  // Certified blockers with the whole light behind them hide it from receivers inside their component's box only.
  const Blocker certified = make_blocker(mesh_, samples_, triangle);
  if (!certified.all_below) return;
  blocker.boxed = true;
  blocker.box_low = certified.box_low, blocker.box_high = certified.box_high;
}

template <class Take>
void GearsAssigner::visit(const GearsBlocker& blocker, const Take& take) const {
  visit_nodes(grid_, blocker, options_.coarse, [&](std::uint32_t index) {
    if (options_.refine) {
      const GearsNode& node = grid_.nodes[index];
      const auto first = grid_.position.begin() + node.begin, last = grid_.position.begin() + node.end;
      if (std::none_of(first, last, [&](const dvec3& p) { return projector_.in_frustum(blocker, p); })) return;
    }
    take(index);
  });
}

/// How many receivers lie in the box, the hull and the frustum around the blocker's shadow volume (section 5.3).
void GearsAssigner::study(std::uint32_t triangle, GearsBlocker& blocker, GearsDemand& demand) const {
  std::vector<dvec3> edges;
  std::swap(edges, blocker.edges);  // nodes by the box alone
  const auto count = [&](std::uint32_t index) {
    const GearsNode& node = grid_.nodes[index];
    for (std::uint32_t i = node.begin; i < node.end; ++i) {
      const dvec2 image = grid_.camera.image(grid_.position[i]);
      if (image.x < blocker.low.x || image.x > blocker.high.x || image.y < blocker.low.y || image.y > blocker.high.y)
        continue;
      ++demand.in_box[triangle];
      demand.in_hull[triangle] += in_hull(edges, image);
      demand.in_frustum[triangle] += projector_.in_frustum(blocker, grid_.position[i]);
    }
  };
  visit_nodes(grid_, blocker, true, count);
  std::swap(edges, blocker.edges);
}

GearsDemand GearsAssigner::count() const {
  const std::size_t triangles = mesh_.triangles.size();
  GearsDemand demand;
  if (options_.study) {
    for (auto* counts : {&demand.in_box, &demand.in_hull, &demand.in_frustum}) counts->assign(triangles, 0);
  }
  std::vector<std::uint32_t> counts(triangles, 0);
  parallel_ranges(triangles, kGrain, [&](std::size_t begin, std::size_t end) {
    GearsBlocker blocker;
    for (std::size_t t = begin; t != end; ++t) {
      const auto triangle = static_cast<std::uint32_t>(t);
      project(triangle, options_.region == GearsRegion::kHull || options_.study, blocker);
      if (blocker.kind == InfluenceRegion::Kind::kEverywhere) counts[t] = GearsDemand::kEverywhere;
      if (blocker.kind != InfluenceRegion::Kind::kRows) continue;
      if (options_.study) study(triangle, blocker, demand);
      if (options_.region == GearsRegion::kBox) blocker.edges.clear();
      visit(blocker, [&](std::uint32_t) { ++counts[t]; });
      if (counts[t] > options_.pair_budget) counts[t] = GearsDemand::kEverywhere;
    }
  });
  for (std::uint32_t t = 0; t < triangles; ++t) {
    if (counts[t] == GearsDemand::kEverywhere) {
      demand.everywhere.push_back(t);
    } else if (counts[t] != 0) {
      demand.touching.push_back(t);
      demand.count.push_back(counts[t]);
    }
  }
  return demand;
}

void GearsAssigner::assign(std::span<const std::uint32_t> blockers, std::span<const std::uint32_t> counts,
                           GearsPairs& pairs) const {
  exclusive_scan({counts.begin(), counts.end()}, pairs.start);
  pairs.pairs.resize(pairs.start.back());
  parallel_ranges(blockers.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    GearsBlocker blocker;
    for (std::size_t b = begin; b != end; ++b) {
      project(blockers[b], options_.region == GearsRegion::kHull, blocker);
      std::uint32_t next = pairs.start[b];
      visit(blocker, [&](std::uint32_t node) { pairs.pairs[next++] = {node, static_cast<std::uint32_t>(b)}; });
    }
  });
  const auto node_count = static_cast<std::uint32_t>(grid_.nodes.size());
  parallel_radix_sort(pairs.pairs, pairs.scratch, node_count, [](const GearsPair& pair) { return pair.node; });
  pairs.offsets.assign(node_count + 1, 0);
  for (const GearsPair& pair : pairs.pairs) ++pairs.offsets[pair.node + 1];
  for (std::size_t n = 0; n < node_count; ++n) pairs.offsets[n + 1] += pairs.offsets[n];
}

}  // namespace halfshade
