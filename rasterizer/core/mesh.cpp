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

}  // namespace halfshade
