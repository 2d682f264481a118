#include "shadows/blocker_tree.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <memory>

#include "rasterizer/core/parallel.h"
#include "rasterizer/core/reuse.h"
#include "shadows/closed_components.h"

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
  std::size_t begin = 0, end = 0, leaves = 1;
  std::unique_ptr<Branch> left, right;

  bool is_group() const { return leaves <= kWidth; }
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

/// visit(item) for all, in order; the call can be stopped meanwhile.
template <class Items, class Visit>
void for_items(const Items& items, const Visit& visit) {
  checked_ranges(items.size(), 16384, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) visit(items[i]);
  });
}

Split find_split(std::span<const Item> items, const Bounds& centers) {
  Split best;
  for (int axis = 0; axis < 3; ++axis) {
    if (!(centers.high[axis] > centers.low[axis])) continue;
    std::array<Bounds, kBins> bounds;
    std::array<std::size_t, kBins> counts{};
    for_items(items, [&](const Item& item) {
      const std::size_t bin = bin_of(item, centers, axis);
      bounds[bin].add(item.bounds);
      ++counts[bin];
    });
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

/// As std::stable_partition, which would get itself new scratch each time; the number of items for which `goes_left`.
template <class GoesLeft>
std::size_t partition(std::span<Item> items, std::span<Item> scratch, const GoesLeft& goes_left) {
  std::size_t left = 0, right = 0;
  for_items(items, [&](const Item& item) { (goes_left(item) ? items[left++] : scratch[right++]) = item; });
  const std::span<Item> rest = items.subspan(left);
  checked_ranges(right, 16384, [&](std::size_t begin, std::size_t end) {
    std::copy_n(scratch.begin() + static_cast<std::ptrdiff_t>(begin), end - begin,
                rest.begin() + static_cast<std::ptrdiff_t>(begin));
  });
  return left;
}

std::unique_ptr<Branch> build(std::span<Item> items, std::span<Item> scratch, std::size_t begin) {
  auto branch = std::make_unique<Branch>();
  branch->begin = begin, branch->end = begin + items.size();
  Bounds centers;
  for_items(items, [&](const Item& item) { branch->bounds.add(item.bounds), centers.add(item.center); });
  if (items.size() <= kWidth) return branch;
  const Split split = find_split(items, centers);
  std::size_t count = items.size() / 2;  // all centres equal: halve the run
  if (split.axis >= 0) {
    count = partition(items, scratch, [&](const Item& item) { return bin_of(item, centers, split.axis) < split.bin; });
  }
  const auto left = [&] { branch->left = build(items.first(count), scratch.first(count), begin); };
  const auto right = [&] { branch->right = build(items.subspan(count), scratch.subspan(count), begin + count); };
  if (items.size() >= kParallelFrom) {
    parallel_pair(left, right);
  } else {
    left();
    right();
  }
  branch->leaves = branch->left->leaves + branch->right->leaves;
  return branch;
}

/// Children of a wide node: the widest branches are opened until there are 16, or all are groups; a group's are its
/// leaves.
std::vector<const Branch*> widen(const Branch& branch) {
  std::vector<const Branch*> children = {&branch};
  while (children.size() < kWidth) {
    const Branch** widest = nullptr;
    for (const Branch*& child : children) {
      if (!child->left || (child->is_group() && !branch.is_group())) continue;
      if (widest == nullptr || child->bounds.area() > (*widest)->bounds.area()) widest = &child;
    }
    if (widest == nullptr) break;
    const Branch* opened = *widest;
    *widest = opened->left.get();
    children.push_back(opened->right.get());
  }
  return children;
}

std::uint32_t flatten_group(const Branch& branch, BlockerTree& tree) {
  const auto index = static_cast<std::uint32_t>(tree.nodes.size());
  BlockerTree::Node& node = tree.nodes.emplace_back();
  node.is_group = true;
  for (const Branch* child : widen(branch)) {
    node.child[node.count++] = static_cast<std::uint32_t>(tree.leaves.size()) | BlockerTree::kLeafBit;
    BlockerTree::Leaf& leaf = tree.leaves.emplace_back();
    leaf.first = static_cast<std::uint32_t>(child->begin);
    leaf.count = static_cast<std::uint32_t>(child->end - child->begin);
  }
  return index;
}

/// A node for a branch that is no group, or the root.
std::uint32_t flatten(const Branch& branch, BlockerTree& tree) {
  const auto index = static_cast<std::uint32_t>(tree.nodes.size());
  tree.nodes.emplace_back();
  check_run();
  const std::vector<const Branch*> children = branch.is_group() ? std::vector{&branch} : widen(branch);
  tree.nodes[index].count = static_cast<std::uint32_t>(children.size());
  for (std::uint32_t i = 0; i < children.size(); ++i) {
    const std::uint32_t child =
        children[i]->is_group() ? flatten_group(*children[i], tree) : flatten(*children[i], tree);
    tree.nodes[index].child[i] = child;
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
  const BlockerPlane plane = plane_of(corner);
  for (int axis = 0; axis < 3; ++axis) leaf.normal[axis][lane] = plane.normal[axis];
  leaf.side_error[lane] = plane.side_error;
}

void fill_lanes(const LatticeMesh& mesh, BlockerTree& tree, std::uint32_t index) {
  BlockerTree::Leaf& leaf = tree.leaves[index];
  std::uint32_t vertices = 0;
  leaf.perforated = 0;
  for (std::uint32_t lane = 0; lane < kWidth; ++lane) {
    set_lane(mesh, tree.order[leaf.first + std::min(lane, leaf.count - 1)], lane, leaf, vertices);
    if (lane >= leaf.count) continue;
    tree.place[leaf.triangle[lane]] = kWidth * index + lane;
    leaf.perforated |= std::uint32_t{mesh.alpha_map(leaf.triangle[lane]) != kNone} << lane;
  }
  leaf.vertices = vertices;
}

/// Finds equal keys again; for as many as a group may have corners.
template <class Key>
class SmallMap {
 public:
  static constexpr std::uint32_t kSlots = 2048;
  SmallMap() { slots_.fill(kNone); }

  /// The number that equal keys got, else `next`.
  template <class KeyOf>
  std::uint32_t& find(const Key& key, std::uint64_t hash, const KeyOf& key_of) {
    std::uint32_t at = static_cast<std::uint32_t>((hash * 0x9e3779b97f4a7c15u) >> 53);
    while (slots_[at] != kNone && !(key_of(slots_[at]) == key)) at = (at + 1) % kSlots;
    return slots_[at];
  }

 private:
  std::array<std::uint32_t, kSlots> slots_;
};

/// Vertices and edges of a group's triangles.
struct GroupMesh {
  static constexpr std::size_t kMost = 3 * BlockerTree::kGroupSlots;
  std::array<vec3, kMost> vertex;
  std::array<BlockerTree::Edge, kMost> edge;
  std::uint32_t vertices = 0, edges = 0;
};

std::uint64_t hash_of(const vec3& p) {
  const auto x = std::bit_cast<std::uint32_t>(p.x), y = std::bit_cast<std::uint32_t>(p.y),
             z = std::bit_cast<std::uint32_t>(p.z);
  return (std::uint64_t{x} << 32 | y) ^ std::uint64_t{z} * 0xff51afd7ed558ccdu;
}

void trace_group(const BlockerTree& tree, const BlockerTree::Node& node, GroupMesh& group) {
  constexpr auto kNobody = static_cast<std::uint16_t>(BlockerTree::kGroupSlots);
  group.vertices = group.edges = 0;
  SmallMap<vec3> vertex_map;
  SmallMap<std::uint32_t> edge_map;
  for (std::uint32_t k = 0; k < node.count; ++k) {
    const BlockerTree::Leaf& leaf = tree.leaves[node.child[k] & ~BlockerTree::kLeafBit];
    std::array<std::uint16_t, 3 * kWidth> number;  // of the leaf's vertices in the group
    for (std::uint32_t v = 0; v < leaf.vertices; ++v) {
      const vec3 p{leaf.vertex[0][v], leaf.vertex[1][v], leaf.vertex[2][v]};
      std::uint32_t& found = vertex_map.find(p, hash_of(p), [&](std::uint32_t i) { return group.vertex[i]; });
      if (found == kNone) found = group.vertices, group.vertex[group.vertices++] = p;
      number[v] = static_cast<std::uint16_t>(found);
    }
    for (std::uint32_t lane = 0; lane < leaf.count; ++lane) {
      const auto triangle = static_cast<std::uint16_t>(kWidth * k + lane);
      for (std::size_t c = 0; c < 3; ++c) {
        const std::uint16_t a = number[leaf.corner_vertex[c][lane]], b = number[leaf.corner_vertex[(c + 1) % 3][lane]];
        if (a == b) continue;
        const std::uint16_t from = std::min(a, b), to = std::max(a, b);
        const std::uint32_t key = std::uint32_t{from} << 16 | to;
        std::uint32_t& found = edge_map.find(
            key, key, [&](std::uint32_t i) { return std::uint32_t{group.edge[i].from} << 16 | group.edge[i].to; });
        if (found != kNone) {
          std::uint16_t& side = a == from ? group.edge[found].left : group.edge[found].right;
          if (side == kNobody) {
            side = triangle;
            continue;
          }
        }
        found = group.edges;
        group.edge[group.edges++] = {from, to, a == from ? triangle : kNobody, a == from ? kNobody : triangle};
      }
    }
  }
}

/// Edges and vertices of all groups, one after another. Traced twice, to be counted and to be stored: so a mesh that
/// only moved needs no more memory.
void trace_groups(BlockerTree& tree) {
  const auto for_groups = [&tree](const auto& visit) {
    parallel_ranges(tree.nodes.size(), 4, [&](std::size_t begin, std::size_t end) {
      GroupMesh group;
      for (std::size_t n = begin; n != end; ++n) {
        if (!tree.nodes[n].is_group) continue;
        trace_group(tree, tree.nodes[n], group);
        visit(tree.nodes[n], group);
      }
    });
  };
  for_groups([](BlockerTree::Node& node, const GroupMesh& group) {
    node.edges = group.edges, node.vertices = group.vertices;
  });
  std::uint32_t edges = 0, vertices = 0;
  for (BlockerTree::Node& node : tree.nodes) {
    node.first_edge = edges, node.first_vertex = vertices;
    edges += node.edges, vertices += node.vertices;
  }
  resize_checked(tree.edges, edges), resize_checked(tree.vertices, vertices);
  for_groups([&tree](const BlockerTree::Node& node, const GroupMesh& group) {
    std::copy_n(group.edge.begin(), group.edges, tree.edges.begin() + node.first_edge);
    std::copy_n(group.vertex.begin(), group.vertices, tree.vertices.begin() + node.first_vertex);
  });
}

/// What a light makes of the lanes: the sides of their planes that samples lie on, and which certificates count.
void fit_leaf(const BlockerTree::Leaf& leaf, const KernelSamples& samples, BlockerFit::Leaf& fit) {
  fit.samples_above = fit.samples_below = fit.back_faces_only = 0;
  fit.box_low = vec3(1e30f), fit.box_high = vec3(-1e30f);
  for (std::uint32_t lane = 0; lane < kWidth; ++lane) {
    const SampleSides sides = sides_of_samples(leaf.plane_at(lane), leaf.corner_at(0, lane), samples);
    fit.samples_above |= std::uint32_t{sides.samples_above} << lane;
    fit.samples_below |= std::uint32_t{sides.samples_below} << lane;
    if (samples.closed == nullptr) continue;
    const std::uint32_t component = samples.closed->of_triangle[leaf.triangle[lane]];
    if (component == kNone || samples.closed_usable[component] == 0) continue;
    fit.back_faces_only |= 1u << lane;
    const ClosedComponents::Box& box = samples.closed->boxes[component];
    fit.box_low = glm::min(fit.box_low, box.low), fit.box_high = glm::max(fit.box_high, box.high);
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
  return (order.size() + place.size()) * sizeof(order[0]) + leaves.size() * sizeof(Leaf) + nodes.size() * sizeof(Node) +
         edges.size() * sizeof(Edge) + vertices.size() * sizeof(vec3) +
         (leaf_box.size() + node_box.size()) * sizeof(Bounds);
}

std::size_t BlockerFit::bytes() const {
  return nodes.size() * sizeof(BlockerTree::Node) + leaves.size() * sizeof(Leaf) +
         alpha.size() * sizeof(AlphaTriangle) + (leaf_box.size() + node_box.size()) * sizeof(Bounds);
}

Blocker blocker_at(const BlockerTree& tree, const BlockerFit& fit, std::size_t leaf, std::size_t lane,
                   const KernelSamples& samples) {
  const BlockerTree::Leaf& l = tree.leaves[leaf];
  const bool perforated = (l.perforated >> lane & 1) != 0;
  Blocker b = make_blocker({l.corner_at(0, lane), l.corner_at(1, lane), l.corner_at(2, lane)}, perforated, samples,
                           l.triangle[lane]);
  if (perforated) b.alpha = &fit.alpha_of(tree, leaf, lane);
  return b;
}

void build_blocker_tree(const LatticeMesh& mesh, BlockerTree& tree) {
  std::vector<Item> items, scratch;
  resize_checked(items, mesh.triangles.size()), resize_checked(scratch, items.size());
  parallel_ranges(items.size(), 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) {
      items[i].triangle = static_cast<std::uint32_t>(i);
      for (const vec3& p : mesh.corners(items[i].triangle)) items[i].bounds.add(p);
      items[i].center = (items[i].bounds.low + items[i].bounds.high) * 0.5f;
    }
  });
  tree.nodes.clear(), tree.leaves.clear(), tree.order.clear();
  if (items.empty()) return;
  const std::unique_ptr<Branch> root = build(items, scratch, 0);
  tree.leaves.reserve(root->leaves);
  flatten(*root, tree);
  resize_checked(tree.order, items.size());
  for (std::size_t i = 0; i < items.size(); ++i) tree.order[i] = items[i].triangle;
  place_blockers(mesh, tree);
}

void place_blockers(const LatticeMesh& mesh, BlockerTree& tree) {
  resize_checked(tree.place, tree.order.size());
  parallel_ranges(tree.leaves.size(), 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) fill_lanes(mesh, tree, static_cast<std::uint32_t>(i));
  });
  trace_groups(tree);
}

void fit_blocker_tree(const LatticeMesh& mesh, const BlockerTree& tree, const KernelSamples& samples,
                      const LightFrame& frame, BlockerFit& fit) {
  copy_checked(tree.nodes, fit.nodes);
  resize_checked(fit.leaves, tree.leaves.size()), resize_checked(fit.leaf_box, tree.leaves.size());
  fit.node_box.assign(tree.nodes.size(), {});
  parallel_ranges(tree.leaves.size(), 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) {
      fit_leaf(tree.leaves[i], samples, fit.leaves[i]);
      fit.leaf_box[i] = leaf_bounds(frame, tree.leaves[i]);
    }
  });
  const auto for_leaves = [&tree](const auto& visit) {
    checked_ranges(tree.leaves.size(), 4096, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i != end; ++i) visit(i, tree.leaves[i]);
    });
  };
  std::size_t perforated = 0;
  for_leaves([&](std::size_t i, const BlockerTree::Leaf& leaf) {
    fit.leaves[i].first_alpha = static_cast<std::uint32_t>(perforated);
    perforated += static_cast<std::size_t>(std::popcount(leaf.perforated));
  });
  fit.alpha.clear();
  fit.alpha.reserve(perforated);
  for_leaves([&](std::size_t, const BlockerTree::Leaf& leaf) {
    for (std::uint32_t rest = leaf.perforated; rest != 0; rest &= rest - 1)
      fit.alpha.push_back(make_alpha_triangle(mesh, leaf.triangle[std::countr_zero(rest)]));
  });
  for (std::size_t n = fit.nodes.size(); n-- > 0;) {
    if (n % 4096 == 0) check_run();
    BlockerTree::Node& node = fit.nodes[n];
    for (std::uint32_t i = 0; i < kWidth; ++i) {
      Bounds box;  // empty for unused children: no shaft meets it
      if (i < node.count) {
        const std::uint32_t child = node.child[i];
        box = child & BlockerTree::kLeafBit ? fit.leaf_box[child & ~BlockerTree::kLeafBit] : fit.node_box[child];
        fit.node_box[n].add(box);
      }
      for (int axis = 0; axis < 3; ++axis) node.low[axis][i] = box.low[axis], node.high[axis][i] = box.high[axis];
    }
  }
}

}  // namespace halfshade
