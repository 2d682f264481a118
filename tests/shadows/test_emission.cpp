#include <doctest/doctest.h>

#include "halfshade/emission.h"
#include "rasterizer/rasterizer.h"
#include "rasterizer/scenes/builtin.h"
#include "rasterizer/shading.h"
#include "shadows/sample_patterns.h"
#include "shadows/solver.h"
#include "support/lit_scene.h"

using namespace halfshade;
using namespace halfshade::test;

namespace {

EmissionImage random_image(std::uint32_t width, std::uint32_t height, std::uint64_t seed) {
  Random random(seed);
  EmissionImage image{"random", width, height, {}};
  for (std::uint32_t i = 0; i < width * height; ++i) image.rgb.emplace_back(random.in_box(0.0, 3.0));
  return image;
}

dvec3 sum_of(const std::vector<vec3>& values) {
  dvec3 sum(0.0);
  for (const vec3& v : values) sum += dvec3(v);
  return sum;
}

bool near(const dvec3& a, const dvec3& b, double tolerance = 1e-6) {
  return glm::length(a - b) <= tolerance * (1.0 + glm::length(b));
}

}  // namespace

TEST_CASE("uniform samples of an image with one texel each have that texel's colour, row 0 at t = 1") {
  const EmissionImage image = random_image(16, 16, 1);
  const std::vector<vec3> weights = sample_emission(image, unit_square_samples(SamplePattern::kUniform, 256, 0, 1, 0));
  for (std::uint32_t i = 0; i < 256; ++i) {
    const std::uint32_t row = 15 - i / 16;
    CHECK(near(dvec3(weights[i]) * 256.0, dvec3(image.rgb[row * 16 + i % 16])));
  }
}

TEST_CASE("weights of a square number of uniform samples add up to the mean of any image") {
  for (const std::uint32_t width : {1u, 3u, 100u}) {
    const EmissionImage image = random_image(width, 37, width);
    const dvec3 mean = sum_of(image.rgb) / static_cast<double>(image.rgb.size());
    for (const std::uint32_t count : {1u, 4u, 64u, 1024u}) {
      const auto st = unit_square_samples(SamplePattern::kUniform, count, 0, 1, 0);
      CHECK(near(sum_of(sample_emission(image, st)), mean));
    }
  }
}

TEST_CASE("a constant image weighs visibility with its colour, for every pattern") {
  const EmissionImage image{"", 1, 1, {vec3(0.5f, 2.0f, 0.0f)}};
  VisibilityMasks masks;
  masks.reset(1, 100);
  masks.words = {0x0123456789abcdefu, 0xfu};
  for (const SamplePattern pattern : {SamplePattern::kRows, SamplePattern::kUniform, SamplePattern::kStratified,
                                      SamplePattern::kLowDiscrepancy, SamplePattern::kPoissonDisk}) {
    const std::vector<vec3> weights = sample_emission(image, unit_square_samples(pattern, 100, 0, 1, 3));
    CHECK(near(dvec3(weighted_visibility(masks.mask(0), weights)), dvec3(image.rgb[0] * masks.visibility(0))));
  }
}

TEST_CASE("emission of a light is that of its samples, set by set; only rectangles with an image have it") {
  Light light = frame_light();
  light.emission_image = random_image(9, 5, 2);
  ShadowConfig config = frame_config(60);
  config.sample_sets = 3;
  const std::vector<vec3> weights = sample_emission(light, config);
  REQUIRE(weights.size() == 180);
  const auto st = unit_square_samples(config.pattern, 60, 2, 1, 0);
  const std::vector<vec3> last = sample_emission(light.emission_image, st);
  CHECK(std::equal(last.begin(), last.end(), weights.begin() + 120));
  light.emission_image = {};
  CHECK_THROWS_AS(sample_emission(light, config), Error);
  light.shape = LightShape::kSphere;
  CHECK_THROWS_AS(sample_emission(light, config), Error);
}

TEST_CASE("images with too few texels or wrong ones are refused, and samples outside of them") {
  Light light = frame_light();
  const std::vector<dvec2> st = {dvec2(0.5)};
  const auto refused = [&](const EmissionImage& image, const char* what) {
    light.emission_image = image;
    CHECK_THROWS_WITH_AS(sample_emission(image, st), what, Error);
    CHECK_THROWS_WITH_AS(sample_emission(light, frame_config(16)), what, Error);
  };
  refused({"", 4000, 4000, {vec3(1.0f)}}, "emission: the image has 1 texels for 4000 x 4000");
  refused({"", 0, 0, {vec3(1.0f)}}, "emission: the image has 1 texels for 0 x 0");
  refused({"", 1, 2, {vec3(1.0f), vec3(0, -1, 0)}}, "emission: texel 1 of the image is negative or not finite");
  refused({"", 1, 1, {vec3(std::nanf(""))}}, "emission: texel 0 of the image is negative or not finite");
  const EmissionImage image = random_image(3, 3, 4);
  for (const dvec2& p : {dvec2(-3.0, 0.5), dvec2(0.5, 1.1), dvec2(std::nan(""), 0.5)}) {
    CHECK_THROWS_WITH_AS(sample_emission(image, std::span(&p, 1)), "emission: sample 0 is not within 0..1", Error);
  }
}

TEST_CASE("stored masks relit with the original image give the original render, and an image changes no mask bit") {
  const BuiltinScene scene = make_builtin_scene("columns", 0);
  View view = scene.view;
  view.lights.resize(1);
  Light& light = view.lights[0];
  REQUIRE(light.shape == LightShape::kRectangle);
  const LatticeMesh mesh = make_lattice_mesh(scene.scene, make_local_frame(scene.scene.positions, light_extent(light)));
  GBuffer gbuffer;
  RasterConfig raster;
  raster.width = raster.height = 48;
  raster.window = {0, 48, 0, 48};
  rasterize(mesh, view.camera, raster, gbuffer);
  ShadowConfig config;
  config.light_sample_count = 144;
  config.sample_sets = 3;
  const auto solve_with = [&](VisibilityMasks& masks) {
    const LightSamples samples = make_light_samples(light, config, mesh.frame);
    const ReceiverArray receivers = make_receivers(gbuffer, samples, 0);
    ShadowStats stats;
    solve_masks(mesh, receivers, light, samples, config, masks, stats);
    return std::pair(samples, receivers);
  };
  VisibilityMasks plain, masks;
  solve_with(plain);
  light.emission_image = random_image(40, 30, 4);
  const auto [samples, receivers] = solve_with(masks);
  CHECK(plain.hash() == masks.hash());

  const std::vector<vec3> weights = sample_emission(light.emission_image, samples);
  std::vector<std::vector<vec3>> visible(1, std::vector<vec3>(gbuffer.size(), vec3(0.0f)));
  std::vector<std::vector<float>> none(1, std::vector<float>(gbuffer.size(), 0.0f));
  const std::vector<vec3> rest = shade(gbuffer, mesh.frame, view, none),
                          response = light_response(gbuffer, mesh.frame, light);
  std::vector<vec3> relit = rest;
  for (std::size_t i = 0; i < receivers.size(); ++i) {
    const std::uint32_t entry = receivers.sample[i];
    const auto own = std::span(weights).subspan(receivers.set[i] * std::size_t{144}, 144);
    visible[0][entry] = weighted_visibility(masks.mask(i), own);
    relit[entry] += response[entry] * visible[0][entry];
  }
  const std::vector<vec3> original = shade(gbuffer, mesh.frame, view, none, {}, visible);
  double worst = 0.0, gain = 0.0;
  for (std::size_t i = 0; i < relit.size(); ++i) {
    worst = std::max(worst, glm::length(dvec3(relit[i]) - dvec3(original[i])));
    gain = std::max(gain, glm::length(dvec3(relit[i]) - dvec3(rest[i])));
  }
  CHECK(worst < 1e-6);
  CHECK(gain > 0.1);
}
