// All threading goes through here: loops that run in the TBB arena of the calling thread, on that thread alone, or in
// the host's own loop, as the current call says (run.h). Every piece of work gets the floating-point environment that
// bit-exact results need, and is a place where the call can be stopped.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <vector>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <tbb/task_arena.h>

#include "rasterizer/core/fp_environment.h"
#include "rasterizer/core/run.h"

namespace halfshade {

/// About how many threads work for the current call.
std::size_t concurrency();

/// body(i) for i in [0, count) in the host's loop. An exception of a body is thrown again here, once the loop is over.
/// Throws Error{kUsage} where the host left some out.
void host_loop(Run& run, std::size_t count, TaskBody body);

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

inline Executor current_executor(const Run* run) {
  return run != nullptr ? run->execution().executor : Executor::kArena;
}

/// body(i) for every i in [0, count), each its own task: for pieces of work that are large and uneven.
template <class Body>
void parallel_tasks(std::size_t count, const Body& body) {
  Run* const run = current_run();
  const auto task = [&](std::size_t i) {
    const TaskScope scope(run);
    body(i);
  };
  if (count <= 1 || current_executor(run) == Executor::kSerial) {
    for (std::size_t i = 0; i != count; ++i) task(i);
  } else if (current_executor(run) == Executor::kHost) {
    const auto call = [](const void* context, std::size_t i) { (*static_cast<const decltype(task)*>(context))(i); };
    host_loop(*run, count, TaskBody(call, &task));
  } else {
    in_own_context([&](tbb::task_group_context& context) {
      tbb::parallel_for(
          tbb::blocked_range<std::size_t>(0, count, 1),
          [&](const tbb::blocked_range<std::size_t>& range) {
            for (std::size_t i = range.begin(); i != range.end(); ++i) task(i);
          },
          tbb::simple_partitioner(), context);
    });
  }
}

/// body(begin, end) over pieces of [0, count) of at least `grain` items (except the last).
template <class Body>
void parallel_ranges(std::size_t count, std::size_t grain, const Body& body) {
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
          tbb::blocked_range<std::size_t>(0, count, grain),
          [&](const tbb::blocked_range<std::size_t>& range) { piece(range.begin(), range.end()); },
          tbb::auto_partitioner(), context);
    });
  }
}

/// Both at once, for recursion.
template <class First, class Second>
void parallel_pair(const First& first, const Second& second) {
  Run* const run = current_run();
  if (current_executor(run) != Executor::kArena) {
    parallel_tasks(2, [&](std::size_t i) { i == 0 ? first() : second(); });
    return;
  }
  const auto guarded = [run](const auto& body) {
    return [&body, run] {
      const TaskScope scope(run);
      body();
    };
  };
  in_own_context(
      [&](tbb::task_group_context& context) { tbb::parallel_invoke(guarded(first), guarded(second), context); });
}

/// Sorts by a strict order that has no ties (equal results for any number of threads). `scratch` is resized to match.
template <class T, class Before>
void parallel_sort(std::vector<T>& values, std::vector<T>& scratch, const Before& before) {
  constexpr std::size_t kRun = 8192;  // sorted by one thread
  const std::size_t count = values.size();
  const auto at = [](std::vector<T>& v, std::size_t i) { return v.begin() + static_cast<std::ptrdiff_t>(i); };
  parallel_tasks((count + kRun - 1) / kRun, [&](std::size_t r) {
    std::sort(at(values, r * kRun), at(values, std::min(count, (r + 1) * kRun)), before);
  });
  if (count > kRun) scratch.resize(count);
  for (std::size_t width = kRun; width < count; width *= 2) {
    // Each task writes one part of the merged runs; binary search finds where its ends lie in the two halves.
    parallel_tasks((count + kRun - 1) / kRun, [&](std::size_t part) {
      const std::size_t first = part * kRun / (2 * width) * (2 * width);
      const auto left = at(values, first), middle = at(values, std::min(count, first + width)),
                 right = at(values, std::min(count, first + 2 * width));
      // How many of the first `wanted` of both halves come from the left one.
      const auto from_left = [&](std::size_t wanted) {
        const auto lefts = static_cast<std::size_t>(middle - left), rights = static_cast<std::size_t>(right - middle);
        std::size_t low = wanted > rights ? wanted - rights : 0, high = std::min(wanted, lefts);
        while (low < high) {
          const std::size_t mine = (low + high) / 2;
          before(left[static_cast<std::ptrdiff_t>(mine)], middle[static_cast<std::ptrdiff_t>(wanted - mine - 1)])
              ? low = mine + 1
              : high = mine;
        }
        return static_cast<std::ptrdiff_t>(low);
      };
      const std::size_t begin = part * kRun - first, end = std::min(count, (part + 1) * kRun) - first;
      const std::ptrdiff_t a = from_left(begin), b = from_left(end);
      std::merge(left + a, left + b, middle + (static_cast<std::ptrdiff_t>(begin) - a),
                 middle + (static_cast<std::ptrdiff_t>(end) - b), at(scratch, first + begin), before);
    });
    std::swap(values, scratch);
  }
}

template <class T, class Before>
void parallel_sort(std::vector<T>& values, const Before& before) {
  std::vector<T> scratch;
  parallel_sort(values, scratch, before);
}

/// offsets[i] = sum of counts[0..i), offsets[count] = total. `offsets` gets counts.size() + 1 entries.
void exclusive_scan(const std::vector<std::uint32_t>& counts, std::vector<std::uint32_t>& offsets);

/// One call of the library: body() in the executor that `execution` asks for, watched by its progress callback.
/// In TBB, threads that wait within the call take up no other work of the arena, so that neither the host's own loops
/// can end up inside of it nor the callback be late.
template <class Body>
void run_call(const Execution& execution, const Body& body) {
  const FpEnvironment environment;
  Run run(execution);
  const RunScope scope(&run);
  try {
    if (execution.executor == Executor::kArena) {
      tbb::this_task_arena::isolate(body);
    } else {
      body();
    }
  } catch (...) {
    if (run.host_exception()) std::rethrow_exception(run.host_exception());
    throw;
  }
}

}  // namespace halfshade
