// Explicit receivers on the lattice, as the public functions get them.
#pragma once

#include "halfshade/shadows.h"
#include "shadows/receivers.h"

namespace halfshade {

/// `unlit` are those behind a one-sided light; the others know their number by ReceiverArray::sample.
struct ReceiverRequest {
  LocalFrame frame;
  LightSamples samples;
  ReceiverArray receivers;
  std::vector<std::uint32_t> unlit;
};

/// World-space points that the local frame must reach. Throws Error{kBadInput} for positions that are not finite.
std::vector<dvec3> receiver_reach(std::span<const Receiver> receivers, const Light& light);

ReceiverRequest make_receiver_request(const LocalFrame& frame, std::span<const Receiver> receivers, const Light& light,
                                      const ShadowConfig& config);

/// Masks of all `count` receivers from those of request.receivers; the unlit ones are blocked in every sample.
void spread_masks(const ReceiverRequest& request, const VisibilityMasks& solved, std::size_t count,
                  VisibilityMasks& masks);

}  // namespace halfshade
