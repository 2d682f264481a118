// Our own method: receivers gather from a tree of blockers, and each receiver asks only for what is still open.
//
// The methods of the papers loop over triangles and pay for every (blocker, receiver) pair; tracing rays loops over
// samples and pays for every one. Here neighbouring receivers form clusters; a cluster collects the leaves that its
// shaft to the light meets; each receiver tests them near ones first, 16 triangles at a time against the part of the
// light that nothing has blocked yet, and stops when there is none.
#pragma once

#include "halfshade/shadows.h"
#include "shadows/receivers.h"

namespace halfshade {

/// Masks of all receivers, exact. Flat lights; point, spherical and volumetric lights are handed to the alias-free
/// shadow map, which gives the same masks.
void solve_exact(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                 const LightSamples& samples, const ShadowConfig& config, VisibilityMasks& masks, ShadowStats& stats);

}  // namespace halfshade
