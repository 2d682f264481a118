// Named stability cases about features finer than the samples, and about lights that creep.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>

#include "stability/cases.h"
#include "stability/integer_oracle.h"

using namespace halfshade;
using namespace halfshade::test;

namespace {

constexpr double kSpacing = 2.0 / 16.0;  // between samples of the light

/// Largest difference of visibility from the share of the light that a wire leaves, over `steps` places of the wire.
double check_wire(double width, int steps) {
  const Scene scene = scene_of(wire(width));
  const std::vector<Receiver> receivers = receivers_at(wire_receivers(steps));
  CHECK(wrong_against_integers(scene, receivers, frame_light(), frame_config()) == 0);
  const VisibilityMasks masks = solve(scene, receivers, frame_light(), frame_config(), ShadowMethod::kExact);
  double worst = 0.0;
  for (std::size_t i = 0; i < receivers.size(); ++i) {
    worst = std::max(worst, std::fabs(masks.visibility(i) - (1.0 - 2.0 * width / 2.0)));  // 2 w of the light's 2
  }
  return worst;
}

}  // namespace

TEST_CASE("S22 wire_sweep: a wire finer than the samples costs at most one column, wherever it is") {
  for (const double width : {0.01, 0.05, 0.0625, 0.1}) {
    CAPTURE(width);
    const double worst = check_wire(width, 512);
    CHECK(worst <= 1.0 / 16.0 + 1e-7);
    CHECK(worst > 0.0);  // sampled, so not right everywhere
    MESSAGE("wire " << width << ", seen " << 2.0 * width / kSpacing << " spacings wide: error up to " << worst);
  }
}

namespace {

struct Flicker {
  double mean = 0.0;            // |V of this frame - 2 V of the last one + V of the one before|, over all
  std::vector<double> visible;  // [frame][receiver]
};

/// Of a light that moves by 1/512 of the distance between its samples in each of 256 frames.
Flicker flicker(const Scene& scene, const std::vector<Receiver>& receivers, ShadowConfig config, ShadowMethod method) {
  constexpr std::size_t kFrames = 256;
  config.method = method;
  const std::size_t n = receivers.size();
  Flicker result;
  double sum = 0.0;
  for (std::size_t frame = 0; frame < kFrames; ++frame) {
    Light light = frame_light();
    light.center.x += static_cast<double>(frame) * kSpacing / 512.0;
    std::vector<float> visibility;
    solve_visibility(scene, receivers, light, config, visibility);
    result.visible.insert(result.visible.end(), visibility.begin(), visibility.end());
    if (frame < 2) continue;
    const double* v = result.visible.data() + (frame - 2) * n;
    for (std::size_t i = 0; i < n; ++i) sum += std::fabs(v[i] - 2.0 * v[i + n] + v[i + 2 * n]);
  }
  result.mean = sum / static_cast<double>(n * (kFrames - 2));
  return result;
}

std::vector<Receiver> penumbra_receivers() {
  std::vector<dvec3> points;
  for (int i = -15; i <= 15; ++i) points.push_back({i / 15.0 + 0.003, 0, 0.25});
  return receivers_at(points);
}

}  // namespace

TEST_CASE(
    "S23 temporal: a light that creeps flickers as the oracle says, and accumulated shadows at most twice as much") {
  const Scene scene = scene_of(half_plane());
  const std::vector<Receiver> receivers = penumbra_receivers();
  ShadowConfig config = frame_config(256);
  const Flicker reference = flicker(scene, receivers, config, ShadowMethod::kOracle);
  REQUIRE(reference.mean > 0.0);
  for (const ShadowMethod method : exact_methods()) {
    const Flicker ours = flicker(scene, receivers, config, method);
    CHECK(ours.mean == reference.mean);
    CHECK(ours.visible == reference.visible);
  }
  config.shadow_map.kernel = 32;
  config.shadow_map.resolution = 512;
  const double ratio = flicker(scene, receivers, config, ShadowMethod::kShadowAccumulation).mean / reference.mean;
  MESSAGE("shadow accumulation, K = 32: ", ratio, " times the flicker of 256 exact samples");
  CHECK(ratio <= 2.0);
}

TEST_CASE("S23 temporal: a bit flips only where an edge passes its sample: once per sample in a whole sweep") {
  const Scene scene = scene_of(half_plane());
  const std::vector<Receiver> receivers = penumbra_receivers();
  for (const ShadowMethod method : exact_methods()) {
    VisibilityMasks last;
    std::uint64_t flips = 0, back = 0;
    for (int frame = 0; frame < 256; ++frame) {
      Light light = frame_light();
      light.center.x += frame * kSpacing / 512.0;
      VisibilityMasks masks = solve(scene, receivers, light, frame_config(), method);
      for (std::size_t w = 0; w < last.words.size(); ++w) {
        flips += static_cast<std::uint64_t>(std::popcount(masks.words[w] ^ last.words[w]));
        back += static_cast<std::uint64_t>(std::popcount(masks.words[w] & ~last.words[w]));
      }
      last = std::move(masks);
    }
    CHECK(flips > 0);
    CHECK(back == 0);  // the light moves away from the half-plane: nothing is hidden again
  }
}
