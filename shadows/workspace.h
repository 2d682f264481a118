// What a Workspace holds.
#pragma once

#include <atomic>

#include "shadows/call_receivers.h"
#include "shadows/exact_engine.h"

namespace halfshade {

/// All that the samples of a light depend on, besides the light.
struct SampleKey {
  SamplePattern pattern = SamplePattern::kRows;
  std::uint32_t count = 0, sets = 0, seed = 0, frame = 0;
  bool interleave = false, rotate = false;
  LocalFrame local;

  bool operator==(const SampleKey& o) const;
};

/// One light as it was when its samples were made, and what was made of it.
struct KeptLight {
  bool filled = false;
  Light light;  // geometry alone
  SampleKey key;
  LightSamples samples;
  EmissionImage image;
  std::vector<vec3> weights;  // of the image, [set][sample]

  // Method exact.
  bool prepared = false;  // `exact` belongs to the samples
  ExactLight exact;
  std::shared_ptr<const int> scene;  // identity of the scene that `exact` was fitted to, and its version
  std::uint64_t scene_version = 0;
};

struct Workspace::Impl {
  explicit Impl(const WorkspaceConfig& config) : lights(config.kept_lights) {}

  std::atomic<bool> busy{false};
  SolveStats stats;
  std::vector<KeptLight> lights;
  CallReceivers receivers;
  LitReceivers lit;
  ExactWork exact;
  VisibilityMasks masks;          // of the lit receivers
  std::vector<float> visibility;  // the same, from methods without masks
};

}  // namespace halfshade
