// RGB light through translucent triangles: the pass behind the masks (definition: halfshade/transmittance.h).
//
// Receivers go tile by tile (64 that lie near each other). A tile collects the panes between it and the light from a
// tree, adds up their attenuation per receiver, sample and channel in a buffer of its own, and sums up the light over
// the samples that its masks leave open. Memory is that of the tiles in flight, not of the picture.
#pragma once

#include "halfshade/transmittance.h"
#include "shadows/panes.h"
#include "shadows/receivers.h"

namespace halfshade {

inline constexpr std::size_t kTransmittanceTile = 64;

/// Light that reaches each receiver, per channel, through the samples that `masks` leave open. `masks` without words:
/// nothing is blocked. `weights` [set][sample], or empty: every sample counts 1 / count. Adds to stats.details.
/// `tile`: receivers per tile, 1..64; changes no bit.
void solve_transmittance(const Panes& panes, const ReceiverArray& receivers, const Light& light,
                         const LightSamples& samples, const ShadowConfig& config, const VisibilityMasks& masks,
                         std::span<const vec3> weights, std::vector<vec3>& reaching, ShadowStats& stats,
                         std::size_t tile = kTransmittanceTile);

/// What solve_light gives, from the answer of the configured method: `masks`, or `visibility` where it yields none. The
/// oracle's light is that of the reference below.
void solve_reaching_light(const Panes& panes, const ReceiverArray& receivers, const Light& light,
                          const LightSamples& samples, const ShadowConfig& config, const VisibilityMasks& masks,
                          std::span<const float> visibility, std::vector<vec3>& reaching, ShadowStats& stats);

/// The same as solve_transmittance for one receiver by the definition: every pane against every sample, exactly. `mask`
/// is its words, or empty.
vec3 reference_transmittance(const Panes& panes, const ReceiverArray& receivers, std::size_t receiver,
                             const LightSamples& samples, std::span<const std::uint64_t> mask,
                             std::span<const vec3> weights);

/// Sums up the light of one receiver: add(attenuation, sample) for each sample that is not blocked, in their order.
class LightSum {
 public:
  /// `weights`: one per sample of the receiver's set, or empty.
  LightSum(std::uint32_t count, std::span<const vec3> weights) : count_(count), weights_(weights) {}
  void add(const RgbAttenuation& attenuation, std::uint32_t sample);
  /// The same for so many samples at once, where there are no weights.
  void add_alike(const RgbAttenuation& attenuation, std::uint32_t samples);
  vec3 value() const;

 private:
  std::uint32_t count_;
  std::span<const vec3> weights_;
  std::array<std::uint64_t, 3> sum_{};  // in 2^-32; below 2^45
  dvec3 weighted_{0.0};
  RgbAttenuation last_{};
  std::array<std::uint64_t, 3> of_last_{std::uint64_t{1} << 32, std::uint64_t{1} << 32, std::uint64_t{1} << 32};
};

}  // namespace halfshade
