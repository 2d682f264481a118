// A host that is not TBB: every loop gets threads of its own.
#pragma once

#include <atomic>
#include <thread>
#include <vector>

#include "halfshade/execution.h"

namespace halfshade::test {

/// body(i) for all i < count on `threads` threads, none of them the caller's.
inline void run_on_threads(std::size_t threads, std::size_t count, TaskBody body) {
  std::atomic<std::size_t> next{0};
  const auto work = [&] {
    for (std::size_t i = next++; i < count; i = next++) body(i);
  };
  std::vector<std::thread> pool;
  for (std::size_t t = 0; t < std::min(threads, count); ++t) pool.emplace_back(work);
  for (std::thread& thread : pool) thread.join();
}

inline Execution host_execution(std::size_t threads = 3) {
  Execution execution;
  execution.executor = Executor::kHost;
  execution.concurrency = threads;
  execution.parallel_for = [threads](std::size_t count, TaskBody body) { run_on_threads(threads, count, body); };
  return execution;
}

}  // namespace halfshade::test
