// Three ways to say where the library's work runs: a TBB arena of the host, the calling thread alone, and the host's
// own thread pool. The bits are the same; exit code 1 if they were not.
#include <tbb/task_arena.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstdio>
#include <list>
#include <mutex>
#include <thread>

#include "halfshade/halfshade.h"

using namespace halfshade;

namespace {

/// The pool that a host may have: loops that are not finished yet, and threads that help with any of them. A loop may
/// be started from inside another one; whoever starts it works on it as well, so nobody waits for a free thread.
class HostPool {
 public:
  explicit HostPool(unsigned threads) {
    for (unsigned i = 0; i < threads; ++i) threads_.emplace_back([this] { help(); });
  }
  ~HostPool() {
    {
      const std::lock_guard lock(mutex_);
      stopping_ = true;
    }
    changed_.notify_all();
    for (std::thread& thread : threads_) thread.join();
  }

  void parallel_for(std::size_t count, const TaskBody& body) {
    std::unique_lock lock(mutex_);
    const auto loop = loops_.insert(loops_.end(), {body, count, 0, 0});
    changed_.notify_all();
    while (loop->next < loop->count) do_one(*loop, lock);
    changed_.wait(lock, [&] { return loop->finished == loop->count; });
    loops_.erase(loop);
  }

 private:
  struct Loop {
    TaskBody body;
    std::size_t count, next, finished;
  };

  /// The lock is held before and after, but not while the body runs.
  void do_one(Loop& loop, std::unique_lock<std::mutex>& lock) {
    const std::size_t index = loop.next++;
    lock.unlock();
    loop.body(index);
    lock.lock();
    if (++loop.finished == loop.count) changed_.notify_all();
  }

  Loop* unfinished() {
    for (Loop& loop : loops_) {
      if (loop.next < loop.count) return &loop;
    }
    return nullptr;
  }

  void help() {
    std::unique_lock lock(mutex_);
    while (!stopping_) {
      if (Loop* loop = unfinished()) {
        do_one(*loop, lock);
      } else {
        changed_.wait(lock);
      }
    }
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  std::list<Loop> loops_;
  bool stopping_ = false;
  std::vector<std::thread> threads_;
};

/// A field of 40 x 40 leaning blades.
void add_blades(ShadowScene& scene) {
  std::vector<vec3> corners;
  for (int i = 0; i < 40 * 40; ++i) {
    const vec3 foot(static_cast<float>(i % 40) * 0.2f - 4.0f, 0.0f, static_cast<float>(i / 40) * 0.2f - 4.0f);
    const float turn = 2.4f * static_cast<float>(i);  // near the golden angle: no two neighbours alike
    const vec3 along(0.08f * std::cos(turn), 0.0f, 0.08f * std::sin(turn));
    for (const vec3& corner : {foot - along, foot + along, foot + vec3(along.z, 0.9f, 0.1f)}) corners.push_back(corner);
  }
  MeshView blades;
  blades.positions = corners;
  scene.add_mesh(blades);
}

}  // namespace

int main() {
  ShadowScene scene;
  add_blades(scene);
  Light light;
  light.center = {1, 4, 0};
  light.u = {1.5, 0, 0};
  light.v = {0, 0, 1.5};
  std::vector<dvec3> floor;
  for (int i = 0; i < 256 * 256; ++i) floor.push_back({i % 256 / 32.0 - 4.0, 0.01, i / 256 / 32.0 - 4.0});
  scene.extend(light);
  scene.extend(floor);
  scene.commit();

  const ShadowSolver solver;
  ReceiverView receivers;
  receivers.positions = floor;
  Workspace workspace;
  VisibilityMasks masks;
  const auto solve = [&](const char* where, const Execution& execution) {
    masks.reset(floor.size(), solver.config().light_sample_count);
    ShadowOutput output;
    output.masks = masks.words;
    const auto start = std::chrono::steady_clock::now();
    solver.solve(scene, receivers, light, workspace, output, execution);
    const std::chrono::duration<double, std::milli> time = std::chrono::steady_clock::now() - start;
    std::printf("%-24s %8.1f ms  masks %s\n", where, time.count(), masks.hash().c_str());
    return masks.hash();
  };

  std::string in_arena;
  tbb::task_arena arena(2);
  arena.execute([&] { in_arena = solve("TBB arena of 2 threads", {}); });

  Execution alone;
  alone.executor = Executor::kSerial;
  const std::string serial = solve("calling thread alone", alone);

  HostPool pool(2);
  std::atomic<std::size_t> pieces = 0;
  Execution by_host;
  by_host.executor = Executor::kHost;
  by_host.concurrency = 3;  // two of the pool and the calling thread
  by_host.parallel_for = [&](std::size_t count, TaskBody body) {
    pieces += count;
    pool.parallel_for(count, body);
  };
  const std::string hosted = solve("the host's own pool", by_host);

  std::printf("the pool ran %zu pieces of work\n", pieces.load());
  return in_arena == serial && serial == hosted && pieces > 0 ? 0 : 1;
}
