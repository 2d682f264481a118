// Named stability cases about where light, blockers and receivers lie.
#include <doctest/doctest.h>
#include <tbb/task_arena.h>

#include <fstream>

#include "rasterizer/core/unit_circle.h"
#include "rasterizer/rasterizer.h"
#include "shadows/alpha.h"
#include "shadows/solver.h"
#include "support/lit_scene.h"
#include "support/simd_targets.h"

using namespace halfshade;
using namespace halfshade::test;
using halfshade::cases::plate;

namespace {

std::vector<dvec3> floor_points(int side, double reach) {
  std::vector<dvec3> points;
  for (int i = 0; i < side * side; ++i) {
    points.push_back(
        {((i % side) * 2.0 / (side - 1) - 1.0) * reach, 0.0, ((i / side) * 2.0 / (side - 1) - 1.0) * reach});
  }
  return points;
}

std::uint64_t wrong_in_frame(const std::vector<Triangle>& triangles, const std::vector<dvec3>& points,
                             const Light& light = frame_light(), const ShadowConfig& config = frame_config()) {
  return wrong_bits_of_exact_methods(scene_of(triangles), receivers_at(points), light, config);
}

ShadowStats stats_of(const std::vector<Triangle>& triangles, const std::vector<dvec3>& points) {
  ShadowStats stats;
  solve(scene_of(triangles), receivers_at(points), frame_light(), frame_config(), ShadowMethod::kAliasFreeShadowMap,
        &stats);
  return stats;
}

}  // namespace

TEST_CASE("S08 coplanar: receivers in the plane of a card are not blocked by it, tilted cards give the oracle's bits") {
  const auto card = quad({-1, 0, -1}, {1, 0, -1}, {1, 0, 1}, {-1, 0, 1});
  const VisibilityMasks masks = solve(scene_of(card), receivers_at(floor_points(11, 1.5)), frame_light(),
                                      frame_config(), ShadowMethod::kAliasFreeShadowMap);
  for (std::size_t i = 0; i < masks.receiver_count; ++i) CHECK(masks.blocked_count(i) == 0);
  for (const double slope : {1e-7, 1e-5, 1e-3, 0.1, 0.577}) {
    std::vector<Triangle> tilted = card;
    for (Triangle& t : tilted) {
      for (dvec3& p : t) p.y = slope * p.x;
    }
    CHECK(wrong_in_frame(tilted, floor_points(15, 2.0)) == 0);
  }
}

namespace {

/// Receivers as the camera makes them, with the masks of the method.
struct CameraRun {
  ReceiverArray receivers;
  LightSamples samples;
  VisibilityMasks masks;
};

CameraRun run_camera(const Scene& scene, const Camera& camera, const Light& light, std::uint32_t size) {
  CameraRun run;
  const LatticeMesh mesh = make_lattice_mesh(scene, make_local_frame(scene.positions, light_extent(light)));
  GBuffer gbuffer;
  rasterize(mesh, camera, {size, size, {}}, gbuffer);
  const ShadowConfig config = frame_config(64);
  run.samples = make_light_samples(light, config, mesh.frame);
  run.receivers = make_receivers(gbuffer, run.samples, 0);
  ShadowStats stats;
  solve_masks(mesh, run.receivers, light, run.samples, config, run.masks, stats);
  return run;
}

std::vector<Triangle> uv_sphere(const dvec3& center, double radius, int rings, int segments) {
  const auto at = [&](int i, int j) {
    const dvec2 polar = unit_circle(0.5 * i / rings), around = unit_circle(1.0 * (j % segments) / segments);
    return center + radius * dvec3(polar.y * around.x, polar.x, polar.y * around.y);
  };
  std::vector<Triangle> triangles;
  for (int i = 0; i < rings; ++i) {
    for (int j = 0; j < segments; ++j) {
      if (i > 0) triangles.push_back({at(i, j), at(i, j + 1), at(i + 1, j)});
      if (i < rings - 1) triangles.push_back({at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)});
    }
  }
  return triangles;
}

}  // namespace

TEST_CASE("S09 lone_plane_acne: a tilted plane of many triangles casts no shadow on itself") {
  std::vector<Triangle> plane;
  for (int i = 0; i < 20; ++i) {
    for (int k = 0; k < 20; ++k) {
      const auto p = [&](int a, int b) { return dvec3(a * 0.31 - 3.1, 0.137 * a + 0.071 * b - 1.0, b * 0.31 - 3.1); };
      const auto q = quad(p(i, k), p(i, k + 1), p(i + 1, k + 1), p(i + 1, k));
      plane.insert(plane.end(), q.begin(), q.end());
    }
  }
  const CameraRun run = run_camera(scene_of(plane), {{-3, 6, 5}, {0, 0, 0}, {0, 1, 0}, 60.0}, frame_light(), 1000);
  REQUIRE(run.receivers.size() > 200000);
  std::uint64_t blocked = 0;
  for (std::size_t i = 0; i < run.receivers.size(); ++i) blocked += run.masks.blocked_count(i);
  CHECK(blocked == 0);
}

TEST_CASE("S09 lone_plane_acne: a convex sphere does not block samples above a facet's horizon") {
  const CameraRun run = run_camera(scene_of(uv_sphere({0, 0, 0}, 1.0, 32, 64)), {{2, 3, 2}, {0, 0, 0}, {0, 1, 0}, 45.0},
                                   frame_light(), 400);
  REQUIRE(run.receivers.size() > 20000);
  std::uint64_t blocked_above = 0;
  for (std::size_t i = 0; i < run.receivers.size(); ++i) {
    bool all_above = true;
    for (const vec3& l : run.samples.set(0)) {
      all_above =
          all_above && glm::dot(dvec3(l) - dvec3(run.receivers.position[i]), dvec3(run.receivers.normal[i])) > 0.0;
    }
    if (all_above) blocked_above += run.masks.blocked_count(i);
  }
  CHECK(blocked_above == 0);
}

TEST_CASE("S10 behind_light_vertex: a triangle that reaches through the light's plane hides the receiver beyond it") {
  std::vector<dvec3> points = {{20, 0, 0.5}};
  const VisibilityMasks masks = solve(scene_of(cases::through_light_plane()), receivers_at(points), frame_light(),
                                      frame_config(), ShadowMethod::kAliasFreeShadowMap);
  CHECK(masks.blocked_count(0) > 0);
  Random random(10);
  for (int i = 0; i < 40; ++i)
    points.push_back({random.uniform(-30, 30), random.uniform(-2, 3.99), random.uniform(-30, 30)});
  for (int i = 0; i < 1000; ++i) {
    const dvec3 c(random.uniform(-4, 4), 4.0, random.uniform(-4, 4));
    const Triangle t = {c + random.in_box(-3, 3), c + random.in_box(-3, 3), c + random.in_box(-1, 1)};
    REQUIRE(wrong_in_frame({t}, points) == 0);
  }
}

TEST_CASE("S11 light_in_triangle: coplanar triangles block nothing, piercing ones exactly, at bounded cost") {
  const std::vector<Triangle> coplanar = {{dvec3(-2, 4, 0), dvec3(2, 4, 0), dvec3(0, 4, 2)}};
  const std::vector<Triangle> piercing = cases::piercing_light();
  const std::vector<Triangle> below = {{dvec3(-0.5, 3, 0), dvec3(0.5, 3, 0), dvec3(0, 3, 1)}};
  const std::vector<dvec3> points = floor_points(40, 6.0);
  const VisibilityMasks masks =
      solve(scene_of(coplanar), receivers_at(points), frame_light(), frame_config(), ShadowMethod::kAliasFreeShadowMap);
  for (std::size_t i = 0; i < points.size(); ++i) CHECK(masks.blocked_count(i) == 0);
  CHECK(wrong_in_frame(piercing, points) == 0);
  CHECK(stats_of(piercing, points).pairs_tested <= 3 * stats_of(below, points).pairs_tested);
}

TEST_CASE("S12 receiver_behind_light: receivers at and behind a one-sided light see nothing of it") {
  const std::vector<dvec3> points = {{0, 5, 0}, {3, 4, 0}, {0, 4, 0}};
  for (const ShadowMethod method : {ShadowMethod::kAliasFreeShadowMap, ShadowMethod::kExact, ShadowMethod::kOracle}) {
    const VisibilityMasks masks =
        solve(scene_of(plate(2)), receivers_at(points), frame_light(), frame_config(), method);
    for (std::size_t i = 0; i < points.size(); ++i) CHECK(masks.visibility(i) == 0.0f);
  }
}

TEST_CASE("S13 light_in_box: a closed box around the light hides it from outside, not from inside") {
  const auto around = box({-3, 3, -3}, {3, 4.5, 3});
  const VisibilityMasks outside = solve(scene_of(around), receivers_at(floor_points(9, 8.0)), frame_light(),
                                        frame_config(), ShadowMethod::kAliasFreeShadowMap);
  for (std::size_t i = 0; i < outside.receiver_count; ++i) CHECK(outside.visibility(i) == 0.0f);
  Random random(13);
  std::vector<dvec3> inside;
  for (int i = 0; i < 200; ++i)
    inside.push_back({random.uniform(-2.9, 2.9), random.uniform(3.01, 3.9), random.uniform(-2.9, 2.9)});
  CHECK(wrong_in_frame(around, inside) == 0);
}

TEST_CASE("S14 inside_room: a room seen from inside does not depend on its winding") {
  std::vector<Triangle> room = joined(box({-8, -8, -8}, {8, 8, 8}), box({-1, 0.5, -1}, {1, 1.5, 1}));
  Random random(14);
  std::vector<dvec3> points = floor_points(12, 5.0);
  for (int i = 0; i < 100; ++i) points.push_back(random.in_box(-7.9, 7.9));
  CHECK(wrong_in_frame(room, points) == 0);
  const auto run = [&] {
    return solve(scene_of(room), receivers_at(points), frame_light(), frame_config(),
                 ShadowMethod::kAliasFreeShadowMap);
  };
  const VisibilityMasks masks = run();
  for (Triangle& t : room) std::swap(t[1], t[2]);
  CHECK(wrong_bits(masks, run()) == 0);
}

TEST_CASE("S15 open_mesh_winding: an open quad blocks from both sides, whatever its winding") {
  auto card = cases::half_plane();
  const auto points = floor_points(11, 1.0);
  const auto run = [&](bool two_sided) {
    Light light = frame_light();
    light.two_sided = two_sided;
    CHECK(wrong_in_frame(card, points, light) == 0);
    return solve(scene_of(card), receivers_at(points), light, frame_config(), ShadowMethod::kAliasFreeShadowMap);
  };
  const VisibilityMasks one = run(false);
  CHECK(wrong_bits(one, run(true)) == 0);
  for (Triangle& t : card) std::swap(t[0], t[1]);
  CHECK(wrong_bits(one, run(false)) == 0);
}

TEST_CASE("S16 zero_light: point, segment and tiny square lights give the hard shadow") {
  const auto triangles = joined(plate(2), box({-2, 0.5, -2}, {-1, 1.0, 2}));
  const auto points = floor_points(21, 4.9);  // none on the edge of the hard shadow
  Light point = frame_light();
  point.shape = LightShape::kPoint;
  const VisibilityMasks hard =
      solve(scene_of(triangles), receivers_at(points), point, frame_config(), ShadowMethod::kOracle);
  for (const double side : {0.0, 0x1p-40, 0x1p-30}) {
    Light tiny = frame_light();
    tiny.u *= side;
    tiny.v *= side;
    CHECK(wrong_in_frame(triangles, points, tiny) == 0);
    const VisibilityMasks masks =
        solve(scene_of(triangles), receivers_at(points), tiny, frame_config(), ShadowMethod::kAliasFreeShadowMap);
    for (std::size_t i = 0; i < points.size(); ++i) CHECK(masks.blocked_count(i) == 256 * hard.blocked_count(i));
  }
  for (const LightShape shape : {LightShape::kDisk, LightShape::kSphere}) {
    Light tiny = frame_light();
    tiny.shape = shape;
    tiny.radius = 0.0;
    CHECK(wrong_in_frame(triangles, points, tiny) == 0);
  }
  Light segment = frame_light();
  segment.v = dvec3(0.0);
  CHECK(wrong_in_frame(triangles, points, segment) == 0);
  Light needle = frame_light();
  needle.u = {2e-4, 0, 0};
  CHECK(wrong_in_frame(triangles, points, needle) == 0);
}

TEST_CASE("S17 N_sweep: any number of samples from 1 to 4096") {
  const auto triangles = joined(plate(2), box({-2, 0.5, -2}, {-1, 1.0, 2}));
  for (const std::uint32_t n : {1u, 2u, 3u, 63u, 64u, 65u, 127u, 128u, 129u, 1024u, 1025u, 4095u, 4096u}) {
    CAPTURE(n);
    CHECK(wrong_in_frame(triangles, floor_points(13, 4.0), frame_light(), frame_config(n)) == 0);
  }
  const std::vector<dvec3> crowd(1025, dvec3(0.3, 0.0, 0.4));
  CHECK(wrong_in_frame(triangles, crowd, frame_light(), frame_config(65)) == 0);
}

TEST_CASE("S18 both_sides_lit: a triangle whose plane holds the light's centre shadows both sides alike") {
  const std::vector<Triangle> t = cases::both_sides_lit();
  for (const ShadowMethod method : {ShadowMethod::kAliasFreeShadowMap, ShadowMethod::kExact, ShadowMethod::kOracle}) {
    const VisibilityMasks masks =
        solve(scene_of(t), receivers_at({{0.5, 0, 0}, {-0.5, 0, 0}}), frame_light(), frame_config(), method);
    CHECK(masks.blocked_count(0) == 88);
    CHECK(masks.blocked_count(1) == 88);
    for (std::uint32_t i = 0; i < 256; ++i) CHECK(masks.blocked(0, i) == masks.blocked(1, i / 16 * 16 + 15 - i % 16));
  }
}

TEST_CASE("S19 on_plane_div0: a receiver in the triangle's plane, or before the triangle, is not blocked") {
  const auto in_plane = quad({-2, 0, -2}, {2, 0, -2}, {2, 0, 2}, {-2, 0, 2});
  const auto under = quad({-2, -1, -2}, {2, -1, -2}, {2, -1, 2}, {-2, -1, 2});
  for (const auto& triangles : {in_plane, under}) {
    const VisibilityMasks masks = solve(scene_of(triangles), receivers_at({{0.5, 0, 0}}), frame_light(), frame_config(),
                                        ShadowMethod::kAliasFreeShadowMap);
    CHECK(masks.blocked_count(0) == 0);
  }
}

namespace {

/// A card at y = 2 with a texture of 4 x 4 texels of growing alpha.
Scene alpha_card(float cutoff, const dvec2& uv_low, const dvec2& uv_high) {
  Scene scene = scene_of(quad({-1, 2, -1}, {1, 2, -1}, {1, 2, 1}, {-1, 2, 1}));
  AlphaMap map{"ramp", 4, 4, {}};
  for (int i = 0; i < 16; ++i) map.alpha.push_back(static_cast<std::uint8_t>(i * 17));
  scene.alpha_maps.push_back(map);
  scene.materials[0].alpha_map = 0;
  scene.materials[0].alpha_cutoff = cutoff;
  const vec2 a(uv_low.x, uv_low.y), b(uv_high.x, uv_low.y), c(uv_high.x, uv_high.y), d(uv_low.x, uv_high.y);
  scene.triangle_uvs = {{a, b, c}, {a, c, d}};
  return scene;
}

}  // namespace

TEST_CASE("S20 alpha_ties: texel borders, wrapping and alpha equal to the threshold follow the rules") {
  CHECK(opaque_threshold(0.5f) == 128);
  CHECK(opaque_threshold(0.0f) == 0);
  CHECK(opaque_threshold(1.0f) == 255);
  const Scene scene = alpha_card(0.5f, {0, 0}, {1, 1});
  const LatticeMesh mesh =
      make_lattice_mesh(scene, make_local_frame(scene.positions, std::vector<dvec3>{{0, 4, 0}, {0, 0, 0}}));
  // Straight up through (x, z) in [-1, 1]^2: u = (x + 1) / 2, v = (z + 1) / 2; texel = floor(4 u), row 0 at v = 1.
  for (int i = -8; i <= 8; ++i) {
    for (int k = -8; k <= 8; ++k) {
      const double x = i / 8.0, z = k / 8.0;
      const vec3 r = mesh.frame.to_lattice({x, 0, z}), l = mesh.frame.to_lattice({x, 4, z});
      for (std::uint32_t t = 0; t < 2; ++t) {
        const auto [a, b, c] = mesh.corners(t);
        if (!blocks(a, b, c, r, l)) continue;
        const auto texel = texel_at_hit(make_alpha_triangle(mesh, t), r, l);
        CHECK(texel[0] == static_cast<std::uint32_t>(std::floor((x + 1) * 2.0)) % 4);
        CHECK(texel[1] == 3 - static_cast<std::uint32_t>(std::floor((z + 1) * 2.0)) % 4);
      }
    }
  }
  const auto points = floor_points(9, 1.0);
  for (const float cutoff : {0.0f, 0.2f, 0.5f, 119.0f / 255.0f, 1.0f}) {
    for (const dvec2 span :
         {dvec2(0, 1), dvec2(-0.0, 1), dvec2(-3.5, 4.25), dvec2(1e6, 1e6 + 3), dvec2(1e9, 1e9 + 1024)}) {
      CHECK(wrong_bits_of_exact_methods(alpha_card(cutoff, {span.x, span.x}, {span.y, span.y}), receivers_at(points),
                                        frame_light(), frame_config()) == 0);
    }
  }
}

TEST_CASE("S24 coincident_receivers: many equal receivers, or all in one cell, are handled") {
  const auto triangles = joined(plate(2), box({-2, 0.5, -2}, {-1, 1.0, 2}));
  CHECK(wrong_in_frame(triangles, std::vector<dvec3>(5000, dvec3(0.0)), frame_light(), frame_config(64)) == 0);
  std::vector<dvec3> crowd;
  Random random(24);
  for (int i = 0; i < 3000; ++i) crowd.push_back(1e-4 * random.in_box(-1, 1));
  crowd.push_back({100, 0, 0});
  CHECK(wrong_in_frame(triangles, crowd, frame_light(), frame_config(64)) == 0);
}

TEST_CASE("S29 isa_threads: masks do not depend on instruction set, threads or triangle order") {
  Random random(29);
  std::vector<Triangle> triangles = joined(box({-2, 0.5, -2}, {-1, 1.0, 2}), plate(2));
  for (int i = 0; i < 300; ++i) {
    const dvec3 c = random.in_box(-3, 4.5);
    triangles.push_back({c + random.in_box(-1, 1), c + random.in_box(-1, 1), c + random.in_box(-1, 1)});
  }
  std::vector<dvec3> points = floor_points(40, 6.0);
  for (int i = 0; i < 500; ++i) points.push_back(random.in_box(-5, 3.9));
  std::vector<std::string> hashes, targets;
  for (int order = 0; order < 3; ++order) {
    for_each_simd_target([&](const std::string& target) {
      targets.push_back(target);
      for (const int threads : {1, 2, 3, 7}) {
        for (const ShadowMethod method : exact_methods()) {
          VisibilityMasks masks;
          tbb::task_arena(threads).execute(
              [&] { masks = solve(scene_of(triangles), receivers_at(points), frame_light(), frame_config(), method); });
          hashes.push_back(masks.hash());
        }
      }
    });
    std::shuffle(triangles.begin(), triangles.end(), random.engine);
  }
  CHECK(targets.size() >= 3);
  for (const std::string& hash : hashes) CHECK(hash == hashes[0]);
}

TEST_CASE("S31 conservative_fuzz: no blocker is ever left out of a list, degenerate and aligned ones included") {
  Random random(31);
  const auto coordinate = [&](bool aligned) {
    const double x = random.uniform(-5, 5);
    return aligned ? std::round(x) : x;
  };
  for (int round = 0; round < 1500; ++round) {
    std::vector<Triangle> triangles;
    for (int i = 0; i < 3; ++i) {
      const bool aligned = random.uniform(0, 1) < 0.2;
      Triangle t;
      for (dvec3& p : t) p = {coordinate(aligned), coordinate(aligned), coordinate(aligned)};
      if (random.uniform(0, 1) < 0.1) t[2] = t[1];
      if (random.uniform(0, 1) < 0.1) t[2] = (t[0] + t[1]) * 0.5;
      triangles.push_back(t);
    }
    std::vector<dvec3> points;
    for (int i = 0; i < 25; ++i)
      points.push_back({coordinate(i % 5 == 0), coordinate(i % 5 == 0), coordinate(i % 5 == 0)});
    Light light = frame_light();
    light.shape = static_cast<LightShape>(round % 4);
    light.two_sided = round % 3 == 0;
    light.radius = random.uniform(0.0, 3.0);
    if (round % 7 == 0) light.u = random.in_box(-3, 3);
    CAPTURE(round);
    REQUIRE(wrong_in_frame(triangles, points, light, frame_config(16)) == 0);
  }
}
