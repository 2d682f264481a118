// Where a closed mesh casts penumbra: near the images of its silhouette edges (Sintorn, Eisemann, Assarsson 2008,
// section 4.3; edges as in Laine et al. 2005).
//
// An edge is settled if all its triangles certainly show their front, or all their back, to the whole hull of the
// light; every other edge may be a silhouette for some point of the light.
//
// Claim. Let C be a closed component (closed_components.h) without alpha whose box holds no point of the light's hull,
// r a receiver, and let no segment from r to a point of the hull meet an edge of C that is not settled. Say that l is
// hidden from behind (from the front) if a triangle of C that shows r its back (its front) blocks it. Then each of the
// two holds for all points of the hull or for none.
//
// Proof. Let B be the points l hidden from behind. B is closed: of a converging sequence infinitely many points are
// hidden by one and the same triangle; r is strictly behind it, the limit's segment meets it, and the limit is not on
// it, hence strictly before it. B is open: let the segment r-l meet the triangle at p. No triangle around p lies in a
// plane with the segment, or has no area: its edges would all be unsettled, and as l is not on it, the segment would
// meet one of them. p is on no unsettled edge, so all triangles around p are crossed from one and the same side, from
// behind. If p is inside the triangle, nearby segments cross it too. If p is inside an edge, as many triangles use the
// edge in one direction as in the other; crossed from the same side, they lie on both sides of it, and nearby segments
// cross one of them. If p is a vertex, the triangles around it form closed fans (every edge is balanced), which turn
// around the segment in one sense by a positive multiple of a full turn: nearby segments cross one of them. The hull is
// connected, so B is all of it or empty. The same with before for behind.
//
// So away from the unsettled edges' influence regions one sample l0 decides:
// - hidden from behind: all samples are;
// - hidden neither way: none is, by C;
// - only from the front: all are, but perhaps by the receiver's own triangle alone, which does not count. Undecided, as
//   are receivers whose own triangle is one of C's and shows its back: another triangle may hide l0, and the own one
//   alone what lies elsewhere. A watertight mesh seen from outside has none.
#pragma once

#include "shadows/closed_components.h"
#include "shadows/light_lists.h"

namespace halfshade {

/// How the triangles face the whole light, for every view. Built once per solve.
struct LightFacing {
  std::vector<std::int8_t> of_triangle;  // +1: all samples certainly on the normal's side, -1: all behind, 0: neither
};

LightFacing find_facing(const LatticeMesh& mesh, const KernelSamples& samples);

/// Unsettled edges of the components that are worth a stencil.
struct SilhouetteEdges {
  struct Edge {
    std::uint32_t component, a, b;  // ends: vertices of the mesh
  };
  std::vector<Edge> edges;
  std::vector<std::uint8_t> wanted;  // [closed component] has a stencil
  std::uint64_t total = 0;           // edges of the components with a stencil
};

SilhouetteEdges find_silhouette_edges(const LatticeMesh& mesh, const KernelSamples& samples, const LightFacing& facing,
                                      std::span<const EdgeUse> uses);

/// Tiles of a view that unsettled edges reach, one bit set per component.
class PenumbraStencils {
 public:
  PenumbraStencils() = default;
  PenumbraStencils(const LightLists& lists, const SilhouetteEdges& silhouettes,
                   const std::vector<dvec3>& view_positions);

  bool has(std::uint32_t component) const { return component != kNone && !slot_.empty() && slot_[component] != kNone; }
  bool penumbra(std::uint32_t component, std::size_t tile) const {
    return (words_[slot_[component] * words_per_stencil_ + tile / 64] >> (tile % 64)) & 1;
  }
  /// Takes the tile from the settled ones. May be called concurrently.
  void mark(std::uint32_t component, std::size_t tile);
  bool any() const { return !words_.empty(); }
  std::uint64_t bytes() const { return words_.size() * 8 + slot_.size() * 4; }
  double penumbra_share() const;

 private:
  std::vector<std::uint32_t> slot_;   // [closed component]
  std::vector<std::uint64_t> words_;  // [slot][word]
  std::size_t words_per_stencil_ = 0;
};

/// What one sample says about the receivers of some spans, in list order.
struct SettledReceivers {
  std::vector<std::uint8_t> hidden;  // from behind, so from every sample
  /// Receivers hidden from the front, and by which component; grouped like the row blocks that may be written at once.
  std::vector<std::vector<std::pair<std::uint32_t, std::uint32_t>>> from_front;
};

/// Tests blockers against one sample, exactly. Spans must stay within receivers that no other call writes.
void test_one_sample(const LatticeMesh& mesh, const KernelSamples& samples, const vec3& sample,
                     std::span<const BlockerSpan> spans, const KernelReceivers& receivers, std::size_t block,
                     SettledReceivers& settled, KernelCounters& counters);

/// Marks the tiles of undecided receivers.
void mark_undecided(const LatticeMesh& mesh, const KernelSamples& samples, const LightLists& lists,
                    const KernelReceivers& receivers, const SettledReceivers& settled, PenumbraStencils& stencils);

}  // namespace halfshade
