// What a benchmark works on: the receivers of one picture under one light.
#pragma once

#include <string>

#include "halfshade/shadows.h"
#include "rasterizer/gbuffer.h"
#include "shadows/receivers.h"

namespace halfshade::bench {

/// One row of work: a scene, one of its lights at one size, the receivers of one picture.
struct Case {
  std::string scene, light_name;
  double light_percent = 0.0;  // the light's diagonal in percent of the scene box's
  Light light;
  LatticeMesh mesh;
  GBuffer gbuffer;
  LightSamples samples;
  ReceiverArray receivers;
  std::vector<std::uint32_t> order;  // receivers by 4x4-pixel tile
};

struct OracleCheck {
  std::uint64_t receivers = 0, wrong_bits = 0;
};

/// Edge length of a rectangle's diagonal, diameter of a disk or sphere, world units; 0 for other shapes.
double light_diagonal(const Light& light);
double box_diagonal(const Scene& scene);
void scale_light(Light& light, double factor);

/// The same steps as the command line's render verb, for light number `light` of `view`; `size` is "WIDTHxHEIGHT",
/// `config` gives samples, pattern, sets and seed. The mesh refers to `scene`. Throws Error{kUsage}.
Case make_case(const std::string& name, const Scene& scene, const View& view, std::size_t light,
               const std::string& size, const ShadowConfig& config);

/// Receivers in random order against the oracle, until the wanted share or the time is used up.
OracleCheck check_with_oracle(const Case& c, const VisibilityMasks& masks, double percent, double seconds);

}  // namespace halfshade::bench
