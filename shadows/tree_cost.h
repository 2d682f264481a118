// How good the order of a blocker tree still is after its triangles moved.
#pragma once

#include "shadows/blocker_tree.h"

namespace halfshade {

/// Sum over leaves and nodes of the surface area of the box around their triangles, over that of the root: about how
/// many of them a random line meets (surface area heuristic). 0 for an empty tree. Writes the tree's scratch.
double tree_cost(const LatticeMesh& mesh, BlockerTree& tree);

}  // namespace halfshade
