#include "rasterizer/scenes/hard_cases.h"

#include <cmath>

#include <glm/common.hpp>

#include "rasterizer/core/unit_circle.h"
#include "rasterizer/scenes/random.h"

namespace halfshade::cases {
namespace {

dvec3 in_box(Random& random, double low, double high) {
  const double x = random.range(low, high), y = random.range(low, high);
  return {x, y, random.range(low, high)};
}

}  // namespace

Scene scene_of(const Triangles& triangles) {
  Scene scene;
  scene.materials.emplace_back();
  for (const Triangle& t : triangles) {
    const auto first = static_cast<std::uint32_t>(scene.positions.size());
    scene.positions.insert(scene.positions.end(), t.begin(), t.end());
    scene.triangles.push_back({first, first + 1, first + 2});
    scene.triangle_materials.push_back(0);
  }
  return scene;
}

Triangles joined(Triangles a, const Triangles& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

Triangles quad(const dvec3& a, const dvec3& b, const dvec3& c, const dvec3& d) { return {{a, b, c}, {a, c, d}}; }

Triangles box(const dvec3& low, const dvec3& high) {
  const auto corner = [&](int i) {
    return dvec3(i & 1 ? high.x : low.x, i & 2 ? high.y : low.y, i & 4 ? high.z : low.z);
  };
  Triangles result;
  for (const auto& f : {std::array{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}}) {
    result = joined(std::move(result), quad(corner(f[0]), corner(f[1]), corner(f[2]), corner(f[3])));
  }
  return result;
}

Light frame_light() {
  Light light;
  light.center = {0.0, 4.0, 0.0};
  light.u = {2.0, 0.0, 0.0};  // u x v points down
  light.v = {0.0, 0.0, 2.0};
  return light;
}

Triangles half_plane(double slant) {
  return quad({-64, 2, -64}, {-64 * slant, 2, -64}, {64 * slant, 2, 64}, {-64, 2, 64});
}

Triangles plate(double y) { return quad({-1, y, -1}, {1, y, -1}, {1, y, 1}, {-1, y, 1}); }

Triangles wire(double width) {
  const double x = 0.5 * width;
  return quad({-x, 2, -64}, {x, 2, -64}, {x, 2, 64}, {-x, 2, 64});
}

Triangles both_sides_lit() { return {{dvec3(0, 1, -1), dvec3(0, 1, 1), dvec3(0, 3, 0)}}; }

Triangles piercing_light() { return {{dvec3(-0.5, 3, 0), dvec3(0.5, 5, 0), dvec3(0, 4, 1)}}; }

Triangles through_light_plane() { return {{dvec3(2, 3, 0), dvec3(2, 5, 0.5), dvec3(2, 3, 1)}}; }

Triangles double_cover() {
  Triangles upper = half_plane();
  for (Triangle& t : upper) {
    for (dvec3& p : t) p.y = 2.5;
  }
  return joined(half_plane(), upper);
}

Scene bars() {
  Scene scene = scene_of(quad({-16, 3.5, -16}, {16, 3.5, -16}, {16, 3.5, 16}, {-16, 3.5, 16}));
  scene.alpha_maps.push_back({"bars", 2, 1, {255, 0}});
  scene.materials[0].alpha_map = 0;
  constexpr float kRepeats = 32.0f * 64.0f;
  scene.triangle_uvs = {{vec2(0, 0), vec2(kRepeats, 0), vec2(kRepeats, 1)},
                        {vec2(0, 0), vec2(kRepeats, 1), vec2(0, 1)}};
  return scene;
}

Triangles swarm_at_light(std::uint32_t seed, int count) {
  Triangles triangles;
  for (int i = 0; i < count; ++i) {
    Random random(seed, static_cast<std::uint32_t>(i));
    const double x = random.range(-1, 1), z = random.range(-1, 1);
    const dvec3 center(x, 4.0 - random.range(0.001, 0.01), z);
    Triangle& t = triangles.emplace_back();
    for (dvec3& p : t) p = center + 1e-3 * in_box(random, -1, 1);
  }
  return triangles;
}

Triangles scattered(std::uint32_t seed, int count) {
  Triangles triangles;
  for (int i = 0; i < count; ++i) {
    Random random(seed, static_cast<std::uint32_t>(i));
    const dvec3 center = in_box(random, -4.0, 3.5);
    Triangle& t = triangles.emplace_back();
    for (dvec3& p : t) p = glm::round((center + in_box(random, -0.7, 0.7)) * 1024.0) / 1024.0;
  }
  return triangles;
}

Triangles t_junctions(double reach) {
  constexpr double kCell = 1.0 / 16.0;
  const int cells = static_cast<int>(std::round(reach / kCell));
  Triangles triangles;
  for (int i = -cells; i < cells; ++i) {
    const double x0 = i * kCell, x1 = x0 + kCell, shift = i % 2 == 0 ? 0.0 : 0.5 * kCell;
    for (int k = -cells - 1; k < cells; ++k) {
      const double z0 = std::max(-reach, k * kCell + shift), z1 = std::min(reach, (k + 1) * kCell + shift);
      if (z0 < z1) triangles = joined(std::move(triangles), quad({x0, 2, z0}, {x1, 2, z0}, {x1, 2, z1}, {x0, 2, z1}));
    }
  }
  return triangles;
}

Light accumulation_light() {
  Light light;
  light.shape = LightShape::kDisk;
  light.center = {0, 0, 0};
  light.normal = {0, 0, 1};
  light.radius = 0.5;
  return light;
}

Triangles card(double z, double x0, double x1, double y) {
  return quad({x0, -y, z}, {x1, -y, z}, {x1, y, z}, {x0, y, z});
}

Triangles hidden_card() { return joined(card(1, -0.1, 0.1, 0.1), card(3, -0.3, 0.3, 0.3)); }

Triangles overlapping_cards(double y) { return joined(card(1, -0.6, 0, y), card(3, 0, 0.6, y)); }

Scene smooth_sphere(std::uint32_t segments, std::uint32_t rings) {
  Scene scene;
  scene.materials.emplace_back().diffuse = vec3(1.0f);
  scene.positions = {{0, -1, 0}, {0, 1, 0}};
  for (std::uint32_t ring = 1; ring < rings; ++ring) {
    for (std::uint32_t s = 0; s < segments; ++s) {
      const dvec2 around = unit_circle((s + 0.25) / segments), up = unit_circle(0.5 * ring / rings);
      scene.positions.push_back({up.y * around.x, -up.x, -up.y * around.y});
    }
  }
  const auto vertex = [&](std::uint32_t ring, std::uint32_t s) {
    if (ring == 0 || ring == rings) return ring == 0 ? 0u : 1u;
    return 2 + (ring - 1) * segments + s % segments;
  };
  for (std::uint32_t ring = 0; ring < rings; ++ring) {
    for (std::uint32_t s = 0; s < segments; ++s) {
      const std::uint32_t a = vertex(ring, s), b = vertex(ring, s + 1), c = vertex(ring + 1, s + 1),
                          d = vertex(ring + 1, s);
      if (ring > 0) scene.triangles.push_back({a, b, c});
      if (ring + 1 < rings) scene.triangles.push_back({a, c, d});
      if (ring == 0) scene.triangles.back() = {a, c, d};
    }
  }
  for (const auto& t : scene.triangles) {
    scene.triangle_materials.push_back(0);
    scene.triangle_normals.push_back(
        {vec3(scene.positions[t[0]]), vec3(scene.positions[t[1]]), vec3(scene.positions[t[2]])});
  }
  return scene;
}

Light grazing_light(double size) {
  const dvec2 angle = unit_circle(85.0 / 360.0);
  Light light;
  light.center = dvec3(angle.y, 0.1, angle.x) * 12.0;
  light.u = {0.0, size, 0.0};
  light.v = {-size * angle.x, 0.0, size * angle.y};
  light.two_sided = true;
  return light;
}

}  // namespace halfshade::cases
