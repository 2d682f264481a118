// Certificate for back-face-only casters (Sintorn, Eisemann, Assarsson 2008, sections 3.3 and 4.3), per connected mesh.
//
// A component is closed when every edge is used as often in one direction as in the other. For a closed component, a
// light sample l and a receiver r that both lie outside the component's bounding box (so its winding number around both
// is zero), the triangles that show the receiver their back block exactly the samples that all of them block, ties
// included: docs/decisions/0002 has the proof. Receivers inside the box keep both sides, and so do open meshes.
#pragma once

#include "rasterizer/core/mesh.h"
#include "rasterizer/core/run.h"
#include "shadows/receivers.h"
#include "shadows/visibility_kernel.h"

namespace halfshade {

struct ClosedComponents {
  struct Box {
    vec3 low{0.0f}, high{0.0f};
  };
  std::vector<std::uint32_t> of_triangle;  // [triangle] -> boxes, or kNone: open, or alpha-tested in part
  std::vector<Box> boxes;                  // of the closed components
  std::uint32_t components = 0;            // closed or not
};

/// One use of an edge by a triangle.
struct EdgeUse {
  std::uint64_t edge;  // equal for all uses of an edge: welded numbers of both ends, the lower one first
  std::uint32_t triangle;
  std::int16_t direction;  // +1 from the lower to the higher end, else -1
  std::uint16_t corner;    // the edge runs from this corner of the triangle to the next
};

/// Calls run(uses of one edge) for each edge; `uses` are sorted by edge.
template <class Run>
void for_each_edge(std::span<const EdgeUse> uses, const Run& run) {
  for (std::size_t runs = 0; !uses.empty(); ++runs) {
    if (runs % 65536 == 0) check_run();
    std::size_t count = 1;
    while (count < uses.size() && uses[count].edge == uses[0].edge) ++count;
    run(uses.first(count));
    uses = uses.subspan(count);
  }
}

/// Connects triangles across edges whose ends have equal positions. Static for a mesh: build once.
/// `edges`, if given, gets all uses of edges, sorted; `welded` a number below the count of positions for each position,
/// equal for equal ones.
ClosedComponents find_closed_components(const LatticeMesh& mesh, std::vector<EdgeUse>* edges = nullptr,
                                        std::vector<std::uint32_t>* welded = nullptr);

/// If the configuration wants it: fills `closed`, lets the kernels use it, and counts the triangles it covers.
///
/// A receiver's own triangle never blocks it. That spoils the certificate only if the triangle shows the receiver its
/// back: then the back face that decision 0002 finds may be the one that does not count. Receivers inside the box keep
/// both sides anyway, but one lifted off a face of the box, or one that the caller put anywhere, can lie outside.
/// Components with such a receiver (wound inside out, as a rule) are not used.
void certify(const LatticeMesh& mesh, const ReceiverArray& receivers, const ShadowConfig& config,
             ClosedComponents& closed, KernelSamples& samples, ShadowStats& stats,
             std::vector<EdgeUse>* edges = nullptr);

/// The same with components that were found before.
void apply_certificates(const LatticeMesh& mesh, const ReceiverArray& receivers, const ClosedComponents& closed,
                        KernelSamples& samples, ShadowStats& stats);

}  // namespace halfshade
