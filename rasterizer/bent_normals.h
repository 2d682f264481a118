// Cosines that fall to zero where the facets turn away from the light: Sintorn, Eisemann, Assarsson 2008, section 4.3
// and figure 8.
//
// Interpolated normals light parts of facets that face away from the light; exact shadows black those facets out, and
// the outline of the mesh's facets shows at the terminator. Here each corner gets the smallest cosine over the facets
// that meet there smoothly; interpolated, it is at most zero all over a facet that faces away.
#pragma once

#include "halfshade/light.h"
#include "rasterizer/core/mesh.h"
#include "rasterizer/gbuffer.h"

namespace halfshade {

/// Which facets meet at which position. Built once per mesh, which must outlive it. Const calls may run concurrently.
class BentNormals {
 public:
  explicit BentNormals(const LatticeMesh& mesh);

  /// Per G-buffer entry, in [0, 1]: a l_f + (1 - a) l_bend with a = min(1, max(3 l_bend, 0)), where l_f is the cosine
  /// of the shading normal and l_bend the interpolated least cosine. Exactly 0 on facets whose plane does not have the
  /// light's centre on the side that is seen; l_f on facets without smooth neighbours. `camera` made the G-buffer.
  std::vector<float> cosines(const GBuffer& gbuffer, const Camera& camera, const Light& light) const;

 private:
  const LatticeMesh& mesh_;
  std::vector<std::uint32_t> offsets_, faces_;  // facets at position v: faces_[offsets_[v] .. offsets_[v + 1])
};

}  // namespace halfshade
