#include <doctest/doctest.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>

#include "halfshade/adaptive.h"
#include "shadows/set_sequence.h"
#include "support/lit_scene.h"

using namespace halfshade;
using namespace halfshade::test;

namespace {

/// Area of the part of [-1,1]^2 where dot(n, p) <= c, as a share of the whole: polygon clipping and the shoelace rule.
double share_below(const dvec2& n, double c) {
  const std::array<dvec2, 4> square = {dvec2(-1, -1), dvec2(1, -1), dvec2(1, 1), dvec2(-1, 1)};
  std::vector<dvec2> kept;
  for (std::size_t i = 0; i < 4; ++i) {
    const dvec2 p = square[i], q = square[(i + 1) % 4];
    const double a = glm::dot(n, p) - c, b = glm::dot(n, q) - c;
    if (a <= 0.0) kept.push_back(p);
    if ((a < 0.0 && b > 0.0) || (a > 0.0 && b < 0.0)) kept.push_back(p + (q - p) * (a / (a - b)));
  }
  double twice = 0.0;
  for (std::size_t i = 0; i < kept.size(); ++i) {
    const dvec2 p = kept[i], q = kept[(i + 1) % kept.size()];
    twice += p.x * q.y - p.y * q.x;
  }
  return std::fabs(twice) / 8.0;
}

/// A strip at half the light's height: all points there with low <= dot(n, p) <= high.
std::vector<Triangle> strip(const dvec2& n, double low, double high) {
  const dvec2 t(-n.y, n.x);
  const auto at = [&](double across, double along) {
    const dvec2 p = n * across + t * along;
    return dvec3(p.x, 2.0, p.y);
  };
  return quad(at(low, -50), at(high, -50), at(high, 50), at(low, 50));
}

AdaptiveVisibility solved(const Scene& scene, const std::vector<Receiver>& receivers, const Light& light, double goal) {
  AdaptiveVisibility result;
  solve_to_error(scene, receivers, light, {}, goal, result);
  return result;
}

/// Receivers on the ground around the origin, near each other as those of a picture are.
std::vector<dvec3> ground_points(int side, double reach) {
  std::vector<dvec3> points;
  for (int j = 0; j < side; ++j) {
    for (int i = 0; i < side; ++i) {
      points.emplace_back((i + 0.37) / side * 2.0 * reach - reach, 0.0, (j + 0.61) / side * 2.0 * reach - reach);
    }
  }
  return points;
}

/// Largest error of V behind a strip, over the receivers.
double worst_behind_strip(const dvec2& n, double low, double high, double goal) {
  const std::vector<dvec3> points = ground_points(24, 2.0);
  const AdaptiveVisibility r = solved(scene_of(strip(n, low, high)), receivers_at(points), frame_light(), goal);
  double worst = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double own = glm::dot(n, dvec2(points[i].x, points[i].z));  // the light's point l is seen at (p + l) / 2
    const double truth = 1.0 - (share_below(n, 2.0 * high - own) - share_below(n, 2.0 * low - own));
    worst = std::max(worst, std::fabs(r.visibility[i] - truth));
  }
  return worst;
}

}  // namespace

TEST_CASE("behind an edge at any angle the error of visibility is below the goal") {
  for (const double goal : {1.0 / 32, 1.0 / 64, 1.0 / 256}) {
    for (const double degrees : {0.0, 1.7899, 7.0, 23.0, 45.0, 61.0, 88.21, 90.0, 133.0, 178.21}) {
      CAPTURE(goal);
      CAPTURE(degrees);
      const double angle = degrees / 180.0 * 3.14159265358979;
      CHECK(worst_behind_strip({std::cos(angle), std::sin(angle)}, 0.13, 40.0, goal) <= goal);
    }
  }
}

TEST_CASE("behind a wire thinner than the samples' distance the error is below the goal") {
  for (const double degrees : {0.0, 1.7899, 30.0, 90.0, 91.79, 120.0}) {
    CAPTURE(degrees);
    const double angle = degrees / 180.0 * 3.14159265358979;
    for (const double width : {0.002, 0.01, 0.03}) {
      CAPTURE(width);
      CHECK(worst_behind_strip({std::cos(angle), std::sin(angle)}, 0.1, 0.1 + width, 1.0 / 256) <= 1.0 / 256);
    }
  }
}

TEST_CASE("what is wholly lit or hidden by one triangle is proved") {
  const std::vector<Receiver> receivers = receivers_at(ground_points(16, 1.0));
  const AdaptiveVisibility lit =
      solved(scene_of(quad({9, 1, 9}, {9, 2, 9}, {9, 2, 8}, {9, 1, 8})), receivers, frame_light(), 1.0 / 256);
  CHECK(lit.proved_lit == receivers.size());
  CHECK(lit.bound_kept == 0.0);
  CHECK(std::all_of(lit.visibility.begin(), lit.visibility.end(), [](float v) { return v == 1.0f; }));
  const AdaptiveVisibility dark = solved(scene_of({Triangle{dvec3(-90, 2, -90), dvec3(90, 2, -90), dvec3(0, 2, 90)}}),
                                         receivers, frame_light(), 1.0 / 256);
  CHECK(dark.proved_umbra == receivers.size());
  CHECK(std::all_of(dark.visibility.begin(), dark.visibility.end(), [](float v) { return v == 0.0f; }));
}

TEST_CASE("the statistics of the levels add up") {
  Random random(7);
  const Scene scene = scene_of(random_triangles(random, 60, 0.8, -2.0, 3.5));
  const std::vector<Receiver> receivers = receivers_at(ground_points(20, 3.0));
  const AdaptiveVisibility r = solved(scene, receivers, frame_light(), 1.0 / 128);
  std::uint64_t asked = 0, closed = 0, open = receivers.size();
  for (const ErrorLevel& level : r.levels) {
    CHECK(level.receivers == open);
    asked += level.samples, closed += level.proved + level.settled, open -= level.proved + level.settled;
  }
  CHECK(open == r.exhausted);
  CHECK(asked == r.samples_asked);
  std::uint64_t samples = 0, proofs = 0;
  for (std::size_t i = 0; i < receivers.size(); ++i) {
    samples += r.samples[i];
    proofs += r.evidence[i] == ErrorEvidence::kProof;
    CHECK((r.evidence[i] == ErrorEvidence::kExhausted || r.bound[i] <= 1.0 / 128));
  }
  CHECK(samples == asked);
  CHECK(proofs == r.proved_lit + r.proved_umbra);
  CHECK(r.levels.size() >= 2);
}

TEST_CASE("one thread and four give the same visibility") {
  Random random(8);
  const Scene scene = scene_of(random_triangles(random, 200, 0.5, -2.0, 3.5));
  const std::vector<Receiver> receivers = receivers_at(ground_points(40, 3.0));
  AdaptiveVisibility one, four;
  tbb::task_arena(1).execute([&] { one = solved(scene, receivers, frame_light(), 1.0 / 64); });
  tbb::task_arena(4).execute([&] { four = solved(scene, receivers, frame_light(), 1.0 / 64); });
  CHECK(one.visibility == four.visibility);
  CHECK(one.bound == four.bound);
  CHECK(one.samples == four.samples);
}

TEST_CASE("disks, spheres and lights that are skewed keep the goal as well") {
  Random random(9);
  const Scene scene = scene_of(random_triangles(random, 30, 1.0, -1.0, 3.0));
  const std::vector<Receiver> receivers = receivers_at(ground_points(8, 2.0));
  std::vector<Light> lights(3, frame_light());
  lights[0].shape = LightShape::kDisk, lights[0].radius = 1.0;
  lights[1].shape = LightShape::kSphere, lights[1].radius = 0.8;
  lights[2].u = {2.0, 0.0, 1.0};
  for (const Light& light : lights) {
    CAPTURE(static_cast<int>(light.shape));
    const AdaptiveVisibility r = solved(scene, receivers, light, 1.0 / 64);
    std::vector<double> truth(receivers.size(), 0.0);
    ShadowConfig config;
    config.pattern = SamplePattern::kLowDiscrepancy, config.light_sample_count = 4096;
    for (config.frame = 900; config.frame < 904; ++config.frame) {
      std::vector<float> v;
      solve_visibility(scene, receivers, light, config, v);
      for (std::size_t i = 0; i < v.size(); ++i) truth[i] += 0.25 * v[i];
    }
    for (std::size_t i = 0; i < truth.size(); ++i) CHECK(std::fabs(r.visibility[i] - truth[i]) <= 1.0 / 64);
  }
}

TEST_CASE("a point light and a light of samples are answered without error") {
  const Scene scene = scene_of(strip({1, 0}, 0.1, 40.0));
  Light light = frame_light();
  light.shape = LightShape::kSamples;
  light.points = {{-1, 4, 0}, {1, 4, 0}, {0.5, 4.5, 0.25}};
  const std::vector<Receiver> receivers = receivers_at(ground_points(6, 2.0));
  const AdaptiveVisibility r = solved(scene, receivers, light, 1.0 / 256);
  std::vector<float> expected;
  solve_visibility(scene, receivers, light, {}, expected);
  CHECK(r.visibility == expected);
  CHECK(r.bound_kept == 0.0);
  CHECK(r.samples_asked == 3 * receivers.size());
}

TEST_CASE("goals out of range are refused") {
  for (const double goal : {0.0, -0.1, 0.5, 1.0 / 8192, std::nan("")}) {
    AdaptiveVisibility result;
    CHECK_THROWS_AS(solve_to_error({}, {}, frame_light(), {}, goal, result), Error);
  }
}

TEST_CASE("every tilted set has one sample in each of as many rows and columns as it has samples") {
  const Light light = frame_light();
  const LocalFrame frame = make_local_frame({}, light_extent(light));
  for (std::uint32_t set = 0; set < 4; ++set) {
    for (const std::uint32_t side : {32u, 64u}) {
      const LightSamples samples = make_sets(light, {}, frame, side, set);
      std::array<std::vector<int>, 2> hits = {std::vector<int>(side * side, 0), std::vector<int>(side * side, 0)};
      for (const vec3& p : samples.points) {
        const dvec3 world = (dvec3(p) - samples.center) / frame.scale;
        for (int axis = 0; axis < 2; ++axis) {
          const double x = (axis == 0 ? world.x : world.z) * 0.5 + 0.5;
          REQUIRE(x >= 0.0);
          REQUIRE(x < 1.0);
          ++hits[axis][static_cast<std::size_t>(x * side * side)];
        }
      }
      for (const std::vector<int>& axis_hits : hits) {
        CHECK(std::count(axis_hits.begin(), axis_hits.end(), 1) == static_cast<std::ptrdiff_t>(side * side));
      }
    }
  }
}
