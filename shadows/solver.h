// Chooses the method and runs it on receivers that exist already.
#pragma once

#include "halfshade/names.h"
#include "halfshade/shadows.h"
#include "shadows/receivers.h"

namespace halfshade {

struct KeptExact;  // exact_engine.h

/// Masks of `receivers` under one light; fills the counters. Exact methods give equal masks. Translucent triangles
/// block nothing, here and below; stats.details has their number (transmittance.h). Throws Error{kUsage} for methods
/// without masks. Calls with the same mesh may share `kept`, which method exact then builds once; others ignore it.
void solve_masks(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                 const LightSamples& samples, const ShadowConfig& config, VisibilityMasks& masks, ShadowStats& stats,
                 KeptExact* kept = nullptr);

/// Visibility of `receivers` by any method; through masks where the method has them.
void solve_visibility(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                      const LightSamples& samples, const ShadowConfig& config, std::vector<float>& visibility,
                      ShadowStats& stats);

/// Does the method, with its options, yield masks? Do they, or else the visibility, equal the oracle's in every bit?
bool yields_masks(const ShadowConfig& config);
bool promises_exactness(const ShadowConfig& config);

/// What an approximate method takes for granted with this configuration and light, in one line; empty for exact ones.
std::string method_assumptions(const ShadowConfig& config, const Light& light);

/// Of all receivers.
void visibility_of(const VisibilityMasks& masks, std::vector<float>& visibility);

/// Asks whoever watches the current call, or config.progress outside of any; throws Error{kCancelled} when told to
/// stop.
void report_progress(const ShadowConfig& config, double done);

}  // namespace halfshade
