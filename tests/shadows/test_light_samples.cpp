#include <doctest/doctest.h>

#include <set>

#include "shadows/light_samples.h"
#include "support/lit_scene.h"

using namespace halfshade;
using namespace halfshade::test;

namespace {

LocalFrame unit_frame() { return make_local_frame(std::vector<dvec3>{{-8, -8, -8}, {8, 8, 8}}, {}); }

LightSamples samples_of(const Light& light, std::uint32_t count, SamplePattern pattern, std::uint32_t sets = 1) {
  ShadowConfig config = frame_config(count);
  config.pattern = pattern;
  config.sample_sets = sets;
  return make_light_samples(light, config, unit_frame());
}

}  // namespace

TEST_CASE("every pattern gives the asked number of different samples inside the unit square, for any number") {
  for (const SamplePattern pattern : {SamplePattern::kRows, SamplePattern::kUniform, SamplePattern::kStratified}) {
    for (std::uint32_t count = 1; count <= 300; ++count) {
      std::set<std::pair<double, double>> seen;
      for (std::uint32_t i = 0; i < count; ++i) {
        const dvec2 st = unit_square_sample(pattern, i, count, 0, 7);
        REQUIRE(st.x >= 0.0);
        REQUIRE(st.x < 1.0);
        REQUIRE(st.y >= 0.0);
        REQUIRE(st.y < 1.0);
        seen.emplace(st.x, st.y);
      }
      REQUIRE(seen.size() == count);
    }
  }
}

TEST_CASE("uniform samples of a square number are the cell centres") {
  for (std::uint32_t i = 0; i < 256; ++i) {
    const dvec2 st = unit_square_sample(SamplePattern::kUniform, i, 256, 0, 0);
    CHECK(st == dvec2((i % 16 + 0.5) / 16, (i / 16 + 0.5) / 16));
  }
}

TEST_CASE("samples of rows share their height, and rows are shifted against each other") {
  std::set<double> shifts;
  for (std::uint32_t row = 0; row < 16; ++row) {
    const dvec2 first = unit_square_sample(SamplePattern::kRows, row * 16, 256, 0, 0);
    shifts.insert(first.x * 16);
    for (std::uint32_t i = 1; i < 16; ++i) {
      const dvec2 st = unit_square_sample(SamplePattern::kRows, row * 16 + i, 256, 0, 0);
      CHECK(st.y == first.y);
      CHECK(st.x - first.x == doctest::Approx(i / 16.0));
    }
  }
  CHECK(shifts.size() == 16);
}

TEST_CASE("every cell of a stratified pattern holds its sample, and the mean lies in the middle") {
  dvec2 sum(0.0);
  for (std::uint32_t i = 0; i < 4096; ++i) {
    const dvec2 st = unit_square_sample(SamplePattern::kStratified, i, 4096, 0, 3);
    CHECK(static_cast<std::uint32_t>(st.x * 64) == i % 64);
    CHECK(static_cast<std::uint32_t>(st.y * 64) == i / 64);
    sum += st;
  }
  CHECK(sum.x / 4096 == doctest::Approx(0.5).epsilon(0.01));
  CHECK(sum.y / 4096 == doctest::Approx(0.5).epsilon(0.01));
}

TEST_CASE("samples lie on their light: rectangle, disk, sphere; sets differ") {
  Light light = frame_light();
  const LightSamples rectangle = samples_of(light, 100, SamplePattern::kRows, 4);
  CHECK(rectangle.points.size() == 400);
  CHECK(
      std::set<float>{rectangle.points[0].x, rectangle.points[100].x, rectangle.points[200].x, rectangle.points[300].x}
          .size() == 4);
  for (const vec3& p : rectangle.points) {
    CHECK(p.y == 0.5f);
    CHECK(std::fabs(p.x) <= 0.125f);
  }
  CHECK(rectangle.flat);
  CHECK(rectangle.axis_n.y == -1.0);
  light.radius = 1.0;
  light.shape = LightShape::kDisk;
  light.normal = {0, -1, 0};
  for (const vec3& p : samples_of(light, 500, SamplePattern::kStratified).points) {
    CHECK(std::fabs(p.y - 0.5f) < 1e-6f);
    CHECK(glm::length(vec3(p.x, 0, p.z)) <= 0.125f * 1.000001f);
  }
  light.shape = LightShape::kSphere;
  for (const vec3& p : samples_of(light, 500, SamplePattern::kStratified).points) {
    CHECK(glm::length(p - vec3(0, 0.5f, 0)) == doctest::Approx(0.125).epsilon(1e-5));
  }
}

TEST_CASE("degenerate lights are described, wrong ones refused with the light's name") {
  Light light = frame_light();
  light.u = dvec3(0.0);
  CHECK_FALSE(samples_of(light, 16, SamplePattern::kRows).flat);
  light.center.x = NAN;
  light.name = "lamp";
  CHECK_THROWS_WITH_AS(samples_of(light, 16, SamplePattern::kRows), doctest::Contains("lamp"), Error);
  light = frame_light();
  light.shape = LightShape::kSamples;
  CHECK_THROWS_AS(samples_of(light, 16, SamplePattern::kRows), Error);
}
