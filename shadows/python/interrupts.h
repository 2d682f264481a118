// A call that runs without the interpreter's lock, yet hears Ctrl-C and asks the caller's progress function.
#pragma once

#include <chrono>
#include <string>

#include <pybind11/pybind11.h>

#include "halfshade/error.h"
#include "halfshade/execution.h"

namespace halfshade::python {

namespace py = pybind11;

/// For one call: serial or in the calling thread's arena. `progress` is None or a function of the share done, whose
/// false result cancels. Whatever Python raises in between (KeyboardInterrupt, an error in `progress`) leaves the call
/// as it is. Python is asked at most every 20 ms: its lock may be held by others.
inline Execution execution_of(const py::object& progress, bool serial) {
  using Clock = std::chrono::steady_clock;
  static constexpr auto kPause = std::chrono::milliseconds(20);
  Execution execution;
  execution.executor = serial ? Executor::kSerial : Executor::kArena;
  execution.progress = [progress = progress.ptr(), last = Clock::now()](double done) mutable {
    const auto now = Clock::now();
    if (now - last < kPause) return true;
    const py::gil_scoped_acquire lock;
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    const bool go_on = progress == Py_None || py::bool_(py::handle(progress)(done));
    last = Clock::now();
    return go_on;
  };
  return execution;
}

/// body() without the interpreter's lock.
template <class Body>
void without_lock(const Body& body) {
  const py::gil_scoped_release release;
  body();
}

/// Who uses an object. Python threads take turns at the lock, but not during calls that give it up; what C++ forbids to
/// do at the same time is refused here.
class UseCount {
 public:
  explicit UseCount(const char* name) : name_(name) {}

  class Reading {
   public:
    explicit Reading(UseCount& uses) : uses_(uses) {
      if (uses.count_ < 0) uses.refuse();
      ++uses.count_;
    }
    ~Reading() { --uses_.count_; }
    Reading(const Reading&) = delete;
    Reading& operator=(const Reading&) = delete;

   private:
    UseCount& uses_;
  };

  class Writing {
   public:
    explicit Writing(UseCount& uses) : uses_(uses) {
      if (uses.count_ != 0) uses.refuse();
      uses.count_ = -1;
    }
    ~Writing() { uses_.count_ = 0; }
    Writing(const Writing&) = delete;
    Writing& operator=(const Writing&) = delete;

   private:
    UseCount& uses_;
  };

 private:
  [[noreturn]] void refuse() const {
    throw Error(ErrorCode::kUsage, std::string(name_) + " is in use by a call of another thread");
  }

  const char* name_;
  int count_ = 0;  // readers, or -1: changed only with the interpreter's lock held
};

}  // namespace halfshade::python
