// Hierarchical penumbra casting (Laine and Aila 2005): a hierarchy of receivers and one of light samples, and one
// blocker at a time against both. No structure over the blockers is needed: they may come in any order, and in pieces.
#pragma once

#include <memory>

#include "halfshade/shadows.h"
#include "shadows/receivers.h"

namespace halfshade {

/// Masks of all receivers, exact.
void solve_hierarchical_penumbra_casting(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                                         const LightSamples& samples, const ShadowConfig& config,
                                         VisibilityMasks& masks, ShadowStats& stats);

/// The same for blockers that come in pieces. One caller at a time; threads are used inside.
///
/// Receivers are cut into at most some hundred parts along the top of their hierarchy, each a hierarchy of its own.
/// A round of blockers is set up and taken through the top in parallel over blockers; then the parts go through the
/// blockers that reached them, in parallel over parts, so that every mask and umbra bit has one writer.
class PenumbraCaster {
 public:
  /// All references must outlive this. Throws Error{kUsage} for options out of range.
  PenumbraCaster(const ReceiverArray& receivers, const Light& light, const LightSamples& samples,
                 const ShadowConfig& config);
  ~PenumbraCaster();

  /// Blockers order[0], order[1] ... of `mesh`. Receivers know their own triangle by numbers[t], or by t if `numbers`
  /// is empty. `progress(done)` is called on the calling thread with a number of blockers before each round.
  void cast(const LatticeMesh& mesh, std::span<const std::uint32_t> order, std::span<const std::uint32_t> numbers,
            const std::function<void(std::size_t done)>& progress);

  /// The masks of all receivers as they stand.
  void write_masks(VisibilityMasks& masks) const;
  /// Adds counters and times.
  void write_stats(ShadowStats& stats) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Throws Error{kUsage} naming option, value and range.
void check_penumbra_casting(const PenumbraCastingOptions& options);

}  // namespace halfshade
