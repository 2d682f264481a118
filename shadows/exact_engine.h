// Our own method: receivers gather from a tree of blockers, and each receiver asks only for what is still open.
//
// The methods of the papers loop over triangles and pay for every (blocker, receiver) pair; tracing rays loops over
// samples and pays for every one. Here neighbouring receivers form clusters; a cluster collects the leaves that its
// shaft to the light meets; packets of receivers test them, what hides most first, against the part of the light that
// nothing has blocked yet, and stop when there is none. Clusters that see too many small parts go sample by sample
// instead (cluster_beams-inl.h); receivers far from each other form clusters of few.
#pragma once

#include <memory>
#include <mutex>

#include "shadows/closed_components.h"
#include "shadows/light_view.h"
#include "shadows/packet_kernel.h"
#include "shadows/space_curve.h"

namespace halfshade {

inline constexpr std::size_t kClusterReceivers = BeamScratch::kReceivers;  // that share a list of groups

/// What blocks, as the engine needs it.
struct ExactBlockers {
  const LatticeMesh& mesh;
  const ClosedComponents* closed = nullptr;  // null: both sides of all triangles cast
  const BlockerTree* tree = nullptr;         // as built or placed
};

/// One side of a light, or for samples that lie in no plane one of the six directions in which receivers may lie, and
/// the blockers as seen from there.
struct ExactSide {
  LightFrame frame;
  SampleCloud cloud;  // not for flat lights
  BlockerFit fit;
  bool fitted = false;               // it belongs to the light's samples and to the blockers
  std::vector<std::uint8_t> usable;  // the certificates that it was made with
};

/// What the engine makes of a light, to be kept from call to call.
struct ExactLight {
  LightBound bound;
  LightFrame front;
  KernelSamples samples;
  KernelSamples tiles;    // the same, neighbours together, of lights that take beams (cluster_beams-inl.h)
  SampleRows rows;        // of flat lights
  std::size_t count = 0;  // sides that receivers may be on
  std::array<ExactSide, 6> sides;

  /// The blockers are others, or moved.
  void unfit() {
    for (ExactSide& side : sides) side.fitted = false;
  }
};

/// One for each thread at work, kept from call to call.
class ScratchPool {
 public:
  /// Room for so many threads, for the tree and for the samples of `light`; nothing is left of earlier calls but what
  /// they took and memory, the same for all: which cluster meets which scratch changes from call to call.
  void start(std::size_t threads, const BlockerTree& tree, const ExactLight& light, bool beams);
  ExactScratch& take();
  void give(ExactScratch& scratch);
  const std::vector<std::unique_ptr<ExactScratch>>& all() const { return scratches_; }

 private:
  std::mutex mutex_;
  std::vector<std::unique_ptr<ExactScratch>> scratches_;
  std::vector<ExactScratch*> free_;
  std::size_t edges_room_ = 0, facing_room_ = 0, turning_room_ = 0;  // of each scratch's lists
};

/// Scratch of a call.
struct ExactWork {
  CurveScratch curve;
  std::vector<std::uint8_t> side;  // of each receiver
  std::vector<std::uint32_t> order;
  KernelReceivers receivers;
  ScratchPool scratches;
  Beams beams = Beams::kWhereCheaper;

  /// Room for so many receivers.
  void reserve(std::size_t count);
};

/// What calls with one mesh share: certificates and the tree of blockers, once they are made, and memory. Everything
/// that depends on the light or on receivers is made anew in every call. One call at a time.
struct KeptExact {
  ClosedComponents closed;
  BlockerTree tree;
  bool has_closed = false, has_tree = false;
  ExactLight light;
  ExactWork work;

  /// Makes of `mesh`, which must be the same in all calls, what is not there yet.
  void build(const LatticeMesh& mesh, bool certificates);
};

/// What `kept` held before gives its memory.
void prepare_exact_light(const Light& light, const LightSamples& samples, ExactLight& kept);

/// The samples alone, all within kept.bound. Sides stay as they were fitted.
void prepare_exact_samples(const LightSamples& samples, ExactLight& kept);

/// Masks of all receivers, exact, by a light that was prepared. Allocates nothing where `work` has room for the
/// receivers and the lists of leaves are not longer than they ever were, unless receivers lie in the light's plane or
/// near to a light that has none.
void solve_exact(const ExactBlockers& blockers, const ReceiverArray& receivers, const Light& light,
                 const LightSamples& samples, const ShadowConfig& config, ExactLight& kept, ExactWork& work,
                 VisibilityMasks& masks, ShadowStats& stats);

/// Masks of all receivers, exact. Receivers in the light's plane or near to a light that has none are handed to the
/// alias-free shadow map, which gives the same masks. stats.build_ms is what making `kept` took.
void solve_exact(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                 const LightSamples& samples, const ShadowConfig& config, KeptExact& kept, VisibilityMasks& masks,
                 ShadowStats& stats);

}  // namespace halfshade
