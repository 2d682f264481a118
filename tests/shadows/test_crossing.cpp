#include <doctest/doctest.h>

#include <boost/multiprecision/cpp_int.hpp>

#include "shadows/crossing.h"
#include "support/lit_scene.h"

using namespace halfshade;
using halfshade::test::Random;

namespace {

/// 2048 bits on the stack: determinants of three coordinates below 2^640.
using Big = boost::multiprecision::number<
    boost::multiprecision::cpp_int_backend<2048, 2048, boost::multiprecision::signed_magnitude,
                                           boost::multiprecision::unchecked, void>,
    boost::multiprecision::et_off>;
using BigPoint = std::array<Big, 3>;
using Solid = std::vector<std::array<vec3, 3>>;  // closed surface

constexpr unsigned kEpsilonBits = 200;

/// Lattice units times 2^600, so that the moved point is an integer as well.
BigPoint big_point(const vec3& p) {
  return {Big(lattice_units(p.x)) << (3 * kEpsilonBits), Big(lattice_units(p.y)) << (3 * kEpsilonBits),
          Big(lattice_units(p.z)) << (3 * kEpsilonBits)};
}

int big_orient3d(const BigPoint& a, const BigPoint& b, const BigPoint& c, const BigPoint& d) {
  const auto minus = [](const BigPoint& p, const BigPoint& q) {
    return BigPoint{p[0] - q[0], p[1] - q[1], p[2] - q[2]};
  };
  const BigPoint u = minus(a, d), v = minus(b, d), w = minus(c, d);
  const Big det =
      u[0] * (v[1] * w[2] - v[2] * w[1]) + u[1] * (v[2] * w[0] - v[0] * w[2]) + u[2] * (v[0] * w[1] - v[1] * w[0]);
  return det.sign();
}

/// The definition with a light sample that is really moved, by 2^-200, 2^-400 and 2^-600 units.
bool really_crosses(const std::array<vec3, 3>& t, const vec3& r, const vec3& l) {
  const BigPoint a = big_point(t[0]), b = big_point(t[1]), c = big_point(t[2]), from = big_point(r);
  BigPoint to = big_point(l);
  const int side = big_orient3d(a, b, c, from);
  if (side == 0 || big_orient3d(a, b, c, to) != -side) return false;
  for (unsigned k = 0; k < 3; ++k) to[k] += Big(1) << ((2 - k) * kEpsilonBits);
  return big_orient3d(a, b, to, from) == side && big_orient3d(b, c, to, from) == side &&
         big_orient3d(c, a, to, from) == side;
}

vec3 on_grid(const dvec3& p, double cells) { return vec3(glm::round(p * cells) / cells); }

/// Unit ball of triangles, corners on multiples of 2^-18: points on the far side of them are representable as well.
Solid ball(int rows, int columns, double radius) {
  const auto corner = [&](int row, int column) {
    const double pi = 3.14159265358979323846, polar = pi * row / rows, around = 2.0 * pi * (column % columns) / columns;
    const double s = row == 0 || row == rows ? 0.0 : std::sin(polar);
    return on_grid(radius * dvec3(s * std::cos(around), std::cos(polar), s * std::sin(around)), 0x1p18);
  };
  Solid solid;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const vec3 a = corner(row, column), b = corner(row, column + 1), c = corner(row + 1, column + 1),
                 d = corner(row + 1, column);
      if (row > 0) solid.push_back({a, b, c});
      if (row + 1 < rows) solid.push_back({a, c, d});
    }
  }
  return solid;
}

int crossings(const Solid& solid, const vec3& r, const vec3& l) {
  int count = 0;
  for (const auto& [a, b, c] : solid) count += crosses(a, b, c, r, l);
  return count;
}

int closed_hits(const Solid& solid, const vec3& r, const vec3& l) {
  int count = 0;
  for (const auto& [a, b, c] : solid) count += blocks(a, b, c, r, l);
  return count;
}

/// A corner, the middle of an edge or the centre of an edge's half, of a random triangle: multiples of 2^-20.
vec3 aim(const Solid& solid, Random& random) {
  const auto& t = solid[random.engine() % solid.size()];
  const std::size_t k = random.engine() % 3;
  const vec3 p = t[k], q = t[(k + 1) % 3];
  switch (random.engine() % 3) {
    case 0:
      return p;
    case 1:
      return (p + q) * 0.5f;
    default:
      return p * 0.75f + q * 0.25f;
  }
}

}  // namespace

TEST_CASE("crosses is blocks at a light sample that is really moved") {
  Random random(11);
  int ties = 0;
  for (int i = 0; i < 60000; ++i) {
    // Few different coordinates, so that segments meet edges and corners, and points lie in planes, all the time.
    const double cells = i % 3 == 0 ? 2.0 : (i % 3 == 1 ? 4.0 : 0x1p22);
    const auto point = [&] { return on_grid(random.in_box(-1.0, 1.0), cells); };
    const std::array<vec3, 3> t = {point(), point(), point()};
    const vec3 r = point(), l = point();
    const bool crossed = crosses(t[0], t[1], t[2], r, l);
    REQUIRE(crossed == really_crosses(t, r, l));
    REQUIRE(crossed == crosses(t[1], t[2], t[0], r, l));
    REQUIRE(crossed == crosses(t[2], t[1], t[0], r, l));
    REQUIRE((!crossed || blocks(t[0], t[1], t[2], r, l)));
    ties += crossed != blocks(t[0], t[1], t[2], r, l);
  }
  CHECK(ties > 100);
}

TEST_CASE("a segment out of a closed ball crosses it once, aimed at corners and edges") {
  const Solid solid = ball(16, 24, 0.5);
  Random random(12);
  int multiple = 0;
  for (int i = 0; i < 20000; ++i) {
    const vec3 through = aim(solid, random), inside = on_grid(random.in_box(-0.2, 0.2), 0x1p18);
    const vec3 outside = inside + 3.0f * (through - inside);  // exact: multiples of 2^-20 below 2
    REQUIRE(crossings(solid, inside, outside) == 1);
    REQUIRE(crossings(solid, outside, inside) == 1);
    multiple += closed_hits(solid, inside, outside) > 1;
  }
  CHECK(multiple > 15000);
}

TEST_CASE("a segment past or through a closed ball crosses it twice or not at all, aimed at corners and edges") {
  const Solid solid = ball(12, 16, 0.5);
  Random random(13);
  int twice = 0, never = 0;
  for (int i = 0; i < 20000; ++i) {
    const vec3 through = aim(solid, random);
    vec3 from = on_grid(random.in_box(-1.0, 1.0), 0x1p18);
    if (glm::length(from) < 0.6f) from.y = 0.75f;
    const vec3 to = through + (through - from);  // outside the ball, or inside it where the segment enters
    const bool ends_inside = glm::length(to) < 0.45f;
    if (!ends_inside && glm::length(to) < 0.51f) continue;
    const int count = crossings(solid, from, to);
    if (ends_inside) {
      REQUIRE(count == 1);
      continue;
    }
    REQUIRE((count == 0 || count == 2));
    (count == 0 ? never : twice) += 1;
  }
  CHECK(twice > 1000);
  CHECK(never > 500);
}

TEST_CASE("crossings of a box by segments on its own coarse grid agree with being inside or outside") {
  Random random(14);
  int changes = 0, beside = 0;
  for (int i = 0; i < 40000; ++i) {
    // Everything on eighths: segments run along edges, through corners and in the planes of faces all the time.
    const auto eighths = [&](int low, int high) {
      return low + static_cast<int>(random.engine() % static_cast<unsigned>(high - low));
    };
    const auto point = [&](int low, int high) {
      const int x = eighths(low, high), y = eighths(low, high);
      return dvec3(x, y, eighths(low, high));
    };
    const dvec3 low = point(-4, 0), high = point(1, 5), r = point(-8, 9), l = point(-8, 9);
    const auto place = [&](const dvec3& p) {  // > 0 inside, 0 on the surface
      const dvec3 depth = glm::min(p - low, high - p);
      return std::min({depth.x, depth.y, depth.z});
    };
    if (place(r) == 0.0 || place(l) == 0.0) continue;
    Solid solid;
    for (const test::Triangle& t : test::box(low / 8.0, high / 8.0)) {
      solid.push_back({vec3(t[0]), vec3(t[1]), vec3(t[2])});
    }
    const bool changed = (place(r) > 0.0) != (place(l) > 0.0);
    const int count = crossings(solid, vec3(r / 8.0), vec3(l / 8.0));
    REQUIRE(count <= 2);
    REQUIRE(count % 2 == changed);
    (changed ? changes : beside) += 1;
  }
  CHECK(changes > 500);
  CHECK(beside > 1000);
}

TEST_CASE("a segment in the plane of a face crosses a box as often as one beside it") {
  Solid solid;
  for (const test::Triangle& t : test::box({-0.5, -0.5, -0.5}, {0.5, 0.5, 0.5})) {
    solid.push_back({vec3(t[0]), vec3(t[1]), vec3(t[2])});
  }
  // In the planes y = +-1/2: moved towards +y, the upper one leaves the box, the lower one enters it.
  CHECK(crossings(solid, {-1, 0.5f, 0.125f}, {1, 0.5f, 0.25f}) == 0);
  CHECK(crossings(solid, {-1, -0.5f, 0.125f}, {1, -0.5f, 0.25f}) == 2);
  // Along an edge.
  CHECK(crossings(solid, {-1, 0.5f, 0.5f}, {1, 0.5f, 0.5f}) % 2 == 0);
  CHECK(crossings(solid, {-1, -0.5f, -0.5f}, {1, -0.5f, -0.5f}) % 2 == 0);
}
