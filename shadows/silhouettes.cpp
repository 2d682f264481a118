#include "shadows/silhouettes.h"

#include <algorithm>
#include <atomic>
#include <bit>

#include "rasterizer/core/parallel.h"
#include "rasterizer/core/predicate.h"
#include "shadows/influence_region.h"
#include "shadows/visibility_pair.h"

namespace halfshade {
namespace {

constexpr std::uint32_t kFewTriangles = 64;                  // smaller components are not worth a stencil
constexpr std::size_t kStencilBytes = std::size_t{1} << 26;  // at most, per view; further components go without

bool settled(std::span<const EdgeUse> edge, const LightFacing& facing) {
  const std::int8_t first = facing.of_triangle[edge[0].triangle];
  return first != 0 && std::all_of(edge.begin(), edge.end(),
                                   [&](const EdgeUse& use) { return facing.of_triangle[use.triangle] == first; });
}

/// The own triangle of receiver `i` if it is one of a closed component and shows its back; else kNone.
std::uint32_t own_from_behind(const LatticeMesh& mesh, const KernelSamples& samples, const KernelReceivers& receivers,
                              std::size_t i) {
  const std::uint32_t own = receivers.own[i];
  if (own == kNone || samples.closed->of_triangle[own] == kNone) return kNone;
  const auto [a, b, c] = mesh.corners(own);
  return orient3d(a, b, c, {receivers.x[i], receivers.y[i], receivers.z[i]}) > 0 ? own : kNone;
}

}  // namespace

LightFacing find_facing(const LatticeMesh& mesh, const KernelSamples& samples) {
  LightFacing facing;
  facing.of_triangle.resize(mesh.triangles.size());
  parallel_ranges(mesh.triangles.size(), 2048, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t != end; ++t) {
      const Blocker b = make_blocker(mesh, samples, static_cast<std::uint32_t>(t));
      facing.of_triangle[t] = b.all_above ? 1 : (b.all_below ? -1 : 0);
    }
  });
  return facing;
}

SilhouetteEdges find_silhouette_edges(const LatticeMesh& mesh, const KernelSamples& samples, const LightFacing& facing,
                                      std::span<const EdgeUse> uses) {
  SilhouetteEdges result;
  const std::vector<std::uint32_t>& component = samples.closed->of_triangle;
  std::vector<std::uint32_t> size(samples.closed->boxes.size(), 0);
  for (const std::uint32_t c : component) {
    if (c != kNone) ++size[c];
  }
  result.wanted.resize(size.size());
  for (std::size_t c = 0; c < size.size(); ++c) {
    result.wanted[c] = samples.closed_usable[c] != 0 && size[c] >= kFewTriangles;
  }
  for_each_edge(uses, [&](std::span<const EdgeUse> edge) {
    const std::uint32_t c = component[edge[0].triangle];
    if (c == kNone || !result.wanted[c]) return;
    ++result.total;
    if (settled(edge, facing)) return;
    const auto& corners = mesh.triangles[edge[0].triangle];
    result.edges.push_back({c, corners[edge[0].corner], corners[(edge[0].corner + 1u) % 3]});
  });
  return result;
}

PenumbraStencils::PenumbraStencils(const LightLists& lists, const SilhouetteEdges& silhouettes,
                                   const std::vector<dvec3>& view_positions) {
  if (!lists.view.has_receivers) return;
  words_per_stencil_ = (lists.tiles.size() + 63) / 64;
  std::uint32_t slots = 0;
  for (const std::uint8_t wanted : silhouettes.wanted) {
    const bool fits = wanted && (slots + 1) * words_per_stencil_ * 8 <= kStencilBytes;
    slot_.push_back(fits ? slots++ : kNone);
  }
  words_.assign(slots * words_per_stencil_, 0);
  parallel_ranges(silhouettes.edges.size(), 256, [&](std::size_t begin, std::size_t end) {
    InfluenceRegion region;
    for (std::size_t i = begin; i != end; ++i) {
      const SilhouetteEdges::Edge& edge = silhouettes.edges[i];
      if (slot_[edge.component] == kNone) continue;
      const dvec3 a = view_positions[edge.a], b = view_positions[edge.b];
      find_influence_region(lists.view, {a, b, b}, region);
      for_each_run(lists.view, region, [&](std::uint32_t row, std::uint32_t first, std::uint32_t last) {
        for (std::size_t t = lists.tile_index(row, first); t <= lists.tile_index(row, last); ++t)
          mark(edge.component, t);
      });
    }
  });
}

void PenumbraStencils::mark(std::uint32_t component, std::size_t tile) {
  std::uint64_t& word = words_[slot_[component] * words_per_stencil_ + tile / 64];
  const std::uint64_t bit = std::uint64_t{1} << (tile % 64);
  const std::atomic_ref<std::uint64_t> shared(word);
  if ((shared.load(std::memory_order_relaxed) & bit) == 0) shared.fetch_or(bit, std::memory_order_relaxed);
}

double PenumbraStencils::penumbra_share() const {
  std::uint64_t set = 0;
  for (const std::uint64_t word : words_) set += static_cast<std::uint64_t>(std::popcount(word));
  return words_.empty() ? 0.0 : static_cast<double>(set) / (64.0 * static_cast<double>(words_.size()));
}

void test_one_sample(const LatticeMesh& mesh, const KernelSamples& samples, const vec3& sample,
                     std::span<const BlockerSpan> spans, const KernelReceivers& receivers, std::size_t block,
                     SettledReceivers& settled, KernelCounters& counters) {
  for (const BlockerSpan& span : spans) {
    const auto [a, b, c] = mesh.corners(span.triangle);
    const bool from_front = orient3d(a, b, c, sample) > 0;  // the sample is behind the plane, a hidden receiver before
    const std::uint32_t component = samples.closed->of_triangle[span.triangle];
    counters.pairs_tested += span.end - span.begin;
    for (std::uint32_t i = span.begin; i < span.end; ++i) {
      if (settled.hidden[i] != 0) continue;
      if (!blocks(a, b, c, {receivers.x[i], receivers.y[i], receivers.z[i]}, sample)) continue;
      if (from_front) {
        settled.from_front[block].emplace_back(component, i);
        continue;
      }
      const std::uint32_t own = own_from_behind(mesh, samples, receivers, i);
      if (own == kNone || samples.closed->of_triangle[own] != component) settled.hidden[i] = 1;
    }
  }
}

void mark_undecided(const LatticeMesh& mesh, const KernelSamples& samples, const LightLists& lists,
                    const KernelReceivers& receivers, const SettledReceivers& settled, PenumbraStencils& stencils) {
  std::vector<std::uint32_t> tile_of(lists.blocks.back().list_begin);
  for (std::size_t t = 0; t < lists.tiles.size(); ++t) {
    const auto [begin, end] = lists.tile_range(t);
    std::fill(tile_of.begin() + begin, tile_of.begin() + end, static_cast<std::uint32_t>(t));
  }
  for (const auto& pairs : settled.from_front) {
    for (const auto& [component, i] : pairs) {
      if (settled.hidden[i] == 0) stencils.mark(component, tile_of[i]);
    }
  }
  for (std::size_t i = 0; i < tile_of.size(); ++i) {
    const std::uint32_t own = own_from_behind(mesh, samples, receivers, i);
    if (own == kNone) continue;
    const std::uint32_t component = samples.closed->of_triangle[own];
    if (stencils.has(component)) stencils.mark(component, tile_of[i]);
  }
}

}  // namespace halfshade
