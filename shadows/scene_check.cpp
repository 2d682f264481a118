#include "shadows/scene_check.h"

#include <cmath>

#include "rasterizer/core/lattice.h"

namespace halfshade {
namespace {

constexpr float kLargestUv = 0x1p30f;  // see shadows/alpha.h
constexpr std::uint32_t kLargestSide = 65536;

[[noreturn]] void fail(const std::string& what) { throw Error(ErrorCode::kBadInput, what); }

std::string numbered(const char* what, std::size_t number) { return what + (' ' + std::to_string(number)); }

void check_index(const char* owner, std::size_t number, const char* what, std::uint32_t index, std::size_t count) {
  if (index < count) return;
  fail(numbered(owner, number) + ": " + what + " " + std::to_string(index) + " is out of range, " +
       (count == 0 ? std::string("there are none") : "allowed 0.." + std::to_string(count - 1)));
}

/// One entry per triangle; where that is allowed, none at all.
void check_length(const char* what, std::size_t length, std::size_t triangles, bool may_be_empty) {
  if (length == triangles || (may_be_empty && length == 0)) return;
  fail(std::string(what) + ": " + std::to_string(length) + " entries for " + std::to_string(triangles) + " triangles");
}

template <class Map>
void check_map(const char* what, std::size_t number, const Map& map, std::size_t bytes, std::size_t texel_bytes) {
  const auto fits = [](std::uint32_t side) { return side >= 1 && side <= kLargestSide; };
  if (fits(map.width) && fits(map.height) && bytes == texel_bytes * map.width * map.height) return;
  fail(numbered(what, number) + ": " + std::to_string(bytes) + " bytes for " + std::to_string(map.width) + " x " +
       std::to_string(map.height) + " texels, allowed 1..65536 each");
}

void check_materials(const Scene& scene) {
  for (std::size_t i = 0; i < scene.color_maps.size(); ++i) {
    check_map("color map", i, scene.color_maps[i], scene.color_maps[i].rgb.size(), 3);
  }
  for (std::size_t i = 0; i < scene.alpha_maps.size(); ++i) {
    check_map("alpha map", i, scene.alpha_maps[i], scene.alpha_maps[i].alpha.size(), 1);
  }
  for (std::size_t i = 0; i < scene.materials.size(); ++i) {
    const Material& m = scene.materials[i];
    if (m.color_map != kNone) check_index("material", i, "color map", m.color_map, scene.color_maps.size());
    if (m.alpha_map != kNone) check_index("material", i, "alpha map", m.alpha_map, scene.alpha_maps.size());
    if (m.transmittance_map != kNone) {
      check_index("material", i, "transmittance map", m.transmittance_map, scene.color_maps.size());
    }
  }
}

}  // namespace

void check_scene(const Scene& scene) {
  const std::size_t count = scene.triangles.size();
  check_length("triangle_materials", scene.triangle_materials.size(), count, scene.triangle_uvs.empty());
  check_length("triangle_uvs", scene.triangle_uvs.size(), count, true);
  check_materials(scene);
  for (std::size_t i = 0; i < scene.positions.size(); ++i) {
    if (!is_finite(scene.positions[i])) fail(numbered("position", i) + " is not finite");
  }
  for (std::size_t t = 0; t < count; ++t) {
    for (const std::uint32_t p : scene.triangles[t]) check_index("triangle", t, "position", p, scene.positions.size());
  }
  for (std::size_t t = 0; t < scene.triangle_materials.size(); ++t) {
    check_index("triangle", t, "material", scene.triangle_materials[t], scene.materials.size());
  }
  for (std::size_t t = 0; t < scene.triangle_uvs.size(); ++t) {
    for (const vec2& uv : scene.triangle_uvs[t]) {
      if (std::fabs(uv.x) <= kLargestUv && std::fabs(uv.y) <= kLargestUv) continue;
      fail(numbered("triangle", t) + ": a texture coordinate is out of range, allowed -2^30..2^30");
    }
  }
}

void check_own_triangles(std::span<const Receiver> receivers, std::size_t triangles) {
  for (std::size_t i = 0; i < receivers.size(); ++i) {
    if (receivers[i].triangle != kNone) check_index("receiver", i, "own triangle", receivers[i].triangle, triangles);
  }
}

}  // namespace halfshade
