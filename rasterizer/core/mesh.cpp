#include "rasterizer/core/mesh.h"

#include "rasterizer/core/parallel.h"

namespace halfshade {

LatticeMesh make_lattice_mesh(const Scene& scene, const LocalFrame& frame) {
  LatticeMesh mesh;
  mesh.scene = &scene;
  mesh.frame = frame;
  mesh.triangles = scene.triangles;
  mesh.positions.resize(scene.positions.size());
  parallel_ranges(scene.positions.size(), 16384, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) mesh.positions[i] = frame.to_lattice(scene.positions[i]);
  });
  return mesh;
}

std::size_t count_translucent(const LatticeMesh& mesh) {
  if (mesh.scene == nullptr) return 0;
  std::vector<std::uint8_t> passes;  // [material]
  for (const Material& m : mesh.scene->materials) passes.push_back(m.translucent());
  std::size_t count = 0;
  for (const std::uint32_t m : mesh.scene->triangle_materials) count += passes[m];
  return count;
}

LatticeMesh opaque_part(const LatticeMesh& mesh) {
  LatticeMesh result = mesh;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const std::uint32_t corner = mesh.triangles[t][0];
    if (mesh.translucent(t)) result.triangles[t] = {corner, corner, corner};
  }
  return result;
}

}  // namespace halfshade
