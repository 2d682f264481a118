// The built-in scenes: well-formed, closed where they say so, the same bits every time.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <span>
#include <type_traits>

#include <tbb/task_arena.h>

#include <glm/vector_relational.hpp>

#include "halfshade/error.h"
#include "rasterizer/core/hash.h"
#include "rasterizer/core/parallel.h"
#include "rasterizer/core/unit_circle.h"
#include "rasterizer/scenes/builtin.h"

using namespace halfshade;

namespace {

struct Case {
  const char* name;
  std::uint32_t size;
};

// Every scene at its default, and at the smallest and at some odd size.
constexpr Case kCases[] = {
    {"demo", 0},       {"demo", 8},         {"columns", 0},      {"columns", 1}, {"bars", 0},   {"bars", 1},
    {"fence", 0},      {"fence", 5},        {"fence_mesh", 0},   {"room", 0},    {"room", 1},   {"fence_mesh", 5},
    {"torus_knot", 0}, {"torus_knot", 300}, {"torus_knot", 777}, {"grass", 0},   {"grass", 1},  {"hairball", 0},
    {"hairball", 1},   {"field", 0},        {"field", 1},        {"sphere", 0},  {"sphere", 4}, {"sphere", 5},
    {"glass", 0},      {"glass", 8},
};

bool all_finite(const dvec3& p) { return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z); }

bool same_bytes(const auto& a, const auto& b) {
  using T = typename std::remove_cvref_t<decltype(a)>::value_type;
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0);
}

/// Every bit of the geometry and of the textures, folded into 32.
std::uint32_t fingerprint(const Scene& scene) {
  std::uint32_t hash = 0;
  const auto add = [&](const auto& array) {
    for (const auto byte : std::as_bytes(std::span(array))) hash = hash32(hash, std::to_integer<std::uint32_t>(byte));
  };
  add(scene.positions), add(scene.triangles), add(scene.triangle_materials);
  add(scene.triangle_uvs), add(scene.triangle_normals);
  for (const ColorMap& map : scene.color_maps) add(map.rgb);
  for (const AlphaMap& map : scene.alpha_maps) add(map.alpha);
  return hash;
}

/// Triangles of the materials whose name is in `names`.
std::vector<std::array<std::uint32_t, 3>> triangles_of(const Scene& scene, std::initializer_list<const char*> names) {
  std::vector<std::array<std::uint32_t, 3>> result;
  for (std::size_t t = 0; t < scene.triangles.size(); ++t) {
    const std::string& name = scene.materials[scene.triangle_materials[t]].name;
    for (const char* wanted : names) {
      if (name == wanted) result.push_back(scene.triangles[t]);
    }
  }
  return result;
}

/// Every directed edge occurs exactly once, and so does its opposite.
bool closed_and_oriented(const std::vector<std::array<std::uint32_t, 3>>& triangles) {
  std::vector<std::uint64_t> edges, opposites;
  for (const auto& t : triangles) {
    for (std::size_t i = 0; i < 3; ++i) {
      const std::uint64_t a = t[i], b = t[(i + 1) % 3];
      edges.push_back(a << 32 | b);
      opposites.push_back(b << 32 | a);
    }
  }
  std::sort(edges.begin(), edges.end());
  std::sort(opposites.begin(), opposites.end());
  return !edges.empty() && std::adjacent_find(edges.begin(), edges.end()) == edges.end() && edges == opposites;
}

double signed_volume(const Scene& scene, const std::vector<std::array<std::uint32_t, 3>>& triangles) {
  double sum = 0.0;
  for (const auto& t : triangles) {
    sum += glm::dot(scene.positions[t[0]], glm::cross(scene.positions[t[1]], scene.positions[t[2]]));
  }
  return sum / 6.0;
}

dvec3 facing(const Light& light) { return glm::normalize(glm::cross(light.u, light.v)); }

}  // namespace

TEST_CASE("every built-in scene has finite positions, indices in range and complete optional arrays") {
  for (const Case& c : kCases) {
    CAPTURE(c.name);
    CAPTURE(c.size);
    const Scene scene = make_builtin_scene(c.name, c.size).scene;
    CHECK(scene.name == c.name);
    REQUIRE(!scene.triangles.empty());
    CHECK(scene.triangle_materials.size() == scene.triangles.size());
    CHECK(std::all_of(scene.positions.begin(), scene.positions.end(), all_finite));
    const auto vertices = scene.positions.size(), materials = scene.materials.size();
    CHECK(std::all_of(scene.triangles.begin(), scene.triangles.end(),
                      [&](const auto& t) { return t[0] < vertices && t[1] < vertices && t[2] < vertices; }));
    CHECK(std::all_of(scene.triangle_materials.begin(), scene.triangle_materials.end(),
                      [&](std::uint32_t m) { return m < materials; }));
    CHECK((scene.triangle_uvs.empty() || scene.triangle_uvs.size() == scene.triangles.size()));
    CHECK((scene.triangle_normals.empty() || scene.triangle_normals.size() == scene.triangles.size()));
    for (const Material& m : scene.materials) CHECK((m.alpha_map == kNone || m.alpha_map < scene.alpha_maps.size()));
    for (const AlphaMap& m : scene.alpha_maps) CHECK(m.alpha.size() == std::size_t{m.width} * m.height);
  }
}

TEST_CASE("no triangle of a built-in scene is without area") {
  for (const Case& c : kCases) {
    CAPTURE(c.name);
    CAPTURE(c.size);
    const Scene scene = make_builtin_scene(c.name, c.size).scene;
    const auto flat = std::count_if(scene.triangles.begin(), scene.triangles.end(), [&](const auto& t) {
      const dvec3& a = scene.positions[t[0]];
      return glm::length(glm::cross(scene.positions[t[1]] - a, scene.positions[t[2]] - a)) < 1e-12;
    });
    CHECK(flat == 0);
  }
}

TEST_CASE("shading normals are unit and on the outer side of their triangle, or zero") {
  for (const Case& c : kCases) {
    CAPTURE(c.name);
    CAPTURE(c.size);
    const Scene scene = make_builtin_scene(c.name, c.size).scene;
    std::size_t wrong = 0;
    for (std::size_t t = 0; t < scene.triangle_normals.size(); ++t) {
      const auto& corners = scene.triangles[t];
      const dvec3& a = scene.positions[corners[0]];
      const dvec3 outward = glm::cross(scene.positions[corners[1]] - a, scene.positions[corners[2]] - a);
      for (const vec3& normal : scene.triangle_normals[t]) {
        if (normal == vec3{0.0f}) continue;
        wrong += std::fabs(glm::length(normal) - 1.0f) > 1e-5f || glm::dot(dvec3(normal), outward) <= 0.0;
      }
    }
    CHECK(wrong == 0);
  }
}

TEST_CASE("a scene made twice, with one thread and with several, has the same bits") {
  for (const BuiltinInfo& info : builtin_scenes()) {
    CAPTURE(info.name);
    const BuiltinScene a = make_builtin_scene(info.name);
    BuiltinScene b;
    tbb::task_arena(1).execute([&] { b = make_builtin_scene(info.name); });
    CHECK(same_bytes(a.scene.positions, b.scene.positions));
    CHECK(same_bytes(a.scene.triangles, b.scene.triangles));
    CHECK(same_bytes(a.scene.triangle_materials, b.scene.triangle_materials));
    CHECK(same_bytes(a.scene.triangle_uvs, b.scene.triangle_uvs));
    CHECK(same_bytes(a.scene.triangle_normals, b.scene.triangle_normals));
  }
}

// Benchmarks and tests quote hashes of masks: a scene that another compiler, library or processor makes of other bits
// would look like wrong shadows there.
TEST_CASE("built-in scenes have the same bits whatever compiles them") {
  const struct {
    std::string_view name;
    std::uint32_t hash;
  } kExpected[] = {
      {"demo", 0x66db3ca7},       {"columns", 0xc50a9b26}, {"bars", 0x2ff0396c},       {"fence", 0x8f13082f},
      {"fence_mesh", 0x100cc38f}, {"room", 0x378ddcc8},    {"torus_knot", 0xa1dc4ace}, {"grass", 0xdf7c6ee1},
      {"hairball", 0xb4a0967d},   {"field", 0xa175920b},   {"sphere", 0x8f14a40f},     {"glass", 0x58ec2a1d},
  };
  CHECK(std::size(kExpected) == builtin_scenes().size());
  for (const auto& [name, hash] : kExpected) {
    CAPTURE(name);
    CHECK(fingerprint(make_builtin_scene(name).scene) == hash);
  }
}

TEST_CASE("torus knot, sphere, hairs, core and animals are closed, consistently wound and face outwards") {
  const struct {
    Case scene;
    std::initializer_list<const char*> materials;
  } solids[] = {
      {{"torus_knot", 0}, {"knot"}}, {{"torus_knot", 301}, {"knot"}},
      {{"sphere", 0}, {"ball"}},     {{"sphere", 7}, {"ball"}},
      {{"hairball", 200}, {"core"}}, {{"hairball", 200}, {"hair", "light hair"}},
      {{"field", 5}, {"skin"}},      {{"field", 5}, {"white wool", "brown wool"}},
      {{"columns", 3}, {"stone"}},   {{"bars", 3}, {"steel", "brass"}},
      {{"grass", 10}, {"stone"}},    {{"demo", 0}, {"knot"}},
      {{"demo", 0}, {"limestone"}},  {{"demo", 0}, {"clay"}},
      {{"demo", 0}, {"stem"}},       {{"demo", 0}, {"brass"}},
      {{"glass", 8}, {"slab"}},      {{"glass", 8}, {"ball"}},
  };
  for (const auto& solid : solids) {
    CAPTURE(solid.scene.name);
    CAPTURE(*solid.materials.begin());
    const Scene scene = make_builtin_scene(solid.scene.name, solid.scene.size).scene;
    const auto triangles = triangles_of(scene, solid.materials);
    CHECK(closed_and_oriented(triangles));
    CHECK(signed_volume(scene, triangles) > 0.0);
  }
}

TEST_CASE("each single hair is a closed tube around a positive volume") {
  const Scene scene = make_builtin_scene("hairball", 500).scene;
  const auto hairs = triangles_of(scene, {"hair", "light hair"});
  REQUIRE(hairs.size() == 500 * 44);
  for (std::size_t hair = 0; hair < 500; ++hair) {
    const auto first = hairs.begin() + static_cast<std::ptrdiff_t>(hair * 44);
    const std::vector<std::array<std::uint32_t, 3>> tube(first, first + 44);
    REQUIRE(closed_and_oriented(tube));
    REQUIRE(signed_volume(scene, tube) > 0.0);
  }
}

TEST_CASE("the room is one closed surface that faces inwards, with camera and light inside") {
  const BuiltinScene room = make_builtin_scene("room");
  const auto walls = triangles_of(room.scene, {"floor boards", "ceiling", "left wall", "wall"});
  CHECK(walls.size() == 12);
  CHECK(closed_and_oriented(walls));
  CHECK(signed_volume(room.scene, walls) < 0.0);
  dvec3 low{1e9}, high{-1e9};
  for (const dvec3& p : room.scene.positions) {
    low = glm::min(low, p);
    high = glm::max(high, p);
  }
  for (const dvec3& p : {room.view.camera.eye, room.view.lights[0].center}) {
    CHECK(glm::all(glm::lessThan(low, p)));
    CHECK(glm::all(glm::lessThan(p, high)));
  }
}

TEST_CASE("every view has a usable camera and one rectangular light that faces the scene") {
  for (const BuiltinInfo& info : builtin_scenes()) {
    CAPTURE(info.name);
    const BuiltinScene built = make_builtin_scene(info.name);
    const Camera& camera = built.view.camera;
    CHECK(glm::length(glm::cross(camera.target - camera.eye, camera.up)) > 0.1);
    CHECK(camera.fov_y_deg > 20.0);
    CHECK(camera.fov_y_deg < 90.0);
    REQUIRE(built.view.lights.size() == 1);
    const Light& light = built.view.lights[0];
    CHECK(light.shape == LightShape::kRectangle);
    CHECK(std::fabs(glm::dot(light.u, light.v)) < 1e-12);
    CHECK(glm::length(light.u) > 0.1);
    CHECK(glm::dot(facing(light), camera.target - light.center) > 0.0);
  }
}

TEST_CASE("a size out of range and an unknown name are usage errors that name what is allowed") {
  const auto message = [](const char* name, std::uint32_t size) -> std::string {
    try {
      make_builtin_scene(name, size);
    } catch (const Error& error) {
      CHECK(error.code() == ErrorCode::kUsage);
      return error.what();
    }
    return "";
  };
  CHECK(message("sphere", 3).find("size 3 is outside 4..4096") != std::string::npos);
  CHECK(message("sphere", 4097).find("4..4096") != std::string::npos);
  CHECK(message("torus_knot", 299).find("300..20000000") != std::string::npos);
  CHECK(message("castle", 0).find("columns, bars, fence") != std::string::npos);
}

TEST_CASE("the size of the scalable scenes is what it says") {
  CHECK(triangles_of(make_builtin_scene("grass", 1234).scene, {"grass", "young grass", "dry grass"}).size() ==
        5 * 1234);
  const auto knot = triangles_of(make_builtin_scene("torus_knot", 100000).scene, {"knot"}).size();
  CHECK(knot > 99000);
  CHECK(knot <= 100000);
  const auto hairball = make_builtin_scene("hairball").scene.triangles.size();
  CHECK(hairball > 44000);
  CHECK(hairball < 46000);
  CHECK(make_builtin_scene("demo").scene.triangles.size() < 60000);
}

TEST_CASE("the fence card is opaque exactly where the mesh fence has a bar") {
  for (const std::uint32_t pickets : {1u, 5u, 16u}) {
    CAPTURE(pickets);
    const Scene card = make_builtin_scene("fence", pickets).scene;
    const Scene mesh = make_builtin_scene("fence_mesh", pickets).scene;
    // The card is the only textured quad: its first triangle runs from the low corner to the high one.
    const std::uint32_t t = static_cast<std::uint32_t>(card.triangles.size()) - 2;
    const dvec3 low = card.positions[card.triangles[t][0]], high = card.positions[card.triangles[t][2]];
    const vec2 repeats = card.triangle_uvs[t][2];
    const AlphaMap& map = card.alpha_maps[0];
    const auto bars = triangles_of(mesh, {"fence"});
    std::size_t opaque_count = 0, wrong = 0;
    for (std::uint32_t i = 0; i < 20000; ++i) {
      const double s = hash_unit(i, 1), r = hash_unit(i, 2);
      const double x = low.x + s * (high.x - low.x), y = low.y + r * (high.y - low.y);
      const double u = s * repeats.x, v = r * repeats.y;
      const auto column = static_cast<std::uint32_t>((u - std::floor(u)) * map.width);
      const auto row = map.height - 1 - static_cast<std::uint32_t>(v * map.height);
      const bool opaque = map.alpha[row * map.width + column] == 255;
      const bool inside = std::any_of(bars.begin(), bars.end(), [&](const auto& b) {
        const dvec3 p[3] = {mesh.positions[b[0]], mesh.positions[b[1]], mesh.positions[b[2]]};
        const auto left_of = [&](const dvec3& from, const dvec3& to) {
          return (to.x - from.x) * (y - from.y) - (to.y - from.y) * (x - from.x) >= 0.0;
        };
        return left_of(p[0], p[1]) && left_of(p[1], p[2]) && left_of(p[2], p[0]);
      });
      opaque_count += opaque;
      wrong += opaque != inside;
    }
    CHECK(wrong == 0);
    CHECK(opaque_count > 8000);
    CHECK(opaque_count < 14000);
  }
}

TEST_CASE("fence coordinates are exact in float, so card and mesh share one lattice") {
  for (const char* name : {"fence", "fence_mesh"}) {
    for (const dvec3& p : make_builtin_scene(name, 100).scene.positions) {
      REQUIRE(p.x * 0x1p12 == std::floor(p.x * 0x1p12));
      REQUIRE(p.y * 0x1p12 == std::floor(p.y * 0x1p12));
    }
  }
}

TEST_CASE("the unit circle is exact at quarter turns and close to libm elsewhere") {
  CHECK(unit_circle(0.0) == dvec2{1.0, 0.0});
  CHECK(unit_circle(0.25) == dvec2{0.0, 1.0});
  CHECK(unit_circle(0.5) == dvec2{-1.0, 0.0});
  CHECK(unit_circle(-0.25) == dvec2{0.0, -1.0});
  double worst = 0.0;
  for (int i = -3000; i <= 3000; ++i) {
    const double turns = i / 977.0, angle = turns * 6.283185307179586477;
    const dvec2 p = unit_circle(turns);
    worst = std::max({worst, std::fabs(p.x - std::cos(angle)), std::fabs(p.y - std::sin(angle))});
  }
  CHECK(worst < 1e-14);  // most of it is the rounding of `angle`
}
