// A scene of several meshes through the embedding interface, and the same as one Scene for comparison.
#pragma once

#include "halfshade/halfshade.h"
#include "support/lit_scene.h"

namespace halfshade::test {

struct OwnedMesh {
  std::vector<dvec3> positions;
  std::vector<std::array<std::uint32_t, 3>> triangles;
  Transform transform = {};

  MeshView view() const { return {.positions = positions, .triangles = triangles, .transform = transform}; }
};

inline OwnedMesh mesh_of(const std::vector<Triangle>& triangles) {
  OwnedMesh mesh;
  for (const Triangle& t : triangles) {
    const auto first = static_cast<std::uint32_t>(mesh.positions.size());
    mesh.positions.insert(mesh.positions.end(), t.begin(), t.end());
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

/// Closed ball of `rings` x 2 `rings` quads, wound outward.
inline OwnedMesh ball(const dvec3& center, double radius, std::uint32_t rings) {
  OwnedMesh mesh;
  const std::uint32_t columns = 2 * rings;
  for (std::uint32_t i = 0; i <= rings; ++i) {
    for (std::uint32_t j = 0; j < columns; ++j) {
      const double a = 3.14159265358979 * i / rings, b = 6.28318530717958 * j / columns;
      const double ring = i == 0 || i == rings ? 0.0 : std::sin(a);
      mesh.positions.push_back(center + radius * dvec3(ring * std::cos(b), std::cos(a), ring * std::sin(b)));
    }
  }
  for (std::uint32_t i = 0; i < rings; ++i) {
    for (std::uint32_t j = 0; j < columns; ++j) {
      const std::uint32_t k = (j + 1) % columns, row = i * columns, next = row + columns;
      mesh.triangles.push_back({row + j, row + k, next + k});
      mesh.triangles.push_back({row + j, next + k, next + j});
    }
  }
  return mesh;
}

inline Transform moved_by(const dvec3& d) {
  Transform t;
  for (int k = 0; k < 3; ++k) t.row[k][3] = d[k];
  return t;
}

/// Rotated by `angle` around y, then moved.
inline Transform turned(double angle, const dvec3& d) {
  Transform t = moved_by(d);
  t.row[0][0] = t.row[2][2] = std::cos(angle);
  t.row[0][2] = std::sin(angle), t.row[2][0] = -std::sin(angle);
  return t;
}

/// Receivers on the ground, side x side, with normals.
struct Ground {
  std::vector<dvec3> positions, normals;
  explicit Ground(std::uint32_t side, double half = 3.0) {
    for (std::uint32_t i = 0; i < side * side; ++i) {
      positions.emplace_back((i % side + 0.5) / side * 2.0 * half - half, 0.0,
                             (i / side + 0.5) / side * 2.0 * half - half);
      normals.emplace_back(0.0, 1.0, 0.0);
    }
  }
  ReceiverView view() const { return {.positions = positions, .normals = normals}; }
};

struct Solved {
  std::vector<std::uint64_t> masks;
  std::vector<float> visibility;
  std::vector<vec3> irradiance, total;
};

inline Solved solve(const ShadowSolver& solver, const ShadowScene& scene, const ReceiverView& receivers,
                    std::span<const Light> lights, Workspace& workspace, const Execution& execution = {}) {
  const std::size_t n = receivers.positions.count, all = n * lights.size();
  const bool integral = !receivers.normals.empty();
  Solved s;
  s.masks.assign(all * solver.mask_words(lights), 0x5555555555555555u);
  s.visibility.assign(all, -1.0f);
  s.irradiance.assign(integral ? all : 0, vec3(-1.0f));
  s.total.assign(integral ? n : 0, vec3(-1.0f));
  solver.solve(scene, receivers, lights, workspace, {s.masks, s.visibility, s.irradiance, s.total}, execution);
  return s;
}

inline Solved solve(const ShadowSolver& solver, const ShadowScene& scene, const ReceiverView& receivers,
                    const Light& light) {
  Workspace workspace;
  return solve(solver, scene, receivers, {&light, 1}, workspace);
}

inline std::uint64_t different_bits(std::span<const std::uint64_t> a, std::span<const std::uint64_t> b) {
  if (a.size() != b.size()) return ~std::uint64_t{0};
  std::uint64_t count = 0;
  for (std::size_t i = 0; i < a.size(); ++i) count += static_cast<std::uint64_t>(std::popcount(a[i] ^ b[i]));
  return count;
}

inline std::uint64_t blocked_bits(std::span<const std::uint64_t> masks) {
  std::uint64_t count = 0;
  for (const std::uint64_t word : masks) count += static_cast<std::uint64_t>(std::popcount(word));
  return count;
}

/// A ground, two balls and a box above it.
inline std::vector<OwnedMesh> embed_meshes(std::uint32_t rings) {
  std::vector<OwnedMesh> meshes;
  meshes.push_back(mesh_of(quad({-3, 0, -3}, {-3, 0, 3}, {3, 0, 3}, {3, 0, -3})));
  meshes.push_back(ball({0, 0, 0}, 0.5, rings));
  meshes.back().transform = moved_by({0.7, 1.0, 0.2});
  meshes.push_back(ball({0, 0, 0}, 0.4, rings));
  meshes.back().transform = turned(0.3, {-0.9, 0.6, -0.5});
  meshes.push_back(mesh_of(box({-0.3, -0.3, -0.3}, {0.3, 0.3, 0.3})));
  meshes.back().transform = turned(0.7, {-0.2, 1.6, 0.9});
  return meshes;
}

struct EmbedScene {
  std::vector<OwnedMesh> meshes;
  std::vector<std::uint32_t> ids;
  ShadowScene scene;

  explicit EmbedScene(std::uint32_t rings = 12) : EmbedScene(embed_meshes(rings)) {}
  explicit EmbedScene(std::vector<OwnedMesh> of, const Execution& execution = {}) : meshes(std::move(of)) {
    scene.extend(frame_light());
    for (const OwnedMesh& mesh : meshes) ids.push_back(scene.add_mesh(mesh.view()));
    scene.commit(execution);
  }
};

/// A scene made at once from the same meshes and the same extension.
inline ShadowScene fresh_copy(const EmbedScene& from) {
  ShadowScene scene;
  scene.extend(frame_light());
  for (const OwnedMesh& mesh : from.meshes) scene.add_mesh(mesh.view());
  scene.commit();
  return scene;
}

}  // namespace halfshade::test
