// Named stability cases about perforated triangles finer than the samples, and about counting what lies in between.
#include <doctest/doctest.h>

#include "halfshade/depth_complexity.h"
#include "stability/cases.h"

using namespace halfshade;
using namespace halfshade::test;

TEST_CASE("S04 split_quad: a segment through the edge that two quads share counts one surface") {
  const auto halves = joined(half_plane(), quad({0, 2, -64}, {64, 2, -64}, {64, 2, 64}, {0, 2, 64}));
  std::vector<dvec3> points;
  for (int i = -64; i <= 64; ++i) points.push_back({i / 64.0, 0.0, (i % 16) / 16.0});
  const DepthComplexity depth = depth_of(scene_of(halves), points, 256);
  for (const std::uint32_t count : depth.counts) REQUIRE(count == 1);
  for (std::size_t i = 0; i < points.size(); ++i) CHECK(depth.visibility(i) == 0.0f);
  ShadowConfig config = frame_config(256);
  config.stsv.opaque = OpaqueBlockers::kVolumes;
  CHECK(wrong_bits_of_exact_methods(scene_of(halves), receivers_at(points), frame_light(), config) == 0);
}

TEST_CASE("S28 wedge_overlap: two quads that hide the same half of the light leave the other half") {
  // Both hide the samples with x < 0 from the origin.
  const auto quads = cases::double_cover();
  const DepthComplexity depth = depth_of(scene_of(quads), {{0, 0, 0}}, 256);
  CHECK(depth.visibility(0) == 0.5f);
  std::uint32_t sum = 0;
  for (const std::uint32_t count : depth.counts) sum += count;
  CHECK(sum == 2 * 128);
  // What adding up the shares that each quad hides would give, as penumbra wedges do: dark, wrong by one half.
  const double added = std::max(0.0, 1.0 - sum / 256.0);
  CHECK(depth.visibility(0) - added == doctest::Approx(0.5).epsilon(1.0 / 16.0));
  CHECK(wrong_bits_of_exact_methods(scene_of(quads), receivers_at({{0, 0, 0}}), frame_light(), frame_config()) == 0);
}

namespace {

double amplitude(const std::vector<float>& v) {
  return double{*std::max_element(v.begin(), v.end())} - double{*std::min_element(v.begin(), v.end())};
}

std::vector<float> visibility_of(const Scene& scene, const std::vector<dvec3>& points, const ShadowConfig& config) {
  ShadowConfig c = config;
  c.method = ShadowMethod::kSoftTexturedShadowVolumes;
  std::vector<float> visibility;
  solve_visibility(scene, receivers_at(points), frame_light(), c, visibility);
  return visibility;
}

}  // namespace

TEST_CASE("S21 fence_minify: bars finer than the samples: nearest is the oracle's, filtered does not flicker") {
  const Scene scene = bars();
  const std::vector<dvec3> points = bar_receivers();
  ShadowConfig config = frame_config(256);
  CHECK(wrong_bits_of_exact_methods(scene, receivers_at(points), frame_light(), config) == 0);
  const double nearest = amplitude(visibility_of(scene, points, config));
  CHECK(nearest > 0.3);  // so the case is one
  config.stsv.filter = OpacityFilter::kFiltered;
  const std::vector<float> filtered = visibility_of(scene, points, config);
  CHECK(amplitude(filtered) <= 0.10);
  for (const float v : filtered) CHECK(v == doctest::Approx(0.5).epsilon(0.1));
}
