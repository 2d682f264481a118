// Answers sets of light samples one after the other for receivers that become fewer: what a scene and light need is
// made once, every set then costs only the receivers that still ask.
#pragma once

#include "shadows/blocker_tree.h"
#include "shadows/closed_components.h"
#include "shadows/receivers.h"
#include "shadows/set_sequence.h"

namespace halfshade {

/// What a receiver sees of one set.
struct SetAnswer {
  std::uint32_t visible = 0;   // samples
  std::uint32_t boundary = 0;  // pairs of neighbouring samples, one visible and one not
  bool lit = false;            // proved: no blocker's box meets the shaft from the receiver's cluster to the light
};

class LevelEngine {
 public:
  /// References are kept. All receivers use set 0. `mesh` holds opaque triangles only (opaque_mesh.h).
  LevelEngine(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light, const ShadowConfig& config,
              std::uint32_t side, ShadowStats& stats);

  /// Sets `first` .. `end - 1` for receivers `which`, which should be in an order that keeps neighbours together.
  /// `answers` get [set][place in which].
  void solve_sets(std::uint32_t first, std::uint32_t end, std::span<const std::uint32_t> which,
                  std::vector<SetAnswer>& answers);

  /// Certificate: no triangle can hide any point of the light from any of `which`. Only after the first set.
  bool all_lit(std::span<const std::uint32_t> which) const;
  /// Certificate: some single opaque triangle hides the whole light from all of `which`. Only after the first set.
  bool all_dark(std::span<const std::uint32_t> which) const;

  std::uint32_t set_size() const { return side_ * side_; }
  bool uses_rows() const { return rows_; }

 private:
  void solve_rows(const LightSamples& samples, std::span<const std::uint32_t> which, std::span<SetAnswer> answers);
  void solve_row_side(const struct RowSetup& setup, const LightFrame& frame, std::span<const std::uint32_t> which,
                      std::span<SetAnswer> answers);
  void solve_generally(const LightSamples& samples, std::span<const std::uint32_t> which, std::span<SetAnswer> answers);
  void prepare_samples(const LightSamples& samples, RowSetup& setup);

  const LatticeMesh& mesh_;
  const ReceiverArray& receivers_;
  const Light& light_;
  const ShadowConfig& config_;
  std::uint32_t side_;
  ShadowStats& stats_;
  bool rows_;
  BlockerTree tree_;
  LightFrame frame_;  // that the boxes of the tree are in
  ClosedComponents closed_;
  std::vector<std::uint8_t> closed_usable_;  // found with the first set and all receivers
  std::vector<vec3> corners_;                // of a convex region around the light, on the lattice
};

}  // namespace halfshade
