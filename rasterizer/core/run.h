// One call of the library as its loops see it: where they run, whether somebody watches, whether to stop.
//
// A Run lives on the stack of the call. Loops (parallel.h) find it through a pointer of their thread and hand it on to
// the threads that help, so that nothing in between has to pass it along.
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <exception>

#include "halfshade/error.h"
#include "halfshade/execution.h"

namespace halfshade {

class Run {
 public:
  /// Of the calling thread. `execution` must outlive it. Throws Error{kUsage} for kHost without parallel_for.
  explicit Run(const Execution& execution);
  Run(const Run&) = delete;
  Run& operator=(const Run&) = delete;

  const Execution& execution() const { return execution_; }
  bool watched() const { return static_cast<bool>(execution_.progress); }

  /// To be called often, by any thread that works for the call: throws where the call has been stopped, and on the
  /// calling thread asks the host from time to time.
  void check();
  /// The share of the current part that is done; asks the host, on the calling thread.
  void report(double done);
  /// What report() reports from now on lies between these shares of the whole call.
  void set_part(double begin, double end) { begin_ = begin, end_ = end, done_ = begin; }

  /// What the host's callback threw, if it did.
  std::exception_ptr host_exception() const { return host_exception_; }

 private:
  using Clock = std::chrono::steady_clock;

  bool on_calling_thread() const;
  void ask();
  [[noreturn]] static void throw_cancelled() { throw Error(ErrorCode::kCancelled, "cancelled"); }

  const Execution& execution_;
  const void* thread_;
  double begin_ = 0.0, end_ = 1.0, done_ = 0.0;
  Clock::time_point asked_ = Clock::now();
  std::atomic<bool> stopped_{false};
  std::exception_ptr host_exception_;
};

/// The run that the calling thread works for, or null: a loop outside of any call, in the thread's TBB arena.
Run* current_run();

/// Makes a run the current one of this thread until the end of the scope.
class RunScope {
 public:
  explicit RunScope(Run* run);
  ~RunScope();
  RunScope(const RunScope&) = delete;
  RunScope& operator=(const RunScope&) = delete;

 private:
  Run* before_;
};

/// In long serial work: Run::check of the current run, if somebody watches it.
inline void check_run() {
  Run* run = current_run();
  if (run != nullptr && run->watched()) run->check();
}

/// body(begin, end) over pieces of [0, count) of at most `piece` items, in order, with a check before each.
template <class Body>
void checked_ranges(std::size_t count, std::size_t piece, const Body& body) {
  for (std::size_t begin = 0; begin < count; begin += piece) {
    check_run();
    body(begin, begin + piece < count ? begin + piece : count);
  }
}

}  // namespace halfshade
