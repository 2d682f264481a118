// The integer state of `halfshade accumulate`, from which a run that was stopped goes on to the same bits
// (docs/files.md).
#pragma once

#include <filesystem>
#include <string>

#include "halfshade/accumulation.h"

namespace halfshade {

/// One finished frame, in the order of the run.
struct FrameRecord {
  VisibilityError error;  // against the reference, or from the frame before; `count` is not kept in the file
  double ms = -1.0;       // not known for frames of an earlier run
};

struct AccumulationState {
  std::string options_hash;                   // of everything that decides the numbers
  std::vector<VisibilityAccumulator> lights;  // one entry per G-buffer entry
  ColorAccumulator color;                     // [pixel][R, G, B, A], or empty
  std::vector<FrameRecord> frames;
};

/// Atomic. Throws Error{kOutput}.
void write_state(const std::filesystem::path& path, const AccumulationState& state);

/// Replaces `state`, which tells the expected hash and sizes. Throws Error{kBadInput} with the path for a state of
/// other options and for damaged files.
void read_state(const std::filesystem::path& path, AccumulationState& state);

}  // namespace halfshade
