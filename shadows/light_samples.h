// Where the samples of an area light lie: a pure function of (light, pattern, count, sets, seed, frame).
#pragma once

#include <string>

#include "halfshade/shadows.h"
#include "rasterizer/core/lattice.h"

namespace halfshade {

/// ShadowConfig::frame stays below this: the offsets of the sets, multiples of an irrational number modulo 1, then keep
/// 28 bits behind the point.
inline constexpr std::uint32_t kMaxFrames = 1u << 25;

inline constexpr std::uint32_t kInterleavedSets = 16;

/// All that the places of samples in the unit square depend on.
struct PatternKey {
  SamplePattern pattern = SamplePattern::kRows;
  std::uint32_t count = 0, sets = 0, seed = 0, frame = 0;
  bool rotate = false;  // the sets are copies of the first
  bool disk = false;    // set 0 are rows of a disk of diameter 1 instead of the square

  bool operator==(const PatternKey&) const = default;
};

/// Samples of one light on the lattice of a local frame.
struct LightSamples {
  std::uint32_t count = 0, sets = 1;
  bool interleaved = false;  // sets are chosen by place in a 4x4 pattern of pixels, not by hash
  std::vector<vec3> points;  // [set][sample]
  std::vector<dvec2> st;     // [set][sample] in [0,1]^2, what the pattern gave; empty for explicit samples
  PatternKey st_key;         // what `st` was made of; of 0 samples where not by make_light_samples
  dvec3 center{0.0};         // local frame
  bool flat = false;         // all samples lie (up to rounding) in one plane through `center`
  bool one_sided = false;    // flat, and receivers at or behind the plane get no light
  dvec3 axis_u{1, 0, 0}, axis_v{0, 1, 0}, axis_n{0, 0, 1};  // orthonormal; flat lights: u, v in the plane, n = facing
  std::vector<dvec2> outline;  // polygons: corners around `center`, counter-clockwise, in units of axis_u, axis_v

  std::span<const vec3> set(std::uint32_t index) const { return {points.data() + std::size_t{index} * count, count}; }
};

/// Throws Error{kUsage} for counts out of range, Error{kBadInput} for a degenerate light (message names the light).
/// `reuse` gives its memory, and `st` where the pattern is the same: with samples of an earlier place of the light
/// nothing is allocated.
LightSamples make_light_samples(const Light& light, const ShadowConfig& config, const LocalFrame& frame,
                                LightSamples reuse = {});

/// Throws what make_light_samples throws for this light or configuration.
void check_light(const Light& light, const ShadowConfig& config);

/// 1 for points, their number for explicit samples, else what `config` asks for. Throws as make_light_samples where
/// explicit samples are none or too many.
std::uint32_t samples_of(const Light& light, const ShadowConfig& config);

/// May a light emit this? Finite, and no colour below 0.
inline bool is_emission(const vec3& c) { return is_finite(dvec3(c)) && c.x >= 0.0f && c.y >= 0.0f && c.z >= 0.0f; }

/// What is wrong with the image, for a message, or "": without as many texels as its width and height say, at least
/// one.
std::string size_fault(const EmissionImage& image);
/// The same: with a texel that no light may emit.
std::string texel_fault(const EmissionImage& image);

/// Weights of the samples of every set, [set][sample] (halfshade/emission.h).
std::vector<vec3> sample_emission(const EmissionImage& image, const LightSamples& samples);

/// Point of the unit sphere, in the axes of the frame, that (s, t) of an ellipsoid's sample stands for.
dvec3 unit_sphere_point(const dvec2& st);

/// World-space points that the local frame must reach: corners or bounding box of the light.
std::vector<dvec3> light_extent(const Light& light);

/// Lowest and highest corner of the box around these. `light` has been checked.
std::array<dvec3, 2> light_box(const Light& light);

}  // namespace halfshade
