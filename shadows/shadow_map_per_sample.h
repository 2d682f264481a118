// One shadow map per light sample (Heckbert and Herf 1997; Williams 1978 for each of them): the brute-force rival of
// alias-free shadow maps, on the same samples.
#pragma once

#include "halfshade/shadows.h"
#include "shadows/receivers.h"

namespace halfshade {

/// Masks of all receivers. Approximate: a lexel's centre answers for the whole lexel, and the biases of
/// ShadowMapOptions keep surfaces from shadowing themselves.
void solve_shadow_maps(const LatticeMesh& mesh, const ReceiverArray& receivers, const LightSamples& samples,
                       const ShadowConfig& config, VisibilityMasks& masks, ShadowStats& stats);

/// What it takes for granted, in one line.
std::string assumptions_of_shadow_maps(const ShadowConfig& config);

}  // namespace halfshade
