// Where the samples of an area light lie: a pure function of (light, pattern, count, sets, seed).
#pragma once

#include "halfshade/shadows.h"
#include "rasterizer/core/lattice.h"

namespace halfshade {

/// Samples of one light on the lattice of a local frame.
struct LightSamples {
  std::uint32_t count = 0, sets = 1;
  std::vector<vec3> points;  // [set][sample]
  dvec3 center{0.0};         // local frame
  bool flat = false;         // all samples lie (up to rounding) in one plane through `center`
  bool one_sided = false;    // flat, and receivers at or behind the plane get no light
  dvec3 axis_u{1, 0, 0}, axis_v{0, 1, 0}, axis_n{0, 0, 1};  // orthonormal; flat lights: u, v in the plane, n = facing

  std::span<const vec3> set(std::uint32_t index) const { return {points.data() + std::size_t{index} * count, count}; }
};

/// Throws Error{kUsage} for counts out of range, Error{kBadInput} for a degenerate light (message names the light).
LightSamples make_light_samples(const Light& light, const ShadowConfig& config, const LocalFrame& frame);

/// World-space points that the local frame must reach: corners or bounding box of the light.
std::vector<dvec3> light_extent(const Light& light);

/// (s, t) in [0,1)^2 of sample `index` of `count`, set `set`; rows by increasing t.
dvec2 unit_square_sample(SamplePattern pattern, std::uint32_t index, std::uint32_t count, std::uint32_t set,
                         std::uint32_t seed);

}  // namespace halfshade
