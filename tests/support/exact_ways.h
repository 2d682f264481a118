// Method exact with all clusters of receivers solved one way, which it chooses by the clock otherwise.
#pragma once

#include "shadows/exact_engine.h"
#include "shadows/receiver_request.h"
#include "support/lit_scene.h"

namespace halfshade::test {

/// Scenes of opaque triangles alone.
inline VisibilityMasks solve_exact_by(Beams beams, const Scene& scene, const std::vector<Receiver>& receivers,
                                      const Light& light, const ShadowConfig& config, ShadowStats* stats = nullptr) {
  const LatticeMesh mesh =
      make_lattice_mesh(scene, make_local_frame(scene.positions, receiver_reach(receivers, light)));
  const ReceiverRequest request = make_receiver_request(mesh.frame, receivers, light, config);
  KeptExact kept;
  kept.work.beams = beams;
  VisibilityMasks solved, masks;
  ShadowStats own;
  solve_exact(mesh, request.receivers, light, request.samples, config, kept, solved, stats != nullptr ? *stats : own);
  spread_masks(request, solved, receivers.size(), masks);
  return masks;
}

}  // namespace halfshade::test
