#define XXH_INLINE_ALL
#include <xxhash.h>

#include <bit>
#include <cstdio>

#include "shadows/mask_hash.h"

namespace halfshade {

void VisibilityMasks::reset(std::size_t receivers, std::uint32_t samples) {
  receiver_count = receivers;
  sample_count = samples;
  words_per_receiver = (samples + 63) / 64;
  words.assign(receivers * words_per_receiver, 0);
}

std::uint32_t VisibilityMasks::blocked_count(std::size_t receiver) const {
  int count = 0;
  for (const std::uint64_t word : mask(receiver)) count += std::popcount(word);
  return static_cast<std::uint32_t>(count);
}

struct MaskHasher::State {
  XXH3_state_t state;
};

MaskHasher::MaskHasher(std::uint64_t receivers, std::uint64_t samples) : state_(std::make_unique<State>()) {
  static_assert(std::endian::native == std::endian::little, "hashes are defined over little-endian words");
  XXH3_128bits_reset(&state_->state);
  const std::uint64_t head[2] = {receivers, samples};
  XXH3_128bits_update(&state_->state, head, sizeof head);
}

MaskHasher::~MaskHasher() = default;

void MaskHasher::add(const VisibilityMasks& masks) {
  XXH3_128bits_update(&state_->state, masks.words.data(), masks.words.size() * sizeof(std::uint64_t));
}

std::string MaskHasher::digest() const {
  const XXH128_hash_t digest = XXH3_128bits_digest(&state_->state);
  char text[33];
  std::snprintf(text, sizeof text, "%016llx%016llx", static_cast<unsigned long long>(digest.high64),
                static_cast<unsigned long long>(digest.low64));
  return text;
}

std::string VisibilityMasks::hash() const {
  MaskHasher hasher(receiver_count, sample_count);
  hasher.add(*this);
  return hasher.digest();
}

}  // namespace halfshade
