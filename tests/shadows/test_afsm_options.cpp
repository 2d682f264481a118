// The options of the alias-free shadow map: all of them leave the masks alone, and each does what it says.
#include <doctest/doctest.h>

#include "rasterizer/core/unit_circle.h"
#include "support/lit_scene.h"

using namespace halfshade;
using namespace halfshade::test;

namespace {

/// Closed ball of 2 * segments * (rings - 1) triangles, wound outward.
std::vector<Triangle> ball(const dvec3& center, double radius, int rings, int segments) {
  const auto at = [&](int i, int j) {
    const dvec2 polar = unit_circle(0.5 * i / rings), around = unit_circle(double(j % segments) / segments);
    return center + radius * dvec3(polar.y * around.x, polar.x, polar.y * around.y);
  };
  const dvec3 top = center + dvec3(0, radius, 0), bottom = center - dvec3(0, radius, 0);
  std::vector<Triangle> triangles;
  for (int i = 0; i < rings; ++i) {
    for (int j = 0; j < segments; ++j) {
      const dvec3 a = i == 0 ? top : at(i, j), b = i == 0 ? top : at(i, j + 1);
      const dvec3 c = i == rings - 1 ? bottom : at(i + 1, j), d = i == rings - 1 ? bottom : at(i + 1, j + 1);
      if (i > 0) triangles.push_back({a, b, c});
      if (i < rings - 1) triangles.push_back({b, d, c});
    }
  }
  return triangles;
}

std::vector<Triangle> inside_out(std::vector<Triangle> triangles) {
  for (Triangle& t : triangles) std::swap(t[0], t[1]);
  return triangles;
}

std::vector<Triangle> loose_triangles(Random& random, int count, double size) {
  std::vector<Triangle> triangles;
  for (int i = 0; i < count; ++i) {
    const dvec3 c = random.in_box(-4.0, 4.5);
    triangles.push_back(
        {c + size * random.in_box(-1, 1), c + size * random.in_box(-1, 1), c + size * random.in_box(-1, 1)});
  }
  return triangles;
}

/// Balls, one of them inside out and one inside another, a box, and triangles without order.
std::vector<Triangle> mixture(Random& random) {
  std::vector<Triangle> triangles = ball(random.in_box(-2, 2), 1.2, 8, 12);
  triangles = joined(triangles, inside_out(ball(random.in_box(-2, 2), 0.7, 6, 10)));
  const dvec3 shell = random.in_box(-3, 1);
  triangles = joined(joined(triangles, ball(shell, 0.9, 7, 9)), ball(shell, 0.5, 6, 8));
  triangles = joined(triangles, box({-3, -3, -3}, {-2, -2.5, -1}));
  return joined(triangles, loose_triangles(random, 25, 0.8));
}

/// Points anywhere, and points lifted a little off both sides of triangles that they name as their own.
std::vector<Receiver> receivers_among(Random& random, const std::vector<Triangle>& triangles, int count) {
  std::vector<Receiver> receivers;
  for (int i = 0; i < count; ++i) {
    const auto t = static_cast<std::uint32_t>(random.engine() % triangles.size());
    const auto& [a, b, c] = triangles[t];
    const double u = random.uniform(0, 1), v = random.uniform(0, 1 - u);
    const dvec3 normal = glm::normalize(glm::cross(b - a, c - a)) * (i % 4 == 1 ? -1e-5 : 1e-5);
    if (i % 2 == 0) receivers.push_back({random.in_box(-5, 3.9), kNone});
    if (i % 2 == 1) receivers.push_back({a + u * (b - a) + v * (c - a) + normal, t});
  }
  return receivers;
}

AliasFreeOptions combination(std::uint32_t bits) {
  AliasFreeOptions o;
  o.region = static_cast<InfluenceOutline>(bits % 6);
  o.fit = bits & 1, o.far_fit = bits & 2, o.skip_empty = bits & 4;
  o.plane_cut = bits & 8, o.cull_back_facing = bits & 16, o.silhouettes = bits & 32;
  return o;
}

Light small_disk(double radius) {
  Light light = frame_light();
  light.shape = LightShape::kDisk;
  light.radius = radius;
  return light;
}

}  // namespace

TEST_CASE("all combinations of options give the oracle's masks among closed, inverted, nested and open meshes") {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    Random random(seed);
    const std::vector<Triangle> triangles = mixture(random);
    const Scene scene = scene_of(triangles);
    const std::vector<Receiver> receivers = receivers_among(random, triangles, 500);
    Light light = frame_light();
    light.shape = seed == 3 ? LightShape::kSphere : LightShape::kRectangle;
    light.radius = 0.4;
    if (seed == 2) light.u *= 0.1, light.v *= 0.1, light.two_sided = true;
    ShadowConfig config = frame_config(40);
    const VisibilityMasks truth = solve(scene, receivers, light, config, ShadowMethod::kOracle);
    for (std::uint32_t bits = 0; bits < 64; ++bits) {
      CAPTURE(seed);
      CAPTURE(bits);
      config.afsm = combination(bits);
      config.sample_sets = 1;
      REQUIRE(wrong_bits(truth, solve(scene, receivers, light, config, ShadowMethod::kAliasFreeShadowMap)) == 0);
    }
  }
}

TEST_CASE("S31 for the alias-free shadow map: no option loses a blocker of degenerate and aligned triangles") {
  Random random(3131);
  const auto coordinate = [&](bool aligned) {
    const double x = random.uniform(-5, 5);
    return aligned ? std::round(x) : x;
  };
  for (std::uint32_t round = 0; round < 600; ++round) {
    std::vector<Triangle> triangles;
    for (int i = 0; i < 3; ++i) {
      const bool aligned = random.uniform(0, 1) < 0.3;
      Triangle t;
      for (dvec3& p : t) p = {coordinate(aligned), coordinate(aligned), coordinate(aligned)};
      if (random.uniform(0, 1) < 0.1) t[2] = t[1];
      triangles.push_back(t);
    }
    if (round % 3 == 0) triangles = joined(triangles, ball(glm::round(random.in_box(-3, 3)), 1.0, 6, 8));
    std::vector<dvec3> points;
    for (int i = 0; i < 25; ++i)
      points.push_back({coordinate(i % 5 == 0), coordinate(i % 5 == 0), coordinate(i % 5 == 0)});
    Light light = frame_light();
    light.shape = static_cast<LightShape>(round % 4);
    light.two_sided = round % 5 == 0;
    light.radius = random.uniform(0.0, 2.0);
    ShadowConfig config = frame_config(16);
    config.afsm = combination(static_cast<std::uint32_t>(random.engine() % 384));
    const Scene scene = scene_of(triangles);
    const auto receivers = receivers_at(points);
    const VisibilityMasks truth = solve(scene, receivers, light, config, ShadowMethod::kOracle);
    CAPTURE(round);
    REQUIRE(wrong_bits(truth, solve(scene, receivers, light, config, ShadowMethod::kAliasFreeShadowMap)) == 0);
  }
}

TEST_CASE(
    "receivers that stand outside a closed mesh on a triangle that shows them its back are shadowed by the rest") {
  // Seen from above the lid, light below the lid's plane arrives through the box: the lid is the receivers' own
  // triangle and does not count, and the wall behind it shows them its front.
  const Scene scene = scene_of(inside_out(box({-1, 0, -1}, {1, 1, 1})));
  Light light = frame_light();
  light.center = {6.0, 1.0, 0.0};
  light.u = {0.0, 2.0, 0.0}, light.v = {0.0, 0.0, 2.0};  // u x v = +x; two-sided: half of it below the lid's plane
  light.two_sided = true;
  std::vector<Receiver> receivers;
  for (std::uint32_t t = 0; t < 12; ++t) {
    const auto& triangle = scene.triangles[t];
    const dvec3 middle =
        (scene.positions[triangle[0]] + scene.positions[triangle[1]] + scene.positions[triangle[2]]) / 3.0;
    receivers.push_back({middle + (middle - dvec3(0, 0.5, 0)) * 1e-4, t});
  }
  CHECK(solve(scene, receivers, light, frame_config(64), ShadowMethod::kOracle).blocked_count(6) > 0);
  CHECK(wrong_bits_of_exact_methods(scene, receivers, light, frame_config(64)) == 0);
}

TEST_CASE("one sample settles more than half of the umbra of a ball under a small light, and no bit changes") {
  const Scene scene = scene_of(ball({0, 2, 0}, 1.0, 32, 48));
  Random random(8);
  std::vector<dvec3> points;
  for (int i = 0; i < 4000; ++i) points.push_back({random.uniform(-3, 3), 0.0, random.uniform(-3, 3)});
  ShadowConfig config = frame_config(64);
  ShadowStats on, off;
  const auto run = [&](ShadowStats& stats) {
    return solve(scene, receivers_at(points), small_disk(0.1), config, ShadowMethod::kAliasFreeShadowMap, &stats);
  };
  const VisibilityMasks with = run(on);
  config.afsm.silhouettes = false;
  const VisibilityMasks without = run(off);
  CHECK(wrong_bits(with, without) == 0);
  std::size_t umbra = 0;
  for (std::size_t i = 0; i < points.size(); ++i) umbra += with.visibility(i) == 0.0f;
  CHECK(on.detail("afsm.settled_hidden_receivers").value() > 0.5 * static_cast<double>(umbra));
  CHECK(on.pairs_sampled < off.pairs_sampled);
  CHECK(on.detail("afsm.silhouette_edges").value() < 0.2 * on.detail("afsm.edges_of_closed_meshes").value());
}

TEST_CASE("receivers just below their own triangle of a closed ball: what that triangle alone hides does not count") {
  // Once, where another triangle of the ball hid the first sample, all samples were taken for hidden.
  const std::vector<Triangle> triangles = ball({0.5, 1.0, 0.0}, 1.2, 9, 16);
  std::vector<Receiver> receivers;
  for (std::uint32_t t = 0; t < triangles.size(); ++t) {
    const auto& [a, b, c] = triangles[t];
    for (const double depth : {1e-6, 0.1, 0.2}) {
      receivers.push_back({(a + b + c) / 3.0 - depth * glm::normalize(glm::cross(b - a, c - a)), t});
    }
  }
  Light light = frame_light();
  light.u *= 0.3, light.v *= 0.3;
  for (const std::uint32_t samples : {16u, 256u}) {
    CHECK(wrong_bits_of_exact_methods(scene_of(triangles), receivers, light, frame_config(samples)) == 0);
  }
}

TEST_CASE("cuts and culling leave fewer pairs, and tighter outlines fewer cells") {
  Random random(12);
  const Scene scene = scene_of(joined(ball({0, 2, 0}, 1.0, 16, 24), loose_triangles(random, 60, 0.5)));
  const auto receivers = receivers_at([&] {
    std::vector<dvec3> points;
    for (int i = 0; i < 5000; ++i)
      points.push_back({random.uniform(-4, 4), random.uniform(0, 1.5), random.uniform(-4, 4)});
    return points;
  }());
  const auto measure = [&](const AliasFreeOptions& options) {
    ShadowConfig config = frame_config(64);
    config.afsm = options;
    ShadowStats stats;
    solve(scene, receivers, small_disk(0.8), config, ShadowMethod::kAliasFreeShadowMap, &stats);
    return stats;
  };
  AliasFreeOptions plain;
  plain.skip_empty = plain.plane_cut = plain.cull_back_facing = plain.silhouettes = false;
  const std::uint64_t pairs = measure(plain).pairs_tested;
  for (bool AliasFreeOptions::*option :
       {&AliasFreeOptions::skip_empty, &AliasFreeOptions::plane_cut, &AliasFreeOptions::cull_back_facing}) {
    AliasFreeOptions with = plain;
    with.*option = true;
    CHECK(measure(with).pairs_tested < pairs);
  }
  const auto cells = [&](InfluenceOutline outline) {
    AliasFreeOptions options = plain;
    options.region = outline;
    return measure(options).detail("afsm.region_cells").value();
  };
  CHECK(cells(InfluenceOutline::kDodecagon) < cells(InfluenceOutline::kHexagon));
  CHECK(cells(InfluenceOutline::kHull) < cells(InfluenceOutline::kQuad));
  CHECK(cells(InfluenceOutline::kHull) < cells(InfluenceOutline::kBox));
}
