#include <algorithm>

#include "rasterizer/core/parallel.h"
#include "shadows/receivers.h"
#include "shadows/visibility_kernel.h"

namespace halfshade {

KernelReceivers gather_receivers(const ReceiverArray& receivers, const std::vector<std::uint32_t>& order,
                                 std::size_t words) {
  KernelReceivers k;
  gather_receivers(receivers, order, words, k);
  return k;
}

void gather_receivers(const ReceiverArray& receivers, const std::vector<std::uint32_t>& order, std::size_t words,
                      KernelReceivers& k) {
  k.count = order.size();
  k.words = words;
  const std::size_t padded = order.size() + KernelReceivers::kLanePadding;
  k.x.resize(padded), k.y.resize(padded), k.z.resize(padded);
  k.own.resize(padded), k.open.resize(padded), k.set.resize(padded);
  for (std::size_t i = order.size(); i != padded; ++i) {
    k.x[i] = k.y[i] = k.z[i] = 0.0f;
    k.own[i] = kNone, k.open[i] = ~0u, k.set[i] = 0;
  }
  k.masks.assign(order.size() * words, 0);
  k.mask_at.clear();
  parallel_ranges(order.size(), 8192, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) {
      const vec3& p = receivers.position[order[i]];
      k.x[i] = p.x, k.y[i] = p.y, k.z[i] = p.z;
      k.own[i] = receivers.triangle[order[i]];
      k.set[i] = receivers.set[order[i]];
      k.open[i] = ~0u;
    }
  });
}

void scatter_masks(const KernelReceivers& k, const KernelSamples& samples, const std::vector<std::uint32_t>& order,
                   VisibilityMasks& masks) {
  parallel_ranges(order.size(), 8192, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) {
      restore_sample_order(samples, k.set[i], {k.masks.data() + i * k.words, k.words},
                           {masks.words.data() + order[i] * k.words, k.words});
    }
  });
}

void KernelCounters::add(const KernelCounters& o) {
  pairs_tested += o.pairs_tested;
  pairs_sampled += o.pairs_sampled;
  pairs_necessary += o.pairs_necessary;
  sample_tests += o.sample_tests;
  exact_fallbacks += o.exact_fallbacks;
}

void add_to_stats(const KernelCounters& counters, ShadowStats& stats) {
  stats.pairs_tested += counters.pairs_tested;
  stats.pairs_sampled += counters.pairs_sampled;
  stats.pairs_necessary += counters.pairs_necessary;
  stats.sample_tests += counters.sample_tests;
  stats.exact_fallbacks += counters.exact_fallbacks;
}

}  // namespace halfshade
