// Parts of split `frames`: integer counts of some of the frames that accumulate would run through. Sums of integers do
// not depend on their order, so parts add up to the picture of all frames.
#pragma once

#include "part.h"
#include "render.h"

namespace halfshade {

/// render --split frames --part; the exit code.
int render_frames_part(const RenderOptions& options, PartNumber number);

/// Adds up complete parts and writes the picture and the JSON that the options ask for. Throws Error{kBadInput} for
/// counts that are not those of the manifests, or of another scene than the one that the options name.
int merge_frames(const RenderOptions& options, const std::vector<Part>& parts);

}  // namespace halfshade
