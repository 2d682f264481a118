#include "shadows/tree_cost.h"

#include "rasterizer/core/parallel.h"

namespace halfshade {
namespace {

using Box = BlockerTree::Bounds;

double half_area(const Box& box) {
  const dvec3 e = dvec3(box.high) - dvec3(box.low);
  return e.x < 0.0 ? 0.0 : e.x * e.y + e.y * e.z + e.z * e.x;
}

Box leaf_box(const LatticeMesh& mesh, const BlockerTree& tree, const BlockerTree::Leaf& leaf) {
  Box box;
  for (std::uint32_t i = 0; i < leaf.count; ++i) {
    for (const vec3& p : mesh.corners(tree.order[leaf.first + i])) box = {glm::min(box.low, p), glm::max(box.high, p)};
  }
  return box;
}

}  // namespace

double tree_cost(const LatticeMesh& mesh, BlockerTree& tree) {
  if (tree.nodes.empty()) return 0.0;
  tree.leaf_box.resize(tree.leaves.size());
  tree.node_box.resize(tree.nodes.size());
  parallel_ranges(tree.leaves.size(), 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) tree.leaf_box[i] = leaf_box(mesh, tree, tree.leaves[i]);
  });
  double sum = 0.0;
  for (std::size_t n = tree.nodes.size(); n-- > 0;) {  // children come behind their parents
    Box box;
    for (std::uint32_t i = 0; i < tree.nodes[n].count; ++i) {
      const std::uint32_t child = tree.nodes[n].child[i];
      const bool is_leaf = (child & BlockerTree::kLeafBit) != 0;
      const Box& part = is_leaf ? tree.leaf_box[child & ~BlockerTree::kLeafBit] : tree.node_box[child];
      box = {glm::min(box.low, part.low), glm::max(box.high, part.high)};
      if (is_leaf) sum += half_area(part);
    }
    tree.node_box[n] = box;
    sum += half_area(box);
  }
  const double root = half_area(tree.node_box[0]);
  return root > 0.0 ? sum / root : 0.0;
}

}  // namespace halfshade
