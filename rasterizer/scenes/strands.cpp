// Many thin things: `grass` (open blades) and `hairball` (closed tubes). Each strand is a pure function of its index
// and has its own place in the arrays, so strands are made in parallel and tens of millions of triangles take seconds.
#include <algorithm>

#include "rasterizer/core/parallel.h"
#include "rasterizer/scenes/mesh_builder.h"
#include "rasterizer/scenes/recipes.h"

namespace halfshade {
namespace {

/// Room for `count` strands of equal size at the end of the scene's arrays.
struct StrandArrays {
  std::size_t first_vertex, first_triangle;
};

StrandArrays grow(Scene& scene, std::size_t count, std::size_t vertices, std::size_t triangles) {
  const StrandArrays start{scene.positions.size(), scene.triangles.size()};
  scene.positions.resize(start.first_vertex + count * vertices);
  scene.triangles.resize(start.first_triangle + count * triangles);
  scene.triangle_materials.resize(scene.triangles.size());
  return start;
}

// --- grass -----------------------------------------------------------------------------------------------------------

constexpr std::uint32_t kBladeVertices = 7;
constexpr std::uint32_t kFirstGreen = 1;  // material
constexpr double kLawnSide = 8.0;

/// Three pairs of vertices and a tip along a parabola that bends more and more over.
void make_blade(std::uint32_t index, std::uint32_t columns, dvec3* positions) {
  Random random(0x67a55u, index);
  const double pitch = kLawnSide / columns;
  const double x = (index % columns + random.uniform()) * pitch - 0.5 * kLawnSide;
  const double z = (index / columns + random.uniform()) * pitch - 0.5 * kLawnSide;
  const dvec2 heading = unit_circle(random.uniform());
  const double height = random.range(0.30, 0.62), bend = random.range(0.05, 0.34);
  const double half_width = std::min(0.016, 0.35 * pitch) * random.range(0.7, 1.3);
  const dvec3 root{x, 0.0, z}, forward{heading.x, 0.0, heading.y}, across{-heading.y, 0.0, heading.x};
  for (std::uint32_t pair = 0; pair < 3; ++pair) {
    const double t = pair * 0.34;
    const dvec3 spine = root + forward * (bend * t * t) + dvec3{0.0, height * t * (1.0 - 0.2 * t), 0.0};
    const dvec3 side = across * (half_width * (1.0 - 0.5 * t * t));
    positions[2 * pair] = spine - side;
    positions[2 * pair + 1] = spine + side;
  }
  positions[6] = root + forward * bend + dvec3{0.0, height * 0.8, 0.0};
}

// --- hairball --------------------------------------------------------------------------------------------------------

constexpr std::uint32_t kHairRings = 8, kHairSides = 3;
constexpr std::uint32_t kHairVertices = kHairRings * kHairSides;
constexpr std::uint32_t kHairTriangles = 2 * kHairSides * (kHairRings - 1) + 2;

/// A curled tube from just inside the unit ball outwards; it stays clear of the floor.
void make_hair(std::uint32_t index, const dvec3& center, dvec3* positions) {
  Random random(0x4a125u, index);
  dvec3 along = random.direction();
  dvec3 point = center + along * 0.97;
  const double curliness = random.range(0.1, 0.5);  // drawn first: which operand of a product is, compilers may choose
  const dvec3 curl = random.direction() * curliness;
  const double step = random.range(0.09, 0.14), radius = random.range(0.006, 0.011);
  dvec3 normal = perpendicular(along);
  for (std::uint32_t ring = 0; ring < kHairRings; ++ring) {
    const dvec3 binormal = glm::cross(along, normal);
    const double taper = radius * (1.0 - 0.1 * ring);
    for (std::uint32_t side = 0; side < kHairSides; ++side) {
      const dvec2 angle = unit_circle(side / 3.0);
      positions[ring * kHairSides + side] = point + (normal * angle.x + binormal * angle.y) * taper;
    }
    along += glm::cross(curl, along) + dvec3{0.0, -0.10, 0.0};
    along /= std::sqrt(glm::dot(along, along));
    point += along * step;
    if (point.y < 0.03) point.y = 0.03;  // lies on the floor rather than sticking through it
    normal -= along * glm::dot(along, normal);
    normal /= std::sqrt(glm::dot(normal, normal));
  }
}

void join_hair(std::uint32_t first, std::array<std::uint32_t, 3>* triangles) {
  for (std::uint32_t ring = 0; ring + 1 < kHairRings; ++ring) {
    const std::uint32_t low = first + ring * kHairSides, high = low + kHairSides;
    for (std::uint32_t side = 0; side < kHairSides; ++side) {
      const std::uint32_t next = (side + 1) % kHairSides;
      *triangles++ = {low + side, low + next, high + next};
      *triangles++ = {low + side, high + next, high + side};
    }
  }
  const std::uint32_t last = first + (kHairRings - 1) * kHairSides;
  *triangles++ = {first, first + 2, first + 1};
  *triangles++ = {last, last + 1, last + 2};
}

}  // namespace

void make_lawn(BuiltinScene& out) {
  Scene& scene = out.scene;
  MeshBuilder builder(scene);
  builder.material("earth", {0.30f, 0.22f, 0.14f});
  builder.ground(0.5 * kLawnSide + 1.0);
  builder.material("grass", {0.22f, 0.40f, 0.10f});
  builder.material("young grass", {0.34f, 0.50f, 0.14f});
  builder.material("dry grass", {0.50f, 0.46f, 0.20f});
  builder.material("stone", {0.60f, 0.58f, 0.56f});
  builder.ellipsoid({-0.6, 0.45, 0.4}, {0.95, 0.65, 0.8}, 32, 16);
  builder.ellipsoid({1.3, 0.25, 1.3}, {0.5, 0.42, 0.45}, 24, 12);
  out.view.camera = look({1.0, 3.4, 5.6}, {0.1, 0.2, 0.3}, 45.0);
  out.view.lights = {rectangle_light({-3.5, 4.5, -1.5}, {0.0, 0.3, 0.3}, 1.75, 1.75)};
}

void add_blades(std::uint32_t first, std::uint32_t count, std::uint32_t size, Scene& scene) {
  const auto columns = static_cast<std::uint32_t>(std::ceil(std::sqrt(static_cast<double>(size))));
  const StrandArrays start = grow(scene, count, kBladeVertices, kBladeTriangles);
  parallel_ranges(count, 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) {
      const std::uint32_t blade = first + static_cast<std::uint32_t>(i);
      const auto v = static_cast<std::uint32_t>(start.first_vertex + i * kBladeVertices);
      make_blade(blade, columns, &scene.positions[v]);
      const std::size_t t = start.first_triangle + i * kBladeTriangles;
      scene.triangles[t] = {v, v + 1, v + 3};
      scene.triangles[t + 1] = {v, v + 3, v + 2};
      scene.triangles[t + 2] = {v + 2, v + 3, v + 5};
      scene.triangles[t + 3] = {v + 2, v + 5, v + 4};
      scene.triangles[t + 4] = {v + 4, v + 5, v + 6};
      const std::uint32_t shade = Random(0xc0104u, blade).bits() % 16;
      const std::uint32_t material = kFirstGreen + (shade < 10 ? 0u : shade < 15 ? 1u : 2u);
      std::fill_n(scene.triangle_materials.begin() + static_cast<std::ptrdiff_t>(t), kBladeTriangles, material);
    }
  });
}

void make_grass(std::uint32_t size, BuiltinScene& out) {
  make_lawn(out);
  add_blades(0, size, size, out.scene);
}

void make_hairball(std::uint32_t size, BuiltinScene& out) {
  Scene& scene = out.scene;
  MeshBuilder builder(scene);
  const dvec3 center{0.0, 1.4, 0.0};
  builder.material("floor", {0.60f, 0.57f, 0.53f});
  builder.ground(6.0);
  builder.material("core", {0.30f, 0.16f, 0.10f});
  builder.ellipsoid(center, {1.0, 1.0, 1.0}, 32, 16);
  const std::uint32_t first_hair = builder.material("hair", {0.62f, 0.34f, 0.16f});
  builder.material("light hair", {0.78f, 0.54f, 0.28f});

  const StrandArrays start = grow(scene, size, kHairVertices, kHairTriangles);
  parallel_ranges(size, 1024, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) {
      const std::size_t v = start.first_vertex + i * kHairVertices, t = start.first_triangle + i * kHairTriangles;
      make_hair(static_cast<std::uint32_t>(i), center, &scene.positions[v]);
      join_hair(static_cast<std::uint32_t>(v), &scene.triangles[t]);
      const auto material = static_cast<std::uint32_t>(first_hair + i % 2);
      std::fill_n(scene.triangle_materials.begin() + static_cast<std::ptrdiff_t>(t), kHairTriangles, material);
    }
  });
  out.view.camera = look({1.2, 3.8, 6.6}, {0.5, 1.1, 0.0}, 44.0);
  out.view.lights = {rectangle_light({-3.5, 5.5, 1.5}, {0.0, 1.0, 0.0}, 1.5, 1.5)};
}

}  // namespace halfshade
