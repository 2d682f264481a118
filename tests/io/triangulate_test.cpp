#include "rasterizer/io/triangulate.h"

#include <chrono>
#include <cmath>
#include <random>

#include <doctest/doctest.h>

namespace halfshade {
namespace {

using Polygon = std::vector<dvec3>;
using Triangles = std::vector<std::array<std::uint32_t, 3>>;

constexpr double kQuick = 60.0;  // seconds; says "not quadratic", not how fast: machines are shared

dvec3 vector_area(const dvec3& a, const dvec3& b, const dvec3& c) { return glm::cross(b - a, c - a) * 0.5; }

dvec3 polygon_area(const Polygon& polygon) {
  dvec3 sum(0.0);
  for (std::size_t i = 1; i + 1 < polygon.size(); ++i) sum += vector_area(polygon[0], polygon[i], polygon[i + 1]);
  return sum;
}

// Triangles of a simple planar polygon do not overlap exactly when their areas, all positive, add up to the polygon's.
void check_partition(const Polygon& polygon) {
  Triangles triangles;
  CHECK(triangulate(polygon, triangles));
  REQUIRE(triangles.size() == polygon.size() - 2);
  const dvec3 whole = polygon_area(polygon);
  double sum = 0.0;
  int upside_down = 0;
  for (const auto& [a, b, c] : triangles) {
    const dvec3 area = vector_area(polygon[a], polygon[b], polygon[c]);
    sum += glm::length(area);
    upside_down += glm::dot(area, whole) < 0.0;
  }
  CHECK(upside_down == 0);
  CHECK(std::fabs(sum - glm::length(whole)) <= 1e-9 * glm::length(whole));
}

// A star-shaped polygon in a tilted plane; `spikes` makes every other corner reflex.
Polygon make_star(std::size_t corners, double inner) {
  Polygon polygon;
  for (std::size_t i = 0; i < corners; ++i) {
    const double angle = 2.0 * 3.14159265358979323846 * static_cast<double>(i) / static_cast<double>(corners);
    const double radius = i % 2 == 0 ? 1.0 : inner;
    const double x = radius * std::cos(angle), y = radius * std::sin(angle);
    polygon.emplace_back(x, 0.8 * y - 0.3 * x, 0.6 * y + 0.2 * x);
  }
  return polygon;
}

TEST_CASE("concave polygons of all windings and planes are cut without overlap") {
  const Polygon arrow = {{0, 0, 0}, {4, 0, 0}, {4, 4, 0}, {3, 1, 0}, {0, 1, 0}};
  for (int axis = 0; axis < 3; ++axis) {
    Polygon turned;
    for (const dvec3& p : arrow) turned.push_back({p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]});
    check_partition(turned);
    check_partition({turned.rbegin(), turned.rend()});
  }
}

TEST_CASE("a concave quad is cut along its inner diagonal") {
  check_partition({{0, 0, 0}, {4, 0, 0}, {1, 1, 0}, {0, 4, 0}});
  check_partition({{4, 0, 0}, {1, 1, 0}, {0, 4, 0}, {0, 0, 0}});
}

TEST_CASE("a convex quad is cut along its shorter diagonal") {
  Triangles triangles;
  triangulate(Polygon{{0, 0, 0}, {4, 0, 0}, {5, 2, 0}, {1, 2, 0}}, triangles);
  CHECK(triangles == Triangles{{0, 1, 3}, {1, 2, 3}});
}

TEST_CASE("corners in the middle of an edge are used by the triangles") {
  const Polygon square = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {2, 2, 0}, {1, 2, 0}, {0, 2, 0}, {0, 1, 0}};
  Triangles triangles;
  CHECK(triangulate(square, triangles));
  for (const auto& [a, b, c] : triangles) CHECK(glm::length(vector_area(square[a], square[b], square[c])) > 0.0);
  check_partition(square);
}

TEST_CASE("a polygon with a hole joined by a double edge is cut without overlap") {
  check_partition(
      {{0, 0, 0}, {6, 0, 0}, {6, 6, 0}, {0, 6, 0}, {0, 0, 0}, {2, 2, 0}, {2, 4, 0}, {4, 4, 0}, {4, 2, 0}, {2, 2, 0}});
}

TEST_CASE("polygons of 300 corners, more than 8 bits can count, are cut without overlap") {
  check_partition(make_star(300, 1.0));
  check_partition(make_star(300, 0.5));
}

TEST_CASE("polygons of 8000 and 65534 corners are cut quickly") {
  for (const std::size_t corners : {8000u, 65534u}) {
    for (const double inner : {1.0, 0.9, 0.2}) {
      CAPTURE(corners);
      CAPTURE(inner);
      const auto start = std::chrono::steady_clock::now();
      check_partition(make_star(corners, inner));
      const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
      CHECK(seconds < kQuick);
    }
  }
}

// Points of a random walk around the origin by angle: simple, with many long spikes.
TEST_CASE("random spiky polygons are cut without overlap") {
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> uniform(0.05, 1.0);
  for (int round = 0; round < 200; ++round) {
    CAPTURE(round);
    Polygon polygon;
    const int corners = 5 + round;
    for (int i = 0; i < corners; ++i) {
      const double angle = 2.0 * 3.14159265358979323846 * i / corners, radius = uniform(random);
      polygon.emplace_back(radius * std::cos(angle), 3.0, radius * std::sin(angle));
    }
    check_partition(polygon);
  }
}

TEST_CASE("a comb and a spiral, with few ears at a time, are cut without overlap and quickly") {
  Polygon comb, spiral;
  for (int i = 0; i < 4000; ++i) comb.emplace_back(i, i % 2 == 0 ? 0.0 : 1000.0, 0.0);
  comb.emplace_back(4000, -1, 0);
  comb.emplace_back(-1, -1, 0);
  Polygon inner;
  for (int i = 0; i < 4000; ++i) {
    const double angle = 0.05 * i, radius = 1.0 + 0.02 * i;
    spiral.emplace_back(radius * std::cos(angle), radius * std::sin(angle), 0.0);
    inner.emplace_back((radius - 0.5) * std::cos(angle), (radius - 0.5) * std::sin(angle), 0.0);
  }
  spiral.insert(spiral.end(), inner.rbegin(), inner.rend());
  const auto start = std::chrono::steady_clock::now();
  check_partition(comb);
  check_partition(spiral);
  CHECK(std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count() < kQuick);
}

TEST_CASE("a polygon that crosses itself, or has no area, keeps its signed area and its corner count") {
  const Polygon bow = {{0, 0, 0}, {4, 4, 0}, {4, 0, 0}, {0, 5, 0}, {-1, 2, 0}};
  const Polygon line = {{0, 0, 0}, {1, 1, 1}, {2, 2, 2}, {3, 3, 3}, {1, 1, 1}};
  for (const Polygon& polygon : {bow, line}) {
    Triangles triangles;
    triangulate(polygon, triangles);
    REQUIRE(triangles.size() == 3);
    dvec3 sum(0.0);
    for (const auto& [a, b, c] : triangles) sum += vector_area(polygon[a], polygon[b], polygon[c]);
    CHECK(glm::length(sum - polygon_area(polygon)) <= 1e-12);
  }
}

}  // namespace
}  // namespace halfshade
