// Named stability cases about cells that too many blockers ask for.
#include <doctest/doctest.h>

#include "rasterizer/core/stopwatch.h"
#include "stability/cases.h"
#include "stability/integer_oracle.h"

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

namespace {

const std::vector<Triangle>& furniture() {
  static const std::vector<Triangle> triangles = joined(plate(2), box({-2, 0.5, -2}, {-1, 1.0, 2}));
  return triangles;
}

/// All but one of `count` receivers within 10^-4 of the origin, or spread over the floor.
std::vector<Receiver> crowd(int count, bool dense) {
  Random random(24);
  std::vector<dvec3> points;
  for (int i = 1; i < count; ++i) {
    points.push_back(dense ? 1e-4 * random.in_box(-1, 1) : dvec3(random.uniform(-4, 4), 0, random.uniform(-4, 4)));
  }
  points.push_back({100, 0, 0});
  return receivers_at(points);
}

struct Cost {
  double ms = 1e30;  // the fastest of three solves
  double bytes = 0.0;
};

Cost cost_of(ShadowMethod method, const Scene& scene, const std::vector<Receiver>& receivers,
             const ShadowConfig& config) {
  Cost cost;
  for (int run = 0; run < 3; ++run) {
    ShadowStats stats;
    Stopwatch watch;
    solve(scene, receivers, frame_light(), config, method, &stats);
    cost.ms = std::min(cost.ms, watch.lap());
    cost.bytes = static_cast<double>(stats.bytes);
  }
  return cost;
}

/// Time and memory for a crowd in one place are at most four times those for the same number spread out.
void check_crowd(int count) {
  const Scene scene = scene_of(furniture());
  const std::vector<Receiver> dense = crowd(count, true), spread = crowd(count, false);
  const ShadowConfig config = frame_config(64);
  for (const ShadowMethod method : exact_methods()) {
    const Cost cost = cost_of(method, scene, dense, config), usual = cost_of(method, scene, spread, config);
    MESSAGE(std::string(traits_of(method).name)
            << ": " << count << " receivers in one place " << cost.ms << " ms, " << cost.bytes * 1e-6
            << " MB, spread out " << usual.ms << " ms, " << usual.bytes * 1e-6 << " MB");
    CAPTURE(std::string(traits_of(method).name));
    CHECK(cost.ms <= 4.0 * usual.ms + 20.0);
    CHECK(usual.bytes > 0.0);
    CHECK(cost.bytes <= 4.0 * usual.bytes);
  }
}

}  // namespace

TEST_CASE("S24 coincident_receivers: many equal receivers, or all in one cell, are handled") {
  const Scene scene = scene_of(furniture());
  const std::vector<Receiver> equal = receivers_at(std::vector<dvec3>(5000, dvec3(0.0)));
  CHECK(wrong_against_integers(scene, equal, frame_light(), frame_config(64)) == 0);
  CHECK(wrong_against_integers(scene, crowd(3000, true), frame_light(), frame_config(64)) == 0);
  ShadowStats stats;
  solve(scene, equal, frame_light(), frame_config(64), ShadowMethod::kHierarchicalPenumbraCasting, &stats);
  CHECK(stats.detail("hpc.hierarchy_depth").value() <= 64.0);
}

TEST_CASE(
    "S24 coincident_receivers: a crowd in one place takes at most four times the time and memory of one spread out") {
  check_crowd(50000);
}

TEST_CASE("S24_long coincident_receivers: a million receivers in one place") { check_crowd(1000000); }
