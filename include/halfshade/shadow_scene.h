// A scene that lives longer than a frame: meshes come, move and go, and only what they change is made anew.
#pragma once

#include <memory>

#include "halfshade/error.h"
#include "halfshade/execution.h"
#include "halfshade/light.h"
#include "halfshade/views.h"

namespace halfshade {

/// A mesh as the caller holds it.
struct MeshView {
  PointView positions = {};         // object space
  TriangleView triangles = {};      // counter-clockwise seen from outside; empty: vertices 0 1 2, 3 4 5, ...
  Transform transform = {};         // object to world
  UvView uvs = {};                  // per vertex; needed with an alpha map, ignored without
  std::uint32_t alpha_map = kNone;  // number of an alpha map of the scene: light passes where the texel is not opaque
  float alpha_cutoff = 0.5f;        // a texel is opaque where alpha / 255 >= alpha_cutoff
  vec3 albedo{0.8f};                // linear RGB; for GBuffer::albedo alone
};

/// How a scene keeps its tree. Changes no result.
struct SceneConfig {
  /// The order of the tree over the triangles is made anew once moving meshes have made it this much worse (expected
  /// cost of a query, relative to the tree as built); 0 = never. Changes no result.
  double rebuild_cost = 1.5;
  /// Meshes proved closed cast by their back faces alone. Changes no result, only time.
  bool back_face_casters = true;
};

/// What commit() had to do, over the life of a scene, and what there is.
struct SceneStats {
  std::uint64_t commits = 0;        // that found something to do
  std::uint64_t frame_changes = 0;  // everything was rounded anew: content left the local frame, or shrank far below it
  std::uint64_t meshes_rounded = 0;       // times that the vertices of a mesh were rounded to the lattice
  std::uint64_t certificates_made = 0;    // times that a mesh was searched for closed parts
  std::uint64_t tree_builds = 0;          // the tree's order from scratch
  double tree_cost = 0.0;                 // of the tree now, relative to when its order was made
  double commit_ms = 0.0, tree_ms = 0.0;  // last commit, and its share for the tree; wall time
  std::uint64_t meshes = 0, triangles = 0, vertices = 0;  // now
  std::uint64_t certified_triangles = 0;                  // of closed parts, now
  std::uint64_t bytes = 0;                                // memory held, without workspaces
};

/// Triangle `triangle` of mesh `mesh`, as the caller numbers them.
struct MeshTriangle {
  std::uint32_t mesh = kNone;      // what add_mesh() returned
  std::uint32_t triangle = kNone;  // in that mesh, from 0

  bool operator==(const MeshTriangle&) const = default;
};

/// Blockers in world space. Changes are noted and checked at once, and done together by commit().
///
/// Rounding. All positions are rounded to the lattice of one local frame (docs/decisions/0001 and 0003). The frame is a
/// pure function of the scene's content: of the box around all meshes and the points given to extend(), in whose middle
/// it is finest, and of the lights given to extend(). It is chosen with room to spare, so that it stays the same while
/// things move. Lights and receivers must lie within its reach(), which is a cube at least twice as wide as that box
/// and twice as wide as the lights need; extend() makes it wider. Equal content gives equal bits, whatever changes led
/// to it.
///
/// Threads: const member functions may run concurrently with each other and with solves; others may not run
/// concurrently with anything on the same scene. Errors are thrown before anything changes, std::bad_alloc as well; a
/// commit() that throws leaves the scene uncommitted, with all noted changes, and may be called again.
class HALFSHADE_API ShadowScene {
 public:
  /// An empty scene, to be committed like any other. Throws Error{kUsage} for a configuration out of range.
  explicit ShadowScene(const SceneConfig& config = {});
  ~ShadowScene();
  ShadowScene(ShadowScene&&) noexcept;
  ShadowScene& operator=(ShadowScene&&) noexcept;

  /// Copies the opacities; returns the map's number. Throws Error{kBadInput} for an empty map or one beyond 65536 in a
  /// direction.
  std::uint32_t add_alpha_map(const AlphaView& view);

  /// Copies the mesh; returns its number. Numbers are given in order and never again. Throws Error{kBadInput} naming
  /// the first vertex that is not finite, index out of range, or view of the wrong length; Error{kLimit} beyond 2^31 -
  /// 1 triangles or 2^32 - 2 vertices.
  std::uint32_t add_mesh(const MeshView& view);
  /// Throws Error{kUsage} for a mesh that is not there, here and below.
  void remove_mesh(std::uint32_t mesh);
  /// New object-space positions, as many as before; triangles stay.
  void set_positions(std::uint32_t mesh, const PointView& positions);
  /// Another place for the mesh. Throws Error{kBadInput} for values that are not finite.
  void set_transform(std::uint32_t mesh, const Transform& transform);

  /// Widens the box that the frame is made for: where meshes and receivers will be that are far from all meshes now. It
  /// never shrinks. Throws Error{kBadInput} for positions that are not finite.
  void extend(const PointView& points_world);
  /// Makes the frame reach all of a light, however far it is: the scene stays in its middle.
  void extend(const Light& light);

  /// Does all that changed. Costs nothing when nothing did. Throws Error{kCancelled} and what `execution` throws.
  void commit(const Execution& execution = {});
  /// Is there nothing to commit?
  bool committed() const;

  /// World-space box that lights and receivers may be in: its lowest and highest corner. Of the last commit.
  std::array<dvec3, 2> reach() const;
  /// From the local frame of the last commit, in which a G-buffer has its positions.
  dvec3 to_world(const dvec3& local) const;
  /// Which triangle has this number in a G-buffer or a picture of this scene. Of the last commit. Throws Error{kUsage}.
  MeshTriangle triangle_of(std::uint32_t number) const;

  const SceneStats& stats() const;  // counters since the scene was made

  struct HALFSHADE_LOCAL Impl;
  const Impl& impl() const { return *impl_; }  // for the library's own use

 private:
  std::unique_ptr<Impl> impl_;
};

}  // namespace halfshade
