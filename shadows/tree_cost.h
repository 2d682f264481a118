// How good the order of a blocker tree still is after its triangles moved.
#pragma once

#include "shadows/blocker_tree.h"

namespace halfshade {

/// Boxes of leaves and nodes, in lattice space; kept so that measuring again allocates nothing.
struct TreeBoxes {
  struct Box {
    vec3 low{1e30f}, high{-1e30f};
  };
  std::vector<Box> leaf, node;
};

/// Sum over leaves and nodes of the surface area of the box around their triangles, over that of the root: about how
/// many of them a random line meets (surface area heuristic). 0 for an empty tree.
double tree_cost(const LatticeMesh& mesh, const BlockerTree& tree, TreeBoxes& boxes);

}  // namespace halfshade
