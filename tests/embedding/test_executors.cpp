// Where loops run: TBB's arena, the calling thread, the host's own loop. Results never differ.
#include <doctest/doctest.h>

#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#include <tbb/task_scheduler_observer.h>

#include <mutex>
#include <numeric>
#include <set>
#include <thread>

#include "rasterizer/core/hash.h"
#include "rasterizer/core/parallel.h"
#include "support/embed_scene.h"
#include "support/host_loop.h"

using namespace halfshade;
using namespace halfshade::test;

namespace {

/// Threads that enter one of TBB's arenas while it lives: the calling thread's, or the one given.
class ArenaWatch : public tbb::task_scheduler_observer {
 public:
  ArenaWatch() { observe(true); }
  explicit ArenaWatch(tbb::task_arena& arena) : tbb::task_scheduler_observer(arena) { observe(true); }
  ~ArenaWatch() override { observe(false); }
  void on_scheduler_entry(bool worker) override {
    workers += worker;
    const int now = ++inside;
    for (int before = most; before < now && !most.compare_exchange_weak(before, now);) {
    }
  }
  void on_scheduler_exit(bool) override { --inside; }
  std::atomic<int> workers{0}, inside{0}, most{0};  // workers that came; threads now, and at most at once
};

Execution executor(Executor which) {
  if (which == Executor::kHost) return host_execution();
  Execution execution;
  execution.executor = which;
  return execution;
}

constexpr Executor kExecutors[] = {Executor::kArena, Executor::kSerial, Executor::kHost};

}  // namespace

TEST_CASE("loops, pairs, sorts and scans do the same everywhere") {
  const tbb::global_control more(tbb::global_control::max_allowed_parallelism, 4);
  std::vector<std::uint32_t> values(70001), counts(30001);
  for (std::uint32_t i = 0; i < values.size(); ++i) values[i] = hash32(i);
  for (std::uint32_t i = 0; i < counts.size(); ++i) counts[i] = hash32(i) % 5;
  std::vector<std::uint32_t> sorted = values, sums(1, 0);
  std::sort(sorted.begin(), sorted.end());
  for (const std::uint32_t c : counts) sums.push_back(sums.back() + c);
  for (const Executor which : kExecutors) {
    for (const bool watched : {false, true}) {
      CAPTURE(static_cast<int>(which));
      Execution execution = executor(which);
      if (watched) execution.progress = [](double) { return true; };
      run_call(execution, [&] {
        std::vector<std::atomic<int>> hits(1000);
        parallel_tasks(10, [&](std::size_t i) {
          parallel_ranges(100, 7, [&](std::size_t begin, std::size_t end) {
            for (std::size_t k = begin; k != end; ++k) ++hits[i * 100 + k];
          });
        });
        CHECK(std::all_of(hits.begin(), hits.end(), [](const auto& h) { return h == 1; }));
        int first = 0, second = 0;
        parallel_pair([&] { ++first; }, [&] { ++second; });
        CHECK(first * 10 + second == 11);
        for (const std::size_t count : {0u, 1u, 8192u, 8193u, 20000u, 70001u}) {
          std::vector<std::uint32_t> some(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(count));
          std::vector<std::uint32_t> expected = some;
          std::sort(expected.begin(), expected.end());
          parallel_sort(some, [](std::uint32_t a, std::uint32_t b) { return a < b; });
          CHECK(some == expected);
        }
        std::vector<std::uint32_t> offsets;
        exclusive_scan(counts, offsets);
        CHECK(offsets == sums);
      });
    }
  }
}

TEST_CASE("masks are the same from every executor, and the host's loop is the only one that works for kHost") {
  EmbedScene s(24);
  const Ground ground(40);
  Light two_sided = frame_light();
  two_sided.two_sided = true, two_sided.center.y = 1.2;
  const std::vector<Light> lights = {frame_light(), two_sided};
  const ShadowSolver solver({.light_sample_count = 64});
  Workspace workspace;
  const Solved expected = solve(solver, s.scene, ground.view(), lights, workspace);
  for (const Executor which : {Executor::kSerial, Executor::kHost}) {
    CAPTURE(static_cast<int>(which));
    const Execution execution = executor(which);
    // An arena where nothing ran before: a worker that leaves an earlier call late would be seen as well.
    tbb::task_arena fresh_arena;
    fresh_arena.execute([&] {
      const ArenaWatch watch;
      s.scene.set_transform(s.ids[1], moved_by({0.1, 1.0, 0.0}));
      s.scene.commit(execution);
      s.scene.set_transform(s.ids[1], s.meshes[1].transform);
      s.scene.commit(execution);
      ShadowScene fresh;
      fresh.extend(frame_light());
      for (const OwnedMesh& mesh : s.meshes) fresh.add_mesh(mesh.view());
      fresh.commit(execution);
      Workspace other;
      for (const ShadowScene* scene : {&s.scene, &fresh}) {
        const Solved solved = solve(solver, *scene, ground.view(), lights, other, execution);
        CHECK(solved.masks == expected.masks);
        CHECK(solved.irradiance == expected.irradiance);
      }
      CHECK(watch.workers == 0);
    });
  }
}

TEST_CASE("a host loop that leaves bodies out is found out, and what it throws comes through") {
  const EmbedScene s(6);
  const Ground ground(40);
  const Light light = frame_light();
  const ShadowSolver solver({.light_sample_count = 16});
  Workspace workspace;
  const Solved expected = solve(solver, s.scene, ground.view(), {&light, 1}, workspace);
  Execution lazy = host_execution();
  lazy.parallel_for = [](std::size_t count, TaskBody body) {
    for (std::size_t i = 1; i < count; ++i) body(i);
  };
  CHECK_THROWS_AS(solve(solver, s.scene, ground.view(), {&light, 1}, workspace, lazy), Error);
  Execution broken = host_execution();
  broken.parallel_for = [](std::size_t, TaskBody) { throw 7; };
  CHECK_THROWS_AS(solve(solver, s.scene, ground.view(), {&light, 1}, workspace, broken), int);
  Execution none;
  none.executor = Executor::kHost;
  CHECK_THROWS_AS(solve(solver, s.scene, ground.view(), {&light, 1}, workspace, none), Error);
  CHECK(solve(solver, s.scene, ground.view(), {&light, 1}, workspace).masks == expected.masks);
}

TEST_CASE("a workspace that is in use is refused") {
  const EmbedScene s(6);
  const Ground ground(40);
  const Light light = frame_light();
  const ShadowSolver solver({.light_sample_count = 16});
  Workspace workspace;
  int refused = 0;
  Execution execution;
  execution.progress = [&](double) {
    try {
      solve(solver, s.scene, ground.view(), {&light, 1}, workspace);
    } catch (const Error& error) {
      refused += error.code() == ErrorCode::kUsage;
    }
    return true;
  };
  solve(solver, s.scene, ground.view(), {&light, 1}, workspace, execution);
  CHECK(refused > 0);
}

TEST_CASE("the callback is called on the calling thread alone, with growing shares") {
  EmbedScene s(48);
  const Ground ground(60);
  const std::vector<Light> lights(3, frame_light());
  const ShadowSolver solver({.light_sample_count = 64});
  for (const Executor which : kExecutors) {
    Workspace workspace;
    std::set<std::thread::id> threads;
    std::vector<double> shares;
    Execution execution = executor(which);
    execution.progress = [&](double done) {
      threads.insert(std::this_thread::get_id());
      shares.push_back(done);
      return true;
    };
    solve(solver, s.scene, ground.view(), lights, workspace, execution);
    CHECK(threads == std::set{std::this_thread::get_id()});
    CHECK(shares.size() > 3);
    CHECK(std::is_sorted(shares.begin(), shares.end()));
    CHECK(shares.back() <= 1.0);
    CHECK(shares.back() > 0.6);
  }
}

TEST_CASE("work stays in the caller's arena, with no more threads than it has") {
  const tbb::global_control more(tbb::global_control::max_allowed_parallelism, 8);
  const Ground ground(48);
  const Light light = frame_light();
  const std::vector<OwnedMesh> meshes = embed_meshes(24);
  std::thread host([&] {  // with an arena around it that nobody has worked in yet
    const ArenaWatch around;
    tbb::task_arena arena(2);
    const ArenaWatch watch(arena);
    arena.execute([&] {
      const ShadowSolver solver({.light_sample_count = 64});
      for (int round = 0; round < 100 && (round < 3 || watch.workers == 0); ++round) {
        EmbedScene s(meshes);
        static_cast<void>(solve(solver, s.scene, ground.view(), light));
        GBuffer gbuffer;
        rasterize(s.scene, {.eye = {0, 3, 6}, .target = {0, 0.5, 0}}, {}, gbuffer);
      }
    });
    CHECK(watch.workers > 0);  // or there was nothing to see
    CHECK(watch.most == 2);
    CHECK(around.workers == 0);
  });
  host.join();
}
