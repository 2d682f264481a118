#include "shadows/penumbra_kernel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "shadows/penumbra_kernel.cpp"
#include <hwy/foreach_target.h>

#include "shadows/edge_planes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace halfshade {
namespace HWY_NAMESPACE {

LeafResult CastOnLeaf(const Blocker& blocker, const KernelSamples& samples, const std::uint64_t* active,
                      std::size_t begin, std::size_t end, bool release, KernelReceivers& receivers, MaskPool& pool,
                      std::uint32_t& finished, KernelCounters& counters) {
  const std::size_t lanes = hn::Lanes(Tag());
  EdgePlanes planes;
  LeafResult result;
  counters.pairs_tested += end - begin;
  const std::uint64_t necessary = counters.pairs_necessary;
  for (std::size_t i = begin; i < end; i += lanes) {
    const BatchResult batch = TestBatch(blocker, samples, receivers, i, std::min(lanes, end - i), planes);
    result.met = result.met || batch.candidates != 0;
    for (std::uint64_t rest = batch.candidates; rest != 0; rest &= rest - 1) {
      const auto lane = static_cast<std::size_t>(std::countr_zero(rest));
      const std::size_t at = i + lane;
      if (receivers.mask_at[at] == nullptr) receivers.mask_at[at] = pool.take();
      TestCandidate(blocker, samples, batch, planes, lane, at, receivers, counters, [&](const ScaledPlanes& p) {
        return TestSamples(blocker, samples, p, at, receivers, counters, active);
      });
      if (receivers.open[at] != 0) continue;
      ++finished;
      if (!release) continue;
      pool.release(receivers.mask_at[at]);
      receivers.mask_at[at] = nullptr;
    }
  }
  result.added = counters.pairs_necessary != necessary;
  return result;
}

}  // namespace HWY_NAMESPACE
}  // namespace halfshade
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace halfshade {

HWY_EXPORT(CastOnLeaf);

LeafResult cast_on_leaf(const Blocker& blocker, const KernelSamples& samples, const std::uint64_t* active,
                        std::size_t begin, std::size_t end, bool release, KernelReceivers& receivers, MaskPool& pool,
                        std::uint32_t& finished, KernelCounters& counters) {
  return HWY_DYNAMIC_DISPATCH(CastOnLeaf)(blocker, samples, active, begin, end, release, receivers, pool, finished,
                                          counters);
}

std::uint64_t* MaskPool::take() {
  if (free_.empty()) {
    chunks_.push_back(std::make_unique<std::uint64_t[]>(kChunk * words_));
    for (std::size_t i = 0; i < kChunk; ++i) free_.push_back(chunks_.back().get() + i * words_);
  }
  std::uint64_t* mask = free_.back();
  free_.pop_back();
  std::fill_n(mask, words_, 0);
  peak_ = std::max(peak_, ++live_);
  return mask;
}

void MaskPool::release(std::uint64_t* mask) {
  free_.push_back(mask);
  --live_;
}

std::size_t MaskPool::take_peak() {
  const std::size_t peak = peak_;
  peak_ = live_;
  return peak;
}

}  // namespace halfshade
#endif
