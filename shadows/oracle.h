// Brute force: the truth that every exact method is compared with.
#pragma once

#include "halfshade/shadows.h"
#include "shadows/receivers.h"

namespace halfshade {

/// Sets mask bit i where any triangle of the mesh blocks sample i of the receiver. Tests every triangle whose bounding
/// box meets the bounding box of receiver and samples, sample by sample, with the exact predicate.
void oracle_mask(const LatticeMesh& mesh, const ReceiverArray& receivers, std::size_t receiver,
                 const LightSamples& samples, std::span<std::uint64_t> mask);

/// The same for all receivers.
void solve_oracle(const LatticeMesh& mesh, const ReceiverArray& receivers, const LightSamples& samples,
                  const ShadowConfig& config, VisibilityMasks& masks);

}  // namespace halfshade
