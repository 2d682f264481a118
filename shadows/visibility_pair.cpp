#include "shadows/visibility_pair.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "shadows/light_view.h"

namespace halfshade {
namespace {

float norm1(const vec3& v) { return std::fabs(v.x) + std::fabs(v.y) + std::fabs(v.z); }
float norm_max(const vec3& v) { return std::max({std::fabs(v.x), std::fabs(v.y), std::fabs(v.z)}); }

}  // namespace

KernelSamples make_kernel_samples(const LightSamples& samples, const LightBound& bound) {
  KernelSamples kernel;
  kernel.count = samples.count;
  kernel.padded = (samples.count + 63) / 64 * 64;
  kernel.center = bound.center;
  kernel.exact = &samples;
  for (std::uint32_t set = 0; set < samples.sets; ++set) {
    const std::span<const vec3> points = samples.set(set);
    for (std::uint32_t i = 0; i < kernel.padded; ++i) {
      const vec3 offset = points[i < samples.count ? i : 0] - bound.center;
      kernel.x.push_back(offset.x), kernel.y.push_back(offset.y), kernel.z.push_back(offset.z);
      kernel.reach = std::max(kernel.reach, norm_max(offset));
    }
  }
  for (int k = 0; k < 3; ++k) kernel.half_axes[k] = vec3(bound.half_axes[k] * (1.0 + 0x1p-20));
  kernel.valid.assign(kernel.padded / 64, ~std::uint64_t{0});
  if (samples.count % 64 != 0) kernel.valid.back() = (std::uint64_t{1} << (samples.count % 64)) - 1;
  return kernel;
}

Blocker make_blocker(const LatticeMesh& mesh, const KernelSamples& samples, std::uint32_t triangle) {
  Blocker b;
  b.triangle = triangle;
  b.corner = mesh.corners(triangle);
  for (int k = 0; k < 3; ++k) {
    b.edge[k] = b.corner[(k + 1) % 3] - b.corner[k];
    b.edge_error[k] = kDeterminantError * norm1(b.edge[k]);
  }
  b.normal = glm::cross(b.edge[0], b.edge[1]);
  b.side_error = b.edge_error[0] * norm1(b.edge[1]);
  const vec3 to_center = samples.center - b.corner[0];
  b.plane_at_center = glm::dot(b.normal, to_center);
  b.plane_error = b.side_error * (norm_max(to_center) + samples.reach);
  float reach = b.plane_error;
  for (const vec3& h : samples.half_axes) reach += std::fabs(glm::dot(b.normal, h));
  b.samples_above = b.plane_at_center + reach >= 0.0f;
  b.samples_below = b.plane_at_center - reach <= 0.0f;
  b.all_above = !b.samples_below;
  b.all_below = !b.samples_above;
  b.perforated = mesh.alpha_map(triangle) != kNone;
  if (b.perforated) b.alpha = make_alpha_triangle(mesh, triangle);
  return b;
}

std::uint64_t settle_word(const Blocker& blocker, const vec3& receiver, std::span<const vec3> samples,
                          std::uint32_t first_sample, std::uint64_t inside, std::uint64_t doubtful,
                          KernelCounters& counters) {
  const auto& [a, b, c] = blocker.corner;
  counters.exact_fallbacks += static_cast<std::uint64_t>(std::popcount(doubtful));
  for (std::uint64_t rest = doubtful; rest != 0; rest &= rest - 1) {
    const int bit = std::countr_zero(rest);
    if (blocks(a, b, c, receiver, samples[first_sample + bit])) inside |= std::uint64_t{1} << bit;
  }
  if (!blocker.perforated) return inside;
  for (std::uint64_t rest = inside; rest != 0; rest &= rest - 1) {
    const int bit = std::countr_zero(rest);
    if (!opaque_at_hit(blocker.alpha, receiver, samples[first_sample + bit])) inside &= ~(std::uint64_t{1} << bit);
  }
  return inside;
}

}  // namespace halfshade
