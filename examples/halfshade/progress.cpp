#include "progress.h"

#include <semaphore.h>
#include <signal.h>
#include <time.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <thread>

#include "rasterizer/io/atomic_file.h"

namespace halfshade {
namespace {

std::atomic<int> g_signal{0};

sem_t g_signals;  // counts them
constexpr long kGraceNs = 100'000'000;

void on_signal(int number) {
  g_signal = number;
  sem_post(&g_signals);
}

void wait_for_signal() {
  while (sem_wait(&g_signals) != 0) continue;
}

/// For a second signal, but not longer than the time of grace.
void wait_for_grace() {
  timespec until{};
  clock_gettime(CLOCK_REALTIME, &until);
  until.tv_nsec += kGraceNs;
  until.tv_sec += until.tv_nsec / 1'000'000'000;
  until.tv_nsec %= 1'000'000'000;
  while (sem_timedwait(&g_signals, &until) != 0 && errno == EINTR) continue;
}

/// Loading a scene or building a tree may take long and asks nobody.
void end_after_signal() {
  wait_for_signal();
  wait_for_grace();
  remove_temporaries_for_exit();
  std::fprintf(stderr, "halfshade: stopped\n");
  _exit(128 + g_signal);
}

}  // namespace

void install_signal_handlers() {
  sem_init(&g_signals, 0, 0);
  std::thread(end_after_signal).detach();
  struct sigaction action = {};
  action.sa_handler = on_signal;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  signal(SIGXFSZ, SIG_IGN);  // a write beyond the file size limit is an error to report, not a death
  signal(SIGPIPE, SIG_IGN);
}

int stop_signal() { return g_signal; }

Progress::Progress(std::string label, bool quiet)
    : label_(std::move(label)), quiet_(quiet), terminal_(isatty(STDERR_FILENO) != 0) {}

Progress::~Progress() {
  if (!quiet_ && terminal_) std::fprintf(stderr, "\r\033[K");
}

bool Progress::operator()(double done, const std::string& note) {
  const int tenth = static_cast<int>(done * 10.0);
  if (!quiet_ && terminal_) {
    const int filled = static_cast<int>(done * 30.0);
    std::fprintf(stderr, "\r\033[K%s [%.*s%*s] %3d %% %s", label_.c_str(), filled, "##############################",
                 30 - filled, "", static_cast<int>(done * 100.0), note.c_str());
  } else if (!quiet_ && tenth > last_tenth_) {
    std::fprintf(stderr, "%s: %d %%%s%s\n", label_.c_str(), tenth * 10, note.empty() ? "" : ", ", note.c_str());
  }
  last_tenth_ = tenth;
  return stop_signal() == 0;
}

}  // namespace halfshade
