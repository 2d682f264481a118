// Straight-edged scenes: `columns`, `bars`, `room`.
#include <algorithm>

#include "rasterizer/scenes/mesh_builder.h"
#include "rasterizer/scenes/recipes.h"

namespace halfshade {
namespace {

/// Box given by the middle of its bottom face and its full size.
void box_on(MeshBuilder& builder, const dvec3& bottom, const dvec3& size) {
  const dvec3 half{0.5 * size.x, 0.0, 0.5 * size.z};
  builder.box(bottom - half, bottom + half + dvec3{0.0, size.y, 0.0});
}

void make_table(MeshBuilder& builder, const Placement& at) {
  builder.place(at);
  box_on(builder, {0.0, 0.71, 0.0}, {1.5, 0.04, 0.8});
  for (const double x : {-0.68, 0.68}) {
    for (const double z : {-0.33, 0.33}) box_on(builder, {x, 0.0, z}, {0.06, 0.71, 0.06});
  }
}

void make_chair(MeshBuilder& builder, const Placement& at) {
  builder.place(at);
  box_on(builder, {0.0, 0.44, 0.0}, {0.42, 0.03, 0.42});
  for (const double x : {-0.185, 0.185}) {
    box_on(builder, {x, 0.0, 0.185}, {0.04, 0.44, 0.04});
    box_on(builder, {x, 0.0, -0.185}, {0.04, 0.44, 0.04});
    box_on(builder, {x, 0.47, -0.185}, {0.04, 0.45, 0.03});
  }
  for (const double y : {0.58, 0.70, 0.82}) box_on(builder, {0.0, y, -0.185}, {0.33, 0.05, 0.02});
}

constexpr double kShelfWidth = 1.8, kShelfPitch = 0.42;

void make_shelf(MeshBuilder& builder, const Placement& at, std::uint32_t boards) {
  builder.place(at);
  const double height = boards * kShelfPitch;
  for (const double x : {-0.5 * kShelfWidth - 0.02, 0.5 * kShelfWidth + 0.02}) {
    box_on(builder, {x, 0.0, 0.0}, {0.04, height, 0.30});
  }
  for (std::uint32_t board = 0; board < boards; ++board) {
    box_on(builder, {0.0, 0.06 + board * kShelfPitch, 0.0}, {kShelfWidth, 0.025, 0.29});
  }
}

/// A row of books of uneven size that fills about nine tenths of a board; some lean against nothing but their luck.
void make_books(MeshBuilder& builder, const Placement& at, std::uint32_t board, std::uint32_t count,
                std::span<const std::uint32_t> covers) {
  builder.place(at);
  const double pitch = 0.9 * kShelfWidth / count;
  for (std::uint32_t i = 0; i < count; ++i) {
    Random random(0xb00c5u + board, i);
    if (random.uniform() < 0.12) continue;
    builder.use(covers[random.bits() % covers.size()]);
    const double x = -0.48 * kShelfWidth + (i + 0.5) * pitch;
    const double height = random.range(0.20, 0.33), depth = random.range(0.16, 0.22);
    box_on(builder, {x, 0.085 + board * kShelfPitch, 0.02}, {pitch * random.range(0.7, 0.96), height, depth});
  }
}

/// The inside of a box: the walls, each a sheet facing inwards, joined into one closed surface.
void make_walls(MeshBuilder& builder, const dvec3& low, const dvec3& high) {
  const std::uint32_t v = builder.vertex_count();
  for (int corner = 0; corner < 8; ++corner) {
    builder.vertex({(corner & 1) ? high.x : low.x, (corner & 2) ? high.y : low.y, (corner & 4) ? high.z : low.z});
  }
  builder.material("floor boards", {0.50f, 0.36f, 0.24f});
  builder.quad(v + 0, v + 4, v + 5, v + 1);
  builder.material("ceiling", {0.86f, 0.85f, 0.82f});
  builder.quad(v + 2, v + 3, v + 7, v + 6);
  builder.material("left wall", {0.44f, 0.56f, 0.56f});
  builder.quad(v + 0, v + 2, v + 6, v + 4);
  builder.material("wall", {0.82f, 0.77f, 0.68f});
  builder.quad(v + 1, v + 5, v + 7, v + 3);
  builder.quad(v + 0, v + 1, v + 3, v + 2);
  builder.quad(v + 4, v + 6, v + 7, v + 5);
}

}  // namespace

void make_columns(std::uint32_t size, BuiltinScene& out) {
  MeshBuilder builder(out.scene);
  const double n = size, pitch = 1.25, length = pitch * (n - 1.0);
  builder.material("pavement", {0.62f, 0.58f, 0.52f});
  builder.ground(0.75 * length + 5.0);
  const std::uint32_t stone = builder.material("stone", {0.76f, 0.70f, 0.60f});
  const std::uint32_t beam = builder.material("beam", {0.56f, 0.32f, 0.22f});
  for (const double z : {-1.25, 1.25}) {
    builder.use(stone);
    for (std::uint32_t i = 0; i < size; ++i) {
      const double x = pitch * i - 0.5 * length;
      builder.place(place_at({x, 0.0, z}, 0.0625));
      builder.cylinder(0.30, 0.0, 0.15, 8);
      builder.cylinder(0.20, 0.15, 2.25, 8);
      builder.cylinder(0.28, 2.25, 2.40, 8);
    }
    builder.place({});
    builder.use(beam);
    builder.box({-0.5 * length - 0.5, 2.4, z - 0.2}, {0.5 * length + 0.5, 2.65, z + 0.2});
  }
  builder.finish();
  const double d = std::max(length, 3.75);  // a short hall is looked at from as far away as one of four columns
  out.view.camera = look({0.3 * d, 2.2 + 0.45 * d, 3.0 + 1.1 * d}, {0.0, 0.8, 0.4}, 45.0);
  out.view.lights = {rectangle_light({-0.4 * d - 1.5, 5.5, -4.5}, {0.0, 1.0, 0.0}, 1.5, 1.5)};
}

void make_bars(std::uint32_t size, BuiltinScene& out) {
  MeshBuilder builder(out.scene);
  builder.material("floor", {0.60f, 0.57f, 0.53f});
  builder.ground(6.0);
  const std::uint32_t steel = builder.material("steel", {0.30f, 0.36f, 0.44f});
  const std::uint32_t brass = builder.material("brass", {0.62f, 0.44f, 0.16f});
  const double pitch = 5.0 / size, half = std::min(0.05, 0.2 * pitch);
  for (std::uint32_t i = 0; i < size; ++i) {
    const double across = (i + 0.5) * pitch - 2.5;
    builder.use(steel);
    builder.box({across - half, 1.0 - half, -2.5}, {across + half, 1.0 + half, 2.5});
    builder.use(brass);
    builder.box({-2.5, 1.5 - half, across - half}, {2.5, 1.5 + half, across + half});
  }
  builder.use(steel);
  for (const double x : {-2.6, 2.6}) {
    for (const double z : {-2.6, 2.6}) box_on(builder, {x, 0.0, z}, {0.12, 1.75, 0.12});
  }
  builder.finish();
  out.view.camera = look({1.4, 5.2, 7.4}, {0.3, 0.45, 0.3}, 46.0);
  out.view.lights = {rectangle_light({-1.5, 6.0, -3.5}, {0.0, 0.5, 0.0}, 0.9, 0.9)};
}

void make_room(std::uint32_t size, BuiltinScene& out) {
  MeshBuilder builder(out.scene);
  make_walls(builder, {-2.5, 0.0, -2.5}, {2.5, 2.75, 3.5});
  builder.material("rug", {0.52f, 0.16f, 0.14f});
  box_on(builder, {0.1, 0.0, 0.2}, {2.8, 0.015, 2.0});
  builder.material("oak", {0.46f, 0.28f, 0.14f});
  make_table(builder, place_at({0.15, 0.015, 0.25}, 0.02));
  builder.material("pine", {0.66f, 0.46f, 0.24f});
  make_chair(builder, place_at({-0.25, 0.015, -0.45}, 0.03));
  make_chair(builder, place_at({0.55, 0.015, 0.95}, 0.46));
  make_chair(builder, place_at({-1.15, 0.015, 0.40}, 0.27));
  builder.material("shelf", {0.30f, 0.20f, 0.14f});
  const Placement back = place_at({0.9, 0.0, -2.32});
  make_shelf(builder, back, 5);
  const std::array covers{
      builder.material("red cover", {0.55f, 0.13f, 0.10f}), builder.material("blue cover", {0.12f, 0.22f, 0.42f}),
      builder.material("green cover", {0.16f, 0.32f, 0.20f}), builder.material("yellow cover", {0.78f, 0.58f, 0.20f}),
      builder.material("white cover", {0.80f, 0.77f, 0.70f})};
  for (std::uint32_t board = 0; board < 5; ++board) make_books(builder, back, board, size, covers);
  builder.place({});
  builder.use(covers[1]);
  box_on(builder, {-1.7, 0.0, -1.8}, {0.7, 0.45, 0.7});
  builder.use(covers[3]);
  builder.place(place_at({-1.68, 0.45, -1.82}, 0.06));
  box_on(builder, {0.0, 0.0, 0.0}, {0.45, 0.32, 0.45});
  builder.material("clay", {0.70f, 0.34f, 0.20f});
  builder.place(place_at({0.35, 0.765, 0.25}));
  const std::uint32_t first_triangle = builder.triangle_count();
  const std::array vase{dvec2{0.07, 0.0}, dvec2{0.12, 0.08}, dvec2{0.13, 0.15}, dvec2{0.06, 0.26}, dvec2{0.08, 0.32}};
  builder.lathe(vase, 0.0, 0.30, 24);
  builder.smooth(first_triangle);
  builder.finish();
  out.view.camera = look({-1.6, 2.05, 3.3}, {0.15, 0.75, -0.3}, 62.0);
  out.view.lights = {rectangle_light({-0.2, 2.7, 0.3}, {-0.2, 0.0, 0.3}, 0.9, 0.9)};
}

}  // namespace halfshade
