#include "shadows/visibility_kernel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "shadows/visibility_kernel.cpp"
#include <hwy/foreach_target.h>

#include "shadows/edge_planes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace halfshade {
namespace HWY_NAMESPACE {

HWY_INLINE LaneMask InsideBox(const Vec3& p, const Blocker& b) {
  const Tag d;
  const Vec x = hn::Max(hn::Sub(hn::Set(d, b.box_low.x), p.x), hn::Sub(p.x, hn::Set(d, b.box_high.x)));
  const Vec y = hn::Max(hn::Sub(hn::Set(d, b.box_low.y), p.y), hn::Sub(p.y, hn::Set(d, b.box_high.y)));
  const Vec z = hn::Max(hn::Sub(hn::Set(d, b.box_low.z), p.z), hn::Sub(p.z, hn::Set(d, b.box_high.z)));
  return hn::Le(hn::Max(x, hn::Max(y, z)), hn::Zero(d));
}

HWY_INLINE BatchResult TestBatch(const Blocker& blocker, const KernelSamples& samples, const KernelReceivers& receivers,
                                 std::size_t first, std::size_t count, EdgePlanes& planes) {
  const Tag d;
  const UintTag du;
  BatchResult result;
  const Vec3 r{hn::LoadU(d, &receivers.x[first]), hn::LoadU(d, &receivers.y[first]), hn::LoadU(d, &receivers.z[first])};
  const auto own = hn::LoadU(du, &receivers.own[first]), open = hn::LoadU(du, &receivers.open[first]);
  const auto usable = hn::AndNot(hn::VecFromMask(du, hn::Eq(own, hn::Set(du, blocker.triangle))), open);
  LaneMask active = hn::And(hn::FirstN(d, count), hn::RebindMask(d, hn::Ne(usable, hn::Zero(du))));

  const std::array<Vec3, 3> to_corner = {Subtract(Splat(blocker.corner[0]), r), Subtract(Splat(blocker.corner[1]), r),
                                         Subtract(Splat(blocker.corner[2]), r)};
  const Vec side = Dot(Splat(blocker.normal), to_corner[0]);
  const Vec side_error = hn::Mul(hn::Set(d, blocker.side_error), Norm1(to_corner[0]));
  // normal . (corner - r) > 0: the plane lies above the receiver (along the normal), which hides only samples above it.
  const LaneMask above = hn::Gt(side, side_error), below = hn::Lt(side, hn::Neg(side_error));
  const LaneMask unknown = hn::Not(hn::Or(above, below));
  LaneMask facing = unknown;
  if (blocker.samples_above) facing = hn::Or(facing, above);
  if (blocker.samples_below) facing = hn::Or(facing, below);
  active = hn::And(active, facing);
  if (blocker.back_faces_only) {  // front faces count only for receivers inside the component's box
    active = hn::And(active, hn::Or(hn::Not(below), InsideBox(r, blocker)));
  }
  if (hn::AllFalse(d, active)) return result;

  PairLanes pairs;
  pairs.to_corner = to_corner;
  for (std::size_t k = 0; k < 3; ++k) {
    pairs.edge[k] = Splat(blocker.edge[k]);
    pairs.edge_error[k] = hn::Set(d, blocker.edge_error[k]);
  }
  pairs.to_center = Subtract(Splat(samples.center), r);
  pairs.distance = hn::Add(NormMax(pairs.to_center), hn::Set(d, samples.reach));
  pairs.active = active, pairs.below = below, pairs.unknown = unknown;
  const LightRegion whole{Splat(vec3(0.0f)),
                          {Splat(samples.half_axes[0]), Splat(samples.half_axes[1]), Splat(samples.half_axes[2])}};
  return TestEdges(pairs, whole, planes);
}

void TestBlockers(const LatticeMesh& mesh, const KernelSamples& samples, std::span<const BlockerSpan> spans,
                  KernelReceivers& receivers, KernelCounters& counters) {
  const std::size_t lanes = hn::Lanes(Tag());
  EdgePlanes planes;
  Blocker blocker;
  AlphaTriangle alpha;
  for (const BlockerSpan& span : spans) {
    if (span.triangle != blocker.triangle) {
      blocker = make_blocker(mesh, samples, span.triangle);
      if (blocker.perforated) alpha = make_alpha_triangle(mesh, span.triangle);
      blocker.alpha = &alpha;
    }
    counters.pairs_tested += span.end - span.begin;
    for (std::size_t i = span.begin; i < span.end; i += lanes) {
      const BatchResult batch =
          TestBatch(blocker, samples, receivers, i, std::min<std::size_t>(lanes, span.end - i), planes);
      for (std::uint64_t rest = batch.candidates; rest != 0; rest &= rest - 1) {
        const auto lane = static_cast<std::size_t>(std::countr_zero(rest));
        TestCandidate(blocker, samples, batch, planes, lane, i + lane, receivers, counters, [&](const ScaledPlanes& p) {
          return TestSamples(blocker, samples, p, i + lane, receivers, counters);
        });
      }
    }
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace halfshade
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace halfshade {

HWY_EXPORT(TestBlockers);

void test_blockers(const LatticeMesh& mesh, const KernelSamples& samples, std::span<const BlockerSpan> spans,
                   KernelReceivers& receivers, KernelCounters& counters) {
  HWY_DYNAMIC_DISPATCH(TestBlockers)(mesh, samples, spans, receivers, counters);
}

}  // namespace halfshade
#endif
