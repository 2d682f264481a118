// Light that reaches a surface: the sum over visible samples that ShadowOutput::irradiance describes.
#pragma once

#include "shadows/light_samples.h"

namespace halfshade {

/// One light, ready to be summed. `samples` must outlive it.
struct IrradianceSum {
  const LightSamples* samples = nullptr;
  LightShape shape = LightShape::kRectangle;
  bool two_sided = false;
  /// Emission of a sample times what does not depend on the receiver: area, or units of distance, over samples.
  dvec3 strength{0.0};
  std::span<const vec3> weights;  // [set][sample] in place of the emission, or empty; sums to the mean emission
  /// Ellipsoids: column k times coordinate k of the unit sphere's point, summed, is the outward normal times the
  /// surface's stretch.
  std::array<dvec3, 3> cofactor{};
  dvec3 center{0.0};  // spheres
};

/// `weights` as above; they must outlive the sum.
IrradianceSum make_irradiance_sum(const Light& light, const LightSamples& samples, const LocalFrame& frame,
                                  std::span<const vec3> weights);

/// `mask`: blocked samples of a receiver at `position` (lattice) with unit `normal`. Summed in double in order of
/// samples.
vec3 irradiance(const IrradianceSum& sum, const vec3& position, const vec3& normal, std::uint32_t set,
                std::span<const std::uint64_t> mask);

}  // namespace halfshade
