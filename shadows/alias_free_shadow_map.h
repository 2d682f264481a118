// Alias-free shadow maps with soft shadows (Sintorn, Eisemann, Assarsson 2008).
#pragma once

#include "halfshade/shadows.h"
#include "shadows/receivers.h"

namespace halfshade {

/// Masks of all receivers, exact. The pipeline: receivers into the light views' lists (3.1), influence region of every
/// blocker over the lists (4.1, 3.2), plane tests of blocker against receivers and samples, OR into the masks (4.2).
/// A light of one sample gives hard shadows by the same steps (section 3).
void solve_alias_free_shadow_map(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                                 const LightSamples& samples, const ShadowConfig& config, VisibilityMasks& masks,
                                 ShadowStats& stats);

/// What afsm-lut takes for granted, for people.
std::string assumptions_of_lookup_table(const ShadowConfig& config);

}  // namespace halfshade
