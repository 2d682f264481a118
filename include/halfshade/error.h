// The one exception type of the library. Thrown before any output is written; the message names the
// argument or file, its value and the allowed range.
#pragma once

#include <stdexcept>
#include <string>

#include "halfshade/export.h"

namespace halfshade {

enum class ErrorCode {
  kUsage,      // a call or command line that makes no sense
  kBadInput,   // a file or array whose content is wrong
  kLimit,      // the work would exceed a stated limit, or memory
  kOutput,     // a result could not be written
  kCancelled,  // the caller asked to stop
};

class HALFSHADE_API Error : public std::runtime_error {
 public:
  Error(ErrorCode code, const std::string& message) : std::runtime_error(message), code_(code) {}
  ErrorCode code() const { return code_; }

 private:
  ErrorCode code_;
};

}  // namespace halfshade
