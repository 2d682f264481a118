#include "rasterizer/core/parallel.h"

#include <atomic>
#include <exception>
#include <mutex>
#include <string>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <tbb/task_arena.h>

namespace halfshade {
namespace {

using Range = tbb::blocked_range<std::size_t>;

Executor current_executor(const Run* run) { return run != nullptr ? run->execution().executor : Executor::kArena; }

/// What every piece of work runs in.
class TaskScope {
 public:
  explicit TaskScope(Run* run) : run_(run) {
    if (run != nullptr && run->watched()) run->check();
  }

 private:
  RunScope run_;
  FpEnvironment environment_;
};

/// TBB loops are not stopped by what happens to loops of the host around them: a call returns with all of its work done
/// or throws.
template <class Loop>
void in_own_context(const Loop& loop) {
  tbb::task_group_context context(tbb::task_group_context::isolated);
  loop(context);
}

}  // namespace

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
  FunctionRef<void(std::size_t)> body;
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

/// body(i) for i in [0, count) in the host's loop. An exception of a body is thrown again here, once the loop is over.
/// Throws Error{kUsage} where the host left some out.
void host_loop(Run& run, std::size_t count, FunctionRef<void(std::size_t)> body) {
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

}  // namespace

void parallel_tasks(std::size_t count, FunctionRef<void(std::size_t)> body) {
  Run* const run = current_run();
  const auto task = [&](std::size_t i) {
    const TaskScope scope(run);
    body(i);
  };
  if (count <= 1 || current_executor(run) == Executor::kSerial) {
    for (std::size_t i = 0; i != count; ++i) task(i);
  } else if (current_executor(run) == Executor::kHost) {
    host_loop(*run, count, task);
  } else {
    in_own_context([&](tbb::task_group_context& context) {
      tbb::parallel_for(
          Range(0, count, 1),
          [&](const Range& range) {
            for (std::size_t i = range.begin(); i != range.end(); ++i) task(i);
          },
          tbb::simple_partitioner(), context);
    });
  }
}

void parallel_ranges(std::size_t count, std::size_t grain, FunctionRef<void(std::size_t, std::size_t)> body) {
  Run* const run = current_run();
  // Where somebody may stop the call, long pieces are cut into short ones.
  const auto piece = [&](std::size_t begin, std::size_t end) {
    const std::size_t step = run != nullptr && run->watched() ? grain : end - begin;
    for (; begin < end; begin += std::min(step, end - begin)) {
      const TaskScope scope(run);
      body(begin, begin + std::min(step, end - begin));
    }
  };
  if (count <= grain || current_executor(run) == Executor::kSerial) {
    piece(0, count);
  } else if (current_executor(run) == Executor::kHost) {
    const std::size_t pieces = std::min((count + grain - 1) / grain, 4 * concurrency());
    parallel_tasks(pieces, [&](std::size_t i) { piece(count * i / pieces, count * (i + 1) / pieces); });
  } else {
    in_own_context([&](tbb::task_group_context& context) {
      tbb::parallel_for(
          Range(0, count, grain), [&](const Range& range) { piece(range.begin(), range.end()); },
          tbb::auto_partitioner(), context);
    });
  }
}

void parallel_pair(FunctionRef<void()> first, FunctionRef<void()> second) {
  Run* const run = current_run();
  if (current_executor(run) != Executor::kArena) {
    parallel_tasks(2, [&](std::size_t i) { i == 0 ? first() : second(); });
    return;
  }
  const auto guarded = [run](FunctionRef<void()> body) {
    return [body, run] {
      const TaskScope scope(run);
      body();
    };
  };
  in_own_context(
      [&](tbb::task_group_context& context) { tbb::parallel_invoke(guarded(first), guarded(second), context); });
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

void run_call(const Execution& execution, FunctionRef<void()> body) {
  const FpEnvironment environment;
  Run run(execution);
  const RunScope scope(&run);
  try {
    if (execution.executor == Executor::kArena) {
      tbb::this_task_arena::isolate([&] { body(); });
    } else {
      body();
    }
  } catch (...) {
    if (run.host_exception()) std::rethrow_exception(run.host_exception());
    throw;
  }
}

}  // namespace halfshade
