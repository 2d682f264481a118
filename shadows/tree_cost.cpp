#include "shadows/tree_cost.h"

#include "rasterizer/core/parallel.h"

namespace halfshade {
namespace {

using Box = TreeBoxes::Box;

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

double tree_cost(const LatticeMesh& mesh, const BlockerTree& tree, TreeBoxes& boxes) {
  if (tree.nodes.empty()) return 0.0;
  boxes.leaf.resize(tree.leaves.size());
  boxes.node.resize(tree.nodes.size());
  parallel_ranges(tree.leaves.size(), 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) boxes.leaf[i] = leaf_box(mesh, tree, tree.leaves[i]);
  });
  double sum = 0.0;
  for (std::size_t n = tree.nodes.size(); n-- > 0;) {  // children come behind their parents
    Box box;
    for (std::uint32_t i = 0; i < tree.nodes[n].count; ++i) {
      const std::uint32_t child = tree.nodes[n].child[i];
      const bool is_leaf = (child & BlockerTree::kLeafBit) != 0;
      const Box& part = is_leaf ? boxes.leaf[child & ~BlockerTree::kLeafBit] : boxes.node[child];
      box = {glm::min(box.low, part.low), glm::max(box.high, part.high)};
      if (is_leaf) sum += half_area(part);
    }
    boxes.node[n] = box;
    sum += half_area(box);
  }
  const double root = half_area(boxes.node[0]);
  return root > 0.0 ? sum / root : 0.0;
}

}  // namespace halfshade
