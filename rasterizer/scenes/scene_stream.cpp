#include "rasterizer/scenes/scene_stream.h"

#include <algorithm>
#include <utility>

#include "halfshade/error.h"
#include "rasterizer/scenes/builtin.h"
#include "rasterizer/scenes/recipes.h"

namespace halfshade {
namespace {

template <class T>
void copy_run(const std::vector<T>& from, std::size_t first, std::size_t count, std::vector<T>& to) {
  to.clear();
  if (!from.empty()) to.assign(from.begin() + std::ptrdiff_t(first), from.begin() + std::ptrdiff_t(first + count));
}

struct Box {
  dvec3 low{0.0}, high{0.0};
};

Box box_of(const Scene& scene) {
  if (scene.positions.empty()) return {};
  Box box{scene.positions[0], scene.positions[0]};
  for (const dvec3& p : scene.positions) box = {glm::min(box.low, p), glm::max(box.high, p)};
  return box;
}

/// A run of triangles with the positions they use; and the box of all positions, used or not, as the local frame
/// depends on them.
void copy_piece(const Scene& scene, const Box& box, std::size_t first, std::size_t count, Scene& piece) {
  copy_run(scene.triangles, first, count, piece.triangles);
  copy_run(scene.triangle_materials, first, count, piece.triangle_materials);
  copy_run(scene.triangle_uvs, first, count, piece.triangle_uvs);
  copy_run(scene.triangle_normals, first, count, piece.triangle_normals);
  std::vector<std::uint32_t> used;
  for (const auto& t : piece.triangles) used.insert(used.end(), t.begin(), t.end());
  std::sort(used.begin(), used.end());
  used.erase(std::unique(used.begin(), used.end()), used.end());
  piece.positions.clear();
  for (const std::uint32_t p : used) piece.positions.push_back(scene.positions[p]);
  piece.positions.insert(piece.positions.end(), {box.low, box.high});
  for (auto& t : piece.triangles) {
    for (std::uint32_t& corner : t) {
      corner = static_cast<std::uint32_t>(std::lower_bound(used.begin(), used.end(), corner) - used.begin());
    }
  }
}

/// Materials and maps of a scene, without its geometry.
Scene without_geometry(const Scene& scene) {
  Scene common;
  common.name = scene.name;
  common.materials = scene.materials;
  common.color_maps = scene.color_maps;
  common.alpha_maps = scene.alpha_maps;
  return common;
}

/// The lawn: first everything but blades, then blades by number.
StreamedScene stream_grass(std::uint32_t size, std::size_t triangles_per_piece) {
  auto base = std::make_shared<BuiltinScene>();
  base->scene.name = "grass";
  make_lawn(*base);
  StreamedScene result;
  result.view = base->view;
  result.stream.piece = without_geometry(base->scene);
  const auto per_piece =
      static_cast<std::uint32_t>(std::clamp<std::size_t>(triangles_per_piece / kBladeTriangles, 1, size));
  auto next = std::make_shared<std::int64_t>(-1);  // blade; -1 = the base
  result.stream.rewind = [next] { *next = -1; };
  result.stream.next = [next, base, size, per_piece](Scene& piece) {
    if (*next >= std::int64_t{size}) return false;
    if (*next < 0) {
      copy_piece(base->scene, box_of(base->scene), 0, base->scene.triangles.size(), piece);
      *next = 0;
      return true;
    }
    const auto first = static_cast<std::uint32_t>(*next), count = std::min(per_piece, size - first);
    piece.positions.clear(), piece.triangles.clear(), piece.triangle_materials.clear();
    add_blades(first, count, size, piece);
    *next += count;
    return true;
  };
  return result;
}

}  // namespace

SceneStream stream_of_scene(std::shared_ptr<const Scene> scene, std::size_t triangles_per_piece) {
  SceneStream stream;
  stream.piece = without_geometry(*scene);
  auto next = std::make_shared<std::size_t>(0);
  stream.rewind = [next] { *next = 0; };
  const Box box = box_of(*scene);
  stream.next = [next, box, scene = std::move(scene), triangles_per_piece](Scene& piece) {
    const std::size_t count = std::min(triangles_per_piece, scene->triangles.size() - *next);
    if (count == 0) return false;
    copy_piece(*scene, box, *next, count, piece);
    *next += count;
    return true;
  };
  return stream;
}

StreamedScene stream_builtin_scene(std::string_view name, std::uint32_t size, std::size_t triangles_per_piece) {
  if (triangles_per_piece == 0) throw Error(ErrorCode::kUsage, "triangles per piece: 0 is not in 1..2^32 - 1");
  if (name == "grass") return stream_grass(checked_builtin_size(name, size), triangles_per_piece);
  BuiltinScene whole = make_builtin_scene(name, size);
  StreamedScene result;
  result.view = std::move(whole.view);
  result.stream = stream_of_scene(std::make_shared<const Scene>(std::move(whole.scene)), triangles_per_piece);
  return result;
}

}  // namespace halfshade
