#include "shadows/transmittance.h"

#include <doctest/doctest.h>

#include <cmath>

#include <tbb/task_arena.h>

#include "halfshade/emission.h"
#include "rasterizer/core/parallel.h"
#include "rasterizer/core/srgb_table.h"
#include "shadows/opaque_mesh.h"
#include "shadows/shaft.h"
#include "shadows/solver.h"
#include "support/lit_scene.h"
#include "support/simd_targets.h"

using namespace halfshade;
using halfshade::test::Random;
using halfshade::test::Triangle;

namespace {

/// Scene with materials, one opaque triangle list and any number of translucent ones.
struct GlassScene {
  Scene scene = test::scene_of({});

  std::uint32_t material(float opacity, const vec3& filter) {
    Material& m = scene.materials.emplace_back();
    m.opacity = opacity;
    m.transmittance = filter;
    return static_cast<std::uint32_t>(scene.materials.size() - 1);
  }
  void add(const std::vector<Triangle>& triangles, std::uint32_t material) {
    for (const Triangle& t : triangles) {
      const auto first = static_cast<std::uint32_t>(scene.positions.size());
      scene.positions.insert(scene.positions.end(), t.begin(), t.end());
      scene.triangles.push_back({first, first + 1, first + 2});
      scene.triangle_materials.push_back(material);
      scene.triangle_uvs.push_back({vec2(0.0f), vec2(1.0f, 0.0f), vec2(1.0f, 1.0f)});
    }
  }
  /// Square of half side `half` at height y, (u, v) from (0, 0) to (1, 1).
  void pane(double y, double half, std::uint32_t material, const dvec2& center = dvec2(0.0)) {
    const auto p = [&](double x, double z) { return dvec3(center.x + x * half, y, center.y + z * half); };
    add(test::quad(p(-1, -1), p(1, -1), p(1, 1), p(-1, 1)), material);
    scene.triangle_uvs.back() = {vec2(0.0f), vec2(1.0f), vec2(0.0f, 1.0f)};
  }
};

ColorMap stained_glass(std::uint32_t width, std::uint32_t height, std::uint64_t seed) {
  Random random(seed);
  ColorMap map{"stained", width, height, {}};
  for (std::uint32_t i = 0; i < width * height * 3; ++i) map.rgb.push_back(static_cast<std::uint8_t>(random.engine()));
  return map;
}

AlphaMap grey_holes(std::uint32_t width, std::uint32_t height, std::uint64_t seed) {
  Random random(seed);
  AlphaMap map{"holes", width, height, {}};
  for (std::uint32_t i = 0; i < width * height; ++i) {
    const std::uint64_t kind = random.engine() % 3;
    map.alpha.push_back(kind == 0 ? 0 : (kind == 1 ? 255 : static_cast<std::uint8_t>(random.engine())));
  }
  return map;
}

std::vector<Receiver> floor_receivers(int side, double reach, std::uint64_t seed) {
  Random random(seed);
  std::vector<Receiver> result;
  for (int i = 0; i < side * side; ++i) {
    const double x = random.uniform(-reach, reach);
    result.push_back({{x, 0.0, random.uniform(-reach, reach)}, kNone});
  }
  return result;
}

/// Panes of every kind over each other and over an opaque box; many share edges and corners with each other.
GlassScene mixed_scene() {
  GlassScene g;
  g.scene.color_maps = {stained_glass(8, 4, 1), stained_glass(5, 7, 2)};
  g.scene.alpha_maps = {grey_holes(4, 4, 3)};
  const std::uint32_t red = g.material(0.25f, {1.0f, 0.2f, 0.1f}), blue = g.material(0.0f, {0.1f, 0.3f, 0.9f});
  const std::uint32_t stained = g.material(0.0f, vec3(1.0f)), holed = g.material(0.5f, {0.0f, 1.0f, 0.5f}),
                      both = g.material(0.1f, {0.9f, 1.0f, 0.8f});
  g.scene.materials[stained].transmittance_map = 0;
  g.scene.materials[holed].alpha_map = 0;
  g.scene.materials[both].alpha_map = 0, g.scene.materials[both].transmittance_map = 1;
  g.pane(2.0, 1.0, red, {-0.5, 0.0}), g.pane(2.25, 0.75, blue), g.pane(1.5, 1.25, stained, {0.5, 0.25});
  g.pane(1.0, 1.0, holed, {0.0, -0.5}), g.pane(1.25, 0.5, both, {0.25, 0.25}), g.pane(2.5, 0.5, both, {-1.0, -1.0});
  g.add(test::box({-1.0, 0.5, -1.0}, {-0.5, 0.75, -0.5}), red);
  g.add(test::box({0.25, 0.25, 0.25}, {0.75, 0.75, 0.75}), 0);
  Random random(4);
  for (int i = 0; i < 60; ++i) {
    const dvec3 a = dvec3(0.0, 1.75, 0.0) + random.in_box(-1.5, 1.5), b = random.in_box(-0.4, 0.4);
    g.add({{a, a + b, a + random.in_box(-0.4, 0.4)}}, i % 2 == 0 ? stained : blue);
  }
  return g;
}

/// Receivers, masks and panes of a scene, one level below the public interface.
struct Prepared {
  LatticeMesh mesh;
  LightSamples samples;
  ReceiverArray receivers;
  VisibilityMasks masks;
  Panes panes;
  ShadowStats stats;

  Prepared(const Scene& scene, const std::vector<Receiver>& points, const Light& light, const ShadowConfig& config) {
    std::vector<dvec3> reach = light_extent(light);
    for (const Receiver& r : points) reach.push_back(r.position_world);
    mesh = make_lattice_mesh(scene, make_local_frame(scene.positions, reach));
    samples = make_light_samples(light, config, mesh.frame);
    for (std::uint32_t i = 0; i < points.size(); ++i) {
      receivers.push_back(mesh.frame.to_lattice(points[i].position_world), vec3(0, 1, 0), points[i].triangle, i,
                          static_cast<std::uint8_t>(receiver_set(i, config.seed, samples.sets)));
    }
    solve_masks(mesh, receivers, light, samples, config, masks, stats);
    panes = find_panes(mesh);
  }
  Prepared(const Prepared&) = delete;
};

std::vector<vec3> reaching(const Prepared& p, const Light& light, const ShadowConfig& config,
                           std::span<const vec3> weights = {}, std::size_t tile = kTransmittanceTile) {
  std::vector<vec3> result;
  ShadowStats stats;
  solve_transmittance(p.panes, p.receivers, light, p.samples, config, p.masks, weights, result, stats, tile);
  return result;
}

std::vector<vec3> reference(const Prepared& p, std::span<const vec3> weights = {}) {
  std::vector<vec3> result;
  for (std::size_t i = 0; i < p.receivers.size(); ++i) {
    result.push_back(reference_transmittance(p.panes, p.receivers, i, p.samples, p.masks.mask(i), weights));
  }
  return result;
}

std::vector<vec3> light_of(const Scene& scene, const std::vector<Receiver>& points, const Light& light,
                           const ShadowConfig& config, ShadowStats* stats = nullptr) {
  std::vector<vec3> result;
  solve_light(scene, points, light, config, result, stats);
  return result;
}

}  // namespace

TEST_CASE("an attenuation is the logarithm of its transmittance to half a unit, and turns back to it") {
  CHECK(attenuation_of(1.0) == 0);
  CHECK(attenuation_of(2.0) == 0);
  CHECK(attenuation_of(0.5) == 65536);
  CHECK(attenuation_of(0.0) == kNoLight);
  CHECK(attenuation_of(std::nan("")) == kNoLight);
  CHECK(transmittance_of(0) == std::uint64_t{1} << 32);
  CHECK(transmittance_of(65536) == std::uint64_t{1} << 31);
  CHECK(transmittance_of(kNoLight) == 0);
  CHECK(transmittance_of(add_attenuation(kNoLight, kNoLight)) == 0);
  Random random(21);
  for (int i = 0; i < 20000; ++i) {
    const double t = i % 2 == 0 ? random.uniform(0.0, 1.0) : std::exp2(random.uniform(-24.0, 0.0));
    const Attenuation a = attenuation_of(t);
    if (t < 0x1p-24) continue;
    REQUIRE(std::fabs(static_cast<double>(a) * kAttenuationUnit + std::log2(t)) <= 0.5001 * kAttenuationUnit);
    const double back = static_cast<double>(transmittance_of(a)) * 0x1p-32;
    REQUIRE(std::fabs(back - std::exp2(-static_cast<double>(a) * kAttenuationUnit)) <= 0x1p-33 * 1.0001);
  }
}

TEST_CASE("three overlapping panes multiply, within the stated bound") {
  GlassScene g;
  const vec3 filters[3] = {{0.9f, 0.4f, 0.3f}, {0.7f, 0.8f, 0.05f}, {0.35f, 0.6f, 1.0f}};
  const float opacities[3] = {0.1f, 0.0f, 0.4f};
  for (int k = 0; k < 3; ++k) g.pane(1.0 + 0.5 * k, 8.0, g.material(opacities[k], filters[k]));
  const auto light = light_of(g.scene, test::receivers_at({{0.1, 0, 0.2}}), test::frame_light(), test::frame_config());
  for (int c = 0; c < 3; ++c) {
    double product = 1.0;
    for (int k = 0; k < 3; ++k) product *= (1.0 - double{opacities[k]}) * double{filters[k][c]};
    CHECK(std::fabs(double{light[0][c]} - product) <= product * 3 * 5.3e-6 + 6e-8);
  }
}

TEST_CASE("twenty panes stay within the bound of twenty factors, and darkness absorbs") {
  GlassScene g;
  const std::uint32_t tinted = g.material(0.0f, {0.93f, 0.6f, 1e-9f});
  for (int k = 0; k < 20; ++k) g.pane(1.0 + 0.125 * k, 8.0, tinted);
  const auto light = light_of(g.scene, test::receivers_at({{0.1, 0, 0.2}}), test::frame_light(), test::frame_config());
  for (int c = 0; c < 2; ++c) {
    const double product = std::pow(double{vec3(0.93f, 0.6f, 0.0f)[c]}, 20);
    CHECK(std::fabs(double{light[0][c]} - product) <= product * 20 * 5.3e-6 + 6e-8);
  }
  CHECK(light[0].z == 0.0f);
}

TEST_CASE("translucent triangles block no sample, and all exact methods agree on the rest") {
  const GlassScene g = mixed_scene();
  Scene opaque_only = g.scene;
  const LatticeMesh mesh = make_lattice_mesh(opaque_only, make_local_frame(opaque_only.positions, {}));
  CHECK(count_translucent(mesh) == g.scene.triangles.size() - 12);
  std::vector<std::array<std::uint32_t, 3>> kept;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    if (!mesh.translucent(t)) kept.push_back(mesh.triangles[t]);
  }
  opaque_only.triangles = kept;
  opaque_only.triangle_materials.assign(kept.size(), 0);
  opaque_only.triangle_uvs.resize(kept.size());
  const std::vector<Receiver> points = floor_receivers(12, 2.0, 5);
  const VisibilityMasks truth =
      test::solve(opaque_only, points, test::frame_light(), test::frame_config(), ShadowMethod::kOracle);
  CHECK(truth.blocked_count(0) + truth.blocked_count(1) < 2 * truth.sample_count);
  std::vector<ShadowMethod> methods = test::exact_methods();
  methods.push_back(ShadowMethod::kOracle);
  for (const ShadowMethod method : methods) {
    CAPTURE(traits_of(method).name);
    ShadowStats stats;
    const VisibilityMasks masks =
        test::solve(g.scene, points, test::frame_light(), test::frame_config(), method, &stats);
    CHECK(test::wrong_bits(truth, masks) == 0);
    CHECK(stats.detail("translucent_triangles").value() == static_cast<double>(g.scene.triangles.size() - 12));
  }
}

TEST_CASE("light through panes equals brute force in every bit, on every instruction set") {
  const GlassScene g = mixed_scene();
  const Light light = test::frame_light();
  ShadowConfig config = test::frame_config();
  config.pattern = SamplePattern::kStratified;
  config.sample_sets = 3;
  const Prepared p(g.scene, floor_receivers(14, 2.0, 6), light, config);
  const std::vector<vec3> truth = reference(p);
  int colored = 0;
  for (const vec3& rgb : truth) colored += rgb.x != rgb.y && rgb.y > 0.0f && rgb.y < 1.0f;
  CHECK(colored > 100);
  test::for_each_simd_target([&](const std::string& target) {
    CAPTURE(target);
    CHECK(reaching(p, light, config) == truth);
  });
}

TEST_CASE("light through panes equals brute force for every shape of light and number of samples") {
  const GlassScene g = mixed_scene();
  Light sphere = test::frame_light();
  sphere.shape = LightShape::kSphere, sphere.center = {0.0, 3.0, 0.5}, sphere.radius = 0.75;
  Light cloud = test::frame_light();
  cloud.shape = LightShape::kSamples;
  Random random(7);
  for (int i = 0; i < 65; ++i) cloud.points.push_back(dvec3(0.0, 2.0, 0.0) + random.in_box(-1.5, 1.5));
  Light point = test::frame_light();
  point.shape = LightShape::kPoint;
  Light inside = test::frame_light();  // among the panes
  inside.center = {0.0, 1.75, 0.0}, inside.two_sided = true;
  for (const Light& light : {sphere, cloud, point, inside}) {
    for (const std::uint32_t count : {1u, 63u, 1025u}) {
      CAPTURE(count);
      const ShadowConfig config = [&] {
        ShadowConfig c = test::frame_config(count);
        c.pattern = SamplePattern::kLowDiscrepancy;
        return c;
      }();
      std::vector<Receiver> points = floor_receivers(5, 2.0, 8);
      for (int i = 0; i < 10; ++i) points.push_back({dvec3(0.0, 1.75, 0.0) + random.in_box(-1.0, 1.0), kNone});
      const Prepared p(g.scene, points, light, config);
      CHECK(reaching(p, light, config) == reference(p));
    }
  }
}

TEST_CASE("order of triangles, threads and tiles change no bit of the light") {
  const GlassScene g = mixed_scene();
  const Light light = test::frame_light();
  const ShadowConfig config = test::frame_config();
  const std::vector<Receiver> points = floor_receivers(16, 2.0, 9);
  const Prepared p(g.scene, points, light, config);
  const std::vector<vec3> truth = reaching(p, light, config);
  for (const std::size_t tile : {1, 5, 63}) CHECK(reaching(p, light, config, {}, tile) == truth);
  for (const int threads : {1, 3}) {
    tbb::task_arena arena(threads);
    arena.execute([&] { CHECK(reaching(p, light, config) == truth); });
  }
  Scene shuffled = g.scene;
  Random random(10);
  for (std::size_t i = shuffled.triangles.size(); i > 1; --i) {
    const std::size_t k = random.engine() % i;
    std::swap(shuffled.triangles[i - 1], shuffled.triangles[k]);
    std::swap(shuffled.triangle_materials[i - 1], shuffled.triangle_materials[k]);
    std::swap(shuffled.triangle_uvs[i - 1], shuffled.triangle_uvs[k]);
  }
  CHECK(light_of(shuffled, points, light, config) == light_of(g.scene, points, light, config));
}

TEST_CASE("S04 a segment through the edge of two panes, or a vertex of many, is dimmed once") {
  // Receivers and the samples of the light lie on a grid of sixteenths, and so do the panes' corners half-way between:
  // a good part of all segments meets the outlines exactly.
  GlassScene g;
  const std::uint32_t half = g.material(0.5f, vec3(1.0f));
  for (int x = -64; x < 64; ++x) {
    for (int z = -64; z < 64; ++z) {
      const auto p = [&](int i, int k) { return dvec3((x + i) / 16.0, 2.0, (z + k) / 16.0); };
      g.add(test::quad(p(0, 0), p(1, 0), p(1, 1), p(0, 1)), half);
    }
  }
  std::vector<dvec3> points;
  for (int i = -8; i <= 8; ++i) {
    for (int k = -8; k <= 8; ++k) points.emplace_back(i / 16.0, 0.0, k / 16.0);
  }
  ShadowStats stats;
  const auto light = light_of(g.scene, test::receivers_at(points), test::frame_light(), test::frame_config(), &stats);
  for (const vec3& rgb : light) CHECK(rgb == vec3(0.5f));
  CHECK(stats.detail("transmittance.crossings").value() == 256.0 * static_cast<double>(points.size()));
  CHECK(stats.detail("transmittance.exact_fallbacks").value() > 1000.0);
}

TEST_CASE("a closed body is crossed twice, and sheets written with both sides once") {
  GlassScene g;
  const std::uint32_t half = g.material(0.5f, vec3(1.0f));
  g.add(test::box({-4.0, 1.0, -4.0}, {4.0, 2.0, 4.0}), half);
  const auto points = test::receivers_at({{0, 0, 0}, {0.25, 0, 0.5}});
  for (const vec3& rgb : light_of(g.scene, points, test::frame_light(), test::frame_config())) {
    CHECK(rgb == vec3(0.25f));
  }
  GlassScene sheet;
  const std::uint32_t pane = sheet.material(0.5f, vec3(1.0f));
  sheet.pane(2.0, 4.0, pane);
  const std::size_t once = sheet.scene.triangles.size();
  for (std::size_t t = 0; t < once; ++t) {
    const auto triangle = sheet.scene.triangles[t];
    const auto uvs = sheet.scene.triangle_uvs[t];
    sheet.scene.triangles.push_back({triangle[2], triangle[1], triangle[0]});
    sheet.scene.triangle_uvs.push_back({uvs[2], uvs[1], uvs[0]});
    sheet.scene.triangle_materials.push_back(pane);
  }
  ShadowStats stats;
  for (const vec3& rgb : light_of(sheet.scene, points, test::frame_light(), test::frame_config(), &stats)) {
    CHECK(rgb == vec3(0.5f));
  }
  CHECK(stats.detail("transmittance.repeated_triangles").value() == 2.0);
}

TEST_CASE("the receiver's own pane does not dim it, under either of its numbers") {
  GlassScene g;
  const std::uint32_t half = g.material(0.5f, vec3(1.0f));
  const std::vector<Triangle> pane = {{dvec3(-4, 1, -4), dvec3(4, 1, -4), dvec3(0, 1, 8)}};
  g.add(pane, half), g.add(pane, half);
  for (const std::uint32_t own : {0u, 1u, kNone}) {
    const std::vector<Receiver> points = {{{0.1, 0.9999, 0.2}, own}};
    const auto light = light_of(g.scene, points, test::frame_light(), test::frame_config());
    CHECK(light[0] == vec3(own == kNone ? 0.5f : 1.0f));
  }
}

TEST_CASE("a textured pane throws its picture") {
  // The light is a point: a receiver at (x, z) sees it through the pane half-way up at (x / 2, z / 2).
  GlassScene g;
  g.scene.color_maps = {stained_glass(4, 4, 11)};
  g.scene.alpha_maps = {grey_holes(2, 2, 12)};
  const std::uint32_t stained = g.material(0.25f, {1.0f, 0.5f, 1.0f});
  g.scene.materials[stained].transmittance_map = 0;
  g.scene.materials[stained].alpha_map = 0;
  g.pane(2.0, 1.0, stained);
  Light light = test::frame_light();
  light.shape = LightShape::kPoint;
  for (int x = 0; x < 4; ++x) {
    for (int z = 0; z < 4; ++z) {
      const dvec2 uv((x + 0.4) / 4.0, (z + 0.3) / 4.0);
      const auto points = test::receivers_at({{(2.0 * uv.x - 1.0) * 2.0, 0.0, (2.0 * uv.y - 1.0) * 2.0}});
      const vec3 rgb = light_of(g.scene, points, light, test::frame_config())[0];
      const int row = 3 - z;
      const double a = g.scene.alpha_maps[0].alpha[static_cast<std::size_t>(row / 2 * 2 + x / 2)] / 255.0;
      for (int c = 0; c < 3; ++c) {
        const double m =
            double{kLinearFromSrgb[g.scene.color_maps[0].rgb[static_cast<std::size_t>((row * 4 + x) * 3 + c)]]};
        const double expected = 1.0 - a + a * 0.75 * (c == 1 ? 0.5 : 1.0) * m;
        CHECK(std::fabs(double{rgb[c]} - expected) <= expected * 5.3e-6 + 6e-8 + 0x1p-24);
      }
    }
  }
}

TEST_CASE("an emission image weighs the samples that the panes dim") {
  const GlassScene g = mixed_scene();
  Light light = test::frame_light();
  light.emission_image = {"halves", 2, 1, {vec3(2.0f, 0.5f, 0.0f), vec3(0.0f, 0.25f, 1.0f)}};
  const ShadowConfig config = test::frame_config();
  const std::vector<Receiver> points = floor_receivers(8, 2.0, 13);
  const Prepared p(g.scene, points, light, config);
  const std::vector<vec3> weights = sample_emission(light.emission_image, p.samples);
  CHECK(reaching(p, light, config, weights) == reference(p, weights));
  CHECK(light_of(g.scene, points, light, config) == reference(p, weights));
  // Without panes it is the visible emission of the masks.
  GlassScene opaque;
  opaque.add(test::box({-1.0, 0.5, -1.0}, {0.0, 1.0, 0.0}), 0);
  const Prepared q(opaque.scene, points, light, config);
  const std::vector<vec3> through_nothing = reaching(q, light, config, weights);
  for (std::size_t i = 0; i < points.size(); ++i) {
    CHECK(through_nothing[i] == weighted_visibility(q.masks.mask(i), weights));
  }
}

TEST_CASE("without panes the light is the visibility, for receivers on both sides of a one-sided light") {
  GlassScene g;
  g.add(test::box({-1.0, 0.5, -1.0}, {0.0, 1.0, 0.0}), 0);
  std::vector<Receiver> points = floor_receivers(8, 2.0, 14);
  points.push_back({{0, 5, 0}, kNone});
  ShadowStats stats;
  const auto light = light_of(g.scene, points, test::frame_light(), test::frame_config(), &stats);
  const VisibilityMasks masks =
      test::solve(g.scene, points, test::frame_light(), test::frame_config(), ShadowMethod::kExact);
  for (std::size_t i = 0; i < points.size(); ++i) CHECK(light[i] == vec3(masks.visibility(i)));
  CHECK(light.back() == vec3(0.0f));
  CHECK(stats.detail("translucent_triangles") == std::nullopt);
}

TEST_CASE("methods without masks say how many translucent triangles they approximate, and are right without overlap") {
  GlassScene g;
  const std::uint32_t red = g.material(0.0f, {1.0f, 0.25f, 0.5f});
  g.pane(2.0, 8.0, red);
  const auto points = test::receivers_at({{0, 0, 0}, {0.5, 0, 0.25}});
  for (const MethodTraits& method : shadow_methods()) {
    if (method.masks) continue;
    CAPTURE(method.name);
    ShadowConfig config = test::frame_config();
    config.method = method.method;
    ShadowStats stats;
    for (const vec3& rgb : light_of(g.scene, points, test::frame_light(), config, &stats)) {
      CHECK(rgb.x == 1.0f);
      CHECK(std::fabs(rgb.y - 0.25f) < 1e-5f);
    }
    CHECK(stats.detail("translucent_triangles").value() == 2.0);
    CHECK(stats.detail("translucent_triangles_approximated").value() == 2.0);
  }
}

TEST_CASE("the oracle's light is brute force, and a material that passes nothing is opaque") {
  GlassScene g = mixed_scene();
  const std::vector<Receiver> points = floor_receivers(6, 2.0, 15);
  ShadowConfig config = test::frame_config();
  const auto fast = light_of(g.scene, points, test::frame_light(), config);
  config.method = ShadowMethod::kOracle;
  CHECK(light_of(g.scene, points, test::frame_light(), config) == fast);
  Material black;
  black.opacity = 0.5f, black.transmittance = vec3(0.0f);
  CHECK_FALSE(black.translucent());
}

TEST_CASE("solve_light can be cancelled, and works on a scene with no triangles") {
  const GlassScene g = mixed_scene();
  ShadowConfig config = test::frame_config();
  std::vector<vec3> light;
  int calls = 0;
  config.progress = [&](double) { return ++calls < 2; };
  CHECK_THROWS_AS(solve_light(g.scene, floor_receivers(40, 2.0, 16), test::frame_light(), config, light), Error);
  CHECK(light.empty());
  CHECK(light_of(test::scene_of({}), test::receivers_at({{0, 0, 0}}), test::frame_light(), test::frame_config())[0] ==
        vec3(1.0f));
}

TEST_CASE("a shaft keeps every box that a segment between its ends meets, and loses most others") {
  Random random(17);
  int kept = 0, beside = 0;
  for (int i = 0; i < 20000; ++i) {
    const auto box_at = [&](double reach, double size) {
      Box box;
      const dvec3 center = random.in_box(-reach, reach);
      for (int k = 0; k < 2; ++k) box.add(vec3(center + random.in_box(-size, size)));
      return box;
    };
    const auto point_in = [&](const Box& box) {
      const dvec3 t = random.in_box(0.0, 1.0);
      return dvec3(box.low) + t * dvec3(box.high - box.low);
    };
    const Box a = box_at(1.0, 0.2), b = box_at(1.0, 0.4);
    const Shaft shaft(a, b);
    const dvec3 between = glm::mix(point_in(a), point_in(b), random.uniform(0.0, 1.0));
    Box met;
    met.add(vec3(between)), met.add(vec3(between + random.in_box(-0.1, 0.1)));
    REQUIRE(shaft.may_meet(met));
    const Box any = box_at(1.0, 0.05);
    (shaft.may_meet(any) ? kept : beside) += 1;
  }
  CHECK(kept < beside);
}
