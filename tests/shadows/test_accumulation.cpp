// Averages over frames: integer counts that do not depend on order or threads.
#include <doctest/doctest.h>
#include <tbb/task_arena.h>

#include <cmath>
#include <set>

#include "halfshade/accumulation.h"
#include "shadows/light_samples.h"
#include "support/lit_scene.h"

using namespace halfshade;
using namespace halfshade::test;

namespace {

std::vector<Receiver> floor_receivers() {
  std::vector<dvec3> points;
  for (int i = 0; i < 400; ++i) points.push_back({(i % 20) * 0.3 - 2.85, 0.0, (i / 20) * 0.3 - 2.85});
  return receivers_at(points);
}

VisibilityMasks masks_of_frame(std::uint32_t frame) {
  ShadowConfig config = frame_config(50);
  config.pattern = SamplePattern::kRows;
  config.frame = frame;
  return solve(scene_of(quad({-1, 2, -1}, {1, 2, -1}, {1, 2, 1}, {-1, 2, 1})), floor_receivers(), frame_light(), config,
               ShadowMethod::kAliasFreeShadowMap);
}

VisibilityAccumulator sum_of_frames(const std::vector<std::uint32_t>& frames) {
  VisibilityAccumulator sum(400);
  for (const std::uint32_t frame : frames) sum.add(masks_of_frame(frame));
  return sum;
}

/// Receivers of `receivers` with bit 0 blocked in every second one.
VisibilityMasks striped_masks(std::size_t receivers, std::uint32_t samples) {
  VisibilityMasks masks;
  masks.reset(receivers, samples);
  for (std::size_t i = 0; i < receivers; i += 2) masks.words[i * masks.words_per_receiver] = 1;
  return masks;
}

}  // namespace

TEST_CASE("frames in any order and in any number of accumulators give the same counts") {
  const VisibilityAccumulator forward = sum_of_frames({0, 1, 2, 3, 4, 5});
  CHECK(sum_of_frames({5, 4, 3, 2, 1, 0}) == forward);
  VisibilityAccumulator parts = sum_of_frames({4, 1});
  parts.merge(sum_of_frames({5, 0, 2, 3}));
  CHECK(parts == forward);
  CHECK(forward.total()[0] == 300);
}

TEST_CASE("1, 2 and 7 threads give the same counts") {
  const auto run = [](int threads) {
    VisibilityAccumulator sum;
    tbb::task_arena(threads).execute([&] { sum = sum_of_frames({0, 1, 2}); });
    return sum;
  };
  const VisibilityAccumulator one = run(1);
  CHECK(run(2) == one);
  CHECK(run(7) == one);
}

TEST_CASE("the mean over frames nears the visibility of the whole light") {
  VisibilityAccumulator truth(400), sum(400);
  for (std::uint32_t frame = 0; frame < 64; ++frame) truth.add(masks_of_frame(10000 + frame));
  std::vector<std::uint32_t> all;
  for (std::uint32_t i = 0; i < 400; ++i) all.push_back(i);
  std::vector<double> frames, errors;
  for (std::uint32_t frame = 0; frame < 16; ++frame) {
    sum.add(masks_of_frame(frame));
    frames.push_back(frame + 1.0);
    errors.push_back(visibility_error(sum, truth, all).rmse);
  }
  CHECK(errors.back() < 0.25 * errors.front());  // random sets: 0.25 on average
  CHECK(convergence_exponent(frames, errors) < -0.5);
}

TEST_CASE("every one of 65536 frames has light samples of its own") {
  const LocalFrame frame = make_local_frame(std::vector<dvec3>{{-8, -8, -8}, {8, 8, 8}}, {});
  for (const SamplePattern pattern : {SamplePattern::kRows, SamplePattern::kUniform, SamplePattern::kStratified}) {
    CAPTURE(static_cast<int>(pattern));
    ShadowConfig config = frame_config(16);
    config.pattern = pattern;
    std::set<std::pair<float, float>> seen;
    for (config.frame = 0; config.frame < 65536; ++config.frame) {
      const vec3 p = make_light_samples(frame_light(), config, frame).points[0];
      seen.emplace(p.x, p.z);
    }
    CHECK(seen.size() == 65536);
  }
}

TEST_CASE("frame f of a configuration with one set is set f of a configuration with many") {
  const LocalFrame frame = make_local_frame(std::vector<dvec3>{{-8, -8, -8}, {8, 8, 8}}, {});
  ShadowConfig many = frame_config(64), one = frame_config(64);
  many.sample_sets = 8;
  const LightSamples sets = make_light_samples(frame_light(), many, frame);
  for (one.frame = 0; one.frame < 8; ++one.frame) {
    const LightSamples set = make_light_samples(frame_light(), one, frame);
    CHECK(std::equal(set.points.begin(), set.points.end(), sets.set(one.frame).begin()));
  }
  one.frame = kMaxFrames;
  CHECK_THROWS_AS(make_light_samples(frame_light(), one, frame), Error);
}

TEST_CASE("entries are counted where they are named, hidden ones in the total alone") {
  VisibilityAccumulator sum(5);
  sum.add(std::vector<std::uint32_t>{4, 1}, striped_masks(2, 10));
  sum.add_hidden(std::vector<std::uint32_t>{1, 2}, 10);
  CHECK(std::vector<std::uint32_t>(sum.visible().begin(), sum.visible().end()) ==
        std::vector<std::uint32_t>{0, 10, 0, 0, 9});
  CHECK(std::vector<std::uint32_t>(sum.total().begin(), sum.total().end()) ==
        std::vector<std::uint32_t>{0, 20, 10, 0, 10});
  CHECK(sum.visibility(1) == 0.5);
  CHECK(sum.visibility(0) == 0.0);
}

TEST_CASE("wrong lengths, entries and counts are refused and change nothing") {
  VisibilityAccumulator sum(3);
  const VisibilityMasks masks = striped_masks(2, 10);
  CHECK_THROWS_AS(sum.add(masks), Error);
  CHECK_THROWS_AS(sum.add(std::vector<std::uint32_t>{0, 3}, masks), Error);
  CHECK_THROWS_AS(sum.merge(VisibilityAccumulator(4)), Error);
  CHECK_THROWS_AS(VisibilityAccumulator({2}, {1}), Error);
  CHECK(sum == VisibilityAccumulator(3));
  const VisibilityAccumulator full({0xfffffff0u}, {0xfffffff0u});
  VisibilityAccumulator copy = full;
  CHECK_THROWS_AS(copy.add(striped_masks(1, 16)), Error);
  CHECK(copy == full);
}

TEST_CASE("errors of two lights join into the error over both") {
  const VisibilityAccumulator a({0, 5, 10, 10}, {10, 10, 10, 0x10}), b({0, 10, 10, 4}, {10, 10, 20, 8});
  const std::vector<std::uint32_t> all = {0, 1, 2, 3}, first = {0, 1}, rest = {2, 3};
  VisibilityError joined = visibility_error(a, b, first);
  joined.merge(visibility_error(a, b, rest));
  const VisibilityError error = visibility_error(a, b, all);
  CHECK(joined.rmse == doctest::Approx(error.rmse));
  CHECK(error.worst == 0.5);
  CHECK(error.count == 4);
}

TEST_CASE("colour sums do not depend on the order of frames") {
  const std::vector<float> a = {0.1f, 1e-7f, -1.0f, NAN}, b = {0.7f, 3.0f, 1e9f, 0.25f};
  ColorAccumulator forward(4), backward(4), merged(4);
  forward.add(a), forward.add(b);
  backward.add(b), backward.add(a);
  merged.merge(forward);
  CHECK(forward == backward);
  CHECK(merged == forward);
  CHECK(forward.mean(0) == doctest::Approx(0.4));
  CHECK(forward.mean(2) == 32768.0f);
  CHECK(forward.mean(3) == 0.125f);
}

TEST_CASE("the exponent of a power law is found, too few values give none") {
  const std::vector<double> frames = {1, 2, 4, 8}, errors = {1.0, 0.5, 0.25, 0.125};
  CHECK(convergence_exponent(frames, errors) == doctest::Approx(-1.0));
  CHECK(std::isnan(convergence_exponent(frames, std::vector<double>{0, 0, 0, 1})));
}
