// Are there shadows of things narrower than the distance between light samples? Masks cannot tell: every bit is right,
// but such a thing covers one sample or none (GEARS, section 5.4, names it as the limit of all sampled methods).
//
// Some receivers, the probes, ask again with a fine grid of samples. In the picture of the light that a probe sees
// there are runs of blocked, and of open, cells between others, along rows and along columns. Those shorter than the
// distance between the samples in use belong to features that these samples can miss. A probe counts where such cells
// make up the share of at least one sample; corners and the ends of edges have fewer.
#pragma once

#include "halfshade/shadows.h"
#include "shadows/exact_engine.h"
#include "shadows/receivers.h"

namespace halfshade {

struct ThinFeatures {
  std::size_t probes = 0;       // receivers asked
  std::size_t seeing = 0;       // of these, before features narrower than the distance between samples
  double share_of_light = 0.0;  // of the light, that these features hide or let through: mean over the probes
  double share() const { return probes == 0 ? 0.0 : static_cast<double>(seeing) / static_cast<double>(probes); }
};

inline constexpr std::uint32_t kProbeSide = 64;  // cells of the fine grid per axis

/// Looks from `probes` receivers, spread over all that are not in umbra (visibility[i] > 0), for features narrower than
/// 1 / sqrt(config.light_sample_count) of the light. No probes for lights without area, for explicit samples, and from
/// half kProbeSide samples per axis on. Throws and runs as solve_masks. By the method exact where `kept` has its tree,
/// else by one that builds nothing.
ThinFeatures find_thin_features(const LatticeMesh& mesh, const ReceiverArray& receivers,
                                std::span<const float> visibility, const Light& light, const ShadowConfig& config,
                                std::size_t probes, KeptExact& kept);

/// Cells of runs shorter than `shortest`, not counting those that touch the border; `blocked` has one row of the light
/// per word, bit i is column i. Runs of ones and of zeros, along rows and along columns.
std::uint32_t cells_in_short_runs(std::span<const std::uint64_t, kProbeSide> blocked, std::uint32_t shortest);

}  // namespace halfshade
