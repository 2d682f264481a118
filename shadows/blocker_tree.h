// Tree over blockers for receivers that gather: leaves of up to 16 triangles laid out for SIMD, nodes of up to 16
// boxes.
//
// Topology and order depend on the mesh alone, and a tree serves all lights. Each light has a fit of its own: boxes
// that are axis-aligned in its frame (u, v in its plane, z along its facing), and the sides of triangles that it shines
// on.
#pragma once

#include <bit>

#include "shadows/visibility_pair.h"

namespace halfshade {

/// The frame of a flat light, one side of it: z > 0 in front.
struct LightFrame {
  dvec3 origin{0.0}, u{1, 0, 0}, v{0, 1, 0}, n{0, 0, 1};
  dvec3 to_frame(const dvec3& p) const {
    const dvec3 d = p - origin;
    return {glm::dot(d, u), glm::dot(d, v), glm::dot(d, n)};
  }
};

struct BlockerTree {
  static constexpr std::uint32_t kWidth = 16;
  static constexpr std::uint32_t kLeafBit = 0x80000000u;
  static constexpr std::uint32_t kGroupSlots = kWidth * kWidth;

  /// Bounds of 16 children, [axis][child], light frame, which only a fit knows; child = node, or leaf with kLeafBit.
  /// The lowest nodes are groups: their children are leaves, one after another. The root is no group.
  struct alignas(64) Node {
    float low[3][kWidth], high[3][kWidth];
    std::uint32_t child[kWidth];
    std::uint32_t count = 0;
    bool is_group = false;
    std::uint32_t first_edge = 0, edges = 0, first_vertex = 0, vertices = 0;  // of a group; runs of the arrays below

    std::uint32_t first_leaf() const { return child[0] & ~kLeafBit; }  // of a group
  };
  /// Edge of a group between two of its vertices. `left` is the triangle that runs along it, `right` the one that runs
  /// against it, as 16 x child + lane; kGroupSlots where there is none. A third triangle takes an edge of its own.
  struct Edge {
    std::uint16_t from, to, left, right;
  };
  /// 16 triangles as arrays of lanes, lattice coordinates; bit masks say what holds for a lane.
  struct alignas(64) Leaf {
    float corner[3][3][kWidth];             // [corner][axis][lane]
    float vertex[3][3 * kWidth];            // [axis][vertex]: the corners again, equal ones once
    std::uint8_t corner_vertex[3][kWidth];  // [corner][lane] -> vertex
    float normal[3][kWidth], side_error[kWidth];
    std::uint32_t triangle[kWidth];
    std::uint32_t first = 0, count = 0;  // run of BlockerTree::order
    std::uint32_t vertices = 0, perforated = 0;

    vec3 corner_at(std::size_t k, std::size_t lane) const {
      return {corner[k][0][lane], corner[k][1][lane], corner[k][2][lane]};
    }
    BlockerPlane plane_at(std::size_t lane) const {
      return {{normal[0][lane], normal[1][lane], normal[2][lane]}, side_error[lane]};
    }
  };
  std::vector<std::uint32_t> order;  // triangles, leaf by leaf
  std::vector<Leaf> leaves;
  std::vector<Node> nodes;           // children behind their parents; the root is the first; empty without triangles
  std::vector<Edge> edges;           // of the groups, one after another
  std::vector<vec3> vertices;        // the same; equal ones of a group once
  std::vector<std::uint32_t> place;  // [triangle] 16 x leaf + lane

  /// Scratch of tree_cost, kept so that asking again allocates nothing.
  struct Bounds {
    vec3 low{1e30f}, high{-1e30f};
    void add(const vec3& p) { low = glm::min(low, p), high = glm::max(high, p); }
    void add(const Bounds& b) { low = glm::min(low, b.low), high = glm::max(high, b.high); }
    float area() const {
      const vec3 e = high - low;
      return e.x < 0.0f ? 0.0f : e.x * e.y + e.y * e.z + e.z * e.x;
    }
  };
  std::vector<Bounds> leaf_box, node_box;

  std::size_t bytes() const;
};

/// A tree as one side of a light sees it.
struct BlockerFit {
  /// Bit masks say what holds for a lane.
  struct Leaf {
    std::uint32_t samples_above = 0, samples_below = 0, back_faces_only = 0;
    std::uint32_t first_alpha = 0;       // run of `alpha`: one for each perforated lane
    vec3 box_low{0.0f}, box_high{0.0f};  // around the components of the lanes in back_faces_only
  };
  std::vector<BlockerTree::Node> nodes;  // of the tree, with bounds
  std::vector<Leaf> leaves;
  std::vector<AlphaTriangle> alpha;  // of the perforated triangles, leaf by leaf

  /// Scratch of fit_blocker_tree, kept so that fitting again allocates nothing.
  std::vector<BlockerTree::Bounds> leaf_box, node_box;

  const AlphaTriangle& alpha_of(const BlockerTree& tree, std::size_t leaf, std::size_t lane) const {
    const std::uint32_t before = tree.leaves[leaf].perforated & ((1u << lane) - 1);
    return alpha[leaves[leaf].first_alpha + static_cast<std::uint32_t>(std::popcount(before))];
  }
  std::size_t bytes() const;
};

/// A triangle of a leaf for the kernels that loop over triangles; `samples` are those that were fitted to.
Blocker blocker_at(const BlockerTree& tree, const BlockerFit& fit, std::size_t leaf, std::size_t lane,
                   const KernelSamples& samples);

/// Order, leaves and topology by binned surface area heuristic. Equal bits for any number of threads.
void build_blocker_tree(const LatticeMesh& mesh, BlockerTree& tree);

/// What the leaves hold of the mesh that does not depend on a light, anew: for a mesh that moved since the tree was
/// built.
void place_blockers(const LatticeMesh& mesh, BlockerTree& tree);

/// The tree of `mesh` for one side of a light; what `fit` held before gives its memory.
void fit_blocker_tree(const LatticeMesh& mesh, const BlockerTree& tree, const KernelSamples& samples,
                      const LightFrame& frame, BlockerFit& fit);

}  // namespace halfshade
