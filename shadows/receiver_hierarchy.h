// The hierarchy of receiver points (Laine and Aila 2005, section 3.1): axis-aligned boxes, made by halving the box
// while a node has more than 1,000 points, and by surface area below that, down to leaves of 16 points.
#pragma once

#include "halfshade/types.h"

namespace halfshade {

struct HierarchyRules {
  std::uint32_t leaf = 16;             // points; leaves hold more only where points coincide
  std::uint32_t halving_above = 1000;  // points
  bool weigh_by_points = false;        // minimise sum(area * points) instead of the paper's sum(area)
};

struct ReceiverHierarchy {
  /// Deeper than this nothing is split: boxes are halved to half of it, points are below that, which takes at most 32
  /// more levels for 2^32 points. Coincident points end a branch at once.
  static constexpr std::uint32_t kMostLevels = 64;

  struct Node {
    vec3 low{0.0f}, high{0.0f};
    std::uint32_t begin = 0, end = 0;  // of `order`
    std::uint32_t right = 0;           // second child, the first is the next node; 0 = leaf
    bool is_leaf() const { return right == 0; }
  };
  std::vector<Node> nodes;           // parents before children
  std::vector<std::uint32_t> order;  // numbers of points
  std::uint32_t depth = 0;           // levels

  std::uint64_t bytes() const { return nodes.capacity() * sizeof(Node) + order.capacity() * sizeof(std::uint32_t); }
};

/// Builds over points[i] for the i in hierarchy.order, which is sorted into leaves. No points, no nodes.
void build_receiver_hierarchy(std::span<const vec3> points, const HierarchyRules& rules, ReceiverHierarchy& hierarchy);

}  // namespace halfshade
