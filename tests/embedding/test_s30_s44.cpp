// Stability cases S30 (hostile floating-point environment) and S44 (nested pools).
#include <doctest/doctest.h>

#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <tbb/task_scheduler_observer.h>

#include <condition_variable>
#include <future>
#include <map>
#include <mutex>
#include <thread>

#if defined(__SSE2__)
#include <xmmintrin.h>
#endif

#include "support/embed_scene.h"
#include "support/host_loop.h"

using namespace halfshade;
using namespace halfshade::test;

#if defined(__SSE2__)
namespace {

constexpr unsigned kModes[] = {
    0x1f80u | 0x8040u,           // flush to zero, denormals are zero
    0x1f80u | 0x4000u,           // upward
    0x1f80u | 0x8040u | 0x2000u  // both kinds, downward
};

/// What the calls below are given; made in the default environment.
struct Input {
  std::vector<OwnedMesh> meshes = embed_meshes(10);
  Transform transform = turned(0.37, {0.31, 1.1, 0.17});
  Ground ground{24};
  Light light = frame_light(), sun;
  Scene scene = scene_of(box({-0.5, 1, -0.5}, {0.5, 2, 0.5}));
  Camera camera{.eye = {0, 3, 6}, .target = {0, 0.5, 0}};
  std::vector<dvec3> aside = {dvec3(5.3, 7.1, 6.4), dvec3(7.9, 7.7, 6.6)};

  Input() {
    light.emission_image = {"thirds", 3, 1, {vec3(0.1f, 0.3f, 0.7f), vec3(1.0f / 3.0f), vec3(0.9f, 0.0f, 1e-39f)}};
    sun.shape = LightShape::kSun, sun.normal = {0.3, -0.7, 0.1};
  }
};

/// Everything an embedding program calls, from the very first mesh on.
struct Everything {
  Solved solved;
  std::vector<std::uint32_t> triangles;
  std::vector<dvec3> places;  // the sun's, and two in a scene
  std::vector<vec3> colors;
  std::string hash;

  Everything(const Input& input, const Execution& execution) {
    EmbedScene s(input.meshes, execution);
    s.scene.set_transform(s.ids[1], input.transform);
    s.scene.commit(execution);
    const ShadowSolver solver({.light_sample_count = 64, .sample_sets = 2});
    Workspace workspace;
    solved = solve(solver, s.scene, input.ground.view(), {&input.light, 1}, workspace, execution);
    GBuffer gbuffer;
    RasterConfig raster;
    raster.width = raster.height = 50;
    rasterize(s.scene, input.camera, raster, gbuffer, execution);
    triangles = gbuffer.triangle;
    const Light sun = place_sun(input.sun, {-3, 0, -3}, {3, 2.1, 3});
    ShadowScene aside;
    aside.extend(PointView(input.aside));
    aside.commit(execution);
    places = {sun.center, sun.normal, dvec3(sun.radius), aside.to_world({0.1, 0.3, 0.7}),
              aside.to_world({-0.1, 0.2, 0.9})};
    const std::vector<vec3> weights = sample_emission(input.light, solver.config());
    colors = weights;
    for (const std::uint64_t& mask : solved.masks) {
      colors.push_back(weighted_visibility({&mask, 1}, std::span(weights).first(64)));
    }
    VisibilityMasks masks;
    solve_shadows(input.scene, receivers_at(input.ground.positions), input.light, {.light_sample_count = 64}, masks);
    hash = masks.hash();
  }
  bool operator==(const Everything& o) const {
    return solved.masks == o.solved.masks && solved.irradiance == o.solved.irradiance && triangles == o.triangles &&
           places == o.places && colors == o.colors && hash == o.hash;
  }
};

}  // namespace

namespace {

/// A host whose threads run in `mode`; counts the bodies that changed it.
Execution host_in_mode(unsigned mode, std::atomic<int>& changed) {
  Execution host = host_execution();
  host.parallel_for = [mode, &changed](std::size_t count, TaskBody body) {
    const auto in_mode = [&](std::size_t i) {
      _mm_setcsr(mode);
      body(i);
      changed += (_mm_getcsr() & ~0x3fu) != mode;
    };
    const auto call = [](const void* context, std::size_t i) { (*static_cast<const decltype(in_mode)*>(context))(i); };
    run_on_threads(3, count, TaskBody(call, &in_mode));
  };
  return host;
}

}  // namespace

TEST_CASE("S30: flush-to-zero and directed rounding around a call change no bit and are there again after it") {
  const Input input;
  const Everything expected(input, {});
  REQUIRE(blocked_bits(expected.solved.masks) > 1000);
  const unsigned before = _mm_getcsr();
  for (const unsigned mode : kModes) {
    CAPTURE(mode);
    std::atomic<int> changed{0};
    for (const Execution& execution : {Execution{}, Execution{Executor::kSerial}, host_in_mode(mode, changed)}) {
      _mm_setcsr(mode);
      const Everything now(input, execution);
      const unsigned after = _mm_getcsr();
      _mm_setcsr(before);
      CHECK((now == expected));
      CHECK((after & ~0x3fu) == mode);  // the lowest bits note what happened
    }
    CHECK(changed == 0);
  }
}
#endif

namespace {

/// How many threads were at work at once; one that is at two pieces of work, nested, counts once.
class ThreadsAtWork {
 public:
  void enter() {
    const std::lock_guard lock(mutex_);
    ++depth_[std::this_thread::get_id()];
    most_ = std::max(most_, depth_.size());
  }
  void leave() {
    const std::lock_guard lock(mutex_);
    const auto at = depth_.find(std::this_thread::get_id());
    if (--at->second == 0) depth_.erase(at);
  }
  std::size_t most() const { return most_; }

 private:
  std::mutex mutex_;
  std::map<std::thread::id, int> depth_;
  std::size_t most_ = 0;
};

/// Those of an arena, whoever's loops they run.
class ThreadsOfArena : public tbb::task_scheduler_observer {
 public:
  explicit ThreadsOfArena(tbb::task_arena& arena) : task_scheduler_observer(arena) { observe(true); }
  ~ThreadsOfArena() override { observe(false); }
  void on_scheduler_entry(bool) override { threads_.enter(); }
  void on_scheduler_exit(bool) override { threads_.leave(); }
  std::size_t most() const { return threads_.most(); }

 private:
  ThreadsAtWork threads_;
};

/// `threads` host threads, each with loops of its own around our calls, `rounds` times.
void nest_pools(std::size_t threads, int rounds) {
  constexpr std::size_t kMostThreads = 8, kOfArena = 2;
  const tbb::global_control more(tbb::global_control::max_allowed_parallelism, kMostThreads);
  EmbedScene s(16);
  const Ground ground(32);
  const Light light = frame_light();
  const ShadowSolver solver({.light_sample_count = 64});
  const std::vector<std::uint64_t> expected = solve(solver, s.scene, ground.view(), light).masks;
  std::atomic<int> wrong{0}, solved{0}, crowded{0};
  ThreadsAtWork at_work;
  const auto host_thread = [&] {
    for (int round = 0; round < rounds; ++round) {
      tbb::parallel_for(0, 4, [&](int) {
        at_work.enter();
        Workspace workspace;
        tbb::parallel_for(
            0, 2, [&](int) {}, tbb::simple_partitioner());
        const Solved result = solve(solver, s.scene, ground.view(), {&light, 1}, workspace);
        wrong += result.masks != expected;
        ++solved;
        at_work.leave();
      });
      // The same from inside an arena of its own, with a workspace that the thread keeps.
      thread_local Workspace kept;
      tbb::task_arena arena(static_cast<int>(kOfArena));
      arena.initialize();
      const ThreadsOfArena in_arena(arena);
      arena.execute([&] {
        wrong += solve(solver, s.scene, ground.view(), {&light, 1}, kept).masks != expected;
        ++solved;
      });
      crowded += in_arena.most() > kOfArena || in_arena.most() < 1;
    }
  };
  std::vector<std::future<void>> running;
  for (std::size_t t = 0; t < threads; ++t) running.push_back(std::async(std::launch::async, host_thread));
  for (std::future<void>& thread : running) thread.get();
  CHECK(wrong == 0);
  CHECK(solved == static_cast<int>(threads) * rounds * 5);
  CHECK(crowded == 0);
  // The host's own, and the workers that may be beside one of them.
  CHECK(at_work.most() <= threads + kMostThreads - 1);
}

}  // namespace

// A deadlock ends in the time limit of the test.
TEST_CASE("S44: eight host threads, each with parallel loops around our parallel calls") { nest_pools(8, 3); }

TEST_CASE("S44_long: the same, a hundred rounds") { nest_pools(8, 100); }

TEST_CASE("S44: a loop of the host that is cancelled does not cut our call short") {
  EmbedScene s(16);
  const Ground ground(32);
  const Light light = frame_light();
  const ShadowSolver solver({.light_sample_count = 64});
  const std::vector<std::uint64_t> expected = solve(solver, s.scene, ground.view(), light).masks;
  for (int round = 0; round < 10; ++round) {
    tbb::task_group_context context;
    std::atomic<int> wrong{0}, solved{0};
    tbb::parallel_for(
        0, 16,
        [&](int i) {
          Workspace workspace;
          if (i == round) context.cancel_group_execution();
          const Solved result = solve(solver, s.scene, ground.view(), {&light, 1}, workspace);
          wrong += result.masks != expected;
          ++solved;
        },
        tbb::simple_partitioner(), context);
    CHECK(wrong == 0);
    CHECK(solved > 0);
  }
}
