#include "rasterizer/core/run.h"

namespace halfshade {
namespace {

constexpr std::chrono::milliseconds kBetweenQuestions{2};

thread_local Run* this_thread_run = nullptr;

/// Different for all threads that are alive.
const void* this_thread() { return &this_thread_run; }

}  // namespace

Run::Run(const Execution& execution) : execution_(execution), thread_(this_thread()) {
  if (execution.executor == Executor::kHost && !execution.parallel_for) {
    throw Error(ErrorCode::kUsage, "execution: executor kHost needs parallel_for");
  }
}

bool Run::on_calling_thread() const { return thread_ == this_thread(); }

void Run::check() {
  if (stopped_.load(std::memory_order_relaxed)) throw_cancelled();
  if (on_calling_thread() && watched() && Clock::now() - asked_ >= kBetweenQuestions) ask();
}

void Run::report(double done) {
  if (stopped_.load(std::memory_order_relaxed)) throw_cancelled();
  if (!on_calling_thread()) return;
  done_ = begin_ + (end_ - begin_) * done;
  if (watched()) ask();
}

void Run::ask() {
  bool go_on = false;
  const RunScope none(nullptr);  // the host may call the library from its callback
  try {
    go_on = execution_.progress(done_);
  } catch (...) {
    host_exception_ = std::current_exception();
    stopped_.store(true, std::memory_order_relaxed);
    throw;
  }
  asked_ = Clock::now();
  if (go_on) return;
  stopped_.store(true, std::memory_order_relaxed);
  throw_cancelled();
}

Run* current_run() { return this_thread_run; }

RunScope::RunScope(Run* run) : before_(this_thread_run) { this_thread_run = run; }
RunScope::~RunScope() { this_thread_run = before_; }

}  // namespace halfshade
