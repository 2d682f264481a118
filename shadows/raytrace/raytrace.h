// Method "raytrace": shadow rays through Embree, where it was built in. A target of its own, halfshade::raytrace, so
// that the core library needs no Embree.
#pragma once

#include "halfshade/shadows.h"
#include "shadows/receivers.h"

namespace halfshade {

/// Masks of all receivers by rays in single precision; config.raytrace chooses the mode. Not exact: rays near edges and
/// vertices may go either way, and a receiver's own triangle counts. Throws Error{kUsage} when Embree is absent.
void solve_raytrace(const LatticeMesh& mesh, const ReceiverArray& receivers, const LightSamples& samples,
                    const ShadowConfig& config, VisibilityMasks& masks, ShadowStats& stats);

}  // namespace halfshade
