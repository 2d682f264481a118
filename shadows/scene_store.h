// What a ShadowScene holds: meshes as they were given, and what commit() makes of them.
#pragma once

#include "halfshade/rasterizer.h"
#include "rasterizer/core/mesh.h"
#include "shadows/blocker_tree.h"
#include "shadows/closed_components.h"
#include "shadows/scene_frame.h"
#include "shadows/tree_cost.h"

namespace halfshade {

/// Closed parts of one mesh. They stay proved while vertices that had equal positions keep having equal positions.
struct MeshCertificate {
  std::vector<std::uint32_t> of_triangle;                // [triangle of the mesh] -> closed part, or kNone
  std::uint32_t parts = 0;                               // closed ones
  std::vector<std::array<std::uint32_t, 2>> coincident;  // pairs of vertices that must keep equal positions
};

struct StoredMesh {
  std::uint32_t id = 0;
  std::vector<dvec3> positions;  // object space
  std::vector<std::array<std::uint32_t, 3>> triangles;
  std::vector<vec2> uvs;  // per vertex, or empty
  Transform transform;
  std::uint32_t alpha_map = kNone;
  float alpha_cutoff = 0.5f;
  vec3 albedo{0.8f};
  WorldBox box;

  std::uint32_t first_vertex = 0, first_triangle = 0;  // in the scene's arrays
  std::uint32_t first_part = 0;                        // in ClosedComponents::boxes
  MeshCertificate certificate;
  bool rounded = false, certified = false,
       boxed = false;  // are positions, certificate, boxes of closed parts up to date?
};

struct ShadowScene::Impl {
  SceneConfig config;
  SceneStats stats;
  std::vector<StoredMesh> meshes;  // by increasing id
  std::uint32_t next_id = 0;
  WorldBox extension, lights;  // what extend() was given: points, and lights

  bool committed = true;
  bool laid_out = true;           // the arrays below have the meshes in their places
  bool parts_are_current = true;  // `closed` has the closed parts of all meshes
  bool tree_is_current = true;    // `tree` has all triangles
  bool tree_is_placed = true;     // and where they are

  Scene attributes;             // materials, maps, texture coordinates; no positions
  LatticeMesh mesh;             // all meshes, one behind the other
  double reach = kLatticeUnit;  // as GBuffer::reach: power of two, at least every |coordinate| of the meshes
  ClosedComponents closed;
  BlockerTree tree;  // order and topology; boxes belong to lights, and so to workspaces
  double built_cost = 0.0;

  /// Nobody else has this pointer's address as long as anybody keeps it: tells scenes apart.
  std::shared_ptr<const int> identity = std::make_shared<const int>(0);
  std::uint64_t version = 0;   // of what blocks
  std::uint64_t surfaces = 0;  // version of `mesh`; changes before it does, so that a commit that throws counts

  DrawnState state() const { return {identity, surfaces}; }
  const StoredMesh* find(std::uint32_t id) const;
  StoredMesh& get(std::uint32_t id);  // throws Error{kUsage}
  /// Number in the scene's arrays, or kNone: there is no such triangle.
  std::uint32_t triangle_number(const MeshTriangle& triangle) const;
};

/// Does what changed: the work of ShadowScene::commit.
void commit_scene(ShadowScene::Impl& scene);

/// Throws Error{kUsage} naming the caller's function.
void require_committed(const ShadowScene::Impl& scene);

}  // namespace halfshade
