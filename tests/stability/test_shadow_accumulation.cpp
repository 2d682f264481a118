// Shadow accumulation where it is known to fail (the cases E1 to E6): how wrong each form is, and in which direction.
//
// A disk light of radius 0.5 at the origin looks along +z, the map plane lies one radius away, the receiver at z = 4.
// Single-layer and summed forms are not expected to be right: their signed errors are pinned, so that they can neither
// grow nor vanish unnoticed.
#include <doctest/doctest.h>

#include <algorithm>

#include "support/lit_picture.h"
#include "support/lit_scene.h"

using namespace halfshade;
using namespace halfshade::test;
using cases::accumulation_light;
using cases::card;

namespace {

struct Form {
  std::uint32_t kernel = 10;
  AccumulationForm form = AccumulationForm::kBits;
  std::uint32_t layers = 1;
  bool refine = false;
};

struct Shadow {
  double s = 0.0;                    // clamped
  double sum = 0.0;                  // before clamping
  bool flagged = false;              // clamped, and said so
  double lexels_before_plane = 0.0;  // casters nearer than the map plane
};

Shadow accumulate(const std::vector<Triangle>& triangles, const dvec3& receiver, const Form& form) {
  ShadowConfig config = frame_config(16);
  config.method = ShadowMethod::kShadowAccumulation;
  config.shadow_map.kernel = form.kernel;
  config.shadow_map.form = form.form;
  config.shadow_map.layers = form.layers;
  config.shadow_map.refine = form.refine;
  config.shadow_map.plane = 1.0f;
  config.shadow_map.resolution = 512;
  std::vector<float> visibility;
  ShadowStats stats;
  const Scene scene = scene_of(triangles);
  const std::vector<Receiver> receivers = receivers_at({receiver});
  solve_visibility(scene, receivers, accumulation_light(), config, visibility, &stats);
  Shadow shadow;
  shadow.s = 1.0 - visibility[0];
  for (const auto& [name, value] : stats.details) {
    if (name == "shadow-accumulation.clamped") shadow.flagged = value > 0.0;
    if (name == "shadow-accumulation.largest_sum") shadow.sum = value;
    if (name == "shadow-accumulation.lexels_before_plane") shadow.lexels_before_plane = value;
  }
  return shadow;
}

double true_shadow(const std::vector<Triangle>& triangles, const dvec3& receiver, std::uint32_t samples) {
  const VisibilityMasks masks = solve(scene_of(triangles), receivers_at({receiver}), accumulation_light(),
                                      frame_config(samples), ShadowMethod::kOracle);
  return 1.0 - masks.visibility(0);
}

const dvec3 kReceiver{0, 0, 4};
constexpr std::uint32_t kKernels[] = {5, 10, 32};

}  // namespace

TEST_CASE("S26 accum_umbra: bits are full under an opaque plane at every depth and kernel size") {
  for (const double z : {0.6, 1.0, 2.0, 3.0, 3.9}) {
    for (const std::uint32_t kernel : kKernels) {
      for (const bool refine : {false, true}) {
        CAPTURE(z);
        CAPTURE(kernel);
        CHECK(accumulate(card(z, -64, 64), kReceiver, {.kernel = kernel, .refine = refine}).s ==
              doctest::Approx(1.0).epsilon(1e-6));
      }
    }
  }
}

TEST_CASE("S26 accum_umbra: a lone plane casts nothing on itself, across the axis or tilted") {
  for (const double tilt : {0.0, 0.3, 1.0, 3.0}) {
    const Scene scene =
        scene_of(quad({-8, -8, 4 - 8 * tilt}, {8, -8, 4 + 8 * tilt}, {8, 8, 4 + 8 * tilt}, {-8, 8, 4 - 8 * tilt}));
    Light light = accumulation_light();
    light.center.z = -30.0;
    Camera camera;
    camera.eye = {-1.0, 0.3, -20.0};
    camera.target = {0, 0, 4};
    CAPTURE(tilt);
    for (const std::uint32_t kernel : kKernels) {
      ShadowConfig config = frame_config(16);
      config.method = ShadowMethod::kShadowAccumulation;
      config.shadow_map.kernel = kernel;
      const LitPicture picture = make_lit_picture(scene, camera, light, config);
      REQUIRE(picture.receivers.size() > 100);
      const std::vector<float> visibility = visibility_by(picture, config, config.method);
      CHECK(std::count(visibility.begin(), visibility.end(), 1.0f) == static_cast<long>(visibility.size()));
    }
  }
}

TEST_CASE("S26 accum_umbra: sums stay in [0,1] and say when they were clamped; with few lexels they are far off") {
  const auto sum_at = [](double z, std::uint32_t kernel, bool refine) {
    return accumulate(card(z, -64, 64), kReceiver,
                      {.kernel = kernel, .form = AccumulationForm::kSum, .refine = refine});
  };
  for (const double z : {0.6, 1.0, 2.0, 3.0, 3.9}) {
    for (const std::uint32_t kernel : kKernels) {
      const Shadow shadow = sum_at(z, kernel, false);
      CAPTURE(z);
      CAPTURE(kernel);
      CHECK(shadow.s >= 0.0);
      CHECK(shadow.s <= 1.0);
      CHECK(shadow.flagged == (shadow.sum > 1.0));
    }
  }
  // E3: a lexel 21 times enlarged overshoots or misses; under an opaque plane K = 10 is fully lit.
  CHECK(sum_at(3.0, 5, false).sum == doctest::Approx(22.46).epsilon(0.01));
  CHECK(sum_at(3.0, 10, false).sum == 0.0);
  CHECK(sum_at(3.0, 32, false).sum == doctest::Approx(2.19).epsilon(0.01));
  // E4: with the units of the normalisation put right the sum of a full blocker near the light is 1.
  CHECK(sum_at(0.6, 32, false).sum == doctest::Approx(1.0).epsilon(0.05));
  CHECK(sum_at(1.0, 32, false).sum == doctest::Approx(1.0).epsilon(0.05));
  // The refined kernel spends all its lookups on what is enlarged.
  for (const double z : {1.0, 2.0, 3.0, 3.9}) {
    CHECK(sum_at(z, 5, true).sum == doctest::Approx(1.07).epsilon(0.01));
    CHECK(sum_at(z, 32, true).sum == doctest::Approx(1.01).epsilon(0.01));
  }
}

TEST_CASE("S26 accum_umbra: a caster nearer than the map plane is too light, and counted") {
  const Shadow shadow = accumulate(card(0.25, -64, 64), kReceiver, {.kernel = 32});  // E6: at half the plane's distance
  CHECK(shadow.s == doctest::Approx(0.24).epsilon(0.02));
  CHECK(shadow.lexels_before_plane > 0.0);
  CHECK(accumulate(card(0.6, -64, 64), kReceiver, {.kernel = 32}).lexels_before_plane == 0.0);
}

TEST_CASE("S27 accum_overlap: a caster hidden from the light's centre is lost by one layer and found by peeling") {
  // E1: the first card exactly hides the second one from the centre; the receiver is in full shadow of the second.
  const std::vector<Triangle> cards = cases::hidden_card();
  REQUIRE(true_shadow(cards, kReceiver, 1024) == 1.0);
  for (const std::uint32_t kernel : kKernels) {
    for (const bool refine : {false, true}) {
      CAPTURE(kernel);
      CHECK(accumulate(cards, kReceiver, {.kernel = kernel, .layers = 8, .refine = refine}).s == 1.0);
    }
  }
  CHECK(accumulate(cards, kReceiver, {.kernel = 32}).s - 1.0 == doctest::Approx(-0.88).epsilon(0.02));
  const auto summed = [&](std::uint32_t kernel) {
    return accumulate(cards, kReceiver, {.kernel = kernel, .form = AccumulationForm::kSum}).s;
  };
  CHECK(summed(5) == doctest::Approx(0.28).epsilon(0.02));
  CHECK(summed(10) == doctest::Approx(0.28).epsilon(0.02));
  CHECK(summed(32) == doctest::Approx(0.11).epsilon(0.02));
}

TEST_CASE("S27 accum_overlap: casters that overlap as seen from the receiver count once as bits, twice as a sum") {
  // E2: one card hides the left half of the light and more, the other one the right half and more.
  const std::vector<Triangle> cards = cases::overlapping_cards();
  REQUIRE(true_shadow(cards, kReceiver, 1024) == 1.0);
  for (const std::uint32_t kernel : {10u, 32u}) {
    CHECK(accumulate(cards, kReceiver, {.kernel = kernel, .layers = 8}).s == 1.0);
    CHECK(accumulate(cards, kReceiver, {.kernel = kernel, .layers = 8, .refine = true}).s == 1.0);
  }
  const auto summed = [&](std::uint32_t kernel, bool refine) {
    return accumulate(cards, kReceiver, {.kernel = kernel, .form = AccumulationForm::kSum, .refine = refine});
  };
  // The kernel as the paper prints it: both cards' shares are added.
  CHECK(summed(5, false).sum == doctest::Approx(1.11).epsilon(0.01));
  CHECK(summed(10, false).sum == doctest::Approx(0.56).epsilon(0.02));
  CHECK(summed(32, false).sum == doctest::Approx(1.60).epsilon(0.01));
  CHECK(summed(32, false).s == 1.0);
  CHECK(summed(32, false).flagged);
  // The refined kernel spends its lookups on the casters that the first one found: nearer to 1, but a sum still.
  CHECK(summed(5, true).sum == doctest::Approx(0.66).epsilon(0.01));
  CHECK(summed(10, true).sum == doctest::Approx(0.51).epsilon(0.01));
  CHECK(summed(32, true).sum == doctest::Approx(1.11).epsilon(0.01));
}

TEST_CASE("S27 accum_overlap: errors over a half-plane's penumbra stay bounded and have no direction") {
  const std::vector<Triangle> half_plane = card(2, -64, 0);
  std::vector<dvec3> points;
  std::vector<double> truth;
  for (int i = -20; i <= 20; ++i) {
    points.push_back({i / 49.0, 0, 4});
    truth.push_back(true_shadow(half_plane, points.back(), 1024));
  }
  const auto errors = [&](const Form& form, double& worst, double& mean) {
    worst = mean = 0.0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const double e = truth[i] - accumulate(half_plane, points[i], form).s;
      worst = std::max(worst, std::fabs(e));
      mean += e / static_cast<double>(points.size());
    }
  };
  double worst = 0.0, mean = 0.0;
  errors({.kernel = 32, .layers = 8, .refine = true}, worst, mean);
  CHECK(worst <= 0.05);
  CHECK(std::fabs(mean) <= 0.01);
  errors({.kernel = 10, .layers = 8, .refine = true}, worst, mean);
  CHECK(worst <= 0.1);
  CHECK(std::fabs(mean) <= 0.01);
  errors({.kernel = 32}, worst, mean);  // the paper's kernel: four to five lexels across the light
  CHECK(worst > 0.05);
  CHECK(worst <= 0.15);
}
