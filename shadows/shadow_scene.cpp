#include "halfshade/shadow_scene.h"

#include <algorithm>

#include "rasterizer/core/parallel.h"
#include "shadows/light_samples.h"
#include "shadows/scene_store.h"
#include "shadows/view_access.h"

namespace halfshade {
namespace {

[[noreturn]] void bad_input(const std::string& what) { throw Error(ErrorCode::kBadInput, what); }

void check_transform(const Transform& transform) {
  for (const auto& row : transform.row) {
    for (const double x : row) {
      if (!std::isfinite(x)) bad_input("mesh: the transform is not finite");
    }
  }
}

/// World-space box of the mesh; throws unless all positions are finite, in object and in world space.
WorldBox box_of(const PointView& positions, const Transform& transform) {
  WorldBox box;
  for (std::size_t i = 0; i < positions.count; ++i) {
    const dvec3 p = element(positions, i);
    if (!is_finite(p)) bad_input("mesh: position " + std::to_string(i) + " is not finite");
    const dvec3 world = apply(transform, p);
    if (!is_finite(world)) bad_input("mesh: position " + std::to_string(i) + " is not finite in world space");
    box.add(world);
  }
  return box;
}

std::vector<std::array<std::uint32_t, 3>> read_triangles(const MeshView& view) {
  const std::size_t vertices = view.positions.count;
  const std::size_t count = view.triangles.empty() ? vertices / 3 : view.triangles.count;
  if (view.triangles.empty() && vertices % 3 != 0) {
    bad_input("mesh: " + std::to_string(vertices) + " positions without triangles are not a multiple of 3");
  }
  if (count >= 0x7fffffffu) {
    throw Error(ErrorCode::kLimit, "mesh: " + std::to_string(count) + " triangles, 2^31 - 1 are allowed");
  }
  std::vector<std::array<std::uint32_t, 3>> triangles(count);
  for (std::size_t t = 0; t < count; ++t) {
    const auto first = static_cast<std::uint32_t>(3 * t);
    triangles[t] = view.triangles.empty() ? std::array{first, first + 1, first + 2} : element(view.triangles, t);
    for (const std::uint32_t v : triangles[t]) {
      if (v < vertices) continue;
      bad_input("mesh: triangle " + std::to_string(t) + " has vertex " + std::to_string(v) + ", there are " +
                std::to_string(vertices));
    }
  }
  return triangles;
}

std::vector<vec2> read_uvs(const MeshView& view, std::size_t maps) {
  if (view.alpha_map == kNone) return {};
  if (view.alpha_map >= maps) {
    bad_input("mesh: alpha map " + std::to_string(view.alpha_map) + ", the scene has " + std::to_string(maps));
  }
  if (view.uvs.count != view.positions.count) {
    bad_input("mesh: " + std::to_string(view.uvs.count) + " texture coordinates for " +
              std::to_string(view.positions.count) + " positions");
  }
  constexpr float kMost = 0x1p30f;  // what the exact lookup holds (alpha.h)
  std::vector<vec2> uvs(view.uvs.count);
  for (std::size_t i = 0; i < uvs.size(); ++i) {
    uvs[i] = element(view.uvs, i);
    if (!(std::fabs(uvs[i].x) <= kMost && std::fabs(uvs[i].y) <= kMost)) {
      bad_input("mesh: texture coordinate " + std::to_string(i) + " is not within -2^30..2^30");
    }
  }
  return uvs;
}

StoredMesh store_mesh(const MeshView& view, std::size_t maps) {
  StoredMesh mesh;
  check_transform(view.transform);
  mesh.box = box_of(view.positions, view.transform);
  mesh.triangles = read_triangles(view);
  mesh.uvs = read_uvs(view, maps);
  mesh.positions.resize(view.positions.count);
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) mesh.positions[i] = element(view.positions, i);
  mesh.transform = view.transform;
  mesh.alpha_map = view.alpha_map;
  if (!(view.alpha_cutoff >= 0.0f)) bad_input("mesh: the alpha cutoff is not a number of at least 0");
  mesh.alpha_cutoff = view.alpha_cutoff;
  mesh.albedo = view.albedo;
  return mesh;
}

void check_totals(const ShadowScene::Impl& scene, const StoredMesh& mesh) {
  std::uint64_t triangles = mesh.triangles.size(), vertices = mesh.positions.size();
  for (const StoredMesh& m : scene.meshes) triangles += m.triangles.size(), vertices += m.positions.size();
  if (triangles > 0x7fffffffu || vertices >= kNone) {
    throw Error(ErrorCode::kLimit, "scene: " + std::to_string(triangles) + " triangles and " +
                                       std::to_string(vertices) + " vertices, 2^31 - 1 and 2^32 - 2 are allowed");
  }
}

}  // namespace

const StoredMesh* ShadowScene::Impl::find(std::uint32_t id) const {
  const auto at = std::lower_bound(meshes.begin(), meshes.end(), id,
                                   [](const StoredMesh& m, std::uint32_t wanted) { return m.id < wanted; });
  return at != meshes.end() && at->id == id ? &*at : nullptr;
}

StoredMesh& ShadowScene::Impl::get(std::uint32_t id) {
  const StoredMesh* stored = find(id);
  if (stored == nullptr) throw Error(ErrorCode::kUsage, "mesh " + std::to_string(id) + " is not in the scene");
  return const_cast<StoredMesh&>(*stored);  // of this scene, which is not const
}

ShadowScene::ShadowScene(const SceneConfig& config) : impl_(std::make_unique<Impl>()) {
  if (!(config.rebuild_cost == 0.0 || config.rebuild_cost >= 1.0)) {
    throw Error(ErrorCode::kUsage, "rebuild cost: " + std::to_string(config.rebuild_cost) + " is neither 0 nor >= 1");
  }
  impl_->config = config;
  impl_->committed = false;  // the first commit makes the empty scene
  impl_->laid_out = impl_->tree_is_current = false;
}

ShadowScene::~ShadowScene() = default;
ShadowScene::ShadowScene(ShadowScene&&) noexcept = default;
ShadowScene& ShadowScene::operator=(ShadowScene&&) noexcept = default;

std::uint32_t ShadowScene::add_alpha_map(const AlphaView& view) {
  constexpr std::uint32_t kMost = 65536;
  if (view.data == nullptr || view.width < 1 || view.height < 1 || view.width > kMost || view.height > kMost) {
    bad_input("alpha map: " + std::to_string(view.width) + " x " + std::to_string(view.height) +
              " texels, 1..65536 each way are allowed");
  }
  AlphaMap map;
  map.width = view.width, map.height = view.height;
  map.alpha.resize(std::size_t{view.width} * view.height);
  const std::size_t texel = view.texel_bytes != 0 ? view.texel_bytes : 1;
  const std::size_t row = view.row_bytes != 0 ? view.row_bytes : view.width * texel;
  for (std::size_t y = 0; y < view.height; ++y) {
    for (std::size_t x = 0; x < view.width; ++x) map.alpha[y * view.width + x] = view.data[y * row + x * texel];
  }
  impl_->attributes.alpha_maps.push_back(std::move(map));
  impl_->committed = impl_->laid_out = false;  // triangles of earlier lookups point to maps that may have moved
  return static_cast<std::uint32_t>(impl_->attributes.alpha_maps.size() - 1);
}

std::uint32_t ShadowScene::add_mesh(const MeshView& view) {
  const FpEnvironment environment;
  StoredMesh mesh = store_mesh(view, impl_->attributes.alpha_maps.size());
  check_totals(*impl_, mesh);
  if (impl_->next_id == kNone) throw Error(ErrorCode::kLimit, "scene: mesh numbers are used up");
  mesh.id = impl_->next_id;
  impl_->meshes.push_back(std::move(mesh));
  impl_->committed = impl_->laid_out = impl_->tree_is_current = false;
  return impl_->next_id++;
}

void ShadowScene::remove_mesh(std::uint32_t mesh) {
  impl_->meshes.erase(impl_->meshes.begin() + (&impl_->get(mesh) - impl_->meshes.data()));
  impl_->committed = impl_->laid_out = impl_->tree_is_current = false;
}

void ShadowScene::set_positions(std::uint32_t mesh, const PointView& positions) {
  const FpEnvironment environment;
  StoredMesh& stored = impl_->get(mesh);
  if (positions.count != stored.positions.size()) {
    bad_input("mesh " + std::to_string(mesh) + ": " + std::to_string(positions.count) + " positions, it has " +
              std::to_string(stored.positions.size()));
  }
  stored.box = box_of(positions, stored.transform);
  for (std::size_t i = 0; i < positions.count; ++i) stored.positions[i] = element(positions, i);
  stored.rounded = impl_->committed = false;
}

void ShadowScene::set_transform(std::uint32_t mesh, const Transform& transform) {
  const FpEnvironment environment;
  StoredMesh& stored = impl_->get(mesh);
  if (transform == stored.transform) return;
  check_transform(transform);
  stored.box = box_of(stored.positions, transform);
  stored.transform = transform;
  stored.rounded = impl_->committed = false;
}

namespace {

/// Does `box` grow?
bool widen(const PointView& points_world, WorldBox& box) {
  const FpEnvironment environment;
  const WorldBox before = box;
  box.add(box_of(points_world, Transform{}));
  return !(box == before);
}

}  // namespace

void ShadowScene::extend(const PointView& points_world) {
  if (widen(points_world, impl_->extension)) impl_->committed = false;
}

void ShadowScene::extend(const Light& light) {
  if (widen(PointView(light_extent(light)), impl_->lights)) impl_->committed = false;
}

void ShadowScene::commit(const Execution& execution) {
  run_call(execution, [&] { commit_scene(*impl_); });
}

bool ShadowScene::committed() const { return impl_->committed; }

std::array<dvec3, 2> ShadowScene::reach() const {
  const FpEnvironment environment;
  const dvec3 center = impl_->mesh.frame.center(), half(frame_half_width(impl_->mesh.frame));
  return {center - half, center + half};
}

dvec3 ShadowScene::to_world(const dvec3& local) const {
  const FpEnvironment environment;
  return impl_->mesh.frame.to_world(local);
}

MeshTriangle ShadowScene::triangle_of(std::uint32_t number) const {
  const auto after = std::upper_bound(impl_->meshes.begin(), impl_->meshes.end(), number,
                                      [](std::uint32_t n, const StoredMesh& mesh) { return n < mesh.first_triangle; });
  if (!impl_->committed || number >= impl_->mesh.triangles.size()) {
    throw Error(ErrorCode::kUsage, "triangle " + std::to_string(number) + " is not in the committed scene");
  }
  const StoredMesh& mesh = *(after - 1);
  return {mesh.id, number - mesh.first_triangle};
}

std::uint32_t ShadowScene::Impl::triangle_number(const MeshTriangle& triangle) const {
  const StoredMesh* stored = find(triangle.mesh);
  if (stored == nullptr || triangle.triangle >= stored->triangles.size()) return kNone;
  return stored->first_triangle + triangle.triangle;
}

const SceneStats& ShadowScene::stats() const { return impl_->stats; }

void require_committed(const ShadowScene::Impl& scene) {
  if (!scene.committed) throw Error(ErrorCode::kUsage, "the scene has changes that are not committed");
}

}  // namespace halfshade
