// How many surfaces lie between every receiver and every light sample (depth complexity; Forest, Barthe, Paulin 2008
// and 2009, section 3.2).
#pragma once

#include "halfshade/shadows.h"

namespace halfshade {

struct HALFSHADE_API DepthComplexity {
  std::size_t receiver_count = 0;
  std::uint32_t sample_count = 0;
  std::vector<std::uint32_t> counts;  // [receiver][sample]: triangles crossed at an opaque texel

  std::uint32_t count(std::size_t receiver, std::uint32_t sample) const {
    return counts[receiver * sample_count + sample];
  }
  /// Fraction of samples behind no surface at all, in [0, 1].
  float visibility(std::size_t receiver) const;
};

/// Counts, for the samples that `config` describes, the triangles that each segment crosses. Two triangles that share
/// an edge or a corner count once where a segment passes through it: ties are broken by simulation of simplicity
/// (shadows/crossing.h), so the count is zero exactly where solve_shadows leaves the sample unblocked, save for
/// segments that only touch the outline of an open surface. Opaque triangles with equal corners count once. Receivers
/// behind a one-sided light get count 1 in every sample. Of `config` the method's own options count for nothing. Errors
/// and threads as for solve_shadows.
HALFSHADE_API void solve_depth_complexity(const Scene& scene, std::span<const Receiver> receivers, const Light& light,
                                          const ShadowConfig& config, DepthComplexity& counts,
                                          ShadowStats* stats = nullptr);

}  // namespace halfshade
