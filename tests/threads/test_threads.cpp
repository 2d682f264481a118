// Several threads in one solve, several solves at once, and solves that are stopped: the same bits, and nothing for a
// thread sanitizer to find (.ci/tsan runs this).
#include <atomic>
#include <thread>

#include <doctest/doctest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include "halfshade/shadow_solver.h"
#include "rasterizer/rasterizer.h"
#include "rasterizer/scenes/builtin.h"
#include "support/lit_scene.h"

namespace halfshade {
namespace {

using test::Random;

struct Work {
  Scene scene;
  std::vector<Receiver> receivers;
  ShadowConfig config;
};

/// Enough triangles and receivers that every loop has several pieces; a third of the triangles perforated, and a closed
/// box among them, so that alpha lookups, certificates and silhouettes have something to do.
Work make_work() {
  Work w;
  Random random(7);
  w.scene = test::scene_of(
      test::joined(test::box({-1.0, 1.0, -1.0}, {0.5, 2.0, 0.5}), test::random_triangles(random, 600, 0.4)));
  w.scene.materials.emplace_back().alpha_map = 0;
  w.scene.alpha_maps.push_back({"a", 2, 2, {255, 0, 0, 255}});
  for (std::size_t t = 0; t < w.scene.triangles.size(); ++t) {
    w.scene.triangle_uvs.push_back({vec2(0, 0), vec2(3, 0), vec2(0, 3)});
    w.scene.triangle_materials[t] = t % 3 == 2 && t > 12;
  }
  w.receivers = test::receivers_at(test::random_points(random, 3000, -4.0, 3.0));
  w.config = test::frame_config(64);
  return w;
}

template <class Call>
void in_arena(int threads, const Call& call) {
  tbb::task_arena arena(threads);
  arena.execute(call);
}

std::vector<ShadowMethod> methods_with_masks() {
  std::vector<ShadowMethod> methods = test::exact_methods();
  methods.push_back(ShadowMethod::kAliasFreeLookupTable);
  methods.push_back(ShadowMethod::kShadowMapPerSample);
  return methods;
}

// More threads than processors, where there are few.
struct Threads {
  tbb::global_control most{tbb::global_control::max_allowed_parallelism, 4};
};

TEST_CASE("threads: methods with masks give the same bits in arenas of 1 and 4 threads") {
  const Threads threads;
  const Work w = make_work();
  for (const ShadowMethod method : methods_with_masks()) {
    CAPTURE(traits_of(method).name);
    VisibilityMasks one, four;
    in_arena(1, [&] { one = test::solve(w.scene, w.receivers, test::frame_light(), w.config, method); });
    in_arena(4, [&] { four = test::solve(w.scene, w.receivers, test::frame_light(), w.config, method); });
    CHECK(one.words == four.words);
  }
}

TEST_CASE("threads: methods without masks give the same visibility in arenas of 1 and 4 threads") {
  const Threads threads;
  Work w = make_work();
  w.config.shadow_map.resolution = 256;
  for (const MethodTraits& method : shadow_methods()) {
    if (method.masks) continue;
    CAPTURE(method.name);
    w.config.method = method.method;
    std::vector<float> one, four;
    in_arena(1, [&] { solve_visibility(w.scene, w.receivers, test::frame_light(), w.config, one); });
    in_arena(4, [&] { solve_visibility(w.scene, w.receivers, test::frame_light(), w.config, four); });
    CHECK(one == four);
  }
}

TEST_CASE("threads: the rasterizer gives the same picture in arenas of 1 and 4 threads") {
  const Threads threads;
  const BuiltinScene built = make_builtin_scene("fence");
  const LatticeMesh mesh = make_lattice_mesh(built.scene, make_local_frame(built.scene.positions, {}));
  GBuffer one, four;
  RasterConfig config;
  config.width = 160, config.height = 120;
  in_arena(1, [&] { rasterize(mesh, built.view.camera, config, one); });
  in_arena(4, [&] { rasterize(mesh, built.view.camera, config, four); });
  CHECK(one.triangle == four.triangle);
  CHECK(one.depth == four.depth);
}

TEST_CASE("threads: solves of one scene at the same time do not see each other") {
  const Threads threads;
  const Work w = make_work();
  const auto methods = methods_with_masks();
  std::vector<VisibilityMasks> alone, together(methods.size() * 2);
  for (const ShadowMethod method : methods) {
    alone.push_back(test::solve(w.scene, w.receivers, test::frame_light(), w.config, method));
  }
  std::vector<std::thread> hosts;
  for (std::size_t i = 0; i < together.size(); ++i) {
    hosts.emplace_back([&, i] {
      in_arena(2, [&] {
        together[i] = test::solve(w.scene, w.receivers, test::frame_light(), w.config, methods[i % methods.size()]);
      });
    });
  }
  for (std::thread& host : hosts) host.join();
  for (std::size_t i = 0; i < together.size(); ++i) CHECK(together[i].words == alone[i % methods.size()].words);
}

TEST_CASE("threads: progress is reported on the calling thread; a solve that is stopped leaves nothing behind") {
  const Threads threads;
  const Work w = make_work();
  for (const ShadowMethod method : test::exact_methods()) {
    CAPTURE(traits_of(method).name);
    const auto whole = test::solve(w.scene, w.receivers, test::frame_light(), w.config, method);
    ShadowConfig config = w.config;
    config.method = method;
    std::atomic<int> reports = 0, elsewhere = 0;
    const auto caller = std::this_thread::get_id();
    int allowed = 1 << 30;
    config.progress = [&](double) {
      if (std::this_thread::get_id() != caller) ++elsewhere;
      return ++reports <= allowed;
    };
    VisibilityMasks masks;
    solve_shadows(w.scene, w.receivers, test::frame_light(), config, masks);
    CHECK(elsewhere == 0);
    CHECK(reports > 0);
    const int all = reports;
    for (const int stop : {0, all / 2}) {
      reports = 0, allowed = stop;
      bool stopped = false;
      try {
        solve_shadows(w.scene, w.receivers, test::frame_light(), config, masks);
      } catch (const Error& error) {
        stopped = error.code() == ErrorCode::kCancelled;
      }
      // Most questions come by the clock, so this run may ask fewer than the one before.
      CHECK(stopped == (reports > stop));
      if (stop == 0) CHECK(stopped);
    }
    reports = 0, allowed = 1 << 30;
    solve_shadows(w.scene, w.receivers, test::frame_light(), config, masks);
    CHECK(masks.words == whole.words);
  }
}

/// The loops of a host that has no TBB: threads of its own, made anew for every loop.
void host_loop(std::size_t count, TaskBody body) {
  std::atomic<std::size_t> next = 0;
  const auto run = [&] {
    for (std::size_t i = next++; i < count; i = next++) body(i);
  };
  std::vector<std::thread> helpers;
  for (std::size_t k = 1; k < std::min<std::size_t>(count, 3); ++k) helpers.emplace_back(run);
  run();
  for (std::thread& helper : helpers) helper.join();
}

Execution host() {
  Execution execution;
  execution.executor = Executor::kHost;
  execution.parallel_for = host_loop;
  execution.concurrency = 3;
  return execution;
}

Execution serial() {
  Execution execution;
  execution.executor = Executor::kSerial;
  return execution;
}

/// The same work through the embedding interface.
struct Embedded {
  ShadowScene scene;
  std::vector<dvec3> points;

  explicit Embedded(const Execution& execution) {
    Work w = make_work();
    MeshView mesh;
    mesh.positions = w.scene.positions;
    mesh.triangles = w.scene.triangles;
    scene.add_mesh(mesh);
    for (const Receiver& r : w.receivers) points.push_back(r.position_world);
    scene.extend(points);
    scene.extend(test::frame_light());
    scene.commit(execution);
  }

  std::vector<std::uint64_t> masks(ShadowMethod method, Workspace& workspace, const Execution& execution) const {
    ShadowConfig config = test::frame_config(64);
    config.method = method;
    const ShadowSolver solver(config);
    std::vector<std::uint64_t> words(points.size() * solver.mask_words(test::frame_light()));
    ReceiverView receivers;
    receivers.positions = points;
    ShadowOutput output;
    output.masks = words;
    solver.solve(scene, receivers, test::frame_light(), workspace, output, execution);
    return words;
  }
};

TEST_CASE("host threads: a host's own threads give the bits of a single one") {
  const Embedded alone(serial()), threaded(host());
  for (const ShadowMethod method : test::exact_methods()) {
    CAPTURE(traits_of(method).name);
    Workspace one, several;
    const auto expected = alone.masks(method, one, serial());
    CHECK(threaded.masks(method, several, host()) == expected);
    CHECK(threaded.masks(method, several, host()) == expected);  // with what the workspace kept
  }
}

TEST_CASE("host threads: several threads ask one scene, each with a workspace of its own") {
  const Embedded embedded(host());
  const auto& methods = test::exact_methods();
  std::vector<std::vector<std::uint64_t>> alone, together(methods.size() * 2);
  for (const ShadowMethod method : methods) {
    Workspace workspace;
    alone.push_back(embedded.masks(method, workspace, serial()));
  }
  std::vector<std::thread> askers;
  for (std::size_t i = 0; i < together.size(); ++i) {
    askers.emplace_back([&, i] {
      Workspace workspace;
      together[i] = embedded.masks(methods[i % methods.size()], workspace, i % 2 == 0 ? host() : serial());
    });
  }
  for (std::thread& asker : askers) asker.join();
  for (std::size_t i = 0; i < together.size(); ++i) CHECK(together[i] == alone[i % methods.size()]);
}

TEST_CASE("host threads: a call that is stopped leaves scene and workspace usable") {
  const Embedded embedded(host());
  for (const ShadowMethod method : test::exact_methods()) {
    CAPTURE(traits_of(method).name);
    Workspace workspace, other;
    Execution stopped = host();
    int reports = 0;
    stopped.progress = [&](double) { return ++reports < 2; };
    try {
      embedded.masks(method, workspace, stopped);
      CHECK(reports < 2);  // over before it could be stopped
    } catch (const Error& error) {
      CHECK(error.code() == ErrorCode::kCancelled);
    }
    CHECK(embedded.masks(method, workspace, host()) == embedded.masks(method, other, serial()));
  }
}

}  // namespace
}  // namespace halfshade
