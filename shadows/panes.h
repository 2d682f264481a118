// The translucent triangles of a scene, which multiply light instead of blocking it.
#pragma once

#include "rasterizer/core/mesh.h"
#include "shadows/surface_filter.h"

namespace halfshade {

/// Triangles that cover each other exactly (same corners, texture coordinates and material, in any winding) are one
/// pane: exporters write both sides of a sheet that way, and light crosses the sheet once.
struct Panes {
  LatticeMesh mesh;                        // the panes alone, in the order of the scene; no scene
  std::vector<std::uint32_t> triangle;     // [pane] -> triangle of the scene
  std::vector<std::uint32_t> of_triangle;  // [triangle of the scene] -> pane, or kNone for opaque ones
  std::vector<SurfaceFilter> filters;      // [material]
  std::vector<std::uint32_t> filter;       // [pane] -> filters
  std::size_t translucent = 0;             // triangles, before equal ones were joined
  const LatticeMesh* source = nullptr;

  bool empty() const { return triangle.empty(); }
  const SurfaceFilter& filter_of(std::uint32_t pane) const { return filters[filter[pane]]; }
};

/// `mesh` must outlive the result. A mesh without a scene has no panes.
Panes find_panes(const LatticeMesh& mesh);

}  // namespace halfshade
