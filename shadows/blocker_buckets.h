// Coarse blocker sorting (Laine and Aila 2005, section 3.3): large blockers first, in linear time.
#pragma once

#include "rasterizer/core/mesh.h"

namespace halfshade {

/// Areas of blockers as a histogram over powers of two, and the border of each bucket: two passes over the blockers,
/// in any pieces, sort any number of them.
class AreaBuckets {
 public:
  static constexpr std::size_t kSteps = 256;

  /// Twice the area, squared: monotonic in the area, a pure function of the corners.
  static double size_of(const std::array<vec3, 3>& corners);

  void count(const std::array<vec3, 3>& corners) { ++histogram_[step_of(size_of(corners))]; }
  /// `number` blockers whose size has this exponent (as of frexp).
  void add(int exponent, std::uint64_t number) { histogram_[step_of_exponent(exponent)] += number; }
  /// Borders for `buckets` of about equal numbers of blockers, the largest areas first. 1..256.
  void finish(std::uint32_t buckets);
  std::uint32_t bucket_of(const std::array<vec3, 3>& corners) const {
    return bucket_of_step_[step_of(size_of(corners))];
  }

 private:
  static std::size_t step_of_exponent(int exponent);
  static std::size_t step_of(double size);
  std::array<std::uint64_t, kSteps> histogram_{};
  std::array<std::uint8_t, kSteps> bucket_of_step_{};
};

/// The triangles of a mesh in the order in which they are cast: opaque ones by bucket, then alpha-tested ones by bucket
/// (section 3.4); within a bucket in their own order. `buckets` 0 keeps the mesh's order.
std::vector<std::uint32_t> casting_order(const LatticeMesh& mesh, std::uint32_t buckets);

}  // namespace halfshade
