// Soft textured shadow volumes (Forest, Barthe, Paulin 2009): object-based soft shadows of perforated triangles.
//
//   geometry of a volume      soft_shadow_volume      section 2.2
//   receivers inside          receiver_tiles, volume_kernel   sections 2.3, 4.2
//   samples into the texture  sample_projection, volume_kernel   section 2.4
//   light sample buffer       bit masks here, or depth complexity (section 3.2)
//   prefiltered opacity       opacity_average
//
// Opaque triangles take the exact engine unless they are asked to go through volumes too (section 3).
#pragma once

#include "halfshade/depth_complexity.h"
#include "shadows/receivers.h"

namespace halfshade {

/// Masks of all receivers, exact. Throws Error{kUsage} for stsv.filter=filtered, which has none.
void solve_soft_textured_shadow_volumes(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                                        const LightSamples& samples, const ShadowConfig& config, VisibilityMasks& masks,
                                        ShadowStats& stats);

/// Visibility with prefiltered opacity: every sample is dimmed by the share of opaque texels under its footprint on
/// each perforated triangle that it crosses. Approximate where footprints are larger than texels.
void solve_filtered_shadow_volumes(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                                   const LightSamples& samples, const ShadowConfig& config,
                                   std::vector<float>& visibility, ShadowStats& stats);

/// The light sample buffer as counters: all triangles go through volumes, whatever stsv.opaque says.
void count_depth_complexity(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                            const LightSamples& samples, const ShadowConfig& config, DepthComplexity& counts,
                            ShadowStats& stats);

}  // namespace halfshade
