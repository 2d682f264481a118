// GEARS: a general and efficient algorithm for rendering shadows (Wang, Wang, Shi, Popescu 2014).
#pragma once

#include "halfshade/shadows.h"
#include "shadows/receivers.h"

namespace halfshade {

/// Masks of all receivers, exact. The pipeline (sections 3 and 4): camera C and grid over the receivers, (blocker,
/// cell) pairs by counting, prefix sum, emission and radix sort, then per cell every receiver's mask from the cell's
/// blockers. Pairs are counted before any is stored and blockers taken in batches that stay within
/// `config.gears.pair_budget`. Notes its counters in `stats.details` (docs/papers/gears.md).
void solve_gears(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                 const LightSamples& samples, const ShadowConfig& config, VisibilityMasks& masks, ShadowStats& stats);

}  // namespace halfshade
