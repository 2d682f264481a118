// The scene's triangles on the lattice of the local frame: the geometry that the rasterizer draws and that blocks
// light.
#pragma once

#include "halfshade/scene.h"
#include "rasterizer/core/lattice.h"

namespace halfshade {

/// Triangle numbers equal the scene's. The scene is referenced, not copied: it must outlive the mesh.
struct LatticeMesh {
  const Scene* scene = nullptr;  // materials, uvs, normals, textures; may be null in tests
  LocalFrame frame;
  std::vector<vec3> positions;                          // local frame, on the lattice
  std::vector<std::array<std::uint32_t, 3>> triangles;  // [triangle] -> positions

  std::array<vec3, 3> corners(std::uint32_t triangle) const {
    const auto& t = triangles[triangle];
    return {positions[t[0]], positions[t[1]], positions[t[2]]};
  }
  /// Index into Scene::alpha_maps, or kNone for an opaque triangle.
  std::uint32_t alpha_map(std::uint32_t triangle) const {
    if (scene == nullptr || scene->triangle_uvs.empty()) return kNone;
    return scene->materials[scene->triangle_materials[triangle]].alpha_map;
  }
  /// Does light pass through it? Then it blocks no sample (halfshade/transmittance.h).
  bool translucent(std::uint32_t triangle) const {
    if (scene == nullptr || scene->triangle_materials.empty()) return false;
    return scene->materials[scene->triangle_materials[triangle]].translucent();
  }
};

/// Moves the scene into `frame` and snaps it. Parallel; equal bits for any number of threads.
LatticeMesh make_lattice_mesh(const Scene& scene, const LocalFrame& frame);

std::size_t count_translucent(const LatticeMesh& mesh);

/// A copy in which every translucent triangle is shrunk to one of its corners. Triangles without area block nothing and
/// cover no pixel, whoever looks at them, and all triangles keep their numbers: what the masks are made of.
LatticeMesh opaque_part(const LatticeMesh& mesh);

}  // namespace halfshade
