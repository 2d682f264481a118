// Hot loop of transmittance: panes against the receivers of one tile and those of their samples that nothing opaque
// hides. Same planes and filters as the masks (edge_planes-inl.h); what floats leave open is settled by crosses().
#pragma once

#include "shadows/blocker_tree.h"
#include "shadows/panes.h"

namespace halfshade {

/// A tile of receivers and the light that reaches them, reused from tile to tile. Samples in the kernel's order.
struct TransmittanceTile {
  KernelReceivers receivers;               // masks: samples that the opaque scene hides
  std::vector<RgbAttenuation> everywhere;  // [receiver] common to all samples that are not hidden
  std::vector<std::uint8_t> touched;       // [receiver] 1: attenuation counts
  std::vector<Attenuation> attenuation;    // [receiver][channel][KernelSamples::padded], on top of `everywhere`

  std::vector<std::uint32_t> stack, leaves;  // scratch
  KernelCounters counters;
  std::uint64_t crossings = 0;  // (pane, receiver, sample)

  Attenuation* channel(std::size_t receiver, std::size_t channel, const KernelSamples& samples) {
    return attenuation.data() + (receiver * 3 + channel) * samples.padded;
  }
};

/// Multiplies the light of the tile's receivers by the panes in the given leaves of `tree`, which is built over
/// panes.mesh.
void cross_panes(const Panes& panes, const BlockerTree& tree, const BlockerFit& fit,
                 std::span<const std::uint32_t> leaves, const KernelSamples& samples, TransmittanceTile& tile);

/// Adds one pane's attenuation to the samples of a receiver whose bits are set in `crossed` (kernel's order), all of
/// which are open.
void filter_samples(const Panes& panes, std::uint32_t pane, const KernelSamples& samples, std::size_t receiver,
                    std::span<const std::uint64_t> crossed, TransmittanceTile& tile);

}  // namespace halfshade
