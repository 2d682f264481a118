// Smooth closed solids: `torus_knot`, `sphere`, `field`.
#include <algorithm>

#include "rasterizer/scenes/mesh_builder.h"
#include "rasterizer/scenes/recipes.h"

namespace halfshade {
namespace {

/// About 180 triangles; one unit tall, looking along +x, standing on y = 0.
void make_animal(MeshBuilder& builder, const Placement& at, std::uint32_t wool, std::uint32_t skin) {
  builder.place(at);
  builder.use(skin);
  for (const double x : {-0.24, 0.24}) {
    for (const double z : {-0.13, 0.13}) {
      builder.tube(std::array{dvec3{x, 0.0, z}, dvec3{x, 0.45, z}}, 0.055, 4);
    }
  }
  builder.ellipsoid({0.56, 0.80, 0.0}, {0.19, 0.13, 0.11}, 6, 4);
  builder.use(wool);
  builder.ellipsoid({0.0, 0.60, 0.0}, {0.50, 0.30, 0.28}, 8, 6);
  builder.place({});
}

}  // namespace

void make_torus_knot(std::uint32_t size, BuiltinScene& out) {
  MeshBuilder builder(out.scene);
  builder.material("floor", {0.60f, 0.57f, 0.53f});
  builder.ground(6.0);
  builder.material("knot", {0.10f, 0.36f, 0.44f});
  // The tube is about ten times as long as it is round: 2 * sides * rings triangles with rings = 10 sides.
  const auto sides = std::max(3u, static_cast<std::uint32_t>(std::sqrt(size / 20.0)));
  const std::uint32_t rings = size / (2 * sides);
  const std::uint32_t first_triangle = builder.triangle_count(), first_vertex = builder.vertex_count();
  builder.place({.origin = dvec3{0.0}, .x = {0.9, 0.0, -0.25}, .y = {0.0, 0.95, 0.0}, .z = {0.25, 0.0, 0.9}});
  builder.torus_knot(1.0, 0.45, 0.20, rings, sides);
  builder.settle(first_vertex, 0.125);
  builder.smooth(first_triangle);
  builder.finish();
  out.view.camera = look({1.0, 3.6, 6.2}, {0.45, 1.15, 0.0}, 42.0);
  out.view.lights = {rectangle_light({-3.0, 5.5, 0.5}, {0.0, 0.8, 0.0}, 1.6, 1.6)};
}

void make_sphere(std::uint32_t size, BuiltinScene& out) {
  MeshBuilder builder(out.scene);
  builder.material("floor", {0.60f, 0.57f, 0.53f});
  builder.ground(5.0);
  builder.material("ball", {0.72f, 0.27f, 0.16f});
  const std::uint32_t first_triangle = builder.triangle_count();
  builder.ellipsoid({0.0, 1.125, 0.0}, {1.0, 1.0, 1.0}, size, size / 2);
  builder.smooth(first_triangle);
  builder.finish();
  out.view.camera = look({0.75, 3.4, 5.4}, {0.6, 0.8, 0.1}, 42.0);
  out.view.lights = {rectangle_light({-2.5, 4.5, 1.0}, {0.0, 0.8, 0.0}, 1.5, 1.5)};
}

void make_field(std::uint32_t size, BuiltinScene& out) {
  MeshBuilder builder(out.scene);
  const double n = size;
  builder.material("meadow", {0.36f, 0.46f, 0.22f});
  builder.ground(std::max(n, 3.0));
  const std::uint32_t skin = builder.material("skin", {0.12f, 0.10f, 0.09f});
  const std::uint32_t white = builder.material("white wool", {0.82f, 0.79f, 0.72f});
  const std::uint32_t brown = builder.material("brown wool", {0.42f, 0.26f, 0.15f});
  const std::uint32_t first_triangle = builder.triangle_count();
  for (std::uint32_t i = 0; i < size * size; ++i) {
    Random random(0xf1e1du, i);
    const double x = (i % size - 0.5 * (n - 1.0)) * 1.75 + random.range(-0.25, 0.25);
    const double z = (i / size - 0.5 * (n - 1.0)) * 1.75 + random.range(-0.25, 0.25);
    const std::uint32_t wool = random.uniform() < 0.2 ? brown : white;
    make_animal(builder, place_at({x, 0.0, z}, random.uniform()), wool, skin);
  }
  builder.smooth(first_triangle);
  builder.finish();
  const double d = std::max(n, 3.0);  // a few animals are looked at from no nearer than nine
  out.view.camera = look({0.0, 1.3 * d, 1.35 * d}, {0.0, 0.0, 0.1 * d}, 48.0);
  out.view.lights = {rectangle_light({-0.8 * d, 1.1 * d, -0.25 * d}, {0.0, 0.0, 0.0}, 0.45 * d, 0.45 * d)};
}

}  // namespace halfshade
