// FLIP: how different two pictures look when one is flipped for the other on a screen (Andersson, Nilsson,
// Akenine-Moeller, Oskarsson, Astrom, Fairchild 2020, the form for pictures of low dynamic range).
//
// Per pixel, 0 (no difference) to 1 (the largest that a screen can show). Colours are blurred by the eye's contrast
// sensitivity in an opponent space and compared in CIELAB by a distance that city blocks lightness (HyAB), with chroma
// weighed by lightness (Hunt effect); where edges or points differ, the error is raised.
#pragma once

#include <cstdint>

#include "halfshade/types.h"

namespace halfshade {

/// A screen 0.7 m wide with 3840 pixels, seen from 0.7 m.
inline constexpr double kFlipPixelsPerDegree = 67.0;

/// FLIP of every pixel, [height][width]; `a` and `b` are linear RGB of IEC 61966-2-1, [height][width], clamped to 0..1
/// (NaN counts as 0). Symmetric in a and b. Throws Error{kUsage} unless both hold width x height pixels, at least one,
/// and 1 <= pixels_per_degree <= 1000. Runs in the calling thread's TBB arena; equal bits for any number of threads.
std::vector<float> flip_errors(std::span<const vec3> a, std::span<const vec3> b, std::uint32_t width,
                               std::uint32_t height, double pixels_per_degree = kFlipPixelsPerDegree);

/// Mean of flip_errors for two pictures of visibility as the reports show them: grey, 0..1 taken as sRGB code values.
double mean_flip_of_grey(std::span<const float> a, std::span<const float> b, std::uint32_t width, std::uint32_t height);

/// Mean of the values; 0 for none.
double mean_of(std::span<const float> values);

}  // namespace halfshade
