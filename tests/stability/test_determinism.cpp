// S29: the masks of all scenes of S01 to S22 do not depend on instruction set, threads or the order of triangles.
#include <doctest/doctest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <numeric>
#include <thread>

#include "stability/cases.h"
#include "support/simd_targets.h"

using namespace halfshade;
using namespace halfshade::test;

namespace {

/// The same scene with its triangles in the order of `seed`; 0 leaves them.
StabilityCase reordered(const StabilityCase& c, std::uint64_t seed) {
  std::vector<std::uint32_t> order(c.scene.triangles.size()), place(order.size());
  std::iota(order.begin(), order.end(), 0u);
  Random random(seed);
  if (seed > 0) std::shuffle(order.begin(), order.end(), random.engine);
  StabilityCase r = c;
  for (std::uint32_t i = 0; i < order.size(); ++i) {
    place[order[i]] = i;
    r.scene.triangles[i] = c.scene.triangles[order[i]];
    r.scene.triangle_materials[i] = c.scene.triangle_materials[order[i]];
    if (!c.scene.triangle_uvs.empty()) r.scene.triangle_uvs[i] = c.scene.triangle_uvs[order[i]];
  }
  for (Receiver& receiver : r.receivers) {
    if (receiver.triangle != kNone) receiver.triangle = place[receiver.triangle];
  }
  return r;
}

std::vector<int> thread_counts() {
  std::vector<int> counts = {1, 2, 3, std::max(1, static_cast<int>(std::thread::hardware_concurrency()))};
  std::sort(counts.begin(), counts.end());
  counts.erase(std::unique(counts.begin(), counts.end()), counts.end());
  return counts;
}

struct Sweep {
  std::uint64_t solves = 0, different = 0;
  std::string first_difference;

  void solve_all(const StabilityCase& c, const std::string& truth, int threads, const std::string& setting) {
    for (const ShadowMethod method : exact_methods()) {
      VisibilityMasks masks;
      tbb::task_arena(threads).execute([&] { masks = solve(c.scene, c.receivers, c.light, c.config, method); });
      ++solves;
      if (masks.hash() == truth) continue;
      if (different++ == 0) {
        first_difference =
            c.name + ", " + traits_of(method).name + ", " + setting + ", " + std::to_string(threads) + " threads";
      }
    }
  }
};

/// Every scene with every instruction set; `all`: with every number of threads and three orders, else these take turns.
Sweep sweep(bool all) {
  const std::vector<StabilityCase> cases = stability_cases();
  const std::vector<int> threads = thread_counts();
  const tbb::global_control enough(tbb::global_control::max_allowed_parallelism,  // three even where two cores are
                                   static_cast<std::size_t>(threads.back()));
  std::vector<std::string> truth;
  for (const StabilityCase& c : cases)
    truth.push_back(solve(c.scene, c.receivers, c.light, c.config, ShadowMethod::kOracle).hash());
  Sweep result;
  for (std::size_t i = 0; i < cases.size(); ++i) {
    const std::array<StabilityCase, 3> orders = {reordered(cases[i], 0), reordered(cases[i], 1),
                                                 reordered(cases[i], 2)};
    std::size_t turn = i;
    for_each_simd_target([&](const std::string& target) {
      for (std::size_t t = 0; t < threads.size(); ++t) {
        for (std::size_t order = 0; order < 3; ++order) {
          if (!all && (t != turn % threads.size() || order != turn % 3)) continue;
          result.solve_all(orders[order], truth[i], threads[t], target + ", order " + std::to_string(order));
        }
      }
      ++turn;
    });
  }
  return result;
}

void check(const Sweep& result) {
  CAPTURE(result.first_difference);
  CHECK(result.different == 0);
  MESSAGE(result.solves << " solves, all with the oracle's hash");
}

}  // namespace

TEST_CASE(
    "S29 isa_threads: the masks of S01 to S22 are the oracle's for every instruction set, threads and order taking "
    "turns") {
  std::vector<std::string> names;
  for (const StabilityCase& c : stability_cases()) names.push_back(c.name.substr(0, 3));
  names.erase(std::unique(names.begin(), names.end()), names.end());
  CHECK(names.size() == 22);
  CHECK(names.front() == "S01");
  CHECK(names.back() == "S22");
  check(sweep(false));
}

TEST_CASE("S29_long isa_threads: every instruction set with 1, 2, 3 and all threads and three orders of triangles") {
  check(sweep(true));
}
