// Stability case S43: a call that is stopped, by its callback or by memory that ran out, leaves everything usable.
#include <doctest/doctest.h>

#include <ctime>
#include <memory>
#include <thread>

#include "halfshade/c_api.h"
#include "rasterizer/scenes/scene_stream.h"
#include "support/counted_new.h"
#include "support/embed_scene.h"
#include "support/host_loop.h"
#include "support/sanitized.h"

using namespace halfshade;
using namespace halfshade::test;

namespace {

/// What a host throws from its callback.
struct HostSays {
  int tick;
};

double cpu_ms() { return 1000.0 * static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

/// Asks `call` to stop at a tick, by returning false or by throwing. How it ended: 0 = was done before, 1 = stopped.
/// `latency` gets the processor time, of all threads, from the callback's answer to the end of the call.
template <class Call>
int stop_at(int tick, bool by_throwing, Executor executor, const Call& call, double& latency) {
  Execution execution = executor == Executor::kHost ? host_execution() : Execution{executor};
  int ticks = 0, answers = 0;
  double asked = 0.0;
  execution.progress = [&](double) {
    if (ticks++ < tick) return true;
    ++answers;
    asked = cpu_ms();
    if (by_throwing) throw HostSays{tick};
    return false;
  };
  int stopped = 0;
  try {
    call(execution);
  } catch (const HostSays& says) {
    stopped = by_throwing && says.tick == tick ? 1 : 2;
  } catch (const Error& error) {
    stopped = !by_throwing && error.code() == ErrorCode::kCancelled ? 1 : 2;
  }
  CHECK(answers == (stopped != 0 ? 1 : 0));
  latency = stopped != 0 ? cpu_ms() - asked : 0.0;
  return stopped;
}

/// Ticks of a whole run.
template <class Call>
int ticks_of(const Call& call) {
  int ticks = 0;
  Execution execution;
  execution.progress = [&](double) { return ++ticks > 0; };
  call(execution);
  return ticks;
}

/// Stops first commits and solves of a scene of about `rings`^2 * 8 triangles at `stops` random ticks each.
void stop_at_random(std::uint32_t rings, std::uint32_t side, int stops) {
  const Ground ground(side);
  const Light light = frame_light();
  const ShadowSolver solver({.light_sample_count = 64});
  const OwnedMesh large = ball({0.0, 1.2, 0.0}, 0.9, rings), small = ball({0, 0, 0}, 0.3, 8);
  const auto make = [&] {
    ShadowScene scene;
    scene.extend(light);
    scene.extend(PointView(ground.positions));
    scene.add_mesh(large.view());
    scene.add_mesh(small.view());
    return scene;
  };
  ShadowScene whole = make();
  const int commit_ticks = ticks_of([&](const Execution& e) { whole.commit(e); });
  Workspace workspace;
  Solved expected;
  const int solve_ticks = ticks_of([&](const Execution& e) {
    expected = solve(solver, whole, ground.view(), {&light, 1}, workspace, e);
  });
  REQUIRE(blocked_bits(expected.masks) > 1000);
  constexpr Executor kExecutors[] = {Executor::kArena, Executor::kSerial, Executor::kHost};
  Random random(43);
  int stopped_commits = 0, stopped_solves = 0;
  double worst = 0.0;
  for (int i = 0; i < stops; ++i) {
    CAPTURE(i);
    const Executor executor = kExecutors[i % 3];
    double latency = 0.0;
    ShadowScene scene = make();
    const int tick = static_cast<int>(random.uniform(0.0, commit_ticks));
    const int how = stop_at(
        tick, i % 2 == 0, executor, [&](const Execution& e) { scene.commit(e); }, latency);
    CHECK(how < 2);
    CHECK(scene.committed() == (how == 0));
    stopped_commits += how, worst = std::max(worst, latency);
    scene.commit();
    Workspace fresh;
    const int at = static_cast<int>(random.uniform(0.0, solve_ticks));
    const int end = stop_at(
        at, i % 4 < 2, executor,
        [&](const Execution& e) {
          solve(solver, scene, ground.view(), {&light, 1}, fresh, e);
        },
        latency);
    CHECK(end < 2);
    stopped_solves += end, worst = std::max(worst, latency);
    CHECK(solve(solver, scene, ground.view(), {&light, 1}, fresh).masks == expected.masks);
    CHECK(solve(solver, whole, ground.view(), {&light, 1}, workspace).masks == expected.masks);
  }
  MESSAGE("ticks: commit ", commit_ticks, ", solve ", solve_ticks, "; stopped: ", stopped_commits, ", ", stopped_solves,
          "; worst: ", worst, " ms of processor time");
  CHECK(stopped_commits > stops / 4);
  CHECK(stopped_solves > stops / 4);
  CHECK(worst <= 100.0);
}

/// Runs `call` on this thread; the host must be asked every 100 ms of processor time, from the start to the end: for so
/// long nobody can stop the call.
template <class Call>
void check_silence(const std::string& what, const Call& call) {
  double last = cpu_ms(), longest = 0.0;
  const auto heard = [&] {
    const double now = cpu_ms();
    longest = std::max(longest, now - last);
    last = now;
    return true;
  };
  Execution execution{Executor::kSerial};
  execution.progress = [&](double) { return heard(); };
  call(execution);
  heard();
  MESSAGE(what, ": longest silence ", longest, " ms");
  CHECK((longest <= 100.0 || kSanitized));
}

/// From an empty scene to a picture, of `rings`^2 * 4 triangles.
void check_silences(std::uint32_t rings) {
  const Ground ground(64);
  const Light light = frame_light();
  const ShadowSolver solver({.light_sample_count = 64});
  ShadowScene scene;
  scene.extend(light);
  scene.extend(PointView(ground.positions));
  const std::uint32_t mesh = scene.add_mesh(ball({0.0, 1.2, 0.0}, 0.9, rings).view());
  Workspace workspace;
  const auto solve_all = [&](const Execution& e) { solve(solver, scene, ground.view(), {&light, 1}, workspace, e); };
  check_silence("first commit", [&](const Execution& e) { scene.commit(e); });
  check_silence("first solve", solve_all);
  check_silence("second solve", solve_all);
  scene.set_transform(mesh, turned(0.3, {0.1, 0.0, 0.0}));
  check_silence("second commit", [&](const Execution& e) { scene.commit(e); });
  check_silence("solve after it", solve_all);
  GBuffer gbuffer;
  RasterConfig config;
  config.width = config.height = 256;
  const Camera camera{.eye = {0, 3, 6}, .target = {0, 0.5, 0}};
  check_silence("rasterize", [&](const Execution& e) { rasterize(scene, camera, config, gbuffer, e); });
}

}  // namespace

TEST_CASE("S43: stopped at random ticks, by false or by an exception") { stop_at_random(40, 48, 100); }

TEST_CASE("S43_long: the same in a scene of a million triangles") { stop_at_random(500, 128, 12); }

TEST_CASE("S43: the host is asked every 100 ms in a scene of 250,000 triangles") { check_silences(250); }

TEST_CASE("S43_long: the host is asked every 100 ms in a scene of a million triangles") { check_silences(500); }

TEST_CASE("S43: a picture that was stopped leaves its G-buffer usable") {
  const EmbedScene s(24);
  const Camera camera{.eye = {0, 3, 6}, .target = {0, 0.5, 0}};
  RasterConfig config;
  config.width = config.height = 1024;
  GBuffer expected, gbuffer;
  rasterize(s.scene, camera, config, expected);
  const auto draw = [&](const Execution& e) { rasterize(s.scene, camera, config, gbuffer, e); };
  int stopped = 0;
  for (const Executor executor : {Executor::kSerial, Executor::kArena, Executor::kHost}) {
    for (const int tick : {0, 1, 3}) {
      double latency = 0.0;
      const int how = stop_at(tick, tick == 1, executor, draw, latency);
      CHECK(how < 2);
      stopped += how;
      CHECK(latency <= 100.0);
      // A picture or none: where the call stopped before it began to draw, the one from before.
      CHECK((gbuffer.size() == 0 ? gbuffer.width == 0 && gbuffer.drawn == DrawnState() && gbuffer.position.empty()
                                 : gbuffer.triangle == expected.triangle));
      draw({executor == Executor::kHost ? Executor::kSerial : executor});
      CHECK(gbuffer.triangle == expected.triangle);
    }
  }
  CHECK(stopped >= 3);
}

TEST_CASE("S43: a streamed solve that was stopped can be asked again") {
  const Ground ground(32);
  Random random(8);
  const auto scene = std::make_shared<const Scene>(scene_of(random_triangles(random, 20000, 0.1, 0.5, 2.0)));
  SceneStream stream = stream_of_scene(scene, 1000);
  ShadowConfig config{.light_sample_count = 64};
  VisibilityMasks expected, masks;
  const auto solve_stream = [&](VisibilityMasks& to) {
    solve_shadows(stream, receivers_at(ground.positions), frame_light(), config, StreamOptions{}, to);
  };
  int ticks = 0;
  config.progress = [&](double) { return ++ticks > 0; };
  solve_stream(expected);
  REQUIRE(ticks > 1);
  for (int tick = 0; tick < ticks; tick += std::max(1, ticks / 10)) {
    CAPTURE(tick);
    int at = 0;
    config.progress = [&](double) { return at++ < tick; };
    CHECK_THROWS_AS(solve_stream(masks), Error);
    config.progress = nullptr;
    solve_stream(masks);
    CHECK(masks.words == expected.words);
  }
}

TEST_CASE("S43: memory runs out at each of the first 500 allocations") {
  const Ground ground(24);
  const std::vector<Light> lights = {frame_light(), frame_light()};
  const ShadowSolver solver({.light_sample_count = 64, .sample_sets = 2});
  const OwnedMesh first = ball({0.3, 1.0, 0.0}, 0.5, 6), second = ball({-0.5, 1.2, 0.3}, 0.4, 5);
  std::vector<std::uint64_t> masks(ground.positions.size() * lights.size());
  std::vector<float> visibility(masks.size());
  const ShadowOutput output{.masks = masks, .visibility = visibility};

  // From the first mesh to the masks; what is finished is not done again.
  struct Host {
    ShadowScene scene;
    Workspace workspace;
    int done = 0;
  };
  const auto advance = [&](Host& host, const Execution& execution) {
    const std::array<std::function<void()>, 8> steps = {
        [&] { host.scene.extend(lights[0]); },
        [&] { host.scene.extend(PointView(ground.positions)); },
        [&] { host.scene.add_mesh(first.view()); },
        [&] { host.scene.add_mesh(second.view()); },
        [&] { host.scene.commit(execution); },
        [&] { solver.solve(host.scene, ground.view(), lights, host.workspace, output, execution); },
        [&] {
          host.scene.set_transform(1, moved_by({0.1, 0.2, 0.0}));
          host.scene.commit(execution);
        },
        [&] { solver.solve(host.scene, ground.view(), lights, host.workspace, output, execution); }};
    for (; host.done < static_cast<int>(steps.size()); ++host.done) steps[static_cast<std::size_t>(host.done)]();
  };
  for (const Executor executor : {Executor::kSerial, Executor::kArena}) {
    const Execution execution{executor};
    std::vector<std::uint64_t> expected;
    {
      Host host;
      advance(host, execution);
      expected = masks;
    }
    REQUIRE(blocked_bits(expected) > 1000);
    int failures = 0, kept = 0;  // kept: calls after which not as many bytes are live as before
    for (std::uint64_t n = 1; n <= 500; ++n) {
      CAPTURE(n);
      masks.assign(masks.size(), 0);
      const std::int64_t before = allocations_now().live;
      bool equal = false;
      std::string other;
      {
        std::optional<Host> host;
        fail_allocation(n);
        for (int attempt = 0; attempt < 2; ++attempt) {
          try {
            if (!host) host.emplace();
            advance(*host, execution);
            break;
          } catch (const std::bad_alloc&) {
            failures += attempt == 0;
            if (attempt == 1) other = "a second failure";
          } catch (const std::exception& error) {
            other = error.what();
          }
        }
        fail_allocation(0);
        equal = host.has_value() && host->done == 8 && masks == expected;
      }
      CHECK(equal);
      CHECK(other == "");
      kept += allocations_now().live != before;
    }
    MESSAGE(failures, " of 500 failed");
    CHECK(failures > 100);
    // TBB's threads keep a few bytes of their own, once each; what we lose we would lose at every failure.
    CHECK(kept <= (executor == Executor::kSerial ? 0 : 2 * static_cast<int>(std::thread::hardware_concurrency())));
  }
}

TEST_CASE("S43: memory that runs out in a C call is a status of it, and the call can be made again") {
  halfshade_context_desc serial = {};
  serial.struct_size = sizeof serial;
  serial.executor = HALFSHADE_EXECUTOR_SERIAL;
  halfshade_context* context = nullptr;
  halfshade_scene* scene = nullptr;
  halfshade_solver* solver = nullptr;
  REQUIRE(halfshade_context_create(&serial, &context) == HALFSHADE_OK);
  REQUIRE(halfshade_scene_create(context, nullptr, &scene) == HALFSHADE_OK);
  REQUIRE(halfshade_solver_create(context, nullptr, &solver) == HALFSHADE_OK);
  const OwnedMesh round = ball({0.0, 1.2, 0.0}, 0.9, 6);
  const Ground ground(16);
  halfshade_mesh_desc mesh = {};
  mesh.struct_size = sizeof mesh;
  mesh.positions = {round.positions.data(), round.positions.size(), 0, HALFSHADE_FLOAT64};
  mesh.triangles = {round.triangles[0].data(), round.triangles.size(), 0};
  mesh.alpha_map = HALFSHADE_NONE;
  for (int k = 0; k < 3; ++k) mesh.transform[k][k] = 1.0;
  REQUIRE(halfshade_scene_add_mesh(context, scene, &mesh, nullptr) == HALFSHADE_OK);
  halfshade_light light = {};
  light.struct_size = sizeof light;
  light.shape = HALFSHADE_LIGHT_RECTANGLE;
  light.center[1] = 3.0;
  light.u[0] = light.v[2] = 1.0;
  REQUIRE(halfshade_scene_extend_light(context, scene, &light) == HALFSHADE_OK);
  halfshade_receivers receivers = {};
  receivers.struct_size = sizeof receivers;
  receivers.positions = {ground.positions.data(), ground.positions.size(), 0, HALFSHADE_FLOAT64};
  receivers.frame = HALFSHADE_NONE;
  REQUIRE(halfshade_scene_extend_points(context, scene, &receivers.positions) == HALFSHADE_OK);
  REQUIRE(halfshade_scene_commit(context, scene) == HALFSHADE_OK);
  std::vector<float> visibility(ground.positions.size()), expected;
  halfshade_output output = {};
  output.struct_size = sizeof output;
  output.visibility = visibility.data();
  output.visibility_count = visibility.size();
  int failures = 0;
  for (std::uint64_t n = 0; n <= 200; ++n) {  // 0: none fails
    CAPTURE(n);
    halfshade_workspace* workspace = nullptr;
    REQUIRE(halfshade_workspace_create(context, nullptr, &workspace) == HALFSHADE_OK);
    const auto solve_all = [&] {
      return halfshade_solve(context, solver, scene, workspace, &receivers, &light, 1, &output);
    };
    fail_allocation(n);
    const halfshade_status status = solve_all();
    const bool failed = n != 0 && allocation_failed();
    fail_allocation(0);
    failures += failed;
    CHECK(status == (failed ? HALFSHADE_ERROR_OUT_OF_MEMORY : HALFSHADE_OK));
    if (failed) CHECK(std::string(halfshade_last_error(context)) != "");
    CHECK(solve_all() == HALFSHADE_OK);
    if (n == 0) expected = visibility;
    CHECK(visibility == expected);
    halfshade_workspace_destroy(&workspace);
  }
  CHECK(failures > 20);
  CHECK(std::count(expected.begin(), expected.end(), 1.0f) < std::ssize(expected));
  halfshade_solver_destroy(&solver);
  halfshade_scene_destroy(&scene);
  halfshade_context_destroy(&context);
}
