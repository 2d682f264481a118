#include "shadows/oracle.h"

#include <algorithm>

#include "rasterizer/core/parallel.h"
#include "shadows/alpha.h"
#include "shadows/solver.h"

namespace halfshade {
namespace {

struct Box {
  vec3 low, high;
  bool meets(const Box& o) const {
    return low.x <= o.high.x && o.low.x <= high.x && low.y <= o.high.y && o.low.y <= high.y && low.z <= o.high.z &&
           o.low.z <= high.z;
  }
};

void block_samples(const LatticeMesh& mesh, std::uint32_t triangle, const vec3& r, std::span<const vec3> samples,
                   std::span<std::uint64_t> mask) {
  const auto [a, b, c] = mesh.corners(triangle);
  const bool perforated = mesh.alpha_map(triangle) != kNone;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if ((mask[i / 64] >> (i % 64)) & 1) continue;
    if (!blocks(a, b, c, r, samples[i])) continue;
    if (perforated && !opaque_at_hit(make_alpha_triangle(mesh, triangle), r, samples[i])) continue;
    mask[i / 64] |= std::uint64_t{1} << (i % 64);
  }
}

/// Receivers between two reports of progress: as many as take about a tenth of a second, so that stopping is prompt,
/// but enough to keep all threads busy. Most tests are rejected early, in about a nanosecond.
std::size_t receivers_per_round(std::size_t tests_per_receiver) {
  constexpr std::size_t kTestsPerThread = 100'000'000;
  const std::size_t threads = concurrency();
  return threads * std::clamp<std::size_t>(kTestsPerThread / std::max<std::size_t>(1, tests_per_receiver), 2, 1024);
}

}  // namespace

void oracle_mask(const LatticeMesh& mesh, const ReceiverArray& receivers, std::size_t receiver,
                 const LightSamples& samples, std::span<std::uint64_t> mask) {
  const vec3 r = receivers.position[receiver];
  const std::span<const vec3> set = samples.set(receivers.set[receiver]);
  Box reach{r, r};
  for (const vec3& l : set) reach = {glm::min(reach.low, l), glm::max(reach.high, l)};
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    if (t == receivers.triangle[receiver]) continue;
    const auto [a, b, c] = mesh.corners(t);
    if (Box{glm::min(glm::min(a, b), c), glm::max(glm::max(a, b), c)}.meets(reach)) {
      block_samples(mesh, t, r, set, mask);
    }
  }
}

void solve_oracle(const LatticeMesh& mesh, const ReceiverArray& receivers, const LightSamples& samples,
                  const ShadowConfig& config, VisibilityMasks& masks) {
  const std::size_t round = receivers_per_round(mesh.triangles.size() * samples.count);
  masks.reset(receivers.size(), samples.count);
  for (std::size_t first = 0; first < receivers.size(); first += round) {
    report_progress(config, static_cast<double>(first) / static_cast<double>(receivers.size()));
    parallel_ranges(std::min(round, receivers.size() - first), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = first + begin; i != first + end; ++i) {
        oracle_mask(mesh, receivers, i, samples,
                    {masks.words.data() + i * masks.words_per_receiver, masks.words_per_receiver});
      }
    });
  }
}

}  // namespace halfshade
