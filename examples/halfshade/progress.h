// Progress on standard error, and the signals that stop the work.
#pragma once

#include <string>

#include "halfshade/shadows.h"

namespace halfshade {

/// SIGINT and SIGTERM set a flag that the progress callback reads. Work that does not look at it in time is not waited
/// for: the program ends after 100 ms, or at once with a second signal; no temporary file stays either way.
void install_signal_handlers();
/// The signal received, or 0.
int stop_signal();

/// A bar on a terminal, a line each 10 % elsewhere.
class Progress {
 public:
  explicit Progress(std::string label, bool quiet);
  ~Progress();
  /// For ShadowConfig::progress: false once a signal has arrived. `note` is shown behind the bar.
  bool operator()(double done, const std::string& note = {});

 private:
  std::string label_;
  bool quiet_, terminal_;
  int last_tenth_ = 0;
};

}  // namespace halfshade
