#include "shadows/panes.h"

#include <tuple>

#include "rasterizer/core/parallel.h"

namespace halfshade {
namespace {

/// What makes two triangles the same pane.
struct PaneKey {
  std::uint32_t material = 0, triangle = 0;
  std::array<std::array<float, 5>, 3> corners{};  // x, y, z, u, v; in increasing order

  bool same_as(const PaneKey& o) const { return material == o.material && corners == o.corners; }
  bool operator<(const PaneKey& o) const {
    return std::tie(material, corners, triangle) < std::tie(o.material, o.corners, o.triangle);
  }
};

PaneKey key_of(const LatticeMesh& mesh, std::uint32_t triangle) {
  PaneKey key;
  key.material = mesh.scene->triangle_materials[triangle];
  key.triangle = triangle;
  const std::array<vec3, 3> corners = mesh.corners(triangle);
  for (int k = 0; k < 3; ++k) {
    const vec2 uv = mesh.scene->triangle_uvs.empty() ? vec2(0.0f) : mesh.scene->triangle_uvs[triangle][k];
    key.corners[k] = {corners[k].x, corners[k].y, corners[k].z, uv.x, uv.y};
  }
  std::sort(key.corners.begin(), key.corners.end());
  return key;
}

/// [triangle] -> first triangle that covers it exactly, or kNone for opaque ones; counts the others.
std::vector<std::uint32_t> find_first_of_equals(const LatticeMesh& mesh, std::size_t& translucent) {
  std::vector<PaneKey> keys;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    if (mesh.translucent(t)) keys.push_back(key_of(mesh, t));
  }
  translucent = keys.size();
  parallel_sort(keys, [](const PaneKey& a, const PaneKey& b) { return a < b; });
  std::vector<std::uint32_t> first_of(mesh.triangles.size(), kNone);
  for (std::size_t i = 0; i < keys.size(); ++i) {
    const bool repeats = i > 0 && keys[i].same_as(keys[i - 1]);
    first_of[keys[i].triangle] = repeats ? first_of[keys[i - 1].triangle] : keys[i].triangle;
  }
  return first_of;
}

void add_pane(const LatticeMesh& mesh, std::uint32_t triangle, Panes& panes) {
  const auto pane = static_cast<std::uint32_t>(panes.triangle.size());
  panes.of_triangle[triangle] = pane;
  panes.triangle.push_back(triangle);
  panes.filter.push_back(mesh.scene->triangle_materials[triangle]);
  panes.mesh.triangles.push_back({3 * pane, 3 * pane + 1, 3 * pane + 2});
  for (const vec3& p : mesh.corners(triangle)) panes.mesh.positions.push_back(p);
}

}  // namespace

Panes find_panes(const LatticeMesh& mesh) {
  Panes panes;
  panes.source = &mesh;
  panes.mesh.frame = mesh.frame;
  panes.of_triangle.assign(mesh.triangles.size(), kNone);
  if (count_translucent(mesh) == 0) return panes;
  const std::vector<std::uint32_t> first_of = find_first_of_equals(mesh, panes.translucent);
  for (const Material& m : mesh.scene->materials) {
    panes.filters.emplace_back(*mesh.scene, m, !mesh.scene->triangle_uvs.empty());
  }
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    if (first_of[t] == kNone) continue;
    if (first_of[t] == t) add_pane(mesh, t, panes);
    panes.of_triangle[t] = panes.of_triangle[first_of[t]];
  }
  return panes;
}

}  // namespace halfshade
