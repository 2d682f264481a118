#include "shadows/closed_components.h"

#include <algorithm>
#include <atomic>
#include <numeric>

#include <glm/vector_relational.hpp>

#include "rasterizer/core/parallel.h"
#include "rasterizer/core/predicate.h"
#include "shadows/receivers.h"

namespace halfshade {
namespace {

/// Equal positions get equal numbers.
std::vector<std::uint32_t> weld(const std::vector<vec3>& positions) {
  std::vector<std::uint32_t> order(positions.size()), number(positions.size());
  std::iota(order.begin(), order.end(), 0u);
  const auto before = [&](std::uint32_t a, std::uint32_t b) {
    const vec3 &p = positions[a], &q = positions[b];
    return p.x != q.x ? p.x < q.x : (p.y != q.y ? p.y < q.y : p.z < q.z);
  };
  parallel_sort(order, before);
  for (std::size_t i = 0; i < order.size(); ++i) {
    if (i % 65536 == 0) check_run();
    const bool same = i > 0 && positions[order[i]] == positions[order[i - 1]];
    number[order[i]] = same ? number[order[i - 1]] : static_cast<std::uint32_t>(i);
  }
  return number;
}

std::vector<EdgeUse> collect_edges(const LatticeMesh& mesh, const std::vector<std::uint32_t>& number) {
  std::vector<EdgeUse> uses;
  uses.reserve(mesh.triangles.size() * 3);
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    if (t % 16384 == 0) check_run();
    for (int k = 0; k < 3; ++k) {
      const std::uint32_t a = number[mesh.triangles[t][k]], b = number[mesh.triangles[t][(k + 1) % 3]];
      if (a == b) continue;
      const std::uint64_t low = std::min(a, b), high = std::max(a, b);
      uses.push_back({low << 32 | high, t, static_cast<std::int16_t>(a < b ? 1 : -1), static_cast<std::uint16_t>(k)});
    }
  }
  parallel_sort(uses, [](const EdgeUse& a, const EdgeUse& b) {
    return a.edge != b.edge ? a.edge < b.edge
                            : (a.triangle != b.triangle ? a.triangle < b.triangle : a.corner < b.corner);
  });
  return uses;
}

class DisjointSets {
 public:
  explicit DisjointSets(std::size_t count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), 0u); }
  std::uint32_t find(std::uint32_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void join(std::uint32_t a, std::uint32_t b) {
    a = find(a), b = find(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<std::uint32_t> parent_;
};

}  // namespace

ClosedComponents find_closed_components(const LatticeMesh& mesh, std::vector<EdgeUse>* edges,
                                        std::vector<std::uint32_t>* welded) {
  const std::size_t count = mesh.triangles.size();
  std::vector<std::uint32_t> number = weld(mesh.positions);
  std::vector<EdgeUse> uses = collect_edges(mesh, number);
  DisjointSets sets(count);
  for_each_edge(uses, [&](std::span<const EdgeUse> edge) {
    for (const EdgeUse& use : edge) sets.join(edge[0].triangle, use.triangle);
  });
  const auto for_triangles = [count](const auto& visit) {
    checked_ranges(count, 65536, [&](std::size_t begin, std::size_t end) {
      for (std::size_t t = begin; t != end; ++t) visit(static_cast<std::uint32_t>(t));
    });
  };
  std::vector<std::uint8_t> open(count, 0);  // [root]
  for_each_edge(uses, [&](std::span<const EdgeUse> edge) {
    std::int32_t balance = 0;
    for (const EdgeUse& use : edge) balance += use.direction;
    if (balance != 0) open[sets.find(edge[0].triangle)] = 1;
  });
  for_triangles([&](std::uint32_t t) {
    if (mesh.alpha_map(t) != kNone) open[sets.find(t)] = 1;
  });
  ClosedComponents result;
  result.of_triangle.assign(count, kNone);
  std::vector<std::uint32_t> box_of_root(count, kNone);
  for_triangles([&](std::uint32_t t) {
    const std::uint32_t root = sets.find(t);
    result.components += root == t;
    if (open[root]) return;
    const auto corners = mesh.corners(t);
    if (box_of_root[root] == kNone) {
      box_of_root[root] = static_cast<std::uint32_t>(result.boxes.size());
      result.boxes.push_back({corners[0], corners[0]});
    }
    result.of_triangle[t] = box_of_root[root];
    ClosedComponents::Box& box = result.boxes[box_of_root[root]];
    for (const vec3& p : corners) box = {glm::min(box.low, p), glm::max(box.high, p)};
  });
  if (edges != nullptr) *edges = std::move(uses);
  if (welded != nullptr) *welded = std::move(number);
  return result;
}

namespace {

/// See certify.
void withdraw_certificates(const LatticeMesh& mesh, const ReceiverArray& receivers, KernelSamples& samples) {
  parallel_ranges(receivers.size(), 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) {
      const std::uint32_t own = receivers.triangle[i];
      const std::uint32_t c = own == kNone ? kNone : samples.closed->of_triangle[own];
      if (c == kNone) continue;
      const vec3& r = receivers.position[i];
      const ClosedComponents::Box& box = samples.closed->boxes[c];
      if (glm::all(glm::lessThanEqual(box.low, r)) && glm::all(glm::lessThanEqual(r, box.high))) continue;
      const auto [p, q, s] = mesh.corners(own);
      if (orient3d(p, q, s, r) > 0) {  // behind the triangle, along its normal
        std::atomic_ref(samples.closed_usable[c]).store(0, std::memory_order_relaxed);
      }
    }
  });
}

}  // namespace

void apply_certificates(const LatticeMesh& mesh, const ReceiverArray& receivers, const ClosedComponents& closed,
                        KernelSamples& samples, ShadowStats& stats) {
  use_certificate(closed, samples);
  withdraw_certificates(mesh, receivers, samples);
  checked_ranges(closed.of_triangle.size(), 65536, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t != end; ++t) {
      const std::uint32_t c = closed.of_triangle[t];
      stats.certified_blockers += c != kNone && samples.closed_usable[c] != 0;
    }
  });
}

void certify(const LatticeMesh& mesh, const ReceiverArray& receivers, const ShadowConfig& config,
             ClosedComponents& closed, KernelSamples& samples, ShadowStats& stats, std::vector<EdgeUse>* edges) {
  if (!config.back_face_casters) return;
  closed = find_closed_components(mesh, edges);
  apply_certificates(mesh, receivers, closed, samples, stats);
}

}  // namespace halfshade
