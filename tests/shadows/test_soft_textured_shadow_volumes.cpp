#include <doctest/doctest.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <glm/common.hpp>

#include "halfshade/depth_complexity.h"
#include "shadows/crossing.h"
#include "shadows/method_options.h"
#include "shadows/opacity_average.h"
#include "shadows/soft_shadow_volume.h"
#include "shadows/soft_textured_shadow_volumes.h"
#include "shadows/solver.h"
#include "support/lit_scene.h"
#include "support/simd_targets.h"

using namespace halfshade;
using namespace halfshade::test;

namespace {

constexpr ShadowMethod kStsv = ShadowMethod::kSoftTexturedShadowVolumes;

/// Gives all triangles one opacity map and random texture coordinates; every third one keeps none of it.
void perforate(Scene& scene, Random& random, std::uint32_t width, std::uint32_t height, double repeats) {
  AlphaMap map{"noise", width, height, {}};
  for (std::uint32_t i = 0; i < width * height; ++i)
    map.alpha.push_back(static_cast<std::uint8_t>(random.engine() % 256));
  scene.alpha_maps.push_back(map);
  Material perforated;
  perforated.alpha_map = 0;
  scene.materials.push_back(perforated);
  for (std::size_t t = 0; t < scene.triangles.size(); ++t) {
    std::array<vec2, 3> uv;
    for (vec2& p : uv) {
      p = {static_cast<float>(random.uniform(-repeats, repeats)),
           static_cast<float>(random.uniform(-repeats, repeats))};
      if (t % 4 == 0) p = glm::round(p * 8.0f) / 8.0f;
    }
    scene.triangle_uvs.push_back(uv);
    if (t % 3 != 0) scene.triangle_materials[t] = 1;
  }
}

Scene random_scene(Random& random, int count) {
  std::vector<Triangle> triangles;
  for (int i = 0; i < count; ++i) {
    const dvec3 c = random.in_box(-3, 4.2);
    Triangle t = {c + random.in_box(-2, 2), c + random.in_box(-2, 2), c + random.in_box(-2, 2)};
    if (i % 5 == 0) {
      for (dvec3& p : t) p = glm::round(p * 2.0) * 0.5;
    }
    triangles.push_back(t);
  }
  return scene_of(triangles);
}

std::vector<dvec3> random_points(Random& random, int count) {
  std::vector<dvec3> points;
  for (int i = 0; i < count; ++i) {
    dvec3 p = random.in_box(-5, 3.9);
    if (i % 4 == 0) p = glm::floor(p * 2.0) * 0.5;  // below the light
    points.push_back(p);
  }
  return points;
}

Light light_of(LightShape shape, Random& random) {
  Light light = frame_light();
  light.shape = shape;
  light.radius = 0.8;
  light.two_sided = true;
  light.axes = {dvec3(1, 0.2, 0), dvec3(0, 0.4, 0.3), dvec3(0.3, 0, 0.7)};
  light.center = {0, 4, 0};
  if (shape == LightShape::kSamples) {
    for (int i = 0; i < 70; ++i) light.points.push_back(light.center + random.in_box(-1, 1));
  }
  if (shape == LightShape::kPolygon) light.points = {{-1, 4, -1}, {0, 4, 1.5}, {1, 4, -1}};
  return light;
}

const std::vector<LightShape>& all_shapes() {
  static const std::vector<LightShape> shapes = {LightShape::kPoint,  LightShape::kRectangle, LightShape::kDisk,
                                                 LightShape::kSphere, LightShape::kSamples,   LightShape::kEllipsoid,
                                                 LightShape::kPolygon};
  return shapes;
}

ShadowConfig volumes_config(std::uint32_t samples) {
  ShadowConfig config = frame_config(samples);
  config.stsv.opaque = OpaqueBlockers::kVolumes;
  return config;
}

std::uint64_t wrong_with(const Scene& scene, const std::vector<Receiver>& receivers, const Light& light,
                         const ShadowConfig& config) {
  return wrong_bits(solve(scene, receivers, light, config, ShadowMethod::kOracle),
                    solve(scene, receivers, light, config, kStsv));
}

/// Volume geometry of one triangle in the frame of the stability cases.
struct Extruded {
  LatticeMesh mesh;
  LightSamples samples;
  LatticeBox receivers;
  std::array<SoftShadowVolume, 2> volume;
  std::array<bool, 2> exists{};
};

Extruded extrude(const Scene& scene, const Light& light, double reach) {
  Extruded e;
  std::vector<dvec3> extent = light_extent(light);
  for (int i = 0; i < 8; ++i)
    extent.push_back(dvec3(i & 1 ? reach : -reach, i & 2 ? reach : -reach, i & 4 ? reach : -reach));
  e.mesh = make_lattice_mesh(scene, make_local_frame(scene.positions, extent));
  e.samples = make_light_samples(light, frame_config(64), e.mesh.frame);
  for (int i = 0; i < 8; ++i)
    e.receivers.add(e.mesh.frame.to_lattice(extent[extent.size() - 8 + static_cast<std::size_t>(i)]));
  const LightBound bound = make_light_bound(light, e.samples);
  const LightHull hull = make_light_hull(bound, e.samples, make_kernel_samples(e.samples, bound));
  for (std::size_t k = 0; k < 2; ++k) {
    e.exists[k] = make_soft_shadow_volume(hull, e.mesh.corners(0), k == 0 ? 1 : -1, e.receivers, e.volume[k]);
  }
  return e;
}

bool inside_planes(const SoftShadowVolume& v, const dvec3& p) {
  for (std::size_t k = 0; k < SoftShadowVolume::kPlanes; ++k) {
    if (glm::dot(v.normal[k], p) < v.offset[k]) return false;
  }
  return true;
}

/// Faces of the strip beyond p along a ray, signed: what the stencil of a z-fail pass counts.
int stencil_count(const SoftShadowVolume& v, const dvec3& p, const dvec3& direction) {
  int count = 0;
  for (std::size_t i = 0; i + 2 < kSoftShadowVolumeStrip.size(); ++i) {
    std::array<dvec3, 3> t;
    for (std::size_t k = 0; k < 3; ++k) t[k] = v.vertex[kSoftShadowVolumeStrip[i + k]] - p;
    if (i % 2 == 1) std::swap(t[0], t[1]);
    const double a = glm::dot(glm::cross(t[0], t[1]), direction), b = glm::dot(glm::cross(t[1], t[2]), direction),
                 c = glm::dot(glm::cross(t[2], t[0]), direction), depth = glm::dot(glm::cross(t[0], t[1]), t[2]);
    if (a > 0 && b > 0 && c > 0 && depth > 0) ++count;
    if (a < 0 && b < 0 && c < 0 && depth < 0) --count;
  }
  return count;
}

}  // namespace

TEST_CASE("a soft shadow volume holds every receiver that its triangle hides from a sample") {
  Random random(1);
  std::uint64_t hidden = 0, closed = 0, with_two_sides = 0;
  for (int round = 0; round < 1500; ++round) {
    const Light light = light_of(all_shapes()[static_cast<std::size_t>(round) % all_shapes().size()], random);
    Scene scene = random_scene(random, 1);
    if (round % 3 == 0) scene.positions[2].y = 4.0;  // a corner in the light's plane
    if (round % 10 == 0) scene.positions[2] = scene.positions[0] + 1e-7 * random.in_box(-1, 1);
    const Extruded e = extrude(scene, light, 5.0);
    const auto [a, b, c] = e.mesh.corners(0);
    with_two_sides += e.exists[0] && e.exists[1];
    for (std::size_t k = 0; k < 2; ++k) closed += e.exists[k] && e.volume[k].closed;
    for (int i = 0; i < 60; ++i) {
      const dvec3 on = dvec3(a) + (dvec3(b) - dvec3(a)) * random.uniform(0, 1) * 0.5 +
                       (dvec3(c) - dvec3(a)) * random.uniform(0, 1) * 0.5;
      const vec3 l = e.samples.points[random.engine() % e.samples.points.size()];
      const vec3 r = snap_to_lattice(dvec3(l) + (on - dvec3(l)) * (1.0 + random.uniform(0.0, 2.0)));
      if (glm::clamp(r, e.receivers.low, e.receivers.high) != r || !blocks(a, b, c, r, l)) continue;
      ++hidden;
      const int side = orient3d(a, b, c, r);
      const dvec3 p(r);
      bool found = false;
      for (std::size_t k = 0; k < 2; ++k) {
        const SoftShadowVolume& v = e.volume[k];
        if (!e.exists[k] || (v.light_side != 0 && v.light_side != side)) continue;
        found = inside_planes(v, p) && glm::clamp(p, v.low, v.high) == p;
      }
      CAPTURE(round);
      REQUIRE(found);
    }
  }
  CHECK(hidden > 10000);
  CHECK(closed > 300);
  CHECK(with_two_sides > 300);
}

TEST_CASE("the ten-vertex strip is closed and oriented: its z-fail count says what the planes say") {
  Random random(2);
  int inside = 0, outside = 0, volumes = 0;
  for (int round = 0; round < 300; ++round) {
    const Scene scene = random_scene(random, 1);
    const Extruded e = extrude(scene, frame_light(), 5.0);
    for (std::size_t k = 0; k < 2; ++k) {
      const SoftShadowVolume& v = e.volume[k];
      if (!e.exists[k] || !v.closed) continue;
      ++volumes;
      for (int i = 0; i < 40; ++i) {
        dvec3 p = random.in_box(e.receivers.low.x, e.receivers.high.x);
        if (i % 2 == 0) {  // in the convex hull of the vertices
          double weight[6], sum = 0.0;
          for (double& w : weight) sum += w = random.uniform(0, 1);
          p = dvec3(0.0);
          for (std::size_t n = 0; n < 6; ++n) p += v.vertex[n] * (weight[n] / sum);
        }
        bool near_face = false;
        for (std::size_t n = 0; n < 4; ++n)
          near_face = near_face || std::fabs(glm::dot(v.normal[n], p) - v.offset[n]) < 1e-6;
        const dvec3 axis = glm::cross(v.vertex[4] - v.vertex[3], v.vertex[5] - v.vertex[3]);
        const double behind_cap = glm::dot(axis, p - v.vertex[3]), front = glm::dot(axis, v.vertex[0] - v.vertex[3]);
        if (near_face || std::fabs(behind_cap) < 1e-6 * glm::length(axis)) continue;
        const bool expected = inside_planes(v, p) && (behind_cap > 0) == (front > 0);
        const int count = std::abs(stencil_count(v, p, random.in_box(-1, 1)));
        CAPTURE(round);
        REQUIRE(count == (expected ? 1 : 0));
        ++(expected ? inside : outside);
      }
    }
  }
  CHECK(volumes > 100);
  CHECK(inside > 1000);
  CHECK(outside > 1000);
}

TEST_CASE("perforated and opaque triangles give the oracle's masks for every shape of light, through volumes or not") {
  Random random(3);
  for (const LightShape shape : all_shapes()) {
    for (int round = 0; round < 4; ++round) {
      CAPTURE(static_cast<int>(shape));
      CAPTURE(round);
      Scene scene = random_scene(random, 24);
      perforate(scene, random, round % 2 == 0 ? 8 : 13, round % 2 == 0 ? 8 : 5, round < 2 ? 3.0 : 40.0);
      const Light light = light_of(shape, random);
      const auto receivers = receivers_at(random_points(random, 300));
      CHECK(wrong_with(scene, receivers, light, frame_config(70)) == 0);
      CHECK(wrong_with(scene, receivers, light, volumes_config(70)) == 0);
    }
  }
}

TEST_CASE("masks of perforated triangles depend neither on instruction set nor on threads") {
  Random random(4);
  Scene scene = random_scene(random, 60);
  perforate(scene, random, 16, 64, 4.0);
  const auto receivers = receivers_at(random_points(random, 2500));
  const VisibilityMasks truth =
      solve(scene, receivers, frame_light(), frame_config(64), ShadowMethod::kAliasFreeShadowMap);
  for_each_simd_target([&](const std::string& target) {
    CAPTURE(target);
    for (const int threads : {1, 3}) {
      tbb::task_arena(threads).execute(
          [&] { CHECK(wrong_bits(truth, solve(scene, receivers, frame_light(), volumes_config(64), kStsv)) == 0); });
    }
  });
}

namespace {

std::uint64_t wrong_through_volumes(const std::vector<Triangle>& triangles, const std::vector<dvec3>& points) {
  return wrong_with(scene_of(triangles), receivers_at(points), frame_light(), volumes_config(256));
}

}  // namespace

TEST_CASE("a triangle whose plane holds the light's centre has a volume on each side (stability.md B1)") {
  const Scene scene = scene_of({{dvec3(0, 1, -1), dvec3(0, 1, 1), dvec3(0, 3, 0)}});
  ShadowStats stats;
  const VisibilityMasks masks =
      solve(scene, receivers_at({{0.5, 0, 0}, {-0.5, 0, 0}}), frame_light(), volumes_config(256), kStsv, &stats);
  for (std::size_t i = 0; i < 2; ++i) CHECK(masks.blocked_count(i) == 88);
  for (std::uint32_t i = 0; i < 256; ++i) CHECK(masks.blocked(0, i) == masks.blocked(1, i / 16 * 16 + 15 - i % 16));
  const auto volumes =
      std::find_if(stats.details.begin(), stats.details.end(), [](const auto& d) { return d.first == "stsv.volumes"; });
  REQUIRE(volumes != stats.details.end());
  CHECK(volumes->second == 2.0);
}

TEST_CASE("receivers in the triangle's plane, or before it, lose no sample through volumes (stability.md B2, B3)") {
  for (const double y : {0.0, -1.0}) {
    const Scene scene = scene_of(quad({-2, y, -2}, {2, y, -2}, {2, y, 2}, {-2, y, 2}));
    const VisibilityMasks masks =
        solve(scene, receivers_at({{0.5, 0, 0}, {0, 0, 0}}), frame_light(), volumes_config(256), kStsv);
    for (std::size_t i = 0; i < 2; ++i) CHECK(masks.blocked_count(i) == 0);
  }
}

TEST_CASE("slivers and corners at the light lose planes, not receivers (stability.md B4, B5)") {
  Random random(9);
  std::vector<dvec3> points = random_points(random, 200);
  for (int i = -20; i <= 20; ++i) points.push_back({0.1 * i, 0.0, 0.05 * i});
  for (const double width : {1e-3, 1e-5, 1e-7, 1e-9, 0.0}) {
    CHECK(wrong_through_volumes({{dvec3(0, 2, 0), dvec3(1, 2, 0), dvec3(2, 2, width)}}, points) == 0);
  }
  for (const double y : {3.9, 3.999, 3.999999, 4.0, 4.001}) {
    CHECK(wrong_through_volumes({{dvec3(0, y, 0), dvec3(1, 2, 0), dvec3(-1, 2, 1)}}, points) == 0);
    CHECK(wrong_through_volumes({{dvec3(1, y, 1), dvec3(2, 1, 0), dvec3(1, 2, 2)}}, points) == 0);
  }
}

TEST_CASE("receivers do not block themselves, and sets of samples are kept apart") {
  Random random(5);
  Scene scene = random_scene(random, 30);
  perforate(scene, random, 8, 8, 2.0);
  std::vector<Receiver> receivers;
  for (std::uint32_t t = 0; t < 30; ++t) {
    const auto& index = scene.triangles[t];
    const dvec3 middle = (scene.positions[index[0]] + scene.positions[index[1]] + scene.positions[index[2]]) / 3.0;
    for (int i = 0; i < 20; ++i) receivers.push_back({middle - dvec3(0, 1e-3 * i, 0), t});
  }
  ShadowConfig config = volumes_config(48);
  config.sample_sets = 7;
  config.pattern = SamplePattern::kStratified;
  CHECK(wrong_with(scene, receivers, frame_light(), config) == 0);
  config.interleave = true;
  CHECK(wrong_with(scene, receivers, frame_light(), config) == 0);
}

TEST_CASE("most samples of a fence are settled by the float filter") {
  Scene scene = scene_of(quad({-3, 1, 0}, {3, 1, 0}, {3, 3, 0.5}, {-3, 3, 0.5}));
  AlphaMap map{"bars", 16, 16, {}};
  for (int i = 0; i < 256; ++i) map.alpha.push_back(i % 4 < 2 ? 255 : 0);
  scene.alpha_maps.push_back(map);
  scene.materials[0].alpha_map = 0;
  scene.triangle_uvs = {{vec2(0, 0), vec2(8, 0), vec2(8, 4)}, {vec2(0, 0), vec2(8, 4), vec2(0, 4)}};
  Random random(6);
  std::vector<dvec3> points;
  for (int i = 0; i < 2000; ++i) points.push_back({random.uniform(-3, 3), 0.0, random.uniform(-4, -0.1)});
  ShadowStats stats;
  solve(scene, receivers_at(points), frame_light(), frame_config(256), kStsv, &stats);
  CHECK(stats.sample_tests > 20000);
  CHECK(stats.exact_fallbacks * 100 < stats.sample_tests);
}

namespace {

/// Depth complexity by definition.
std::uint32_t crossings(const LatticeMesh& mesh, const vec3& r, const vec3& l) {
  std::uint32_t count = 0;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto [a, b, c] = mesh.corners(t);
    if (!crosses(a, b, c, r, l)) continue;
    count += mesh.alpha_map(t) == kNone || opaque_at_hit(make_alpha_triangle(mesh, t), r, l);
  }
  return count;
}

}  // namespace

TEST_CASE("depth complexity counts every crossing, ties on shared edges once") {
  Random random(7);
  std::uint64_t deeper = 0;
  for (int round = 0; round < 6; ++round) {
    Scene scene = random_scene(random, 40);
    perforate(scene, random, 4, 4, 2.0);
    const auto points = random_points(random, 200);
    const DepthComplexity depth = depth_of(scene, points, 64);
    std::vector<dvec3> extent = light_extent(frame_light());
    extent.insert(extent.end(), points.begin(), points.end());
    const LatticeMesh mesh = make_lattice_mesh(scene, make_local_frame(scene.positions, extent));
    const LightSamples samples = make_light_samples(frame_light(), frame_config(64), mesh.frame);
    for (std::size_t i = 0; i < points.size(); ++i) {
      for (std::uint32_t s = 0; s < 64; ++s) {
        const std::uint32_t expected = crossings(mesh, mesh.frame.to_lattice(points[i]), samples.points[s]);
        REQUIRE(depth.count(i, s) == expected);
        deeper += expected > 1;
      }
    }
  }
  CHECK(deeper > 1000);
}

TEST_CASE("coincident opaque triangles count once") {
  auto twice = quad({-64, 2, -64}, {0, 2, -64}, {0, 2, 64}, {-64, 2, 64});
  auto turned = twice;
  for (Triangle& t : turned) std::swap(t[0], t[1]);
  twice.insert(twice.end(), turned.begin(), turned.end());
  const DepthComplexity depth = depth_of(scene_of(twice), {{-0.9, 0, 0.1}}, 64);
  for (const std::uint32_t count : depth.counts) CHECK(count <= 1);
  CHECK(depth.visibility(0) < 0.1f);
}

namespace {

std::vector<float> visibility_of(const Scene& scene, const std::vector<dvec3>& points, const ShadowConfig& config) {
  ShadowConfig c = config;
  c.method = kStsv;
  std::vector<float> visibility;
  solve_visibility(scene, receivers_at(points), frame_light(), c, visibility);
  return visibility;
}

}  // namespace

TEST_CASE("filtered opacity tends to the nearest texel's as footprints shrink below texels") {
  Scene scene = scene_of(quad({-2, 2, -2}, {2, 2, -2}, {2, 2, 2}, {-2, 2, 2}));
  scene.alpha_maps.push_back({"checks", 2, 2, {255, 0, 0, 255}});
  scene.materials[0].alpha_map = 0;
  scene.triangle_uvs = {{vec2(0, 0), vec2(1, 0), vec2(1, 1)}, {vec2(0, 0), vec2(1, 1), vec2(0, 1)}};
  const std::vector<dvec3> points = {{0.1, 0, 0.2}, {-0.7, 0, 0.3}, {1.3, 0, -0.4}};
  double previous = 1.0;
  for (const std::uint32_t n : {16u, 256u, 4096u}) {
    ShadowConfig config = frame_config(n);
    const std::vector<float> nearest = visibility_of(scene, points, config);
    config.stsv.filter = OpacityFilter::kFiltered;
    const std::vector<float> filtered = visibility_of(scene, points, config);
    double largest = 0.0;
    for (std::size_t i = 0; i < points.size(); ++i)
      largest = std::max(largest, std::fabs(double{nearest[i]} - double{filtered[i]}));
    CHECK(largest < previous);
    previous = largest;
  }
  CHECK(previous < 0.01);
}

TEST_CASE("filtered opacity is an opacity: opaque maps block as triangles do, shared edges are crossed once") {
  Scene scene = scene_of(quad({-1, 2, -1}, {1, 2, -1}, {1, 2, 1}, {-1, 2, 1}));
  scene.alpha_maps.push_back({"full", 1, 1, {255}});
  scene.materials[0].alpha_map = 0;
  scene.triangle_uvs = {{vec2(0, 0), vec2(1, 0), vec2(1, 1)}, {vec2(0, 0), vec2(1, 1), vec2(0, 1)}};
  ShadowConfig config = frame_config(64);
  config.stsv.filter = OpacityFilter::kFiltered;
  const std::vector<dvec3> points = {{0.1, 0, 0.2}, {-0.9, 0, 0.3}, {1.7, 0, -0.4}};
  const std::vector<float> filtered = visibility_of(scene, points, config);
  const VisibilityMasks masks =
      solve(scene, receivers_at(points), frame_light(), frame_config(64), ShadowMethod::kOracle);
  for (std::size_t i = 0; i < points.size(); ++i) CHECK(filtered[i] == doctest::Approx(double{masks.visibility(i)}));
}

TEST_CASE("the average over a rectangle is the integral over the repeated map") {
  const AlphaMap map{"dots", 3, 2, {255, 0, 0, 0, 0, 255}};
  const OpacityBits bits = make_opacity_bits(map, 128);
  const OpacityAverage average(bits);
  Random random(8);
  for (int round = 0; round < 200; ++round) {
    const double u = random.uniform(-7, 7), v = random.uniform(-7, 7), w = random.uniform(0.1, 5),
                 h = random.uniform(0.1, 5);
    double area = 0.0;  // texel by texel
    for (int y = -20; y < 20; ++y) {
      for (int x = -20; x < 20; ++x) {
        const int column = ((x % 3) + 3) % 3, up = ((y % 2) + 2) % 2;
        if (map.alpha[static_cast<std::size_t>((1 - up) * 3 + column)] < 128) continue;
        const double dx = std::min(u + w / 2, x + 1.0) - std::max(u - w / 2, double(x));
        const double dy = std::min(v + h / 2, y + 1.0) - std::max(v - h / 2, double(y));
        if (dx > 0.0 && dy > 0.0) area += dx * dy;
      }
    }
    CHECK(average.average(u, v, w, h) == doctest::Approx(area / (w * h)).epsilon(1e-9));
  }
}

TEST_CASE("options of stsv: names, values, and no masks from filtered opacity") {
  ShadowConfig config = frame_config(16);
  config.method = kStsv;
  set_method_option(config, "stsv.opaque=volumes");
  CHECK(config.stsv.opaque == OpaqueBlockers::kVolumes);
  CHECK(promises_exactness(config));
  set_method_option(config, "stsv.filter=filtered");
  CHECK_FALSE(yields_masks(config));
  CHECK_FALSE(promises_exactness(config));
  VisibilityMasks masks;
  CHECK_THROWS_AS(solve_shadows(scene_of(quad({-1, 2, -1}, {1, 2, -1}, {1, 2, 1}, {-1, 2, 1})),
                                receivers_at({{0, 0, 0}}), frame_light(), config, masks),
                  Error);
  CHECK_THROWS_AS(set_method_option(config, "stsv.filter=blurred"), Error);
}
