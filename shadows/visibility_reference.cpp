#include "shadows/alpha.h"
#include "shadows/visibility_kernel.h"

namespace halfshade {
namespace {

/// True where the triangle added a bit to the receiver's mask.
bool test_pair(const LatticeMesh& mesh, const KernelSamples& samples, std::uint32_t triangle, std::size_t i,
               KernelReceivers& receivers) {
  const auto [a, b, c] = mesh.corners(triangle);
  const vec3 r(receivers.x[i], receivers.y[i], receivers.z[i]);
  const std::span<const vec3> set = samples.set_points(receivers.set[i]).first(samples.count);
  std::uint64_t* mask = receivers.masks.data() + i * receivers.words;
  bool added = false;
  for (std::size_t s = 0; s < set.size(); ++s) {
    const std::uint64_t bit = std::uint64_t{1} << (s % 64);
    if ((mask[s / 64] & bit) != 0 || !blocks(a, b, c, r, set[s])) continue;
    if (mesh.alpha_map(triangle) != kNone && !opaque_at_hit(make_alpha_triangle(mesh, triangle), r, set[s])) continue;
    mask[s / 64] |= bit;
    added = true;
  }
  return added;
}

}  // namespace

void test_blockers_reference(const LatticeMesh& mesh, const KernelSamples& samples, std::span<const BlockerSpan> spans,
                             KernelReceivers& receivers, KernelCounters& counters) {
  for (const BlockerSpan& span : spans) {
    for (std::size_t i = span.begin; i < span.end; ++i) {
      if (receivers.own[i] == span.triangle) continue;
      ++counters.pairs_tested;
      ++counters.pairs_sampled;
      counters.sample_tests += samples.count;
      if (test_pair(mesh, samples, span.triangle, i, receivers)) ++counters.pairs_necessary;
    }
  }
}

}  // namespace halfshade
