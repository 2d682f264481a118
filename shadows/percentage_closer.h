// Soft edges by comparing with many lexels of one map: percentage-closer filtering over a fixed box (Reeves, Salesin,
// Cook 1987) and percentage-closer soft shadows, whose box grows with the penumbra that the mean blocker would cast
// (Fernando 2005).
#pragma once

#include "halfshade/shadows.h"
#include "shadows/receivers.h"

namespace halfshade {

/// The share of (2 radius + 1)^2 lexels around the receiver's own that do not hide it.
void solve_pcf(const LatticeMesh& mesh, const ReceiverArray& receivers, const LightSamples& samples,
               const ShadowConfig& config, std::vector<float>& visibility, ShadowStats& stats);

/// Blocker search over the part of the map through which the light may be seen, mean depth of the blockers found, then
/// the filter as large as the light seen through that depth. The light is a square of the area of its equivalent disk.
void solve_pcss(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                const LightSamples& samples, const ShadowConfig& config, std::vector<float>& visibility,
                ShadowStats& stats);

/// What they take for granted, in one line.
std::string assumptions_of_pcf(const ShadowConfig& config);
std::string assumptions_of_pcss(const ShadowConfig& config, const Light& light);

}  // namespace halfshade
