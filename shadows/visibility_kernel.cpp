#include "shadows/visibility_kernel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "shadows/visibility_kernel.cpp"
#include <hwy/foreach_target.h>

#include "shadows/edge_planes-inl.h"
#include "shadows/half_plane_table.h"

HWY_BEFORE_NAMESPACE();
namespace halfshade {
namespace HWY_NAMESPACE {

/// One blocker against the receivers [begin, end).
HWY_INLINE void TestRun(const Blocker& blocker, const KernelSamples& samples, std::size_t begin, std::size_t end,
                        EdgePlanes& planes, KernelReceivers& receivers, KernelCounters& counters) {
  const std::size_t lanes = hn::Lanes(Tag());
  counters.pairs_tested += end - begin;
  for (std::size_t i = begin; i < end; i += lanes) {
    const BatchResult batch = TestBatch(blocker, samples, receivers, i, std::min<std::size_t>(lanes, end - i), planes);
    for (std::uint64_t rest = batch.candidates; rest != 0; rest &= rest - 1) {
      const auto lane = static_cast<std::size_t>(std::countr_zero(rest));
      TestCandidate(blocker, samples, batch, planes, lane, i + lane, receivers, counters, [&](const ScaledPlanes& p) {
        if (samples.table != nullptr && !blocker.perforated) {
          return block_by_table(*samples.table, blocker, samples, i + lane, receivers);
        }
        return TestSamples(blocker, samples, p, i + lane, receivers, counters);
      });
    }
  }
}

void TestBlockers(const LatticeMesh& mesh, const KernelSamples& samples, std::span<const BlockerSpan> spans,
                  KernelReceivers& receivers, KernelCounters& counters) {
  EdgePlanes planes;
  Blocker blocker;
  AlphaTriangle alpha;
  for (const BlockerSpan& span : spans) {
    if (span.triangle != blocker.triangle) {
      blocker = make_blocker(mesh, samples, span.triangle);
      if (blocker.perforated) alpha = make_alpha_triangle(mesh, span.triangle);
      blocker.alpha = &alpha;
    }
    TestRun(blocker, samples, span.begin, span.end, planes, receivers, counters);
  }
}

void TestPreparedBlockers(std::span<const Blocker> blockers, const KernelSamples& samples,
                          std::span<const BlockerSpan> spans, KernelReceivers& receivers, KernelCounters& counters) {
  EdgePlanes planes;
  for (const BlockerSpan& span : spans) {
    TestRun(blockers[span.triangle], samples, span.begin, span.end, planes, receivers, counters);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace halfshade
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace halfshade {

HWY_EXPORT(TestBlockers);
HWY_EXPORT(TestPreparedBlockers);

void test_blockers(const LatticeMesh& mesh, const KernelSamples& samples, std::span<const BlockerSpan> spans,
                   KernelReceivers& receivers, KernelCounters& counters) {
  HWY_DYNAMIC_DISPATCH(TestBlockers)(mesh, samples, spans, receivers, counters);
}

void test_prepared_blockers(std::span<const Blocker> blockers, const KernelSamples& samples,
                            std::span<const BlockerSpan> spans, KernelReceivers& receivers, KernelCounters& counters) {
  HWY_DYNAMIC_DISPATCH(TestPreparedBlockers)(blockers, samples, spans, receivers, counters);
}

}  // namespace halfshade
#endif
