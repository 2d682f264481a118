#include <doctest/doctest.h>
#include <tbb/task_arena.h>

#include "rasterizer/core/predicate.h"
#include "shadows/influence_region.h"
#include "shadows/irregular_zbuffer.h"
#include "support/lit_scene.h"

using namespace halfshade;
using namespace halfshade::test;

namespace {

Light light_of_shape(LightShape shape, Random& random) {
  Light light = frame_light();
  light.shape = shape;
  light.two_sided = true;
  light.normal = {0.3, -1.0, 0.2};
  light.radius = 0.8;
  light.axes = {dvec3(0.9, 0.3, 0.0), dvec3(-0.2, 0.5, 0.4), dvec3(0.1, -0.1, 0.3)};  // not orthogonal
  if (shape == LightShape::kPolygon) {
    light.points = {{-1.0, 4.0, -0.5}, {0.2, 4.3, -1.1}, {1.2, 4.4, -0.4}, {0.8, 4.1, 0.8}, {-0.6, 3.9, 0.4}};
    for (dvec3& p : light.points) p.y = 4.0 + 0.2 * p.x - 0.1 * p.z;
  }
  if (shape == LightShape::kSamples) {
    for (int i = 0; i < 70; ++i) light.points.push_back(light.center + random.in_box(-1.0, 1.0));
  }
  return light;
}

}  // namespace

TEST_CASE("masks equal the oracle for every light shape among random triangles") {
  for (const LightShape shape : {LightShape::kPoint, LightShape::kRectangle, LightShape::kDisk, LightShape::kSphere,
                                 LightShape::kSamples, LightShape::kEllipsoid, LightShape::kPolygon}) {
    for (std::uint64_t seed = 1; seed <= 6; ++seed) {
      CAPTURE(static_cast<int>(shape));
      CAPTURE(seed);
      Random random(seed);
      const Scene scene = scene_of(random_triangles(random, 150, seed % 2 == 0 ? 3.0 : 0.7));
      const std::vector<Receiver> receivers = receivers_at(random_points(random, 700, -6.0, 6.0));
      ShadowConfig config = frame_config(64 + static_cast<std::uint32_t>(seed));
      config.pattern = seed % 3 == 0 ? SamplePattern::kStratified : SamplePattern::kRows;
      config.sample_sets = seed % 2 == 0 ? 4 : 1;
      CHECK(wrong_bits_of_exact_methods(scene, receivers, light_of_shape(shape, random), config) == 0);
    }
  }
}

TEST_CASE("masks equal the oracle for long, thin, flat and tiny ellipsoids, and for a sliver of a polygon") {
  const std::array<std::array<dvec3, 3>, 5> ellipsoids = {{{dvec3(3, 0, 0), dvec3(0, 0.1, 0), dvec3(0, 0, 0.1)},
                                                           {dvec3(1, 1, 0), dvec3(1, 0.8, 0.1), dvec3(0, 0.2, 1)},
                                                           {dvec3(1, 0, 0), dvec3(0, 0, 1), dvec3(0, 1e-9, 0)},
                                                           {dvec3(1, 0, 0), dvec3(2, 0, 0), dvec3(0, 0.3, 0)},
                                                           {dvec3(1e-6, 0, 0), dvec3(0, 3e-6, 0), dvec3(0, 0, 1e-6)}}};
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    CAPTURE(seed);
    Random random(seed + 40);
    const Scene scene = scene_of(random_triangles(random, 150, seed % 2 == 0 ? 3.0 : 0.7));
    const std::vector<Receiver> receivers = receivers_at(random_points(random, 500, -6.0, 6.0));
    Light light = frame_light();
    light.shape = seed == 6 ? LightShape::kPolygon : LightShape::kEllipsoid;
    if (seed == 6) light.points = {{-1, 4, 0}, {1, 4, 0}, {1.5, 4, 0.00001}, {0, 4, 0.001}};
    if (seed < 6) light.axes = ellipsoids[seed - 1];
    light.two_sided = true;
    CHECK(wrong_bits_of_exact_methods(scene, receivers, light, frame_config(100)) == 0);
  }
}

TEST_CASE("masks equal the oracle for every pattern, with sets chosen by hash, interleaved and rotated") {
  for (const SamplePattern pattern : {SamplePattern::kRows, SamplePattern::kUniform, SamplePattern::kStratified,
                                      SamplePattern::kLowDiscrepancy, SamplePattern::kPoissonDisk}) {
    CAPTURE(static_cast<int>(pattern));
    Random random(static_cast<std::uint64_t>(pattern) + 70);
    const Scene scene = scene_of(random_triangles(random, 120, 1.5));
    const std::vector<Receiver> receivers = receivers_at(random_points(random, 400, -6.0, 6.0));
    for (const LightShape shape : {LightShape::kDisk, LightShape::kSphere, LightShape::kPolygon}) {
      const Light light = light_of_shape(shape, random);
      ShadowConfig config = frame_config(90);
      config.pattern = pattern;
      config.sample_sets = 5;
      CHECK(wrong_bits_of_exact_methods(scene, receivers, light, config) == 0);
      config.rotate_sets = true;
      CHECK(wrong_bits_of_exact_methods(scene, receivers, light, config) == 0);
      config.interleave = true;
      CHECK(wrong_bits_of_exact_methods(scene, receivers, light, config) == 0);
    }
  }
}

TEST_CASE("a point light gives hard shadows: every mask bit equals the predicate") {
  Random random(5);
  const std::vector<Triangle> triangles = random_triangles(random, 60, 1.0);
  Light light = frame_light();
  light.shape = LightShape::kPoint;
  const auto receivers = receivers_at(random_points(random, 300, -6.0, 3.0));
  const VisibilityMasks masks = solve(scene_of(triangles), receivers, light, {}, ShadowMethod::kAliasFreeShadowMap);
  CHECK(masks.sample_count == 1);
  CHECK(wrong_bits_of_exact_methods(scene_of(triangles), receivers, light, {}) == 0);
}

TEST_CASE("the irregular z-buffer equals a sequential count for 1, 2 and 7 threads") {
  Random random(11);
  constexpr std::uint32_t kCells = 5000;
  std::vector<std::uint32_t> cells(60000);
  for (auto& c : cells) {
    const double x = random.uniform(0.0, 1.0);
    c = x < 0.05 ? kNone : static_cast<std::uint32_t>(x * x * kCells);
  }
  std::vector<std::vector<std::uint32_t>> expected(kCells);
  for (std::uint32_t i = 0; i < cells.size(); ++i) {
    if (cells[i] != kNone) expected[cells[i]].push_back(i);
  }
  for (const int threads : {1, 2, 7}) {
    CAPTURE(threads);
    IrregularZBuffer zbuffer;
    tbb::task_arena(threads).execute([&] { build_irregular_zbuffer(cells, kCells, zbuffer); });
    REQUIRE(zbuffer.offsets.size() == kCells + 1);
    for (std::uint32_t c = 0; c < kCells; ++c) {
      const std::vector<std::uint32_t> list(zbuffer.entries.begin() + zbuffer.offsets[c],
                                            zbuffer.entries.begin() + zbuffer.offsets[c + 1]);
      REQUIRE(list == expected[c]);
    }
  }
}

TEST_CASE("the convex hull holds every point and turns left at every corner") {
  Random random(3);
  for (int round = 0; round < 200; ++round) {
    std::vector<dvec2> points, hull;
    const int count = 1 + round % 30;
    for (int i = 0; i < count; ++i) points.emplace_back(random.uniform(-1, 1), random.uniform(-1, 1));
    if (round % 5 == 0) points.insert(points.end(), points.begin(), points.end());  // duplicates
    convex_hull(points, hull);
    REQUIRE(!hull.empty());
    if (hull.size() < 3) continue;
    for (std::size_t i = 0; i < hull.size(); ++i) {
      const dvec2 a = hull[i], b = hull[(i + 1) % hull.size()];
      for (const dvec2& p : points) REQUIRE((b.x - a.x) * (p.y - a.y) - (b.y - a.y) * (p.x - a.x) >= -1e-12);
    }
  }
}

TEST_CASE("the convex hull holds every point where some are apart by no more than rounding") {
  Random random(4);
  for (int round = 0; round < 2000; ++round) {
    std::vector<dvec2> corners, points, hull;
    for (int i = 0; i < 3; ++i) {
      corners.emplace_back(random.uniform(-5, 5), random.uniform(-5, 5));
      for (int copy = 0; copy < 9; ++copy) {
        const auto moved = [&](double x) { return x + std::floor(random.uniform(-1, 2)) * 0x1p-52 * std::fabs(x); };
        points.emplace_back(moved(corners.back().x), moved(corners.back().y));
      }
    }
    convex_hull(points, hull);
    double twice = 0.0;  // areas, both ways round
    for (std::size_t i = 0; i < hull.size(); ++i) {
      const dvec2 a = hull[i], b = hull[(i + 1) % hull.size()];
      twice += a.x * b.y - a.y * b.x;
    }
    const dvec2 e = corners[1] - corners[0], f = corners[2] - corners[0];
    CHECK(twice == doctest::Approx(std::fabs(e.x * f.y - e.y * f.x)).epsilon(1e-6));
  }
}

TEST_CASE("a blocker behind the light hides nothing") {
  const Scene scene = scene_of(quad({-9, 5, -9}, {9, 5, -9}, {9, 5, 9}, {-9, 5, 9}));
  Random random(1);
  const auto receivers = receivers_at(random_points(random, 100, -3.0, 3.0));
  const VisibilityMasks masks =
      solve(scene, receivers, frame_light(), frame_config(), ShadowMethod::kAliasFreeShadowMap);
  for (std::size_t i = 0; i < receivers.size(); ++i) CHECK(masks.visibility(i) == 1.0f);
}

TEST_CASE("a closed box around the light hides it entirely") {
  const Scene scene = scene_of(box({-3, 3, -3}, {3, 5, 3}));
  Random random(2);
  const auto receivers = receivers_at(random_points(random, 200, -8.0, 2.9));
  const VisibilityMasks masks =
      solve(scene, receivers, frame_light(), frame_config(), ShadowMethod::kAliasFreeShadowMap);
  for (std::size_t i = 0; i < receivers.size(); ++i) CHECK(masks.visibility(i) == 0.0f);
}

TEST_CASE("adding a blocker never increases visibility, and order does not matter") {
  Random random(9);
  std::vector<Triangle> triangles = random_triangles(random, 80, 1.5);
  const auto receivers = receivers_at(random_points(random, 300, -5.0, 3.0));
  const auto run = [&] {
    return solve(scene_of(triangles), receivers, frame_light(), frame_config(100), ShadowMethod::kAliasFreeShadowMap);
  };
  const VisibilityMasks before = run();
  std::reverse(triangles.begin(), triangles.end());
  CHECK(wrong_bits(before, run()) == 0);
  triangles.push_back(random_triangles(random, 1, 2.0)[0]);
  const VisibilityMasks after = run();
  for (std::size_t w = 0; w < before.words.size(); ++w) CHECK((before.words[w] & ~after.words[w]) == 0);
}

TEST_CASE("an empty scene, no receivers and a configuration out of range are handled") {
  const Scene empty;
  const auto one = receivers_at({{0, 0, 0}});
  CHECK(solve(empty, one, frame_light(), frame_config(), ShadowMethod::kAliasFreeShadowMap).visibility(0) == 1.0f);
  CHECK(solve(empty, {}, frame_light(), frame_config(), ShadowMethod::kAliasFreeShadowMap).words.empty());
  CHECK_THROWS_AS(solve(empty, one, frame_light(), frame_config(0), ShadowMethod::kAliasFreeShadowMap), Error);
  CHECK_THROWS_AS(solve(empty, one, frame_light(), frame_config(4097), ShadowMethod::kAliasFreeShadowMap), Error);
  ShadowConfig config = frame_config();
  config.grid_resolution = 5000;
  CHECK_THROWS_AS(solve(empty, one, frame_light(), config, ShadowMethod::kAliasFreeShadowMap), Error);
  CHECK_THROWS_AS(solve(empty, receivers_at({{NAN, 0, 0}}), frame_light(), frame_config(), ShadowMethod::kOracle),
                  Error);
}
