// Memory of beams; the hot loops are in cluster_beams-inl.h.
#include "shadows/packet_kernel.h"

namespace halfshade {

void BeamScratch::Slopes::resize(std::size_t count) {
  for (std::size_t k = 0; k < kSlopes; ++k) low[k].resize(count), high[k].resize(count);
  near.resize(count), far.resize(count);
}

void BeamScratch::Slopes::reserve(std::size_t count) {
  for (std::size_t k = 0; k < kSlopes; ++k) low[k].reserve(count), high[k].reserve(count);
  near.reserve(count), far.reserve(count);
}

void BeamScratch::reserve(std::size_t leaves, std::size_t samples) {
  leaves += PictureLines::kLanes;
  leaf.reserve(leaves), is_tight.reserve(leaves), leaf_slopes.reserve(leaves);
  for (int k = 0; k < 3; ++k) leaf_low[k].reserve(leaves), leaf_high[k].reserve(leaves);
  blocked.reserve(samples * kRuns);
}

void BeamScratch::clear_leaves() {
  leaf.clear();
  for (int k = 0; k < 3; ++k) leaf_low[k].clear(), leaf_high[k].clear();
}

void BeamScratch::add_leaf(const BlockerTree::Node& group, std::size_t child) {
  leaf.push_back(group.first_leaf() + static_cast<std::uint32_t>(child));
  for (int k = 0; k < 3; ++k) leaf_low[k].push_back(group.low[k][child]), leaf_high[k].push_back(group.high[k][child]);
}

void BeamScratch::pad_leaves() {
  const std::size_t padded = leaf.size() + PictureLines::kLanes;
  for (int k = 0; k < 3; ++k) leaf_low[k].resize(padded, 1e30f), leaf_high[k].resize(padded, -1e30f);
  leaf_slopes.resize(padded);
  is_tight.assign(padded, 0);
}

}  // namespace halfshade
