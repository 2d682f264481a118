// What the visibility kernel prepares once per blocker, and how it settles what floats cannot decide. Scalar code
// shared by all instruction sets.
#pragma once

#include "shadows/alpha.h"
#include "shadows/visibility_kernel.h"

namespace halfshade {

/// Bound on the relative error of the kernel's float determinants, as a multiple of the product of the 1-norms of their
/// vectors. Each factor is a rounded difference (1 unit of 2^-24), the cross product adds 3, the two dot products and
/// the rounded offset of the sample 8 more: 12 in all. 16 leaves room for rounding the bound itself.
inline constexpr float kDeterminantError = 16.0f * 0x1p-24f;

/// A blocker seen by one light: edges, plane, and on which sides of the plane the samples lie.
struct Blocker {
  std::uint32_t triangle = kNone;
  std::array<vec3, 3> corner, edge;                 // edge[k] = corner[k + 1] - corner[k]
  vec3 normal{0.0f};                                // edge[0] x edge[1], not normalised
  std::array<float, 3> edge_error{};                // kDeterminantError * |edge|_1
  float side_error = 0.0f;                          // kDeterminantError * |edge[0]|_1 |edge[1]|_1
  float plane_at_center = 0.0f;                     // normal . (light centre - corner 0)
  float plane_error = 0.0f;                         // error bound of normal . (sample - corner 0)
  bool samples_above = true, samples_below = true;  // some sample may lie on that side (along the normal) of the plane
  bool all_above = false, all_below = false;        // all samples certainly do
  bool back_faces_only = false;                     // for receivers outside the box: certified (closed_components.h)
  vec3 box_low{0.0f}, box_high{0.0f};               // of the blocker's component, if back_faces_only
  bool perforated = false;                          // alpha-tested
  const AlphaTriangle* alpha = nullptr;             // set by the caller of make_blocker for perforated ones
};

/// The plane of a triangle, as in Blocker.
struct BlockerPlane {
  vec3 normal{0.0f};
  float side_error = 0.0f;
};
BlockerPlane plane_of(const std::array<vec3, 3>& corners);

/// Where the samples lie of a plane through `corner`, as in Blocker.
struct SampleSides {
  float plane_at_center = 0.0f, plane_error = 0.0f;
  bool samples_above = true, samples_below = true;
};
SampleSides sides_of_samples(const BlockerPlane& plane, const vec3& corner, const KernelSamples& samples);

Blocker make_blocker(const LatticeMesh& mesh, const KernelSamples& samples, std::uint32_t triangle);
/// The same of corners at hand.
Blocker make_blocker(const std::array<vec3, 3>& corners, bool perforated, const KernelSamples& samples,
                     std::uint32_t triangle);

/// Settles up to 64 samples of one receiver: `inside` are bits of samples that the blocker's outline certainly covers,
/// `doubtful` those the float filter left open. Returns the bits of the samples that are blocked.
std::uint64_t settle_samples(const Blocker& blocker, const vec3& receiver, std::span<const vec3> samples,
                             std::uint64_t inside, std::uint64_t doubtful, KernelCounters& counters);

}  // namespace halfshade
