// Chooses the method and runs it on receivers that exist already.
#pragma once

#include "halfshade/shadows.h"
#include "shadows/receivers.h"

namespace halfshade {

/// Masks of `receivers` under one light; fills the counters. Exact methods give equal masks. Throws Error{kUsage} for
/// methods without masks.
void solve_masks(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                 const LightSamples& samples, const ShadowConfig& config, VisibilityMasks& masks, ShadowStats& stats);

/// Visibility of `receivers` by any method; through masks where the method has them.
void solve_visibility(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                      const LightSamples& samples, const ShadowConfig& config, std::vector<float>& visibility,
                      ShadowStats& stats);

/// Calls config.progress if there is one; throws Error{kCancelled} when it returns false.
void report_progress(const ShadowConfig& config, double done);

/// "exact", "afsm" ...; throws Error{kUsage} listing the known names.
ShadowMethod shadow_method_from_name(const std::string& name);
const char* name_of(ShadowMethod method);
SamplePattern sample_pattern_from_name(const std::string& name);
const char* name_of(SamplePattern pattern);

}  // namespace halfshade
