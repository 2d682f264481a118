// Shadow accumulation (Aszodi, Szirmay-Kalos 2006): every lexel of one depth map stands for a small caster, is seen
// from the receiver against the light, and hides its share of it.
//
// With rho(z) = R (1/z - 1/w) for a light of radius R and a receiver at distance w along the map's axis, the light seen
// through the plane at distance z covers slopes up to rho(z) around the receiver's own. A caster that a lexel shows at
// depth c is seen from the receiver `size` = rho(n) / rho(c) times as large on the map plane at n, and as much farther
// from the receiver's own place there: the paper's equation for l_r, divided by n.
#pragma once

#include "halfshade/shadows.h"
#include "shadows/receivers.h"

namespace halfshade {

struct MapReceiver;

/// The paper's shadowing factor s of one receiver: the hidden part of the light. Sums may leave [0, 1]; `radius` and
/// `plane` (n) in local units.
double shadowing_factor(const MapReceiver& receiver, double radius, double plane, const ShadowMapOptions& options);

/// 1 - s, clamped; how often and how far clamping was needed is noted in the details.
void solve_shadow_accumulation(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                               const LightSamples& samples, const ShadowConfig& config, std::vector<float>& visibility,
                               ShadowStats& stats);

/// What it takes for granted, in one line.
std::string assumptions_of_shadow_accumulation(const ShadowConfig& config, const Light& light);

}  // namespace halfshade
