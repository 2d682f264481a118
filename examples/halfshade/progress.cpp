#include "progress.h"

#include <signal.h>
#include <unistd.h>

#include <atomic>
#include <cstdio>

namespace halfshade {
namespace {

std::atomic<int> g_signal{0};

void on_signal(int number) {
  if (g_signal.exchange(number) != 0) _exit(128 + number);
}

}  // namespace

void install_signal_handlers() {
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
