#include <doctest/doctest.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>

#include "halfshade/adaptive.h"
#include "shadows/exact_engine.h"
#include "shadows/level_engine.h"
#include "shadows/receiver_request.h"
#include "shadows/run_meter.h"
#include "shadows/solver.h"
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
    for (const double degrees : {0.0, 1.7899, 7.0, 16.7, 23.0, 30.7, 45.0, 61.0, 88.21, 90.0, 133.0, 163.3, 178.21}) {
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

TEST_CASE("together the rows of a round are evenly spaced, and no two of its samples share a place along them") {
  const Light light = frame_light();
  const LocalFrame frame = make_local_frame({}, light_extent(light));
  for (const SetRound& round : kSetRounds) {
    for (const SetShape shape : {SetShape{8, 32}, {16, 32}, {32, 32}, {64, 32}, {64, 64}}) {
      const LightSamples samples = make_sets(light, {}, frame, shape, round);
      const std::uint32_t size = shape.size() * round.count;
      REQUIRE(samples.points.size() == size);
      std::array<std::vector<int>, 2> hits = {std::vector<int>(size, 0), std::vector<int>(size, 0)};
      for (const vec3& p : samples.points) {
        const dvec3 world = (dvec3(p) - samples.center) / frame.scale;
        for (std::size_t axis = 0; axis < 2; ++axis) {
          const double x = (axis == 0 ? world.x : world.z) * 0.5 + 0.5;
          REQUIRE(x >= 0.0);
          REQUIRE(x < 1.0);
          ++hits[axis][static_cast<std::size_t>(x * size)];
        }
      }
      const std::size_t along = round.index % 2;
      CHECK(std::count(hits[along].begin(), hits[along].end(), 1) == static_cast<std::ptrdiff_t>(size));
      std::vector<std::size_t> heights;
      for (std::size_t i = 0; i < size; ++i) {
        if (hits[1 - along][i] != 0) heights.push_back(i);
      }
      REQUIRE(heights.size() == shape.rows * round.count);
      for (std::size_t row = 0; row < heights.size(); ++row) {
        CHECK(heights[row] == row * shape.columns + shape.columns / 2);  // the middle of the row's stripe
        CHECK(hits[1 - along][heights[row]] == static_cast<int>(shape.columns));
      }
    }
  }
}

TEST_CASE("every set of a rectangle has rows that the fast kernel takes, whichever way its edges turn") {
  Light light = frame_light();
  for (const bool mirrored : {false, true}) {
    if (mirrored) std::swap(light.u, light.v);
    const LocalFrame frame = make_local_frame({}, light_extent(light));
    for (const SetRound& round : kSetRounds) {
      CAPTURE(round.index);
      CAPTURE(mirrored);
      ExactLight kept;
      prepare_exact_light(light, make_sets(light, {}, frame, {64, 32}, round), kept);
      CHECK(kept.rows.rows == 64);
    }
  }
}

TEST_CASE("every round, whichever way its rows run, sees what a light of its samples alone shows") {
  // A closed box among loose triangles: certificates hold for some receivers and not for others.
  const Scene scene = scene_of(joined(cases::scattered(5, 120), box({-1.5, 1, -1}, {-0.5, 1.5, 1})));
  Random random(12);
  std::vector<dvec3> points = ground_points(9, 2.5);
  for (const dvec3& p : random_points(random, 60, -3.0, 6.0)) points.push_back(p);
  Light light = frame_light();
  light.two_sided = true;
  light.u = {1.6, 0.5, 0.3}, light.v = glm::cross(light.u, dvec3(0.2, 1.0, -0.1));
  for (const bool mirrored : {false, true}) {
    if (mirrored) light.v = -light.v;
    const std::vector<Receiver> receivers = receivers_at(points);
    const LocalFrame frame = make_local_frame(scene.positions, receiver_reach(receivers, light));
    const LatticeMesh mesh = make_lattice_mesh(scene, frame);
    const ReceiverRequest q = make_receiver_request(frame, receivers, light, {});
    ShadowStats stats;
    const ShadowConfig config;
    LevelEngine engine(mesh, q.receivers, light, config, stats);
    REQUIRE(engine.uses_rows());
    for (const SetRound& round : kSetRounds) {
      CAPTURE(round.index);
      std::vector<std::uint32_t> which;  // fewer and fewer, as in earnest
      for (std::uint32_t i = 0; i < q.receivers.size(); ++i) {
        if (round.index == 0 || i % (round.index + 1) != 0) which.push_back(i);
      }
      const SetShape shape{16, 32};
      std::vector<SetAnswer> answers;
      engine.solve_round(shape, round, which, answers);
      std::vector<std::uint32_t> expected(which.size(), 0);
      const LightSamples samples = make_sets(light, {}, frame, shape, round);
      for (std::uint32_t set = 0; set < round.count; ++set) {
        ReceiverArray part;
        for (const std::uint32_t i : which) {
          part.push_back(q.receivers.position[i], q.receivers.normal[i], q.receivers.triangle[i], q.receivers.sample[i],
                         static_cast<std::uint8_t>(set));
        }
        VisibilityMasks masks;
        solve_masks(mesh, part, light, samples, {.method = ShadowMethod::kOracle}, masks, stats);
        for (std::size_t k = 0; k < which.size(); ++k) expected[k] += shape.size() - masks.blocked_count(k);
      }
      std::size_t wrong = 0;
      for (std::size_t k = 0; k < which.size(); ++k) wrong += answers[k].visible != expected[k];
      CHECK(wrong == 0);
    }
  }
}

namespace {

/// Samples of the first set of a round, [-1,1] along the light's u and v.
std::vector<dvec2> places_of(const SetShape& shape, const SetRound& round) {
  const Light light = frame_light();
  const LocalFrame frame = make_local_frame({}, light_extent(light));
  const LightSamples samples = make_sets(light, {}, frame, shape, round);
  std::vector<dvec2> places;
  for (std::uint32_t i = 0; i < shape.size(); ++i) {
    const dvec3 world = (dvec3(samples.points[i]) - samples.center) / frame.scale;
    places.emplace_back(world.x, world.z);
  }
  return places;
}

/// Those with dot(n, p) > c are blocked.
std::vector<std::uint64_t> mask_of_half_plane(const std::vector<dvec2>& places, const dvec2& n, double c) {
  std::vector<std::uint64_t> mask(places.size() / 64, 0);
  for (std::size_t i = 0; i < places.size(); ++i) {
    if (glm::dot(n, places[i]) > c) mask[i / 64] |= std::uint64_t{1} << i % 64;
  }
  return mask;
}

}  // namespace

TEST_CASE("the share of a half-plane is rarely farther off than its picture says, at any angle") {
  for (const SetShape shape : {SetShape{8, 32}, {32, 32}, {64, 32}, {64, 64}}) {
    for (const SetRound& round : {kSetRounds[0], kSetRounds[1]}) {
      const RunMeter meter(shape, round, 0);
      const std::vector<dvec2> places = places_of(shape, round);
      double worst = 0.0, count = 0.0, beyond = 0.0;
      for (int k = 0; k < 180; ++k) {
        const double angle = k * 0.0349065850398866;
        const dvec2 n(std::cos(angle), std::sin(angle));
        for (double c = -0.8; c < 0.85; c += 0.0373) {
          const SetAnswer answer = meter.read(mask_of_half_plane(places, n, c));
          if (answer.roughness == 0) continue;
          const double error = std::fabs(answer.visible - share_below(n, c) * shape.size());
          const double deviations = error / std::sqrt(answer.roughness / 12.0);
          worst = std::max(worst, deviations), count += 1.0, beyond += deviations > 3.0;  // kRowDeviations
        }
      }
      CAPTURE(shape.rows);
      CAPTURE(shape.columns);
      CAPTURE(round.index);
      CHECK(worst <= 4.5);
      CHECK(beyond <= 0.01 * count);
    }
  }
}

TEST_CASE("the variance of a picture of samples by chance is that of a count of coins") {
  std::mt19937_64 engine(11);
  for (const SetShape shape : {SetShape{32, 32}, {64, 64}}) {
    const RunMeter meter(shape, {}, 0);
    std::vector<std::uint64_t> mask(shape.size() / 64);
    for (std::uint64_t& word : mask) word = engine();
    CHECK(meter.read(mask).roughness / 12.0 == doctest::Approx(shape.size() / 4.0).epsilon(0.15));
  }
}

TEST_CASE("runs are squared along the rows and along the lattice") {
  for (const SetShape shape : {SetShape{16, 32}, {64, 64}}) {
    const RunMeter meter(shape, {}, 0);
    std::vector<std::uint64_t> mask(shape.size() / 64, 0);
    CHECK(meter.read(mask).roughness == 0);
    for (std::uint32_t i = 0; i < 5 * shape.columns; ++i)
      mask[i / 64] |= std::uint64_t{1} << i % 64;  // five whole rows
    CHECK(meter.read(mask).roughness == shape.columns * shape.columns);
    CHECK(meter.read(mask).visible == shape.size() - 5 * shape.columns);
    std::fill(mask.begin(), mask.end(), 0);
    mask[2] = 1 << 7;  // alone, both in its row and in its column: four neighbours differ
    CHECK(meter.read(mask).roughness == 4 + 4 * 2);
    // An edge along the lattice itself: in each row as many samples as the lattice has moved on by.
    const std::vector<bool> wraps = row_wraps(shape, {}, 0);
    std::fill(mask.begin(), mask.end(), 0);
    std::uint32_t columns = 3, rows = 0;
    for (; rows < shape.rows && columns < shape.columns; ++rows) {
      for (std::uint32_t i = rows * shape.columns; i < rows * shape.columns + columns; ++i) {
        mask[i / 64] |= std::uint64_t{1} << i % 64;
      }
      if (rows + 1 < shape.rows) columns += wraps[rows];
    }
    CHECK(meter.read(mask).roughness >= rows * rows);
  }
}
