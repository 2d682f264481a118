// (blocker, cell) pairs of GEARS (Wang et al. 2014, section 5.2): counted per blocker, placed by prefix sum, sorted by
// cell.
#pragma once

#include "shadows/gears_region.h"
#include "shadows/visibility_kernel.h"

namespace halfshade {

struct GearsPair {
  std::uint32_t node;
  std::uint32_t blocker;  // place in the batch
};

/// What every blocker of the scene asks of the grid.
struct GearsDemand {
  static constexpr std::uint32_t kEverywhere = kNone;
  std::vector<std::uint32_t> touching;                     // blockers with pairs, ascending
  std::vector<std::uint32_t> count;                        // [touching] pairs
  std::vector<std::uint32_t> everywhere;                   // blockers for all receivers of the grid, ascending
  std::vector<std::uint64_t> in_box, in_hull, in_frustum;  // study: [triangle] receivers inside those bounds
};

/// Pairs of some blockers, by node.
struct GearsPairs {
  std::vector<GearsPair> pairs, scratch;
  std::vector<std::uint32_t> start;    // [blocker of the batch] first pair
  std::vector<std::uint32_t> offsets;  // [node] pairs[offsets[n] .. offsets[n + 1]) are its blockers
};

/// Finds pairs. Refers to everything it is given.
class GearsAssigner {
 public:
  GearsAssigner(const LatticeMesh& mesh, const KernelSamples& samples, const GearsGrid& grid,
                const GearsOptions& options);

  /// Counts pairs without storing any. A blocker that alone exceeds the budget counts as one for all receivers.
  GearsDemand count() const;

  /// Pairs of `blockers`, whose numbers of pairs are `counts`, sorted by node and within a node by blocker.
  void assign(std::span<const std::uint32_t> blockers, std::span<const std::uint32_t> counts, GearsPairs& pairs) const;

  std::uint64_t bytes() const { return view_positions_.size() * sizeof(dvec3); }

 private:
  void project(std::uint32_t triangle, bool with_hull, GearsBlocker& blocker) const;
  template <class Take>
  void visit(const GearsBlocker& blocker, const Take& take) const;
  void study(std::uint32_t triangle, GearsBlocker& blocker, GearsDemand& demand) const;

  const LatticeMesh& mesh_;
  const KernelSamples& samples_;
  const GearsGrid& grid_;
  const GearsOptions& options_;
  GearsProjector projector_;
  std::vector<dvec3> view_positions_;
};

}  // namespace halfshade
