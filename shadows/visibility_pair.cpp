#include "shadows/visibility_pair.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include <glm/vector_relational.hpp>

#include "rasterizer/core/reuse.h"
#include "shadows/closed_components.h"
#include "shadows/light_view.h"

namespace halfshade {
namespace {

float norm1(const vec3& v) { return std::fabs(v.x) + std::fabs(v.y) + std::fabs(v.z); }
float norm_max(const vec3& v) { return std::max({std::fabs(v.x), std::fabs(v.y), std::fabs(v.z)}); }

/// Sorts the sample indices of every set, [set][sample], so that each run of 16 is compact: halves along the longest
/// side, at multiples of 16. The sets are split alike, so that equal runs of different sets lie near each other.
void group_neighbours(const LightSamples& samples, std::size_t first, std::size_t count,
                      std::vector<std::uint32_t>& order) {
  if (count <= KernelSamples::kGroup) return;
  vec3 low(2.0f), high(-2.0f);
  for (std::uint32_t set = 0; set < samples.sets; ++set) {
    for (std::size_t i = first; i < first + count; ++i) {
      const vec3& p = samples.set(set)[order[std::size_t{set} * samples.count + i]];
      low = glm::min(low, p), high = glm::max(high, p);
    }
  }
  const vec3 extent = high - low;
  const int axis = extent.x >= extent.y && extent.x >= extent.z ? 0 : (extent.y >= extent.z ? 1 : 2);
  const std::size_t groups = (count + KernelSamples::kGroup - 1) / KernelSamples::kGroup;
  const std::size_t middle = groups / 2 * KernelSamples::kGroup;
  for (std::uint32_t set = 0; set < samples.sets; ++set) {
    const std::span<const vec3> points = samples.set(set);
    const auto begin = order.begin() + static_cast<std::ptrdiff_t>(std::size_t{set} * samples.count + first);
    std::nth_element(begin, begin + static_cast<std::ptrdiff_t>(middle), begin + static_cast<std::ptrdiff_t>(count),
                     [&](std::uint32_t a, std::uint32_t b) {
                       const float x = points[a][axis], y = points[b][axis];
                       return x != y ? x < y : a < b;
                     });
  }
  group_neighbours(samples, first, middle, order);
  group_neighbours(samples, first + middle, count - middle, order);
}

/// KernelSamples::order: first [set][sample] packed, then moved apart from the last set on, with padding.
void order_samples(const LightSamples& samples, SampleOrder sample_order, KernelSamples& kernel) {
  std::vector<std::uint32_t>& order = kernel.order;
  order.resize(std::size_t{samples.sets} * samples.count);
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = static_cast<std::uint32_t>(i % samples.count);
  if (sample_order == SampleOrder::kNeighboursTogether) group_neighbours(samples, 0, samples.count, order);
  order.resize(std::size_t{samples.sets} * kernel.padded);
  for (std::size_t set = samples.sets; set-- > 0;) {
    std::uint32_t *from = order.data() + set * samples.count, *to = order.data() + set * kernel.padded;
    std::copy_backward(from, from + samples.count, to + samples.count);
    std::fill(to + samples.count, to + kernel.padded, to[samples.count - 1]);
  }
}

/// Bounding boxes of the groups, in offsets from the light's centre; widened so that float rounding cannot shrink them.
void add_groups(KernelSamples& kernel) {
  const std::uint32_t groups = kernel.padded / KernelSamples::kGroup;
  kernel.group_stride = (groups + 63) / 64 * 64;
  for (auto* values :
       {&kernel.group_x, &kernel.group_y, &kernel.group_z, &kernel.half_x, &kernel.half_y, &kernel.half_z}) {
    values->assign(std::size_t{kernel.sets} * kernel.group_stride, 0.0f);
  }
  for (std::size_t g = 0; g < std::size_t{kernel.sets} * groups; ++g) {
    const std::size_t first = g * KernelSamples::kGroup, at = g / groups * kernel.group_stride + g % groups;
    vec3 low(kernel.x[first], kernel.y[first], kernel.z[first]), high = low;
    for (std::size_t i = first; i < first + KernelSamples::kGroup; ++i) {
      const vec3 p(kernel.x[i], kernel.y[i], kernel.z[i]);
      low = glm::min(low, p), high = glm::max(high, p);
    }
    const vec3 center = (low + high) * 0.5f, half = (high - low) * (0.5f + 0x1p-20f) + glm::abs(center) * 0x1p-20f;
    kernel.group_x[at] = center.x, kernel.group_y[at] = center.y, kernel.group_z[at] = center.z;
    kernel.half_x[at] = half.x, kernel.half_y[at] = half.y, kernel.half_z[at] = half.z;
  }
}

}  // namespace

KernelSamples make_kernel_samples(const LightSamples& samples, const LightBound& bound, SampleOrder sample_order,
                                  KernelSamples reuse) {
  KernelSamples kernel;
  kernel.order = emptied(reuse.order), kernel.points = emptied(reuse.points), kernel.valid = emptied(reuse.valid);
  kernel.closed_usable = emptied(reuse.closed_usable);
  kernel.x = emptied(reuse.x), kernel.y = emptied(reuse.y), kernel.z = emptied(reuse.z);
  kernel.group_x = emptied(reuse.group_x), kernel.group_y = emptied(reuse.group_y);
  kernel.group_z = emptied(reuse.group_z), kernel.half_x = emptied(reuse.half_x);
  kernel.half_y = emptied(reuse.half_y), kernel.half_z = emptied(reuse.half_z);
  kernel.count = samples.count;
  kernel.padded = (samples.count + 63) / 64 * 64;
  kernel.sets = samples.sets;
  kernel.center = bound.center;
  order_samples(samples, sample_order, kernel);
  for (std::size_t i = 0; i < kernel.order.size(); ++i) {
    const vec3 point = samples.set(static_cast<std::uint32_t>(i / kernel.padded))[kernel.order[i]];
    const vec3 offset = point - bound.center;
    kernel.points.push_back(point);
    kernel.x.push_back(offset.x), kernel.y.push_back(offset.y), kernel.z.push_back(offset.z);
    kernel.reach = std::max(kernel.reach, norm_max(offset));
  }
  add_groups(kernel);
  for (int k = 0; k < 3; ++k) kernel.half_axes[k] = vec3(bound.half_axes[k] * (1.0 + 0x1p-20));
  kernel.valid.assign(kernel.padded / 64, ~std::uint64_t{0});
  if (samples.count % 64 != 0) kernel.valid.back() = (std::uint64_t{1} << (samples.count % 64)) - 1;
  return kernel;
}

void use_certificate(const ClosedComponents& closed, KernelSamples& samples) {
  samples.closed = &closed;
  vec3 low = samples.points[0], high = low;
  for (const vec3& p : samples.points) low = glm::min(low, p), high = glm::max(high, p);
  samples.closed_usable.clear();
  for (const ClosedComponents::Box& box : closed.boxes) {
    samples.closed_usable.push_back(glm::any(glm::lessThan(high, box.low)) ||
                                    glm::any(glm::greaterThan(low, box.high)));
  }
}

void restore_sample_order(const KernelSamples& samples, std::uint32_t set, std::span<const std::uint64_t> kernel_mask,
                          std::span<std::uint64_t> mask) {
  bool all = true, none = true;
  for (std::size_t w = 0; w < mask.size(); ++w) {
    all = all && kernel_mask[w] == samples.valid[w];
    none = none && kernel_mask[w] == 0;
  }
  if (all || none) {
    std::copy(kernel_mask.begin(), kernel_mask.end(), mask.begin());
    return;
  }
  std::fill(mask.begin(), mask.end(), 0);
  const std::uint32_t* order = samples.order.data() + std::size_t{set} * samples.padded;
  for (std::size_t w = 0; w < mask.size(); ++w) {
    for (std::uint64_t rest = kernel_mask[w]; rest != 0; rest &= rest - 1) {
      const std::uint32_t index = order[64 * w + static_cast<std::size_t>(std::countr_zero(rest))];
      mask[index / 64] |= std::uint64_t{1} << (index % 64);
    }
  }
}

BlockerPlane plane_of(const std::array<vec3, 3>& corners) {
  const vec3 a = corners[1] - corners[0], b = corners[2] - corners[1];
  return {glm::cross(a, b), kDeterminantError * norm1(a) * norm1(b)};
}

SampleSides sides_of_samples(const BlockerPlane& plane, const vec3& corner, const KernelSamples& samples) {
  SampleSides sides;
  const vec3 to_center = samples.center - corner;
  sides.plane_at_center = glm::dot(plane.normal, to_center);
  sides.plane_error = plane.side_error * (norm_max(to_center) + samples.reach);
  float reach = sides.plane_error;
  for (const vec3& h : samples.half_axes) reach += std::fabs(glm::dot(plane.normal, h));
  sides.samples_above = sides.plane_at_center + reach >= 0.0f;
  sides.samples_below = sides.plane_at_center - reach <= 0.0f;
  return sides;
}

Blocker make_blocker(const LatticeMesh& mesh, const KernelSamples& samples, std::uint32_t triangle) {
  return make_blocker(mesh.corners(triangle), mesh.alpha_map(triangle) != kNone, samples, triangle);
}

Blocker make_blocker(const std::array<vec3, 3>& corners, bool perforated, const KernelSamples& samples,
                     std::uint32_t triangle) {
  Blocker b;
  b.triangle = triangle;
  b.corner = corners;
  for (int k = 0; k < 3; ++k) {
    b.edge[k] = b.corner[(k + 1) % 3] - b.corner[k];
    b.edge_error[k] = kDeterminantError * norm1(b.edge[k]);
  }
  const BlockerPlane plane = plane_of(corners);
  b.normal = plane.normal, b.side_error = plane.side_error;
  const SampleSides sides = sides_of_samples(plane, b.corner[0], samples);
  b.plane_at_center = sides.plane_at_center, b.plane_error = sides.plane_error;
  b.samples_above = sides.samples_above, b.samples_below = sides.samples_below;
  b.all_above = !b.samples_below;
  b.all_below = !b.samples_above;
  if (samples.closed != nullptr && samples.closed->of_triangle[triangle] != kNone) {
    const std::uint32_t component = samples.closed->of_triangle[triangle];
    b.back_faces_only = samples.closed_usable[component] != 0;
    b.box_low = samples.closed->boxes[component].low, b.box_high = samples.closed->boxes[component].high;
  }
  b.perforated = perforated;
  return b;
}

std::uint64_t settle_samples(const Blocker& blocker, const vec3& receiver, std::span<const vec3> samples,
                             std::uint64_t inside, std::uint64_t doubtful, KernelCounters& counters) {
  const auto& [a, b, c] = blocker.corner;
  counters.exact_fallbacks += static_cast<std::uint64_t>(std::popcount(doubtful));
  for (std::uint64_t rest = doubtful; rest != 0; rest &= rest - 1) {
    const int bit = std::countr_zero(rest);
    if (blocks(a, b, c, receiver, samples[static_cast<std::size_t>(bit)])) inside |= std::uint64_t{1} << bit;
  }
  if (!blocker.perforated || inside == 0) return inside;
  const AlphaLookup lookup(*blocker.alpha, receiver);
  for (std::uint64_t rest = inside; rest != 0; rest &= rest - 1) {
    const int bit = std::countr_zero(rest);
    if (!lookup.opaque(samples[static_cast<std::size_t>(bit)], counters.exact_fallbacks))
      inside &= ~(std::uint64_t{1} << bit);
  }
  return inside;
}

}  // namespace halfshade
