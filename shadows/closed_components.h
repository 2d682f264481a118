// Certificate for back-face-only casters (Sintorn, Eisemann, Assarsson 2008, sections 3.3 and 4.3), per connected mesh.
//
// A component is closed when every edge is used as often in one direction as in the other. For a closed component, a
// light sample l and a receiver r that both lie outside the component's bounding box (so its winding number around both
// is zero), the triangles that show the receiver their back block exactly the samples that all of them block, ties
// included: docs/decisions/0002 has the proof. Receivers inside the box keep both sides, and so do open meshes.
#pragma once

#include "rasterizer/core/mesh.h"
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

/// Connects triangles across edges whose ends have equal positions. Static for a mesh: build once.
ClosedComponents find_closed_components(const LatticeMesh& mesh);

/// If the configuration wants it: fills `closed`, lets the kernels use it, and counts the triangles it covers.
void certify(const LatticeMesh& mesh, const ShadowConfig& config, ClosedComponents& closed, KernelSamples& samples,
             ShadowStats& stats);

}  // namespace halfshade
