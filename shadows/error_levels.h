// Sets of samples, round after round, for the receivers whose error may still exceed a goal (docs/max_error.md).
#pragma once

#include "halfshade/adaptive.h"
#include "shadows/receivers.h"

namespace halfshade {

/// solve_to_error for receivers that exist already; the lattice is theirs. Translucent triangles block nothing.
void solve_to_error(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                    const ShadowConfig& config, double max_error, AdaptiveVisibility& result, ShadowStats& stats);

/// Throws Error{kUsage} unless kSmallestMaxError <= max_error <= kLargestMaxError.
void check_max_error(double max_error);

}  // namespace halfshade
