// Answers sets of light samples one after the other for receivers that become fewer: what a scene and light need is
// made once, every set then costs only the receivers that still ask.
#pragma once

#include "shadows/exact_engine.h"
#include "shadows/run_meter.h"

namespace halfshade {

class LevelEngine {
 public:
  /// References are kept. All receivers use set 0. `mesh` holds opaque triangles only (opaque_mesh.h).
  LevelEngine(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light, const ShadowConfig& config,
              ShadowStats& stats);

  /// A round of sets for receivers `which`, which should be in an order that keeps neighbours together. `answers` get
  /// [place in which], sums over the sets.
  void solve_round(const SetShape& shape, const SetRound& round, std::span<const std::uint32_t> which,
                   std::vector<SetAnswer>& answers);

  /// Certificate: no triangle can hide any point of the light from any of `which`. Only after a round.
  bool all_lit(std::span<const std::uint32_t> which) const;
  /// Certificate: some single opaque triangle hides the whole light from all of `which`. Only after a round.
  bool all_dark(std::span<const std::uint32_t> which) const;

  bool uses_rows() const { return rows_; }

 private:
  void prepare(const LightSamples& samples);
  void give_up_withdrawn_certificates();
  void solve(const LightSamples& samples, const ReceiverArray& part);
  const ExactSide* side_of(std::span<const std::uint32_t> which, LightFrame& frame) const;

  const LatticeMesh& mesh_;
  const ReceiverArray& receivers_;
  const Light& light_;
  const ShadowConfig& config_;
  ShadowStats& stats_;
  bool rows_;
  BlockerTree tree_;
  ClosedComponents closed_;
  ExactLight kept_;
  ExactWork work_;
  VisibilityMasks masks_;
  ReceiverArray part_;         // that is being solved
  std::vector<vec3> corners_;  // of a convex region around the light, on the lattice; none if that is no rectangle
};

}  // namespace halfshade
