// The local frame and its lattice, and the parallel scan under everything that builds lists.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include "halfshade/error.h"
#include "rasterizer/core/hash.h"
#include "rasterizer/core/mesh.h"
#include "rasterizer/core/parallel.h"

using namespace halfshade;

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// Random points in [-1, 1]^3 with coordinates that are multiples of 2^-24, so that adding 1e6 stays exact in double.
Scene random_scene(std::uint32_t triangles, std::uint32_t seed) {
  Scene scene;
  scene.materials.emplace_back();
  for (std::uint32_t i = 0; i < 3 * triangles; ++i) {
    const auto coordinate = [&](std::uint32_t axis) { return 2.0 * hash_unit(3 * i + axis, seed) - 1.0; };
    scene.positions.push_back({coordinate(0), coordinate(1), coordinate(2)});
  }
  for (std::uint32_t t = 0; t < triangles; ++t) {
    scene.triangles.push_back({3 * t, 3 * t + 1, 3 * t + 2});
    scene.triangle_materials.push_back(0);
  }
  return scene;
}

template <class Map>
Scene mapped(Scene scene, const Map& map) {
  for (dvec3& p : scene.positions) p = map(p);
  return scene;
}

std::vector<vec3> lattice_positions(const Scene& scene, const dvec3& light) {
  return make_lattice_mesh(scene, make_local_frame(scene.positions, std::span(&light, 1))).positions;
}

bool same_bits(const std::vector<vec3>& a, const std::vector<vec3>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(vec3)) == 0;
}

}  // namespace

TEST_CASE("snapping gives the nearest multiple of 2^-38, or the nearest float where floats are coarser") {
  for (std::uint32_t i = 0; i < 100000; ++i) {
    const int exponent = static_cast<int>(hash32(i, 7) % 45);
    const double x = std::ldexp(2.0 * hash_unit(i, 11) - 1.0 + 0x1p-40, -exponent);
    const float snapped = snap_to_lattice(x);
    const double units = static_cast<double>(snapped) * 0x1p38;
    REQUIRE(units == std::floor(units));
    REQUIRE(static_cast<double>(lattice_units(snapped)) == units);
    const double spacing = std::max(kLatticeUnit, std::ldexp(1.0, std::ilogb(x == 0.0 ? 1.0 : x) - 23));
    REQUIRE(std::fabs(static_cast<double>(snapped) - x) <= 0.5 * spacing);
  }
}

TEST_CASE("snapping keeps lattice values, zero and the frame's ends as they are") {
  for (const double x : {0.0, 1.0, -1.0, 2.0, 0x1p-38, -0x1p-38, 0x1p-14, 0x1p-14 - 0x1p-38, 0x1.fffffep-1}) {
    CHECK(static_cast<double>(snap_to_lattice(x)) == x);
  }
  CHECK(snap_to_lattice(0x1p-39) == 0.0f);  // a tie goes to the even multiple
  CHECK(static_cast<double>(snap_to_lattice(0x1.8p-38)) == 0x1p-37);
}

TEST_CASE("lattice positions do not depend on where the scene lies") {
  const Scene scene = random_scene(500, 3);
  const dvec3 light{0.5, 3.0, -0.25};
  const std::vector<vec3> home = lattice_positions(scene, light);
  for (const double offset : {1e2, 1e3, 1e4, 1e5, 1e6}) {
    CAPTURE(offset);
    const dvec3 shift{offset, -offset, 0.5 * offset};
    const Scene moved = mapped(scene, [&](const dvec3& p) { return p + shift; });
    for (std::size_t i = 0; i < moved.positions.size(); ++i) {
      REQUIRE(moved.positions[i] - shift == scene.positions[i]);  // the shifted coordinates are exact
    }
    CHECK(same_bits(lattice_positions(moved, light + shift), home));
  }
}

TEST_CASE("lattice positions do not depend on the scene's scale by a power of two") {
  const Scene scene = random_scene(500, 5);
  const dvec3 light{-1.5, 2.0, 0.75};
  const std::vector<vec3> home = lattice_positions(scene, light);
  for (const int exponent : {-60, -20, -1, 1, 20, 60}) {
    CAPTURE(exponent);
    const double factor = std::ldexp(1.0, exponent);
    const Scene scaled = mapped(scene, [&](const dvec3& p) { return p * factor; });
    CHECK(same_bits(lattice_positions(scaled, light * factor), home));
  }
}

TEST_CASE("the frame holds geometry and lights within 1, and its box fills more than half of it") {
  const Scene scene = random_scene(200, 9);
  for (const double reach : {0.0, 1.0, 1.5, 2.0, 100.0}) {
    CAPTURE(reach);
    const dvec3 light{0.0, reach, 0.0};
    const LocalFrame frame = make_local_frame(scene.positions, std::span(&light, 1));
    double largest = 0.0;
    const auto grow = [&](const dvec3& world) {
      const dvec3 p = glm::abs(frame.to_local(world));
      largest = std::max({largest, p.x, p.y, p.z});
    };
    for (const dvec3& p : scene.positions) grow(p);
    grow(light);
    CHECK(largest <= 1.0);
    CHECK(largest > 0.5);
    int exponent = 0;
    CHECK(std::frexp(frame.scale, &exponent) == 0.5);
  }
}

TEST_CASE("to_world undoes to_local to within a rounding of the coordinates") {
  const Scene scene = mapped(random_scene(200, 13), [](const dvec3& p) { return p * 37.0 + dvec3{1000.0, -5.0, 3.0}; });
  const LocalFrame frame = make_local_frame(scene.positions, {});
  for (const dvec3& p : scene.positions) {
    REQUIRE(glm::length(frame.to_world(frame.to_local(p)) - p) < 1e-12 * 1000.0);
  }
}

TEST_CASE("an extent of zero, one point or no point at all gives a usable frame") {
  const dvec3 point{3.0, 4.0, 5.0};
  CHECK(make_local_frame(std::span(&point, 1), {}).to_lattice(point) == vec3{0.0f});
  CHECK(make_local_frame({}, std::span(&point, 1)).to_lattice(point) == vec3{0.0f});
  CHECK(make_local_frame({}, {}).scale == 1.0);
}

TEST_CASE("an extent near the smallest double gives a usable frame") {
  for (const double size : {0x1p-1021, 0x1p-1023, 1e-310, 0x1p-1050}) {
    CAPTURE(size);
    const std::vector<dvec3> corners = {{0.0, 0.0, 0.0}, {size, 0.0, 0.0}, {0.0, size, 0.0}};
    const LocalFrame frame = make_local_frame(corners, {});
    CHECK(std::isfinite(frame.scale));
    for (const dvec3& corner : corners) {
      const vec3 p = frame.to_lattice(corner);
      for (int axis = 0; axis < 3; ++axis) CHECK(std::fabs(p[axis]) <= 1.0f);
    }
    CHECK(frame.to_lattice(corners[1]).x > frame.to_lattice(corners[0]).x);
  }
}

TEST_CASE("a coordinate that is not finite is refused on every axis, in geometry and in lights") {
  for (const double bad : {kNan, kInfinity, -kInfinity}) {
    for (int axis = 0; axis < 3; ++axis) {
      CAPTURE(bad);
      CAPTURE(axis);
      std::array points{dvec3{1.0, 2.0, 3.0}, dvec3{0.0}};
      points[1][axis] = bad;
      CHECK_THROWS_AS(make_local_frame(points, {}), Error);
      CHECK_THROWS_AS(make_local_frame(std::span(points).first(1), std::span(points).last(1)), Error);
      CHECK_THROWS_AS(make_local_frame({}, points), Error);
    }
  }
}

TEST_CASE("extents that overflow double are refused") {
  const std::array points{dvec3{-1.7e308, 0.0, 0.0}, dvec3{1.7e308, 0.0, 0.0}};
  CHECK_THROWS_AS(make_local_frame(points, {}), Error);
}

TEST_CASE("an exclusive scan equals the sequential one for 1, 2 and 7 threads") {
  const tbb::global_control more(tbb::global_control::max_allowed_parallelism, 7);  // also on machines with fewer cores
  for (const std::size_t count : {0u, 1u, 2u, 4095u, 4096u, 4097u, 100003u}) {
    std::vector<std::uint32_t> counts(count), expected(count + 1, 0);
    for (std::size_t i = 0; i < count; ++i) {
      counts[i] = hash32(static_cast<std::uint32_t>(i)) % 100;
      expected[i + 1] = expected[i] + counts[i];
    }
    for (const int threads : {1, 2, 7}) {
      CAPTURE(count);
      CAPTURE(threads);
      std::vector<std::uint32_t> offsets{99, 98, 97};
      tbb::task_arena(threads).execute([&] { exclusive_scan(counts, offsets); });
      CHECK(offsets == expected);
    }
  }
}

TEST_CASE("parallel loops visit each index once and set the floating-point environment") {
  std::vector<std::uint8_t> visits(100000, 0);
  parallel_ranges(visits.size(), 1000, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) ++visits[i];
  });
  parallel_tasks(visits.size(), [&](std::size_t i) { ++visits[i]; });
  CHECK(std::count(visits.begin(), visits.end(), 2) == static_cast<std::ptrdiff_t>(visits.size()));
#if defined(__SSE2__)
  const unsigned before = _mm_getcsr();
  _mm_setcsr(before | 0x8040u);  // flush to zero, denormals are zero
  double smallest = 0.0;
  parallel_tasks(1, [&](std::size_t) {
    volatile double tiny = 0x1p-1022;
    smallest = tiny * 0.5;
  });
  const unsigned after = _mm_getcsr();
  _mm_setcsr(before);
  CHECK(smallest == 0x1p-1023);
  CHECK((after & 0x8040u) == 0x8040u);
#endif
}
