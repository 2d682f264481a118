// `demo`: a still life in a studio cove that shows every kind of shadow at once: contact shadows under the balls, wide
// penumbrae behind the columns and the knot, thin rods, and light through the holes of leaves and of a trellis.
#include "rasterizer/scenes/mesh_builder.h"
#include "rasterizer/scenes/recipes.h"

namespace halfshade {
namespace {

/// Floor that bends up into a back wall, one sheet.
void make_cove(MeshBuilder& builder, std::uint32_t steps) {
  constexpr double kHalfWidth = 9.0, kFront = 7.0, kBend = -3.25, kRadius = 2.5, kTop = 8.0;
  std::vector<dvec2> profile{{kFront, 0.0}};  // (z, y)
  for (std::uint32_t i = 0; i <= steps; ++i) {
    const dvec2 angle = unit_circle(0.25 * i / steps);
    profile.push_back({kBend - kRadius * angle.y, kRadius * (1.0 - angle.x)});
  }
  profile.push_back({kBend - kRadius, kTop});
  const std::uint32_t first = builder.vertex_count();
  for (const dvec2& p : profile) {
    builder.vertex({-kHalfWidth, p.y, p.x});
    builder.vertex({kHalfWidth, p.y, p.x});
  }
  for (std::uint32_t i = 0; i + 1 < profile.size(); ++i) {
    const std::uint32_t v = first + 2 * i;
    builder.quad(v, v + 1, v + 3, v + 2);
  }
}

/// A column with base and capital, the shaft swelling as Greek ones do.
void make_column(MeshBuilder& builder, const dvec3& foot, double height, double radius, std::uint32_t sides) {
  builder.place(place_at(foot));
  const double r = radius;
  builder.box({-1.6 * r, 0.0, -1.6 * r}, {1.6 * r, 0.12, 1.6 * r});
  std::vector<dvec2> profile{{1.45 * r, 0.12}, {1.5 * r, 0.16}, {1.45 * r, 0.21}, {1.12 * r, 0.24}, {1.0 * r, 0.32}};
  for (int i = 1; i <= 6; ++i) {
    const double t = i / 6.0;
    profile.push_back({r * (1.0 - 0.18 * t * t), 0.32 + t * (height - 0.72)});
  }
  profile.push_back({0.95 * r, height - 0.34});
  profile.push_back({1.35 * r, height - 0.18});
  profile.push_back({1.35 * r, height - 0.14});
  builder.lathe(profile, 0.12, height - 0.14, sides);
  builder.box({-1.5 * r, height - 0.14, -1.5 * r}, {1.5 * r, height, 1.5 * r});
}

/// A leaf with slits between its ribs; x from -1 to 1 across, y from 0 at the stem to 1 at the tip.
bool inside_leaf(double x, double y) {
  const double side = std::fabs(x);
  const double widest = y < 0.32 ? 1.0 - (0.32 - y) * (0.32 - y) * 6.5 : 1.0 - (y - 0.32) * (y - 0.32) * 2.16;
  if (side > 0.96 * widest) return false;
  if (side < 0.05) return true;
  const double rib = (y - 0.30 * side) * 6.0;          // ribs lean towards the tip
  const double between = rib - std::floor(rib) - 0.5;  // 0 half-way between two ribs
  const double slit = 0.22 * (side - 0.42);
  return std::fabs(between) > slit || y > 0.88;
}

AlphaMap leaf_texture() {
  AlphaMap map;
  map.name = "leaf";
  map.width = 128;
  map.height = 128;
  for (std::uint32_t row = 0; row < map.height; ++row) {
    for (std::uint32_t column = 0; column < map.width; ++column) {
      const double x = (column + 0.5) / 64.0 - 1.0, y = 1.0 - (row + 0.5) / 128.0;
      map.alpha.push_back(inside_leaf(x, y) ? 255 : 0);
    }
  }
  return map;
}

/// A stem that rises and bends outwards, with a drooping leaf of `kBends` cards at its end.
void make_leaf(MeshBuilder& builder, const dvec3& root, std::uint32_t index, std::uint32_t stem, std::uint32_t leaf) {
  constexpr std::uint32_t kBends = 5;
  Random random(0x1eafu, index);
  const dvec2 heading = unit_circle(index * 0.381966 + random.range(-0.03, 0.03));
  const dvec3 out{heading.x, 0.0, heading.y}, across{-heading.y, 0.0, heading.x};
  const double height = 0.55 + 0.085 * index + random.range(-0.05, 0.05), spread = random.range(0.30, 0.55);
  std::vector<dvec3> path;
  for (std::uint32_t i = 0; i <= 6; ++i) {
    const double t = i / 6.0;
    path.push_back(root + out * (spread * t * t + 0.05 * t) + dvec3{0.0, height * t * (1.3 - 0.3 * t), 0.0});
  }
  builder.use(stem);
  builder.tube(path, 0.013, 6);
  builder.use(leaf);
  const double length = random.range(0.55, 0.75), half = 0.42 * length;
  dvec3 spine = path.back();
  for (std::uint32_t i = 0; i < kBends; ++i) {
    const dvec2 droop = unit_circle(0.05 - 0.05 * i);
    const dvec3 next = spine + (out * droop.x + dvec3{0.0, droop.y, 0.0}) * (length / kBends);
    const auto v0 = static_cast<float>(i) / kBends, v1 = static_cast<float>(i + 1) / kBends;
    builder.card(spine + across * half, spine - across * half, next - across * half, next + across * half, {0.0f, v0},
                 {1.0f, v1});
    spine = next;
  }
}

void make_plant(MeshBuilder& builder, Scene& scene, const dvec3& foot, std::uint32_t sides) {
  const std::uint32_t clay = builder.material("clay", {0.62f, 0.27f, 0.16f});
  const std::uint32_t earth = builder.material("earth", {0.16f, 0.11f, 0.08f});
  const std::uint32_t stem = builder.material("stem", {0.26f, 0.36f, 0.14f});
  const std::uint32_t leaf = builder.material("leaf", {0.15f, 0.36f, 0.13f});
  scene.materials[leaf].alpha_map = static_cast<std::uint32_t>(scene.alpha_maps.size());
  scene.alpha_maps.push_back(leaf_texture());
  builder.place(place_at(foot));
  const std::array pot{dvec2{0.26, 0.0},  dvec2{0.38, 0.48}, dvec2{0.42, 0.48},
                       dvec2{0.43, 0.60}, dvec2{0.38, 0.60}, dvec2{0.37, 0.55}};
  builder.use(clay);
  builder.lathe(pot, 0.0, 0.54, sides);
  builder.use(earth);
  builder.ellipsoid({0.0, 0.54, 0.0}, {0.36, 0.04, 0.36}, sides, 8);
  for (std::uint32_t i = 0; i < 13; ++i) make_leaf(builder, {0.0, 0.55, 0.0}, i, stem, leaf);
}

AlphaMap trellis_texture() {
  AlphaMap map;
  map.name = "trellis";
  map.width = 64;
  map.height = 64;
  for (std::uint32_t y = 0; y < 64; ++y) {
    for (std::uint32_t x = 0; x < 64; ++x) {
      const bool rising = (x + y) % 32 < 7, falling = (x - y + 64) % 32 < 7;
      map.alpha.push_back(rising || falling ? 255 : 0);
    }
  }
  return map;
}

/// A framed screen of crossed laths: four posts and rails as boxes, the laths as one repeating card.
void make_trellis(MeshBuilder& builder, Scene& scene, const Placement& at) {
  builder.material("frame", {0.40f, 0.26f, 0.15f});
  builder.place(at);
  builder.box({-1.0, 0.0, -0.05}, {-0.92, 2.1, 0.05});
  builder.box({0.92, 0.0, -0.05}, {1.0, 2.1, 0.05});
  builder.box({-0.92, 0.10, -0.04}, {0.92, 0.18, 0.04});
  builder.box({-0.92, 2.0, -0.04}, {0.92, 2.08, 0.04});
  const std::uint32_t laths = builder.material("laths", {0.56f, 0.38f, 0.22f});
  scene.materials[laths].alpha_map = static_cast<std::uint32_t>(scene.alpha_maps.size());
  scene.alpha_maps.push_back(trellis_texture());
  builder.card({-0.92, 0.18, 0.0}, {0.92, 0.18, 0.0}, {0.92, 2.0, 0.0}, {-0.92, 2.0, 0.0}, {0.0f, 0.0f}, {2.5f, 2.5f});
}

/// Pins of rising length in a wooden sole.
void make_pins(MeshBuilder& builder, const Placement& at, std::uint32_t sides) {
  builder.material("walnut", {0.24f, 0.14f, 0.09f});
  builder.place(at);
  builder.box({-0.85, 0.0, -0.16}, {0.85, 0.10, 0.16});
  builder.material("brass", {0.72f, 0.52f, 0.20f});
  for (int i = 0; i < 9; ++i) {
    const double x = -0.72 + 0.18 * i, height = 0.45 + 0.011 * i * i + 0.02 * i;
    builder.tube(std::array{dvec3{x, 0.10, 0.0}, dvec3{x, height, 0.0}}, 0.014, 8);
    builder.ellipsoid({x, height + 0.035, 0.0}, dvec3{0.04}, sides / 4 + 3, sides / 8 + 2);
  }
}

void make_knot_on_plinth(MeshBuilder& builder, const dvec3& foot, std::uint32_t sides) {
  builder.material("plinth", {0.84f, 0.82f, 0.78f});
  builder.place(place_at(foot));
  const std::array plinth{dvec2{0.80, 0.0},  dvec2{0.80, 0.10}, dvec2{0.70, 0.14},
                          dvec2{0.70, 0.50}, dvec2{0.76, 0.54}, dvec2{0.76, 0.62}};
  builder.lathe(plinth, 0.0, 0.62, 2 * sides);
  builder.material("knot", {0.05f, 0.34f, 0.42f});
  const std::uint32_t first_vertex = builder.vertex_count();
  builder.place(place_at(foot, 0.06, 0.80));
  builder.torus_knot(1.0, 0.45, 0.20, 6 * sides, sides / 2);
  builder.settle(first_vertex, foot.y + 0.62);
}

}  // namespace

void make_demo(std::uint32_t size, BuiltinScene& out) {
  MeshBuilder builder(out.scene);
  builder.material("cove", {0.62f, 0.58f, 0.53f});
  make_cove(builder, size / 2);
  make_knot_on_plinth(builder, {0.0, 0.0, -0.2}, size);
  builder.material("limestone", {0.78f, 0.72f, 0.62f});
  make_column(builder, {-2.55, 0.0, -1.5}, 3.4, 0.27, size);
  make_column(builder, {-1.45, 0.0, -2.4}, 2.7, 0.23, size);
  make_column(builder, {1.4, 0.0, -1.9}, 1.3, 0.23, size);
  builder.material("vermilion", {0.74f, 0.19f, 0.10f});
  builder.place({});
  builder.ellipsoid({-0.55, 0.34, 1.95}, dvec3{0.34}, size, size / 2);
  builder.ellipsoid({1.4, 1.52, -1.9}, dvec3{0.22}, size, size / 2);
  builder.material("ivory", {0.86f, 0.82f, 0.72f});
  builder.ellipsoid({0.20, 0.20, 2.2}, dvec3{0.20}, size, size / 2);
  builder.material("mustard", {0.82f, 0.55f, 0.10f});
  builder.ellipsoid({-1.05, 0.14, 2.6}, dvec3{0.14}, size, size / 2);
  make_pins(builder, place_at({1.75, 0.0, 1.75}, 0.04), size);
  make_plant(builder, out.scene, {2.42, 0.0, -0.35}, size);
  make_trellis(builder, out.scene, place_at({-2.15, 0.0, 0.9}, 0.145, 0.78));
  builder.smooth(0);
  builder.finish();
  out.view.camera = look({0.6, 4.3, 8.6}, {0.0, 0.95, 0.0}, 38.0);
  out.view.lights = {rectangle_light({-5.2, 6.0, 0.0}, {0.0, 0.6, 0.2}, 1.25, 1.25)};
}

}  // namespace halfshade
