// The one exception type of the library. Thrown before any output is written; the message names the
// argument or file, its value and the allowed range.
#pragma once

#include <stdexcept>
#include <string>

#include "halfshade/export.h"

namespace halfshade {

/// What went wrong, as far as a program can act on it; the message has the rest.
enum class ErrorCode {
  kUsage,      // a call or command line that makes no sense
  kBadInput,   // a file or array whose content is wrong
  kLimit,      // the work would exceed a stated limit, or memory
  kOutput,     // a result could not be written
  kCancelled,  // the caller asked to stop
};

/// Thrown by everything in the library that can fail, besides std::bad_alloc.
class HALFSHADE_API Error : public std::runtime_error {
 public:
  /// `message` names the argument or file, its value and the allowed range.
  Error(ErrorCode code, const std::string& message) : std::runtime_error(message), code_(code) {}
  ErrorCode code() const { return code_; }  // the kind of failure

 private:
  ErrorCode code_;
};

}  // namespace halfshade
