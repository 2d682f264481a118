#include "shadows/blocker_tree.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "rasterizer/core/parallel.h"

namespace halfshade {
namespace {

constexpr std::uint32_t kWidth = BlockerTree::kWidth;
constexpr std::size_t kBins = 16;
constexpr std::size_t kParallelFrom = 8192;  // triangles; smaller subtrees are built by one thread
/// Bounds are widened by this much (coordinates are below 4) against rounding of bounds and receivers to float.
constexpr double kBoundPad = 2e-6;

using Bounds = BlockerTree::Bounds;

struct Item {
  Bounds bounds;
  vec3 center{0.0f};
  std::uint32_t triangle = 0;
};

/// Binary tree before it is widened; a leaf has no children.
struct Branch {
  Bounds bounds;
  std::size_t begin = 0, end = 0;
  std::unique_ptr<Branch> left, right;
};

struct Split {
  int axis = -1;
  std::size_t bin = 0;
  float cost = 1e30f;
};

/// A leaf costs the same however full it is, so what counts is the number of leaves on either side.
float leaf_count(std::size_t items) { return static_cast<float>((items + kWidth - 1) / kWidth); }

std::size_t bin_of(const Item& item, const Bounds& centers, int axis) {
  const float extent = centers.high[axis] - centers.low[axis];
  const float place = (item.center[axis] - centers.low[axis]) / extent * static_cast<float>(kBins);
  return std::min(kBins - 1, static_cast<std::size_t>(place));
}

Split find_split(std::span<const Item> items, const Bounds& centers) {
  Split best;
  for (int axis = 0; axis < 3; ++axis) {
    if (!(centers.high[axis] > centers.low[axis])) continue;
    check_run();
    std::array<Bounds, kBins> bounds;
    std::array<std::size_t, kBins> counts{};
    for (const Item& item : items) {
      const std::size_t bin = bin_of(item, centers, axis);
      bounds[bin].add(item.bounds);
      ++counts[bin];
    }
    std::array<float, kBins> right_cost{};
    Bounds right;
    std::size_t right_count = 0;
    for (std::size_t bin = kBins - 1; bin > 0; --bin) {
      right.add(bounds[bin]);
      right_cost[bin] = right.area() * leaf_count(right_count += counts[bin]);
    }
    Bounds left;
    std::size_t left_count = 0;
    for (std::size_t bin = 1; bin < kBins; ++bin) {
      left.add(bounds[bin - 1]);
      left_count += counts[bin - 1];
      if (left_count == 0 || left_count == items.size()) continue;
      const float cost = left.area() * leaf_count(left_count) + right_cost[bin];
      if (cost < best.cost) best = {axis, bin, cost};
    }
  }
  return best;
}

std::unique_ptr<Branch> build(std::span<Item> items, std::size_t begin) {
  auto branch = std::make_unique<Branch>();
  branch->begin = begin, branch->end = begin + items.size();
  Bounds centers;
  for (const Item& item : items) branch->bounds.add(item.bounds), centers.add(item.center);
  check_run();
  if (items.size() <= kWidth) return branch;
  const Split split = find_split(items, centers);
  auto middle = items.begin() + static_cast<std::ptrdiff_t>(items.size() / 2);  // all centres equal: halve the run
  if (split.axis >= 0) {
    middle = std::stable_partition(items.begin(), items.end(),
                                   [&](const Item& item) { return bin_of(item, centers, split.axis) < split.bin; });
  }
  const auto count = static_cast<std::size_t>(middle - items.begin());
  const auto left = [&] { branch->left = build(items.first(count), begin); };
  const auto right = [&] { branch->right = build(items.subspan(count), begin + count); };
  if (items.size() >= kParallelFrom) {
    parallel_pair(left, right);
  } else {
    left();
    right();
  }
  return branch;
}

/// Children of a wide node: the widest branches are opened until there are 16, or all are leaves.
std::vector<const Branch*> widen(const Branch& branch) {
  std::vector<const Branch*> children = {&branch};
  while (children.size() < kWidth) {
    const Branch** widest = nullptr;
    for (const Branch*& child : children) {
      if (child->left && (widest == nullptr || child->bounds.area() > (*widest)->bounds.area())) widest = &child;
    }
    if (widest == nullptr) break;
    const Branch* opened = *widest;
    *widest = opened->left.get();
    children.push_back(opened->right.get());
  }
  return children;
}

std::uint32_t flatten(const Branch& branch, BlockerTree& tree) {
  const auto index = static_cast<std::uint32_t>(tree.nodes.size());
  tree.nodes.emplace_back();
  check_run();
  const std::vector<const Branch*> children = widen(branch);
  tree.nodes[index].count = static_cast<std::uint32_t>(children.size());
  for (std::uint32_t i = 0; i < children.size(); ++i) {
    const Branch& child = *children[i];
    std::uint32_t reference = 0;
    if (child.left) {
      reference = flatten(child, tree);
    } else {
      reference = static_cast<std::uint32_t>(tree.leaves.size()) | BlockerTree::kLeafBit;
      BlockerTree::Leaf& leaf = tree.leaves.emplace_back();
      leaf.first = static_cast<std::uint32_t>(child.begin);
      leaf.count = static_cast<std::uint32_t>(child.end - child.begin);
    }
    tree.nodes[index].child[i] = reference;
  }
  return index;
}

/// What does not depend on a light; lanes beyond the last repeat it.
void set_lane(const LatticeMesh& mesh, std::uint32_t triangle, std::uint32_t lane, BlockerTree::Leaf& leaf,
              std::uint32_t& vertices) {
  const std::array<vec3, 3> corner = mesh.corners(triangle);
  for (int k = 0; k < 3; ++k) {
    std::uint32_t v = 0;
    while (v < vertices && vec3(leaf.vertex[0][v], leaf.vertex[1][v], leaf.vertex[2][v]) != corner[k]) ++v;
    for (int axis = 0; axis < 3; ++axis) leaf.corner[k][axis][lane] = leaf.vertex[axis][v] = corner[k][axis];
    leaf.corner_vertex[k][lane] = static_cast<std::uint8_t>(v);
    vertices = std::max(vertices, v + 1);
  }
  leaf.triangle[lane] = triangle;
}

void set_edges(std::uint32_t lane, BlockerTree::Leaf& leaf, std::uint32_t& edges) {
  for (int k = 0; k < 3; ++k) {
    const std::uint8_t a = leaf.corner_vertex[k][lane], b = leaf.corner_vertex[(k + 1) % 3][lane];
    std::uint32_t e = 0;
    const auto is = [&](std::uint8_t from, std::uint8_t to) {
      return leaf.edge_vertex[0][e] == from && leaf.edge_vertex[1][e] == to;
    };
    while (e < edges && !is(a, b) && !is(b, a)) ++e;
    if (e == edges) leaf.edge_vertex[0][e] = a, leaf.edge_vertex[1][e] = b, ++edges;
    leaf.corner_edge[k][lane] = static_cast<std::uint8_t>(e | (is(a, b) ? 0 : BlockerTree::kReversed));
  }
}

void fill_lanes(const LatticeMesh& mesh, const BlockerTree& tree, BlockerTree::Leaf& leaf) {
  std::uint32_t vertices = 0, edges = 0;
  leaf.perforated = 0;
  for (std::uint32_t lane = 0; lane < kWidth; ++lane) {
    set_lane(mesh, tree.order[leaf.first + std::min(lane, leaf.count - 1)], lane, leaf, vertices);
    set_edges(lane, leaf, edges);
    leaf.perforated |= std::uint32_t{lane < leaf.count && mesh.alpha_map(leaf.triangle[lane]) != kNone} << lane;
  }
  leaf.vertices = vertices;
}

void fill_leaf(const KernelSamples& samples, BlockerTree& tree, BlockerTree::Leaf& leaf) {
  leaf.samples_above = leaf.samples_below = leaf.back_faces_only = 0;
  leaf.box_low = vec3(1e30f), leaf.box_high = vec3(-1e30f);
  for (std::uint32_t lane = 0; lane < kWidth; ++lane) {
    const std::uint32_t place = leaf.first + std::min(lane, leaf.count - 1);  // unused lanes repeat the last triangle
    if (lane < leaf.count) {
      std::array<vec3, 3> corners;
      for (int k = 0; k < 3; ++k)
        corners[k] = {leaf.corner[k][0][lane], leaf.corner[k][1][lane], leaf.corner[k][2][lane]};
      tree.blockers[place] = make_blocker(corners, (leaf.perforated >> lane) & 1, samples, leaf.triangle[lane]);
    }
    const Blocker& b = tree.blockers[place];
    for (int k = 0; k < 3; ++k) leaf.normal[k][lane] = b.normal[k];
    leaf.side_error[lane] = b.side_error;
    leaf.samples_above |= std::uint32_t{b.samples_above} << lane;
    leaf.samples_below |= std::uint32_t{b.samples_below} << lane;
    if (!b.back_faces_only) continue;
    leaf.back_faces_only |= 1u << lane;
    leaf.box_low = glm::min(leaf.box_low, b.box_low), leaf.box_high = glm::max(leaf.box_high, b.box_high);
  }
}

Bounds leaf_bounds(const LightFrame& frame, const BlockerTree::Leaf& leaf) {
  Bounds bounds;
  for (std::uint32_t v = 0; v < leaf.vertices; ++v) {
    const dvec3 q = frame.to_frame(dvec3(leaf.vertex[0][v], leaf.vertex[1][v], leaf.vertex[2][v]));
    bounds.add(vec3(q - kBoundPad));
    bounds.add(vec3(q + kBoundPad));
  }
  return bounds;
}

}  // namespace

std::size_t BlockerTree::bytes() const {
  return order.size() * sizeof(order[0]) + leaves.size() * sizeof(Leaf) + nodes.size() * sizeof(Node) +
         blockers.size() * sizeof(Blocker) + alpha.size() * sizeof(AlphaTriangle);
}

void build_blocker_tree(const LatticeMesh& mesh, BlockerTree& tree) {
  std::vector<Item> items(mesh.triangles.size());
  parallel_ranges(items.size(), 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) {
      items[i].triangle = static_cast<std::uint32_t>(i);
      for (const vec3& p : mesh.corners(items[i].triangle)) items[i].bounds.add(p);
      items[i].center = (items[i].bounds.low + items[i].bounds.high) * 0.5f;
    }
  });
  tree.nodes.clear(), tree.leaves.clear(), tree.order.clear();
  if (items.empty()) return;
  flatten(*build(items, 0), tree);
  tree.order.reserve(items.size());
  for (const Item& item : items) tree.order.push_back(item.triangle);
  place_blockers(mesh, tree);
}

void place_blockers(const LatticeMesh& mesh, BlockerTree& tree) {
  parallel_ranges(tree.leaves.size(), 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) fill_lanes(mesh, tree, tree.leaves[i]);
  });
}

void refit_blocker_tree(const LatticeMesh& mesh, const KernelSamples& samples, const LightFrame& frame,
                        BlockerTree& tree) {
  tree.blockers.resize(tree.order.size());
  std::vector<Bounds>&leaf_box = tree.leaf_box, &node_box = tree.node_box;
  leaf_box.resize(tree.leaves.size());
  node_box.assign(tree.nodes.size(), {});
  parallel_ranges(tree.leaves.size(), 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) {
      fill_leaf(samples, tree, tree.leaves[i]);
      leaf_box[i] = leaf_bounds(frame, tree.leaves[i]);
    }
  });
  std::size_t perforated = 0;
  for (const BlockerTree::Leaf& leaf : tree.leaves)
    perforated += static_cast<std::size_t>(std::popcount(leaf.perforated));
  tree.alpha.clear();
  tree.alpha.reserve(perforated);  // blockers point into it
  for (const BlockerTree::Leaf& leaf : tree.leaves) {
    for (std::uint32_t rest = leaf.perforated; rest != 0; rest &= rest - 1) {
      Blocker& b = tree.blockers[leaf.first + static_cast<std::uint32_t>(std::countr_zero(rest))];
      b.alpha = &tree.alpha.emplace_back(make_alpha_triangle(mesh, b.triangle));
    }
  }
  for (std::size_t n = tree.nodes.size(); n-- > 0;) {
    BlockerTree::Node& node = tree.nodes[n];
    for (std::uint32_t i = 0; i < kWidth; ++i) {
      Bounds box;  // empty for unused children: no shaft meets it
      if (i < node.count) {
        const std::uint32_t child = node.child[i];
        box = child & BlockerTree::kLeafBit ? leaf_box[child & ~BlockerTree::kLeafBit] : node_box[child];
        node_box[n].add(box);
      }
      for (int axis = 0; axis < 3; ++axis) node.low[axis][i] = box.low[axis], node.high[axis][i] = box.high[axis];
    }
  }
}

}  // namespace halfshade
