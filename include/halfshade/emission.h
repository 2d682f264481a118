// Emission images: light of many colours over a rectangle, weighed into visibility. Masks do not depend on it, so that
// stored masks answer for any image.
#pragma once

#include "halfshade/light.h"
#include "halfshade/shadows.h"

namespace halfshade {

/// Weight of each sample: mean colour of the image over a square of area 1 / n (clipped to the unit square) around its
/// (s, t), divided by the number n of samples. s runs along the rectangle's u, t along v, both 0..1; t = 1 is row 0 of
/// the image. The weights of a constant image add up to its colour. Throws Error{kUsage} for an empty image;
/// Error{kBadInput} for one without width * height texels, a texel that is negative or not finite, or a sample outside
/// of the square.
HALFSHADE_API std::vector<vec3> sample_emission(const EmissionImage& image, std::span<const dvec2> st);

/// The same for the samples of a light, [set][sample]; `light` is a rectangle with an emission image and `config` what
/// solve_shadows was called with.
HALFSHADE_API std::vector<vec3> sample_emission(const Light& light, const ShadowConfig& config);

/// Sum of the weights of all samples that the mask does not block, in order of samples, in double. `mask` is one
/// receiver's words of VisibilityMasks, `weights` has one value per sample.
HALFSHADE_API vec3 weighted_visibility(std::span<const std::uint64_t> mask, std::span<const vec3> weights);

}  // namespace halfshade
