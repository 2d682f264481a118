// What blocks light in a scene with translucent triangles: made in one place, so that every method, the oracle and the
// rivals mean the same triangles.
#pragma once

#include "rasterizer/core/mesh.h"

namespace halfshade {

/// The given mesh where nothing is translucent, else its opaque part (opaque_part in mesh.h).
class OpaqueMesh {
 public:
  /// `mesh` must outlive it.
  explicit OpaqueMesh(const LatticeMesh& mesh) : mesh_(&mesh), translucent_(count_translucent(mesh)) {
    if (translucent_ == 0) return;
    part_ = opaque_part(mesh);
    mesh_ = &part_;
  }
  OpaqueMesh(const OpaqueMesh&) = delete;
  OpaqueMesh& operator=(const OpaqueMesh&) = delete;

  const LatticeMesh& get() const { return *mesh_; }
  std::size_t translucent() const { return translucent_; }  // triangles left out

 private:
  const LatticeMesh* mesh_;
  std::size_t translucent_;
  LatticeMesh part_;
};

}  // namespace halfshade
