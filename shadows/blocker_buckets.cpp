#include "shadows/blocker_buckets.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace halfshade {

double AreaBuckets::size_of(const std::array<vec3, 3>& corners) {
  const dvec3 a(corners[0]);
  const dvec3 n = glm::cross(dvec3(corners[1]) - a, dvec3(corners[2]) - a);
  return glm::dot(n, n);
}

/// Sizes reach from 2^-160 (edges of one lattice unit) to 2^6; steps are powers of two, each half a power of the area.
std::size_t AreaBuckets::step_of_exponent(int exponent) {
  return static_cast<std::size_t>(std::clamp(exponent + 200, 0, static_cast<int>(kSteps) - 1));
}

std::size_t AreaBuckets::step_of(double size) {
  if (!(size > 0.0)) return 0;
  int exponent = 0;
  std::frexp(size, &exponent);
  return step_of_exponent(exponent);
}

void AreaBuckets::finish(std::uint32_t buckets) {
  const std::uint64_t total = std::accumulate(histogram_.begin(), histogram_.end(), std::uint64_t{0});
  std::uint64_t before = 0;
  for (std::size_t step = kSteps; step-- > 0; before += histogram_[step]) {
    const std::uint64_t middle = before + histogram_[step] / 2;
    const std::uint64_t bucket = total == 0 ? 0 : middle * buckets / total;
    bucket_of_step_[step] = static_cast<std::uint8_t>(std::min<std::uint64_t>(bucket, buckets - 1));
  }
}

std::vector<std::uint32_t> casting_order(const LatticeMesh& mesh, std::uint32_t buckets) {
  std::vector<std::uint32_t> order(mesh.triangles.size());
  std::iota(order.begin(), order.end(), 0u);
  if (buckets == 0) return order;
  AreaBuckets areas;
  for (std::uint32_t t = 0; t < order.size(); ++t) areas.count(mesh.corners(t));
  areas.finish(buckets);
  const auto bucket_of = [&](std::uint32_t t) {
    return areas.bucket_of(mesh.corners(t)) + (mesh.alpha_map(t) != kNone ? buckets : 0);
  };
  std::vector<std::uint32_t> first(2 * std::size_t{buckets} + 1, 0);
  for (std::uint32_t t = 0; t < order.size(); ++t) ++first[bucket_of(t) + 1];
  std::partial_sum(first.begin(), first.end(), first.begin());
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) order[first[bucket_of(t)]++] = t;
  return order;
}

}  // namespace halfshade
