// Hot loop of hierarchical penumbra casting: one blocker against the receivers of one leaf (Laine and Aila 2005,
// figure 3, lines 56 to 76).
//
// The paper tests receivers against the planes of penumbra and hard shadow volumes; the same signs are found from the
// other side, by the planes through receiver and blocker edges against the light, its groups and its samples
// (edge_planes-inl.h), 16 receivers or samples at a time and exactly.
#pragma once

#include <memory>

#include "shadows/visibility_pair.h"

namespace halfshade {

/// Masks of equal size, handed out zeroed and taken back (optimisation D).
class MaskPool {
 public:
  explicit MaskPool(std::size_t words) : words_(words) {}
  std::uint64_t* take();
  void release(std::uint64_t* mask);

  std::size_t live() const { return live_; }
  /// Most masks at once since the last call.
  std::size_t take_peak();
  std::uint64_t bytes() const { return chunks_.size() * kChunk * words_ * sizeof(std::uint64_t); }

 private:
  static constexpr std::size_t kChunk = 64;  // masks
  std::size_t words_, live_ = 0, peak_ = 0;
  std::vector<std::unique_ptr<std::uint64_t[]>> chunks_;
  std::vector<std::uint64_t*> free_;
};

struct LeafResult {
  bool met = false;    // some receiver lies in the penumbra volume
  bool added = false;  // bits were added
};

/// ORs into the masks of receivers [begin, end) what the blocker hides of the groups with a bit in `active` (groups of
/// KernelSamples::kGroup). Receivers without a mask get one where the blocker may matter; with `release` those in full
/// umbra lose theirs. Returns also how many reached full umbra, by `finished`.
LeafResult cast_on_leaf(const Blocker& blocker, const KernelSamples& samples, const std::uint64_t* active,
                        std::size_t begin, std::size_t end, bool release, KernelReceivers& receivers, MaskPool& pool,
                        std::uint32_t& finished, KernelCounters& counters);

}  // namespace halfshade
