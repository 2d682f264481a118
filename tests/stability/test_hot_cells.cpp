// Named stability cases about cells that too many blockers ask for.
#include <doctest/doctest.h>

#include "support/lit_scene.h"

using namespace halfshade;
using namespace halfshade::test;

namespace {

VisibilityMasks gears(const Scene& scene, const std::vector<Receiver>& receivers, const ShadowConfig& config,
                      ShadowStats* stats = nullptr, const Light& light = frame_light()) {
  return solve(scene, receivers, light, config, ShadowMethod::kGears, stats);
}

}  // namespace

TEST_CASE(
    "S25 hot_cell_memory: gears: a swarm at the light stays within the pair budget and gives the oracle's masks") {
  const Scene scene = scene_of(cases::swarm_at_light(25, 3000));
  std::vector<dvec3> points;
  for (int i = 0; i < 400; ++i) points.push_back({i % 20 * 0.5 - 5.0, 0.0, i / 20 * 0.5 - 5.0});
  const std::vector<Receiver> receivers = receivers_at(points);
  ShadowConfig config = frame_config(16);
  config.gears.grid = 128;
  const VisibilityMasks truth = solve(scene, receivers, frame_light(), config, ShadowMethod::kOracle);
  for (const bool coarse : {false, true}) {
    config.gears.coarse = coarse;
    for (const std::uint32_t budget : {10u, 500u, 20000u}) {
      config.gears.pair_budget = budget;
      ShadowStats stats;
      CHECK(wrong_bits(truth, gears(scene, receivers, config, &stats)) == 0);
      CHECK(stats.detail("gears.pairs_in_flight_max").value() <= budget);
      CHECK(stats.detail("gears.assignments").value() > 100000);  // more than any of the budgets, in cells
      if (!coarse && budget == 20000u) CHECK(stats.detail("gears.batches").value() > 3);
    }
  }
}

TEST_CASE("S25 hot_cell_memory: gears: memory grows with the swarm's size, not with its product with the grid") {
  std::vector<dvec3> points;
  for (int i = 0; i < 64; ++i) points.push_back({i % 8 - 3.5, 0.0, i / 8 - 3.5});
  ShadowConfig config = frame_config(1);
  config.gears.grid = 128;
  config.gears.coarse = false;
  std::array<double, 2> bytes{};
  for (std::size_t k = 0; k < 2; ++k) {
    ShadowStats stats;
    const Scene scene = scene_of(cases::swarm_at_light(26, k == 0 ? 20000 : 40000));
    gears(scene, receivers_at(points), config, &stats);
    bytes[k] = static_cast<double>(stats.bytes);
    CHECK(stats.detail("gears.pairs_in_flight_max").value() <= config.gears.pair_budget);
  }
  CHECK(bytes[0] < 100e6);
  CHECK(bytes[1] < 2.1 * bytes[0]);
}
