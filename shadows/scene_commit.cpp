// What a commit does: frame, arrays, rounding, certificates, tree; each only where something changed. Every step notes
// that it is done once it is, so that a commit that was stopped can be called again.
#include <algorithm>
#include <atomic>

#include "rasterizer/core/parallel.h"
#include "rasterizer/core/reuse.h"
#include "rasterizer/core/stopwatch.h"
#include "shadows/scene_store.h"
#include "shadows/view_access.h"

namespace halfshade {
namespace {

using SceneImpl = ShadowScene::Impl;

bool same_frame(const LocalFrame& a, const LocalFrame& b) {
  return a.box_min == b.box_min && a.half_extent == b.half_extent && a.scale == b.scale;
}

double reach_of(const WorldBox& box, const LocalFrame& frame) {
  double reach = kLatticeUnit;
  if (box.empty()) return reach;
  const vec3 far = glm::max(glm::abs(frame.to_lattice(box.low)), glm::abs(frame.to_lattice(box.high)));
  while (reach < std::max({far.x, far.y, far.z})) reach *= 2.0;
  return reach;
}

void choose_frame(SceneImpl& scene) {
  WorldBox meshes;
  for (const StoredMesh& mesh : scene.meshes) meshes.add(mesh.box);
  WorldBox content = meshes;
  content.add(scene.extension);
  const LocalFrame frame = make_scene_frame(content, scene.lights);
  scene.reach = reach_of(meshes, frame);
  if (same_frame(frame, scene.mesh.frame)) return;
  scene.mesh.frame = frame;
  for (StoredMesh& mesh : scene.meshes) mesh.rounded = false;
  scene.stats.frame_changes += scene.stats.commits != 0;
}

/// Triangles and what belongs to them into the scene's arrays.
void place_mesh(const StoredMesh& mesh, std::uint32_t material, SceneImpl& scene) {
  parallel_ranges(mesh.triangles.size(), 16384, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t != end; ++t) {
      const std::size_t at = mesh.first_triangle + t;
      for (int k = 0; k < 3; ++k) scene.mesh.triangles[at][k] = mesh.triangles[t][k] + mesh.first_vertex;
      scene.attributes.triangle_materials[at] = material;
      if (scene.attributes.triangle_uvs.empty()) continue;
      for (int k = 0; k < 3; ++k) {
        scene.attributes.triangle_uvs[at][k] = mesh.uvs.empty() ? vec2(0.0f) : mesh.uvs[mesh.triangles[t][k]];
      }
    }
  });
}

void lay_out(SceneImpl& scene) {
  ++scene.surfaces;
  std::size_t vertices = 0, triangles = 0;
  bool textured = false;
  scene.attributes.materials.clear();
  for (StoredMesh& mesh : scene.meshes) {
    mesh.first_vertex = static_cast<std::uint32_t>(vertices), vertices += mesh.positions.size();
    mesh.first_triangle = static_cast<std::uint32_t>(triangles), triangles += mesh.triangles.size();
    mesh.rounded = false;
    textured |= !mesh.uvs.empty();
    Material material;
    material.diffuse = mesh.albedo, material.alpha_map = mesh.alpha_map, material.alpha_cutoff = mesh.alpha_cutoff;
    scene.attributes.materials.push_back(material);
  }
  scene.mesh.scene = &scene.attributes;
  resize_checked(scene.mesh.positions, vertices);
  resize_checked(scene.mesh.triangles, triangles);
  resize_checked(scene.attributes.triangle_materials, triangles);
  resize_checked(scene.attributes.triangle_uvs, textured ? triangles : 0);
  for (std::size_t i = 0; i < scene.meshes.size(); ++i)
    place_mesh(scene.meshes[i], static_cast<std::uint32_t>(i), scene);
  scene.parts_are_current = false;
  scene.laid_out = true;
}

void round_mesh(const StoredMesh& mesh, SceneImpl& scene) {
  parallel_ranges(mesh.positions.size(), 16384, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v != end; ++v) {
      scene.mesh.positions[mesh.first_vertex + v] =
          scene.mesh.frame.to_lattice(apply(mesh.transform, mesh.positions[v]));
    }
  });
}

/// Is every vertex still where the vertices are that it was taken to be one with?
bool still_welded(const StoredMesh& mesh, std::span<const vec3> positions) {
  std::atomic<bool> holds{true};
  parallel_ranges(mesh.certificate.coincident.size(), 16384, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) {
      const auto& [a, b] = mesh.certificate.coincident[i];
      if (positions[a] != positions[b]) holds.store(false, std::memory_order_relaxed);
    }
  });
  return holds.load();
}

MeshCertificate make_certificate(const StoredMesh& mesh, std::span<const vec3> positions) {
  LatticeMesh alone;
  copy_checked(positions, alone.positions);
  copy_checked(mesh.triangles, alone.triangles);
  MeshCertificate result;
  std::vector<std::uint32_t> number;
  ClosedComponents closed = find_closed_components(alone, nullptr, &number);
  result.of_triangle = std::move(closed.of_triangle);
  result.parts = static_cast<std::uint32_t>(closed.boxes.size());
  std::vector<std::uint32_t> first(number.size(), kNone);  // [number] -> a vertex that has it
  for (std::uint32_t v = 0; v < number.size(); ++v) {
    if (v % 65536 == 0) check_run();
    if (first[number[v]] == kNone) first[number[v]] = v;
    if (first[number[v]] != v) result.coincident.push_back({first[number[v]], v});
  }
  return result;
}

/// Positions, and whether the mesh is still as closed as it was.
void update_mesh(StoredMesh& mesh, SceneImpl& scene) {
  ++scene.surfaces;
  scene.tree_is_placed = false;
  round_mesh(mesh, scene);
  ++scene.stats.meshes_rounded;
  const std::span<const vec3> positions(scene.mesh.positions.data() + mesh.first_vertex, mesh.positions.size());
  const bool wanted = scene.config.back_face_casters && mesh.alpha_map == kNone;
  if (wanted && !(mesh.certified && still_welded(mesh, positions))) {
    mesh.certified = false;
    scene.parts_are_current = false;
    mesh.certificate = make_certificate(mesh, positions);
    ++scene.stats.certificates_made;
    mesh.certified = true;
  }
  mesh.rounded = true;
  mesh.boxed = false;
}

void set_part_boxes(const StoredMesh& mesh, SceneImpl& scene) {
  if (mesh.certificate.parts == 0) return;
  std::fill_n(scene.closed.boxes.begin() + mesh.first_part, mesh.certificate.parts,
              ClosedComponents::Box{vec3(HUGE_VALF), vec3(-HUGE_VALF)});
  checked_ranges(mesh.triangles.size(), 16384, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t != end; ++t) {
      if (mesh.certificate.of_triangle[t] == kNone) continue;
      ClosedComponents::Box& box = scene.closed.boxes[mesh.first_part + mesh.certificate.of_triangle[t]];
      for (const vec3& p : scene.mesh.corners(mesh.first_triangle + static_cast<std::uint32_t>(t))) {
        box = {glm::min(box.low, p), glm::max(box.high, p)};
      }
    }
  });
}

/// Closed parts of all meshes, numbered through the scene.
void number_parts(SceneImpl& scene) {
  std::uint32_t parts = 0;
  for (StoredMesh& mesh : scene.meshes) {
    mesh.first_part = parts, parts += mesh.certificate.parts;
    mesh.boxed = false;
  }
  scene.closed.boxes.resize(parts);
  resize_checked(scene.closed.of_triangle, scene.mesh.triangles.size());
  for (const StoredMesh& mesh : scene.meshes) {
    checked_ranges(mesh.triangles.size(), 65536, [&](std::size_t begin, std::size_t end) {
      for (std::size_t t = begin; t != end; ++t) {
        const std::uint32_t part = mesh.certificate.parts == 0 ? kNone : mesh.certificate.of_triangle[t];
        scene.closed.of_triangle[mesh.first_triangle + t] = part == kNone ? kNone : mesh.first_part + part;
      }
    });
  }
  scene.parts_are_current = true;
}

void update_parts(SceneImpl& scene) {
  if (!scene.parts_are_current) number_parts(scene);
  parallel_tasks(scene.meshes.size(), [&](std::size_t i) {
    StoredMesh& mesh = scene.meshes[i];
    if (!mesh.boxed) set_part_boxes(mesh, scene);
    mesh.boxed = true;
  });
}

/// The order of triangles in the tree, made anew where it is missing or too bad.
void update_tree(SceneImpl& scene) {
  Stopwatch watch;
  bool build = !scene.tree_is_current;
  if (!build && scene.config.rebuild_cost > 0.0) {
    scene.stats.tree_cost = scene.built_cost > 0.0 ? tree_cost(scene.mesh, scene.tree) / scene.built_cost : 1.0;
    build = scene.stats.tree_cost > scene.config.rebuild_cost;
  }
  if (build) {
    scene.tree_is_current = scene.tree_is_placed = false;
    build_blocker_tree(scene.mesh, scene.tree);
    scene.built_cost = scene.config.rebuild_cost > 0.0 ? tree_cost(scene.mesh, scene.tree) : 0.0;
    scene.tree_is_current = true;
    scene.stats.tree_cost = 1.0;
    ++scene.stats.tree_builds;
  } else if (!scene.tree_is_placed) {
    place_blockers(scene.mesh, scene.tree);
  }
  scene.tree_is_placed = true;
  scene.stats.tree_ms = watch.lap();
}

std::uint64_t bytes_of(const SceneImpl& scene) {
  std::uint64_t bytes = scene.tree.bytes();
  for (const StoredMesh& m : scene.meshes) {
    bytes += m.positions.size() * sizeof(dvec3) + m.triangles.size() * 12 + m.uvs.size() * sizeof(vec2) +
             m.certificate.of_triangle.size() * 4 + m.certificate.coincident.size() * 8;
  }
  for (const AlphaMap& map : scene.attributes.alpha_maps) bytes += map.alpha.size();
  return bytes + scene.mesh.positions.size() * sizeof(vec3) + scene.mesh.triangles.size() * (12 + 4 + 4) +
         scene.attributes.triangle_uvs.size() * sizeof(std::array<vec2, 3>);
}

void count(SceneImpl& scene) {
  SceneStats& stats = scene.stats;
  ++stats.commits;
  stats.meshes = scene.meshes.size();
  stats.triangles = scene.mesh.triangles.size();
  stats.vertices = scene.mesh.positions.size();
  stats.certified_triangles = static_cast<std::uint64_t>(std::count_if(
      scene.closed.of_triangle.begin(), scene.closed.of_triangle.end(), [](auto c) { return c != kNone; }));
  stats.bytes = bytes_of(scene);
}

}  // namespace

void commit_scene(SceneImpl& scene) {
  if (scene.committed) return;
  Stopwatch watch;
  if (!scene.laid_out) lay_out(scene);
  choose_frame(scene);
  Run& run = *current_run();
  for (std::size_t i = 0; i < scene.meshes.size(); ++i) {
    if (scene.meshes[i].rounded) continue;
    run.report(0.5 * static_cast<double>(i) / static_cast<double>(scene.meshes.size()));
    update_mesh(scene.meshes[i], scene);
  }
  run.report(0.5);
  update_parts(scene);
  update_tree(scene);
  ++scene.version;
  count(scene);
  scene.committed = true;
  scene.stats.commit_ms = watch.lap();
}

}  // namespace halfshade
