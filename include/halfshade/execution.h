// Where the library's loops run, and how a call is watched and stopped.
#pragma once

#include <cstddef>
#include <functional>

namespace halfshade {

/// What a host's loop has to call: body(index) does one piece of the work. Refers to memory of the call that made it:
/// valid until the host's parallel_for returns. May be called from any thread, by several at once, in any order.
class TaskBody {
 public:
  TaskBody(void (*run)(const void* context, std::size_t index), const void* context) : run_(run), context_(context) {}
  void operator()(std::size_t index) const { run_(context_, index); }

 private:
  void (*run_)(const void*, std::size_t);
  const void* context_;
};

enum class Executor {
  kArena,   // TBB, in the arena of the calling thread
  kSerial,  // the calling thread alone; no TBB function is called
  kHost,    // Execution::parallel_for; no TBB function is called
};

/// How one call runs. Results never depend on it.
struct Execution {
  Executor executor = Executor::kArena;

  /// kHost: calls body(i) exactly once for every i in [0, count), on threads of its choice, and returns when all of
  /// these calls have returned. `body` never throws. Loops may be nested: a body may call parallel_for again. If it
  /// throws, no body may be running any more, and the call that needed it throws the same.
  std::function<void(std::size_t count, TaskBody body)> parallel_for = nullptr;
  /// kHost: number of threads that parallel_for uses, about. Decides into how many pieces work is split, nothing else.
  std::size_t concurrency = 0;

  /// Called now and then on the calling thread, and on no other, with the share done, 0..1. Returning false stops the
  /// work: the call throws Error{kCancelled}. If it throws, the call throws the same. Either way all objects are as
  /// usable as before, and what the call would have written is unspecified. It runs in the floating-point environment
  /// of the library's own work. May be empty.
  std::function<bool(double done)> progress = nullptr;
};

}  // namespace halfshade
