#include "rasterizer/core/parallel.h"

#include <mutex>

namespace halfshade {

std::size_t concurrency() {
  const Run* run = current_run();
  switch (current_executor(run)) {
    case Executor::kSerial:
      return 1;
    case Executor::kHost:
      return run->execution().concurrency > 0 ? run->execution().concurrency : 8;
    default:
      return static_cast<std::size_t>(tbb::this_task_arena::max_concurrency());
  }
}

namespace {

/// Keeps exceptions out of the host's loop, and counts what was called.
struct GuardedLoop {
  TaskBody body;
  std::atomic<std::size_t> called{0};
  std::atomic<bool> failed{false};
  std::mutex mutex;
  std::exception_ptr exception;  // the first one

  void call(std::size_t i) {
    called.fetch_add(1, std::memory_order_relaxed);
    if (failed.load(std::memory_order_relaxed)) return;
    try {
      body(i);
    } catch (...) {
      const std::lock_guard lock(mutex);
      if (!exception) exception = std::current_exception();
      failed.store(true, std::memory_order_relaxed);
    }
  }
};

}  // namespace

void host_loop(Run& run, std::size_t count, TaskBody body) {
  GuardedLoop loop{body, {}, {}, {}, {}};
  const auto call = [](const void* context, std::size_t i) {
    static_cast<GuardedLoop*>(const_cast<void*>(context))->call(i);  // `loop` below, which is not const
  };
  {
    const RunScope none(nullptr);  // the host may do other things of its own meanwhile
    run.execution().parallel_for(count, TaskBody(call, &loop));
  }
  if (loop.exception) std::rethrow_exception(loop.exception);
  if (loop.called.load() == count) return;
  throw Error(ErrorCode::kUsage, "execution: parallel_for called " + std::to_string(loop.called.load()) + " of " +
                                     std::to_string(count) + " bodies");
}

void exclusive_scan(const std::vector<std::uint32_t>& counts, std::vector<std::uint32_t>& offsets) {
  constexpr std::size_t kBlock = 4096;
  const std::size_t count = counts.size(), blocks = (count + kBlock - 1) / kBlock;
  const auto end_of = [&](std::size_t block) { return std::min(count, (block + 1) * kBlock); };
  offsets.resize(count + 1);
  offsets[0] = 0;
  parallel_tasks(blocks, [&](std::size_t block) {
    std::uint32_t sum = 0;
    for (std::size_t i = block * kBlock; i != end_of(block); ++i) offsets[i + 1] = sum += counts[i];
  });
  for (std::size_t block = 1; block < blocks; ++block) offsets[end_of(block)] += offsets[block * kBlock];
  parallel_tasks(blocks, [&](std::size_t block) {
    if (block == 0) return;
    for (std::size_t i = block * kBlock; i + 1 < end_of(block); ++i) offsets[i + 1] += offsets[block * kBlock];
  });
}

}  // namespace halfshade
