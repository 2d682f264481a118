#include "shadows/receiver_request.h"

#include <algorithm>

namespace halfshade {

std::vector<dvec3> receiver_reach(std::span<const Receiver> receivers, const Light& light) {
  std::vector<dvec3> reach = light_extent(light);
  if (!std::all_of(reach.begin(), reach.end(), is_finite)) {
    throw Error(ErrorCode::kBadInput, "light '" + light.name + "': a coordinate or the extent is not finite");
  }
  for (std::size_t i = 0; i < receivers.size(); ++i) {
    if (!is_finite(receivers[i].position_world)) {
      throw Error(ErrorCode::kBadInput, "receiver " + std::to_string(i) + ": the position is not finite");
    }
    reach.push_back(receivers[i].position_world);
  }
  return reach;
}

ReceiverRequest make_receiver_request(const LocalFrame& frame, std::span<const Receiver> receivers, const Light& light,
                                      const ShadowConfig& config) {
  ReceiverRequest q;
  q.frame = frame;
  q.samples = make_light_samples(light, config, frame);
  for (std::uint32_t i = 0; i < receivers.size(); ++i) {
    const vec3 position = frame.to_lattice(receivers[i].position_world);
    if (behind_light(position, q.samples)) {
      q.unlit.push_back(i);
    } else {
      const std::uint32_t set =
          q.samples.interleaved ? i % kInterleavedSets : receiver_set(i, config.seed, q.samples.sets);
      q.receivers.push_back(position, vec3(0.0f), receivers[i].triangle, i, static_cast<std::uint8_t>(set));
    }
  }
  return q;
}

void spread_masks(const ReceiverRequest& request, const VisibilityMasks& solved, std::size_t count,
                  VisibilityMasks& masks) {
  masks.reset(count, request.samples.count);
  for (std::size_t i = 0; i < request.receivers.size(); ++i) {
    std::copy_n(solved.mask(i).begin(), masks.words_per_receiver,
                masks.words.begin() + request.receivers.sample[i] * masks.words_per_receiver);
  }
  for (const std::uint32_t i : request.unlit) {
    for (std::uint32_t s = 0; s < request.samples.count; ++s) {
      masks.words[i * masks.words_per_receiver + s / 64] |= std::uint64_t{1} << (s % 64);
    }
  }
}

}  // namespace halfshade
