#include <doctest/doctest.h>

#include <algorithm>
#include <set>

#include "shadows/light_samples.h"
#include "shadows/receivers.h"
#include "shadows/sample_patterns.h"
#include "support/lit_scene.h"

using namespace halfshade;
using namespace halfshade::test;

namespace {

constexpr SamplePattern kPatterns[] = {SamplePattern::kRows, SamplePattern::kUniform, SamplePattern::kStratified,
                                       SamplePattern::kLowDiscrepancy, SamplePattern::kPoissonDisk};

LocalFrame unit_frame() { return make_local_frame(std::vector<dvec3>{{-8, -8, -8}, {8, 8, 8}}, {}); }

LightSamples samples_of(const Light& light, std::uint32_t count, SamplePattern pattern, std::uint32_t sets = 1) {
  ShadowConfig config = frame_config(count);
  config.pattern = pattern;
  config.sample_sets = sets;
  return make_light_samples(light, config, unit_frame());
}

double torus_distance(const dvec2& p, const dvec2& q) {
  const dvec2 d = glm::abs(p - q);
  return glm::length(glm::min(d, 1.0 - d));
}

Light polygon_light(const std::vector<dvec3>& points) {
  Light light = frame_light();
  light.shape = LightShape::kPolygon;
  light.name = "pane";
  light.points = points;
  return light;
}

}  // namespace

TEST_CASE("every pattern gives the asked number of different samples inside the unit square, for any number") {
  for (const SamplePattern pattern : kPatterns) {
    for (std::uint32_t count = 1; count <= 300; ++count) {
      const std::vector<dvec2> points = unit_square_samples(pattern, count, 0, 1, 7);
      std::set<std::pair<double, double>> seen;
      for (std::uint32_t i = 0; i < count; ++i) {
        const dvec2 st = points[i];
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
  const std::vector<dvec2> points = unit_square_samples(SamplePattern::kUniform, 256, 0, 1, 0);
  for (std::uint32_t i = 0; i < 256; ++i) {
    const dvec2 st = points[i];
    CHECK(st == dvec2((i % 16 + 0.5) / 16, (i / 16 + 0.5) / 16));
  }
}

TEST_CASE("samples of rows share their height, and rows are shifted against each other") {
  const std::vector<dvec2> points = unit_square_samples(SamplePattern::kRows, 256, 0, 1, 0);
  std::set<double> shifts;
  for (std::uint32_t row = 0; row < 16; ++row) {
    const dvec2 first = points[row * 16];
    shifts.insert(first.x * 16);
    for (std::uint32_t i = 1; i < 16; ++i) {
      const dvec2 st = points[row * 16 + i];
      CHECK(st.y == first.y);
      CHECK(st.x - first.x == doctest::Approx(i / 16.0));
    }
  }
  CHECK(shifts.size() == 16);
}

TEST_CASE("every cell of a stratified pattern holds its sample, and the mean lies in the middle") {
  const std::vector<dvec2> points = unit_square_samples(SamplePattern::kStratified, 4096, 0, 1, 3);
  dvec2 sum(0.0);
  for (std::uint32_t i = 0; i < 4096; ++i) {
    const dvec2 st = points[i];
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

TEST_CASE("rows of a disk: the asked number of different points in it, at one pitch, spread evenly") {
  std::vector<std::uint32_t> counts = {512, 1000, 1024, 2048, 3217, 4096};
  for (std::uint32_t count = 1; count <= 300; ++count) counts.push_back(count);
  for (const std::uint32_t count : counts) {
    CAPTURE(count);
    std::vector<dvec2> points(count);
    disk_rows(points);
    double pitch = 0.0;
    std::set<double> heights;
    dvec2 sum(0.0);
    for (std::uint32_t i = 0; i < count; ++i) {
      REQUIRE(glm::length(points[i] - 0.5) < 0.5);
      heights.insert(points[i].y), sum += points[i] - 0.5;
      if (i == 0) continue;
      REQUIRE(points[i].y >= points[i - 1].y);
      if (points[i].y != points[i - 1].y) continue;
      const double step = points[i].x - points[i - 1].x;
      REQUIRE(step > 0.0);
      if (pitch == 0.0) pitch = step;
      REQUIRE(step == doctest::Approx(pitch).epsilon(1e-9));
    }
    REQUIRE(heights.size() == disk_row_count(count));
    REQUIRE(glm::length(sum) < 1.0);
    // Half-planes hold the share of points that they hold of the disk.
    if (count < 64) continue;
    for (int k = 0; k < 12; ++k) {
      const double angle = 0.26 * k, distance = 0.07 * (k % 6);  // from the middle
      const dvec2 n(std::cos(angle), std::sin(angle));
      const auto beyond =
          std::count_if(points.begin(), points.end(), [&](const dvec2& p) { return glm::dot(p - 0.5, n) > distance; });
      const double share =
          (std::acos(2.0 * distance) - 2.0 * distance * std::sqrt(1.0 - 4.0 * distance * distance)) / 3.14159265358979;
      CHECK(std::fabs(static_cast<double>(beyond) / count - share) < 2.0 / std::pow(count, 0.75));
    }
  }
}

TEST_CASE("a disk has the same set 0, whether alone or before others") {
  Light light = frame_light();
  light.shape = LightShape::kDisk, light.radius = 1.0;
  const LightSamples one = samples_of(light, 100, SamplePattern::kRows),
                     three = samples_of(light, 100, SamplePattern::kRows, 3);
  CHECK(std::equal(one.points.begin(), one.points.end(), three.points.begin()));
  ShadowConfig config = frame_config(100);
  config.pattern = SamplePattern::kRows, config.frame = 2;
  const LightSamples third = make_light_samples(light, config, unit_frame());
  CHECK(std::equal(third.points.begin(), third.points.end(), three.points.begin() + 200));
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

TEST_CASE("directions whose squares do not fit a double are directions all the same") {
  Light light = frame_light();
  light.shape = LightShape::kDisk, light.radius = 1.0, light.normal = {3, -2, 1};
  const LightSamples disk = samples_of(light, 64, SamplePattern::kStratified);
  for (const int exponent : {-1000, -600, 600, 1000}) {
    light.normal = {std::ldexp(3.0, exponent), std::ldexp(-2.0, exponent), std::ldexp(1.0, exponent)};
    const LightSamples scaled = samples_of(light, 64, SamplePattern::kStratified);
    CHECK(scaled.axis_n == disk.axis_n);
    CHECK(scaled.axis_u == disk.axis_u);
    CHECK(scaled.points == disk.points);
  }
  light = frame_light();
  light.u = {1e-200, 0, 0}, light.v = {0, 0, 1e-250};
  const LightSamples tiny = samples_of(light, 16, SamplePattern::kRows);
  CHECK(tiny.flat);
  CHECK(tiny.axis_u == dvec3(1, 0, 0));
  CHECK(tiny.axis_n.y == -1.0);
  light.shape = LightShape::kEllipsoid;
  light.axes = {dvec3(1e-200, 0, 0), dvec3(0, 1e-220, 0), dvec3(0, 0, 1e-240)};
  CHECK(samples_of(light, 16, SamplePattern::kRows).axis_n.z == doctest::Approx(1.0));
}

TEST_CASE("low-discrepancy: every first 2^m samples have one in each elementary interval, for every seed and set") {
  for (const std::uint32_t seed : {0u, 1u, 77u}) {
    for (const std::uint32_t set : {0u, 1u, 200u}) {
      const std::vector<dvec2> points = unit_square_samples(SamplePattern::kLowDiscrepancy, 4096, set, 1, seed);
      for (std::uint32_t m = 0; m <= 12; ++m) {
        for (std::uint32_t k = 0; k <= m; ++k) {
          std::vector<int> hits(std::size_t{1} << m, 0);
          for (std::uint32_t i = 0; i < 1u << m; ++i) {
            const auto column = static_cast<std::size_t>(points[i].x * (1u << k));
            const auto row = static_cast<std::size_t>(points[i].y * (1u << (m - k)));
            ++hits[(row << k) + column];
          }
          REQUIRE(std::all_of(hits.begin(), hits.end(), [](int h) { return h == 1; }));
        }
      }
    }
  }
}

TEST_CASE("low-discrepancy and poisson-disk are nested: fewer samples are the first ones of more") {
  for (const SamplePattern pattern : {SamplePattern::kLowDiscrepancy, SamplePattern::kPoissonDisk}) {
    const std::vector<dvec2> all = unit_square_samples(pattern, 1000, 3, 1, 5);
    for (const std::uint32_t count : {1u, 16u, 64u, 100u, 256u}) {
      const std::vector<dvec2> few = unit_square_samples(pattern, count, 3, 1, 5);
      CHECK(std::equal(few.begin(), few.end(), all.begin()));
    }
  }
}

TEST_CASE("poisson-disk: any two of the first n samples keep 65 % of the largest possible distance on the torus") {
  for (const std::uint32_t seed : {0u, 1u, 2u, 3u}) {
    const std::vector<dvec2> points = unit_square_samples(SamplePattern::kPoissonDisk, 4096, 0, 1, seed);
    double nearest = 1.0;
    for (std::size_t n = 1; n < points.size(); ++n) {
      for (std::size_t i = 0; i < n; ++i) nearest = std::min(nearest, torus_distance(points[i], points[n]));
      REQUIRE(nearest >= 0.65 * std::sqrt(1.1547005383792517 / static_cast<double>(n + 1)));
    }
  }
}

TEST_CASE("a set depends on its number, not on how many sets there are or which comes first") {
  for (const SamplePattern pattern : kPatterns) {
    const std::vector<dvec2> many = unit_square_samples(pattern, 50, 0, 8, 9);
    const std::vector<dvec2> one = unit_square_samples(pattern, 50, 6, 1, 9);
    CHECK(std::equal(one.begin(), one.end(), many.begin() + 6 * 50));
  }
}

TEST_CASE("interleaved sets are 16, one for each place in a 4x4 block of pixels") {
  ShadowConfig config = frame_config(32);
  config.interleave = true;
  const LightSamples samples = make_light_samples(frame_light(), config, unit_frame());
  CHECK(samples.sets == 16);
  CHECK(samples.points.size() == 16 * 32);
  GBuffer gbuffer;
  gbuffer.width = gbuffer.height = 16;
  gbuffer.window = {3, 11, 6, 14};
  gbuffer.triangle.assign(64, 0);
  gbuffer.position.assign(64, dvec3(0.0));
  gbuffer.geometric_normal.assign(64, vec3(0, 1, 0));
  const ReceiverArray receivers = make_receivers(gbuffer, samples, 0);
  REQUIRE(receivers.size() == 64);
  for (std::uint32_t i = 0; i < 64; ++i) CHECK(receivers.set[i] == (6 + i / 8) % 4 * 4 + (3 + i % 8) % 4);
  std::set<std::uint8_t> block;
  for (const std::uint32_t i : {0u, 1u, 2u, 3u, 8u, 9u, 10u, 11u, 16u, 17u, 18u, 19u, 24u, 25u, 26u, 27u}) {
    block.insert(receivers.set[i]);
  }
  CHECK(block.size() == 16);
}

TEST_CASE("rotated sets of disks and spheres are the first set turned; other shapes keep their own sets") {
  Light light = frame_light();
  light.radius = 1.0;
  ShadowConfig config = frame_config(200);
  config.rotate_sets = true;
  config.sample_sets = 7;
  for (const LightShape shape : {LightShape::kDisk, LightShape::kSphere}) {
    light.shape = shape;
    const LightSamples samples = make_light_samples(light, config, unit_frame());
    for (std::uint32_t set = 1; set < 7; ++set) {
      CHECK(samples.set(set)[0] != samples.set(0)[0]);
      for (std::uint32_t i = 1; i < 200; ++i) {  // a rotation keeps all distances
        const float before = glm::length(samples.set(0)[i] - samples.set(0)[i - 1]);
        REQUIRE(glm::length(samples.set(set)[i] - samples.set(set)[i - 1]) == doctest::Approx(before).epsilon(1e-4));
      }
    }
  }
  const LightSamples turned = make_light_samples(frame_light(), config, unit_frame());
  config.rotate_sets = false;
  CHECK(turned.points == make_light_samples(frame_light(), config, unit_frame()).points);
}

TEST_CASE("samples of an ellipsoid satisfy its equation, and those of a ball are those of the sphere") {
  Light light = frame_light();
  light.shape = LightShape::kEllipsoid;
  light.axes = {dvec3(2, 0, 0), dvec3(0, 0.5, 0), dvec3(0, 0, 1)};
  for (const vec3& p : samples_of(light, 300, SamplePattern::kRows).points) {
    const vec3 q = (p - vec3(0, 0.5f, 0)) * 8.0f / vec3(2, 0.5, 1);
    CHECK(glm::length(q) == doctest::Approx(1.0).epsilon(1e-4));
  }
  light.axes = {dvec3(1, 0, 0), dvec3(0, 1, 0), dvec3(0, 0, 1)};
  const LightSamples ball = samples_of(light, 300, SamplePattern::kRows);
  light.shape = LightShape::kSphere;
  light.radius = 1.0;
  CHECK(ball.points == samples_of(light, 300, SamplePattern::kRows).points);
  for (const dvec3& p : light_extent(light)) CHECK(glm::length(p - light.center) >= 1.0);
}

TEST_CASE("samples of a polygon are spread evenly over its area and stay inside it") {
  // A trapezoid of heights 0..2 with widths 4 and 2 and a triangle on top: areas 6 and 1.
  const Light light = polygon_light({{-2, 4, 0}, {-1, 4, 2}, {0, 4, 3}, {1, 4, 2}, {2, 4, 0}});
  const LightSamples samples = samples_of(light, 4096, SamplePattern::kStratified);
  CHECK(samples.flat);
  CHECK(samples.axis_n.y == doctest::Approx(1.0));
  int top = 0, left = 0;
  for (const vec3& local : samples.points) {
    const dvec3 p = unit_frame().to_world(dvec3(local));
    CHECK(p.y == doctest::Approx(4.0));
    CHECK(p.z >= -1e-6);
    CHECK(std::fabs(p.x) <= (p.z <= 2.0 ? 2.0 - 0.5 * p.z : 3.0 - p.z) + 1e-6);
    top += p.z > 2.0;
    left += p.x < 0.0;
  }
  CHECK(std::abs(top - 4096 / 7) < 25);
  CHECK(std::abs(left - 2048) < 25);
}

TEST_CASE("a rectangle given as a polygon gets the rectangle's samples, and its corners may be collinear") {
  const Light rectangle = frame_light();  // x and z from -1 to 1, u x v points down
  const Light polygon = polygon_light({{-1, 4, -1}, {1, 4, -1}, {1, 4, 0.5}, {1, 4, 1}, {-1, 4, 1}});
  const LightSamples a = samples_of(rectangle, 256, SamplePattern::kRows);
  const LightSamples b = samples_of(polygon, 256, SamplePattern::kRows);
  CHECK(b.axis_n.y == doctest::Approx(-1.0));
  for (std::size_t i = 0; i < 256; ++i) CHECK(glm::length(a.points[i] - b.points[i]) < 1e-6f);
}

TEST_CASE("polygons that are not flat, not convex or without area are refused with the light's name") {
  const std::pair<std::vector<dvec3>, const char*> wrong[] = {
      {{{0, 4, 0}, {1, 4, 0}}, "2 corners"},
      {{{0, 4, 0}, {1, 4, 0}, {2, 4, 0}}, "no area"},
      {{{0, 4, 0}, {0, 4, 0}, {0, 4, 0}}, "no area"},
      {{{0, 4, 0}, {1, 4, 0}, {1, 4, 1}, {0, 4.00001, 1}}, "plane"},
      {{{0, 4, 0}, {1, 4, 0}, {0.2, 4, 0.2}, {0, 4, 1}}, "not convex"},
      {{{0, 4, 1}, {0.59, 4, -0.81}, {-0.95, 4, 0.31}, {0.95, 4, 0.31}, {-0.59, 4, -0.81}}, "not convex"},  // pentagram
      {{{0, 4, 0}, {1, 4, 0}, {NAN, 4, 1}}, "not finite"},
      {std::vector<dvec3>(65, dvec3(0.0)), "65 corners"}};
  for (const auto& [points, what] : wrong) {
    CAPTURE(what);
    CHECK_THROWS_WITH_AS(samples_of(polygon_light(points), 16, SamplePattern::kRows), doctest::Contains(what), Error);
    CHECK_THROWS_WITH_AS(samples_of(polygon_light(points), 16, SamplePattern::kRows), doctest::Contains("pane"), Error);
  }
  CHECK_NOTHROW(
      samples_of(polygon_light({{0, 4, 0}, {1, 4, 0}, {1, 4, 1}, {0, 4.0000001, 1}}), 16, SamplePattern::kRows));
}
