#include <doctest/doctest.h>

#include <boost/multiprecision/cpp_int.hpp>

#include "rasterizer/core/predicate.h"
#include "rasterizer/core/unit_circle.h"
#include "support/lit_scene.h"

using namespace halfshade;
using halfshade::test::Random;

namespace {

using Big = boost::multiprecision::cpp_int;

/// The determinant with integers of any length, term by term.
int big_orient3d(const vec3& a, const vec3& b, const vec3& c, const vec3& d) {
  Big m[3][3];
  const vec3 rows[3] = {a, b, c};
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) m[i][k] = Big(lattice_units(rows[i][k])) - Big(lattice_units(d[k]));
  }
  const Big det = m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
                  m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
  return det.sign();
}

vec3 lattice_point(Random& random, double reach) { return snap_to_lattice(random.in_box(-reach, reach)); }

}  // namespace

TEST_CASE("orient3d has the sign of unlimited integers, for ordinary, nearly flat and extreme points") {
  Random random(1);
  for (int i = 0; i < 200000; ++i) {
    const double reach = i % 3 == 0 ? 2.0 : (i % 3 == 1 ? 1e-3 : 0x1p-30);
    const vec3 a = lattice_point(random, reach), b = lattice_point(random, reach), c = lattice_point(random, reach);
    vec3 d = lattice_point(random, reach);
    if (i % 2 == 0)
      d = snap_to_lattice(dvec3(a) + random.uniform(0, 1) * dvec3(b - a) + random.uniform(0, 1) * dvec3(c - a));
    d = glm::clamp(d, vec3(-2.0f), vec3(2.0f));
    REQUIRE(orient3d(a, b, c, d) == big_orient3d(a, b, c, d));
    REQUIRE(sign_of(orient3d_exact(a, b, c, d)) == big_orient3d(a, b, c, d));
  }
  const vec3 corner[4] = {{2, 2, 2}, {-2, -2, 2}, {-2, 2, -2}, {2, -2, -2}};
  CHECK(orient3d(corner[0], corner[1], corner[2], corner[3]) ==
        big_orient3d(corner[0], corner[1], corner[2], corner[3]));
}

TEST_CASE("blocks does not depend on the order of the corners or the direction of the segment") {
  Random random(2);
  for (int i = 0; i < 20000; ++i) {
    const vec3 a = lattice_point(random, 1), b = lattice_point(random, 1), c = lattice_point(random, 1);
    const vec3 r = lattice_point(random, 1), l = lattice_point(random, 1);
    const bool blocked = blocks(a, b, c, r, l);
    REQUIRE(blocks(b, c, a, r, l) == blocked);
    REQUIRE(blocks(c, b, a, r, l) == blocked);
    REQUIRE(blocks(a, b, c, l, r) == blocked);
  }
}

TEST_CASE("a triangle without area, or with a corner at the receiver, blocks nothing") {
  const vec3 a(0, 0.5f, 0), b(0.5f, 0.5f, 0), r(0.25f, 0, 0), l(0.25f, 1, 0);
  CHECK_FALSE(blocks(a, b, b, r, l));
  CHECK_FALSE(blocks(a, a, a, r, l));
  CHECK_FALSE(blocks(r, a, b, r, l));
  CHECK_FALSE(blocks(l, a, b, r, l));
}

TEST_CASE("unit_circle agrees with the mathematics library to 1e-15 and is exact at the quarters") {
  for (int i = -4000; i <= 4000; ++i) {
    const double turns = i / 1234.5;
    const dvec2 p = unit_circle(turns);
    CHECK(p.x == doctest::Approx(std::cos(turns * 6.283185307179586)).epsilon(1e-14));
    CHECK(std::fabs(p.y - std::sin(turns * 6.283185307179586)) < 2e-14);
  }
  CHECK(unit_circle(0.25) == dvec2(0, 1));
  CHECK(unit_circle(0.5) == dvec2(-1, 0));
}
