// Where the segments from one receiver to many light samples cross the plane of a textured triangle: the matrices M, W
// and S of Forest, Barthe, Paulin 2009, section 2.4.
//
// The paper projects a sample s onto the triangle as seen from p by J = W M: three homogeneous barycentric coordinates,
// 15 operations; all three edge tests are comparisons of these. S turns them into homogeneous texture coordinates, 12
// operations with the divisions. W divides by the distance e of p from the triangle's plane. Homogeneous coordinates do
// not care for a common factor, so we use J times e |n|^2: its rows are then the planes through p and the three edges,
// det(a - p, b - a, s - p), nothing is divided by before the texture coordinate itself, and a receiver in the
// triangle's plane (e = 0, stability.md B2) is as good as any. With the weight of the third corner as a row of its own
// (instead of the sum of all three) the matrices become symmetric in the corners.
#pragma once

#include "shadows/visibility_pair.h"

namespace halfshade {

/// Opacity of a map at one threshold as bits: texel (column, up) is bit up * width + column; up = 0 is the row v = 0.
struct OpacityBits {
  std::uint32_t width = 0, height = 0;
  std::vector<std::uint32_t> bits;
};

OpacityBits make_opacity_bits(const AlphaMap& map, std::uint32_t threshold);

/// S: texture coordinates of the corners in texels, moved by whole repetitions of the map so that the least lies in its
/// first one.
struct CornerTexels {
  std::array<double, 3> u{}, v{};
  double reach = 0.0;  // the largest of them
};

CornerTexels make_corner_texels(const AlphaTriangle& triangle);

/// J of one receiver: weight k of a sample is normal[k] . (sample - centre) + offset[k], the centre being the light's.
/// It belongs to the edge from corner k, hence to corner k + 2, and is not negative where the segment passes inside.
struct SampleProjection {
  std::array<dvec3, 3> normal;
  std::array<double, 3> offset{};
  std::array<double, 3> error{};  // bound of the rounding errors when float evaluates the weight
};

/// `side` is the sign of orient3d(corners, receiver), not 0.
SampleProjection make_sample_projection(const Blocker& blocker, const KernelSamples& samples, const vec3& receiver,
                                        int side);

}  // namespace halfshade
