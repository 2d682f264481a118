// Named stability cases about where light, blockers and receivers lie.
#include <doctest/doctest.h>

#include <cmath>

#include "rasterizer/rasterizer.h"
#include "shadows/alpha.h"
#include "shadows/solver.h"
#include "stability/cases.h"
#include "stability/integer_oracle.h"

using namespace halfshade;
using namespace halfshade::test;

namespace {

std::uint64_t wrong_in_frame(const std::vector<Triangle>& triangles, const std::vector<dvec3>& points,
                             const Light& light = frame_light(), const ShadowConfig& config = frame_config()) {
  return wrong_against_integers(scene_of(triangles), receivers_at(points), light, config);
}

/// By every exact method.
std::vector<VisibilityMasks> masks_in_frame(const std::vector<Triangle>& triangles, const std::vector<dvec3>& points,
                                            const Light& light = frame_light(),
                                            const ShadowConfig& config = frame_config()) {
  std::vector<VisibilityMasks> all;
  for (const ShadowMethod method : exact_methods())
    all.push_back(solve(scene_of(triangles), receivers_at(points), light, config, method));
  return all;
}

/// Does every method give every receiver that visibility?
bool all_see(const std::vector<VisibilityMasks>& all, float visibility) {
  for (const VisibilityMasks& masks : all) {
    for (std::size_t i = 0; i < masks.receiver_count; ++i) {
      if (masks.visibility(i) != visibility) return false;
    }
  }
  return true;
}

/// Blockers against receivers, as each method counts them.
std::vector<std::uint64_t> tests_in_frame(const std::vector<Triangle>& triangles, const std::vector<dvec3>& points) {
  std::vector<std::uint64_t> tests;
  for (const ShadowMethod method : exact_methods()) {
    ShadowStats stats;
    solve(scene_of(triangles), receivers_at(points), frame_light(), frame_config(), method, &stats);
    tests.push_back(method == ShadowMethod::kExact ? stats.leaves_tested : stats.pairs_tested);
  }
  return tests;
}

}  // namespace

TEST_CASE("S08 coplanar: receivers in the plane of a card are not blocked by it, tilted cards give the oracle's bits") {
  const auto card = plate(0);
  CHECK(all_see(masks_in_frame(card, floor_points(11, 1.5)), 1.0f));
  for (const double slope : {1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 0.577}) {  // 0.577: 30 degrees
    std::vector<Triangle> tilted = card;
    for (Triangle& t : tilted) {
      for (dvec3& p : t) p.y = slope * p.x;
    }
    CHECK(wrong_in_frame(tilted, floor_points(15, 2.0)) == 0);
  }
}

namespace {

/// Receivers as the camera makes them, with the masks of every exact method.
struct CameraRun {
  ReceiverArray receivers;
  LightSamples samples;
  std::vector<VisibilityMasks> masks;
};

CameraRun run_camera(const Scene& scene, const Camera& camera, const Light& light, std::uint32_t size) {
  CameraRun run;
  const LatticeMesh mesh = make_lattice_mesh(scene, make_local_frame(scene.positions, light_extent(light)));
  GBuffer gbuffer;
  rasterize(mesh, camera, {size, size, {}}, gbuffer);
  ShadowConfig config = frame_config(64);
  run.samples = make_light_samples(light, config, mesh.frame);
  run.receivers = make_receivers(gbuffer, run.samples, 0);
  for (const ShadowMethod method : exact_methods()) {
    ShadowStats stats;
    config.method = method;
    solve_masks(mesh, run.receivers, light, run.samples, config, run.masks.emplace_back(), stats);
  }
  return run;
}

std::vector<Triangle> tilted_plane() {
  std::vector<Triangle> plane;
  for (int i = 0; i < 20; ++i) {
    for (int k = 0; k < 20; ++k) {
      const auto p = [&](int a, int b) { return dvec3(a * 0.31 - 3.1, 0.137 * a + 0.071 * b - 1.0, b * 0.31 - 3.1); };
      const auto q = quad(p(i, k), p(i, k + 1), p(i + 1, k + 1), p(i + 1, k));
      plane.insert(plane.end(), q.begin(), q.end());
    }
  }
  return plane;
}

/// No bit on the plane; on the sphere none where all samples are above the horizon of the receiver's facet, and all
/// methods agree about the others.
void check_acne(std::uint32_t plane_size, std::size_t plane_receivers, std::uint32_t sphere_size) {
  const CameraRun plane =
      run_camera(scene_of(tilted_plane()), {{-3, 6, 5}, {0, 0, 0}, {0, 1, 0}, 60.0}, frame_light(), plane_size);
  REQUIRE(plane.receivers.size() > plane_receivers);
  CHECK(all_see(plane.masks, 1.0f));
  const CameraRun ball = run_camera(scene_of(uv_sphere({0, 0, 0}, 1.0, 32, 64)),
                                    {{2, 3, 2}, {0, 0, 0}, {0, 1, 0}, 45.0}, frame_light(), sphere_size);
  REQUIRE(ball.receivers.size() > sphere_size * sphere_size / 8);
  for (const VisibilityMasks& masks : ball.masks) CHECK(wrong_bits(ball.masks[0], masks) == 0);
  std::uint64_t blocked_above = 0, above = 0;
  for (std::size_t i = 0; i < ball.receivers.size(); ++i) {
    bool all_above = true;
    for (const vec3& l : ball.samples.set(0)) {
      all_above =
          all_above && glm::dot(dvec3(l) - dvec3(ball.receivers.position[i]), dvec3(ball.receivers.normal[i])) > 0.0;
    }
    above += all_above;
    if (all_above) blocked_above += ball.masks[0].blocked_count(i);
  }
  CHECK(above > ball.receivers.size() / 4);
  CHECK(blocked_above == 0);
}

}  // namespace

TEST_CASE("S09 lone_plane_acne: neither a tilted plane nor the lit side of a sphere casts shadow on itself") {
  check_acne(500, 50000, 200);
}

TEST_CASE("S09_long lone_plane_acne: a million receivers on the plane") { check_acne(2400, 1000000, 600); }

TEST_CASE("S09 lone_plane_acne: the sphere's bits are those of integers") {
  for (const StabilityCase& c : stability_cases()) {
    if (c.name == "S09 lone_plane_acne") CHECK(wrong_against_integers(c.scene, c.receivers, c.light, c.config) == 0);
  }
}

TEST_CASE("S10 behind_light_vertex: a triangle that reaches through the light's plane hides the receiver beyond it") {
  const std::vector<Triangle> crossing = {{dvec3(2, 3, 0), dvec3(2, 5, 0.5), dvec3(2, 3, 1)}};
  std::vector<dvec3> points = {{20, 0, 0.5}};
  for (const VisibilityMasks& masks : masks_in_frame(crossing, points)) CHECK(masks.blocked_count(0) > 0);
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
  const std::vector<Triangle> piercing = {{dvec3(-0.5, 3, 0), dvec3(0.5, 5, 0), dvec3(0, 4, 1)}};
  const std::vector<Triangle> below = {{dvec3(-0.5, 3, 0), dvec3(0.5, 3, 0), dvec3(0, 3, 1)}};
  const std::vector<dvec3> points = floor_points(40, 6.0);
  CHECK(all_see(masks_in_frame(coplanar, points), 1.0f));
  CHECK(wrong_in_frame(coplanar, points) == 0);
  CHECK(wrong_in_frame(piercing, points) == 0);
  const std::vector<std::uint64_t> tests = tests_in_frame(piercing, points), usual = tests_in_frame(below, points);
  for (std::size_t k = 0; k < tests.size(); ++k) {
    CAPTURE(k);
    CHECK(tests[k] <= 3 * usual[k]);
  }
}

TEST_CASE("S12 receiver_behind_light: receivers at and behind a one-sided light see nothing of it") {
  const std::vector<dvec3> points = {{0, 5, 0}, {3, 4, 0}, {0, 4, 0}};
  CHECK(all_see(masks_in_frame(plate(2), points), 0.0f));
  CHECK(wrong_in_frame(plate(2), points) == 0);
  for (const MethodTraits& traits : shadow_methods()) {  // the approximate ones as well: no NaN, no light
    if (traits.method == ShadowMethod::kRaytrace) continue;
    ShadowConfig config = frame_config(16);
    config.method = traits.method;
    std::vector<float> visibility;
    solve_visibility(scene_of(plate(2)), receivers_at(points), frame_light(), config, visibility);
    CAPTURE(std::string(traits.name));
    for (const float v : visibility) CHECK(v == 0.0f);
  }
}

TEST_CASE("S13 light_in_box: a closed box around the light hides it from outside, not from inside") {
  const auto around = box({-3, 3, -3}, {3, 4.5, 3});
  CHECK(all_see(masks_in_frame(around, floor_points(9, 8.0)), 0.0f));
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
  const std::vector<VisibilityMasks> outward = masks_in_frame(room, points);
  for (Triangle& t : room) std::swap(t[1], t[2]);
  const std::vector<VisibilityMasks> inward = masks_in_frame(room, points);
  for (std::size_t k = 0; k < outward.size(); ++k) CHECK(wrong_bits(outward[k], inward[k]) == 0);
}

TEST_CASE("S15 open_mesh_winding: an open quad blocks from both sides, whatever its winding") {
  auto card = half_plane();
  const auto points = floor_points(11, 1.0);
  const auto run = [&](bool two_sided) {
    Light light = frame_light();
    light.two_sided = two_sided;
    CHECK(wrong_in_frame(card, points, light) == 0);
    return masks_in_frame(card, points, light);
  };
  const std::vector<VisibilityMasks> one = run(false);
  const auto check_same = [&](const std::vector<VisibilityMasks>& other) {
    for (std::size_t k = 0; k < one.size(); ++k) CHECK(wrong_bits(one[k], other[k]) == 0);
  };
  check_same(run(true));
  for (Triangle& t : card) std::swap(t[0], t[1]);
  check_same(run(false));
  check_same(run(true));
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
    for (const VisibilityMasks& masks : masks_in_frame(triangles, points, tiny)) {
      for (std::size_t i = 0; i < points.size(); ++i) CHECK(masks.blocked_count(i) == 256 * hard.blocked_count(i));
    }
  }
  for (const VisibilityMasks& masks : masks_in_frame(triangles, points, point)) CHECK(wrong_bits(masks, hard) == 0);
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

TEST_CASE("S16 zero_light: every other method gives numbers from 0 to 1 as well") {
  const auto triangles = joined(plate(2), box({-2, 0.5, -2}, {-1, 1.0, 2}));
  for (const MethodTraits& traits : shadow_methods()) {
    if (traits.exact || traits.method == ShadowMethod::kRaytrace) continue;
    for (const double side : {0.0, 0x1p-40, 0x1p-30}) {
      for (const LightShape shape :
           {LightShape::kPoint, LightShape::kRectangle, LightShape::kDisk, LightShape::kSphere}) {
        Light tiny = frame_light();
        tiny.shape = shape;
        tiny.u *= side;
        tiny.v *= side;
        tiny.radius = side;
        ShadowConfig config = frame_config(16);
        config.method = traits.method;
        std::vector<float> visibility;
        solve_visibility(scene_of(triangles), receivers_at(floor_points(7, 4.9)), tiny, config, visibility);
        CAPTURE(std::string(traits.name));
        CAPTURE(side);
        for (const float v : visibility) CHECK((v >= 0.0f && v <= 1.0f));
      }
    }
  }
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
  const std::vector<Triangle> t = {{dvec3(0, 1, -1), dvec3(0, 1, 1), dvec3(0, 3, 0)}};
  CHECK(wrong_in_frame(t, {{0.5, 0, 0}, {-0.5, 0, 0}}) == 0);
  for (const VisibilityMasks& masks : masks_in_frame(t, {{0.5, 0, 0}, {-0.5, 0, 0}})) {
    CHECK(masks.blocked_count(0) == 88);
    CHECK(masks.blocked_count(1) == 88);
    for (std::uint32_t i = 0; i < 256; ++i) CHECK(masks.blocked(0, i) == masks.blocked(1, i / 16 * 16 + 15 - i % 16));
  }
}

TEST_CASE("S19 on_plane_div0: a receiver in the triangle's plane, or before the triangle, is not blocked") {
  const auto in_plane = quad({-2, 0, -2}, {2, 0, -2}, {2, 0, 2}, {-2, 0, 2});
  const auto under = quad({-2, -1, -2}, {2, -1, -2}, {2, -1, 2}, {-2, -1, 2});
  for (const auto& triangles : {in_plane, under}) {
    CHECK(all_see(masks_in_frame(triangles, {{0.5, 0, 0}, {0, 0, 0}}), 1.0f));
    CHECK(wrong_in_frame(triangles, {{0.5, 0, 0}, {0, 0, 0}}) == 0);
  }
}

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

TEST_CASE(
    "S20 alpha_ties: 64 places on texel borders and between them, by every method, are opaque as the table says") {
  // Row 0 of the texture is v = 1; alpha of texel (column, row) is 17 (4 row + column).
  for (const float cutoff : {0.0f, 119.0f / 255.0f, 120.0f / 255.0f, 1.0f}) {
    const Scene scene = alpha_card(cutoff, {0, 0}, {1, 1});
    for (int entry = 0; entry < 64; ++entry) {
      const int i = entry % 8, k = entry / 8;  // u = i / 8, v = k / 8: even ones on a border
      const dvec3 r(i / 4.0 - 1.0, 0.0, k / 4.0 - 1.0);
      const int alpha = 17 * (4 * (3 - k / 2) + i / 2);
      const bool opaque = alpha >= 255.0 * static_cast<double>(cutoff);  // exactly; float(119 / 255) is above 119 / 255
      CAPTURE(cutoff);
      CAPTURE(entry);
      for (const ShadowMethod method : exact_methods()) {
        const VisibilityMasks masks =
            solve(scene, receivers_at({r}), sample_light({{r.x, 4.0, r.z}}), frame_config(1), method);
        CHECK(masks.blocked(0, 0) == opaque);
      }
    }
  }
}

namespace {

/// Of every shape in turn.
Light random_light(Random& random, int round) {
  constexpr LightShape kShapes[] = {LightShape::kRectangle, LightShape::kDisk,      LightShape::kSphere,
                                    LightShape::kPoint,     LightShape::kEllipsoid, LightShape::kPolygon,
                                    LightShape::kSamples};
  Light light = frame_light();
  light.shape = kShapes[round % 7];
  light.two_sided = round % 3 == 0;
  light.radius = random.uniform(0.0, 3.0);
  if (round % 4 == 0) light.u = random.in_box(-3, 3);
  for (dvec3& axis : light.axes) axis = random.in_box(-2, 2);
  if (light.shape == LightShape::kSamples) light.points = random_points(random, 16, -4, 5);
  if (light.shape == LightShape::kPolygon) light.points = {{-1, 4, -1}, {1, 4, -1}, {1.5, 4, 1}, {0, 4, 2}};
  return light;
}

/// Rounds `first`.. of those of a seed.
void fuzz_lists(std::uint64_t seed, int rounds, int first = 0) {
  Random random(seed);
  const auto coordinate = [&](bool aligned) {
    const double x = random.uniform(-5, 5);
    return aligned ? std::round(x) : x;
  };
  for (int round = 0; round < rounds; ++round) {
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
    const Light light = random_light(random, round);
    if (round < first) continue;
    CAPTURE(round);
    REQUIRE(wrong_in_frame(triangles, points, light, frame_config(16)) == 0);
  }
}

}  // namespace

TEST_CASE("S31 conservative_fuzz: no blocker is ever left out of a list, degenerate and aligned ones included") {
  fuzz_lists(31, 1500);
}

TEST_CASE("S31 conservative_fuzz: images of a corner by a point light, apart by rounding, do not cut its list short") {
  fuzz_lists(3100, 17112, 17111);
}

TEST_CASE("S31_long conservative_fuzz: a million triangles") { fuzz_lists(3100, 333334); }
