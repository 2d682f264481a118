// The planes of blocker and receiver against light samples, per instruction set: what the kernels that loop over
// receivers for a blocker have in common, and vectors for all. Included once per Highway target.

#if defined(HALFSHADE_EDGE_PLANES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef HALFSHADE_EDGE_PLANES_INL_H_
#undef HALFSHADE_EDGE_PLANES_INL_H_
#else
#define HALFSHADE_EDGE_PLANES_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <bit>

#include "shadows/visibility_pair.h"

HWY_BEFORE_NAMESPACE();
namespace halfshade {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Tag = hn::ScalableTag<float>;
using UintTag = hn::RebindToUnsigned<Tag>;
using Vec = hn::Vec<Tag>;
using LaneMask = hn::Mask<Tag>;
constexpr std::size_t kMaxLanes = HWY_MAX_BYTES / sizeof(float);

struct Vec3 {
  Vec x, y, z;
};

HWY_INLINE Vec3 Splat(const vec3& v) {
  const Tag d;
  return {hn::Set(d, v.x), hn::Set(d, v.y), hn::Set(d, v.z)};
}
HWY_INLINE Vec3 Subtract(const Vec3& a, const Vec3& b) {
  return {hn::Sub(a.x, b.x), hn::Sub(a.y, b.y), hn::Sub(a.z, b.z)};
}
HWY_INLINE Vec Dot(const Vec3& a, const Vec3& b) {
  return hn::MulAdd(a.x, b.x, hn::MulAdd(a.y, b.y, hn::Mul(a.z, b.z)));
}
HWY_INLINE Vec3 Cross(const Vec3& a, const Vec3& b) {
  return {hn::MulSub(a.y, b.z, hn::Mul(a.z, b.y)), hn::MulSub(a.z, b.x, hn::Mul(a.x, b.z)),
          hn::MulSub(a.x, b.y, hn::Mul(a.y, b.x))};
}
HWY_INLINE Vec Norm1(const Vec3& v) { return hn::Add(hn::Abs(v.x), hn::Add(hn::Abs(v.y), hn::Abs(v.z))); }
HWY_INLINE Vec NormMax(const Vec3& v) { return hn::Max(hn::Abs(v.x), hn::Max(hn::Abs(v.y), hn::Abs(v.z))); }

/// Bits of a lane mask, lane 0 lowest.
HWY_INLINE std::uint64_t Bits(LaneMask mask) {
  const Tag d;
  std::uint8_t bytes[8] = {};
  hn::StoreMaskBits(d, mask, bytes);
  std::uint64_t bits;
  hwy::CopyBytes<8>(bytes, &bits);
  return bits & ((hn::MaxLanes(d) < 64 ? std::uint64_t{1} << (hn::MaxLanes(d) % 64) : 0) - 1);
}

/// The planes through a lane's receiver and the blocker's edges, as m . (l - c) + d with error bound e.
struct EdgePlanes {
  alignas(HWY_MAX_BYTES) float mx[3][kMaxLanes], my[3][kMaxLanes], mz[3][kMaxLanes], d[3][kMaxLanes], e[3][kMaxLanes];
};

/// What the first test says of a batch of pairs, one bit per lane.
struct BatchResult {
  std::uint64_t candidates = 0;  // some sample may be hidden
  std::uint64_t covered = 0;     // the outline covers all samples
  std::uint64_t below = 0;       // the blocker's plane lies below the receiver, along the blocker's normal
  std::uint64_t side_unknown = 0;
};

/// A batch of (blocker, receiver) pairs, one per lane.
struct PairLanes {
  std::array<Vec3, 3> to_corner, edge;  // receiver to corner; corner to the next corner
  std::array<Vec, 3> edge_error;        // kDeterminantError * |edge|_1
  Vec3 to_center;                       // receiver to the light's centre
  Vec distance;                         // bound on |coordinate| of receiver to sample
  LaneMask active, below, unknown;      // below, unknown: see BatchResult
};

/// Tests the planes through receiver and edges against the parallelepiped around all samples.
HWY_INLINE BatchResult TestEdges(const PairLanes& pairs, const std::array<vec3, 3>& half_axes, EdgePlanes& planes) {
  const Tag d;
  BatchResult result;
  const Vec sign = hn::IfThenElse(pairs.below, hn::Set(d, -0.0f), hn::Zero(d));
  LaneMask outside = hn::Gt(hn::Zero(d), hn::Zero(d)), outside_flipped = outside, covered = pairs.active;
  LaneMask rejected = outside;
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec3 m = Cross(pairs.to_corner[k], pairs.edge[k]);
    const Vec at_center = hn::Xor(sign, Dot(m, pairs.to_center));
    Vec reach = hn::Abs(Dot(m, Splat(half_axes[0])));
    reach = hn::Add(reach, hn::Abs(Dot(m, Splat(half_axes[1]))));
    reach = hn::Add(reach, hn::Abs(Dot(m, Splat(half_axes[2]))));
    Vec error = hn::Mul(hn::Mul(pairs.edge_error[k], Norm1(pairs.to_corner[k])), pairs.distance);
    error = hn::Max(error, hn::Set(d, 0x1p-123f));  // keeps the reciprocal finite
    const Vec slack = hn::Add(reach, error);
    outside = hn::Or(outside, hn::Gt(hn::Neg(slack), at_center));
    outside_flipped = hn::Or(outside_flipped, hn::Gt(at_center, slack));
    covered = hn::And(covered, hn::Gt(at_center, slack));
    rejected = hn::And(outside, hn::Or(outside_flipped, hn::Not(pairs.unknown)));
    hn::Store(hn::Xor(sign, m.x), d, planes.mx[k]);
    hn::Store(hn::Xor(sign, m.y), d, planes.my[k]);
    hn::Store(hn::Xor(sign, m.z), d, planes.mz[k]);
    hn::Store(at_center, d, planes.d[k]);
    hn::Store(error, d, planes.e[k]);
    if (hn::AllTrue(d, hn::Or(hn::Not(pairs.active), rejected))) return result;
  }
  result.candidates = Bits(hn::AndNot(rejected, pairs.active));
  result.covered = Bits(covered);
  result.below = Bits(pairs.below);
  result.side_unknown = Bits(pairs.unknown);
  return result;
}

/// Receivers inside the box of the blocker's closed component.
HWY_INLINE LaneMask InsideBox(const Vec3& p, const Blocker& b) {
  const Tag d;
  const Vec x = hn::Max(hn::Sub(hn::Set(d, b.box_low.x), p.x), hn::Sub(p.x, hn::Set(d, b.box_high.x)));
  const Vec y = hn::Max(hn::Sub(hn::Set(d, b.box_low.y), p.y), hn::Sub(p.y, hn::Set(d, b.box_high.y)));
  const Vec z = hn::Max(hn::Sub(hn::Set(d, b.box_low.z), p.z), hn::Sub(p.z, hn::Set(d, b.box_high.z)));
  return hn::Le(hn::Max(x, hn::Max(y, z)), hn::Zero(d));
}

/// One blocker against the receivers [first, first + count), a lane each: which of them may lose a sample?
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
  return TestEdges(pairs, samples.half_axes, planes);
}

/// One lane's planes, scaled so that values beyond +-1 are certain. The fourth is the blocker's own plane.
struct ScaledPlanes {
  float mx[4], my[4], mz[4], d[4];
  int count = 3;
};

HWY_INLINE ScaledPlanes ScalePlanes(const Blocker& blocker, const EdgePlanes& planes, std::size_t lane, bool flip,
                                    bool below, bool own_plane) {
  ScaledPlanes s;
  for (int k = 0; k < 3; ++k) {
    const float scale = (flip ? -1.0f : 1.0f) / planes.e[k][lane];
    s.mx[k] = planes.mx[k][lane] * scale;
    s.my[k] = planes.my[k][lane] * scale;
    s.mz[k] = planes.mz[k][lane] * scale;
    s.d[k] = planes.d[k][lane] * scale;
  }
  if (own_plane) {
    const float scale = (below ? -1.0f : 1.0f) / std::max(blocker.plane_error, 0x1p-123f);
    s.mx[3] = blocker.normal.x * scale;
    s.my[3] = blocker.normal.y * scale;
    s.mz[3] = blocker.normal.z * scale;
    s.d[3] = blocker.plane_at_center * scale;
    s.count = 4;
  }
  return s;
}

HWY_INLINE Vec PlaneValue(const ScaledPlanes& s, int k, Vec x, Vec y, Vec z) {
  const Tag d;
  return hn::MulAdd(hn::Set(d, s.mx[k]), x,
                    hn::MulAdd(hn::Set(d, s.my[k]), y, hn::MulAdd(hn::Set(d, s.mz[k]), z, hn::Set(d, s.d[k]))));
}

/// Which groups of samples the planes cut, and which lie inside all of them; one bit per group of [first, first + 64).
struct GroupBits {
  std::uint64_t possible = 0, inside = 0;
};

HWY_INLINE GroupBits TestGroups(const ScaledPlanes& s, const KernelSamples& samples, std::size_t first,
                                std::uint64_t open) {
  const Tag d;
  GroupBits bits;
  for (std::size_t i = 0; i < 64 && open >> i != 0; i += hn::Lanes(d)) {
    const std::size_t g = first + i;
    const Vec x = hn::LoadU(d, &samples.group_x[g]), y = hn::LoadU(d, &samples.group_y[g]),
              z = hn::LoadU(d, &samples.group_z[g]);
    const Vec hx = hn::LoadU(d, &samples.half_x[g]), hy = hn::LoadU(d, &samples.half_y[g]),
              hz = hn::LoadU(d, &samples.half_z[g]);
    Vec lowest = hn::Set(d, 1e30f), highest = lowest;
    for (int k = 0; k < s.count; ++k) {
      const Vec center = PlaneValue(s, k, x, y, z);
      const Vec half =
          hn::MulAdd(hn::Abs(hn::Set(d, s.mx[k])), hx,
                     hn::MulAdd(hn::Abs(hn::Set(d, s.my[k])), hy, hn::Mul(hn::Abs(hn::Set(d, s.mz[k])), hz)));
      lowest = hn::Min(lowest, hn::Sub(center, half));
      highest = hn::Min(highest, hn::Add(center, half));
    }
    // Certain beyond +-1; the boxes' own arithmetic is within another unit of the error bound.
    bits.possible |= Bits(hn::Ge(highest, hn::Set(d, -2.0f))) << i;
    bits.inside |= Bits(hn::Gt(lowest, hn::Set(d, 2.0f))) << i;
  }
  bits.possible &= open;
  return bits;
}

/// One group of samples against the planes: bits certainly inside, and bits that are not certainly outside.
HWY_INLINE void TestGroup(const ScaledPlanes& s, const float* x, const float* y, const float* z, std::uint64_t& inside,
                          std::uint64_t& possible) {
  const Tag d;
  inside = possible = 0;
  for (std::size_t i = 0; i < KernelSamples::kGroup; i += hn::Lanes(d)) {
    const Vec px = hn::LoadU(d, x + i), py = hn::LoadU(d, y + i), pz = hn::LoadU(d, z + i);
    Vec least =
        hn::Min(PlaneValue(s, 0, px, py, pz), hn::Min(PlaneValue(s, 1, px, py, pz), PlaneValue(s, 2, px, py, pz)));
    if (s.count == 4) least = hn::Min(least, PlaneValue(s, 3, px, py, pz));
    inside |= Bits(hn::Gt(least, hn::Set(d, 1.0f))) << i;
    possible |= Bits(hn::Ge(least, hn::Set(d, -1.0f))) << i;
  }
}

/// Bits of the groups of mask words [word, word + count) that have samples left to block; count <= 16.
HWY_INLINE std::uint64_t OpenGroups(const std::uint64_t* valid, const std::uint64_t* mask, std::size_t word,
                                    std::size_t count) {
  std::uint64_t open = 0;
  for (std::size_t w = 0; w < count; ++w) {
    const std::uint64_t rest = valid[word + w] & ~mask[word + w];
    for (unsigned k = 0; k < 4; ++k) open |= std::uint64_t{((rest >> (16 * k)) & 0xffff) != 0} << (4 * w + k);
  }
  return open;
}

/// visit(word, shift, first, inside, doubtful) for the groups of open samples of one receiver that the planes do not
/// rule out: samples first.. of KernelSamples::points, bits shift.. of the mask word; of those still open, the ones
/// certainly inside the planes and the ones that the filter leaves open. `active`, if given, has a bit for every group
/// that matters; the others are left alone.
template <class Visit>
HWY_INLINE void ForEachPossibleGroup(const KernelSamples& samples, const ScaledPlanes& planes, std::size_t receiver,
                                     const KernelReceivers& receivers, const std::uint64_t* mask,
                                     const std::uint64_t* active, KernelCounters& counters, const Visit& visit) {
  constexpr std::uint32_t kGroup = KernelSamples::kGroup;
  const std::size_t set = receivers.set[receiver], offset = set * samples.padded,
                    groups_at = set * samples.group_stride;
  for (std::size_t word = 0; word < receivers.words; word += 16) {
    std::uint64_t open =
        OpenGroups(samples.valid.data(), mask, word, std::min<std::size_t>(16, receivers.words - word));
    if (active != nullptr) open &= active[word / 16];
    const GroupBits groups = TestGroups(planes, samples, groups_at + 4 * word, open);
    for (std::uint64_t rest = groups.possible; rest != 0; rest &= rest - 1) {
      const std::size_t g = 4 * word + static_cast<std::size_t>(std::countr_zero(rest)), first = g * kGroup;
      const std::size_t w = first / 64, shift = first % 64, at = offset + first;
      const std::uint64_t wanted = ((samples.valid[w] & ~mask[w]) >> shift) & 0xffff;
      std::uint64_t inside = wanted, possible = wanted;
      if (((groups.inside >> (g - 4 * word)) & 1) == 0) {
        TestGroup(planes, &samples.x[at], &samples.y[at], &samples.z[at], inside, possible);
        counters.sample_tests += kGroup;
        inside &= wanted;
        possible &= wanted;
      }
      visit(w, shift, at, inside, possible & ~inside);
    }
  }
}

/// Tests every still open sample of one receiver; true where bits were added. `active` as above.
HWY_INLINE bool TestSamples(const Blocker& blocker, const KernelSamples& samples, const ScaledPlanes& planes,
                            std::size_t receiver, KernelReceivers& receivers, KernelCounters& counters,
                            const std::uint64_t* active = nullptr) {
  const vec3 r(receivers.x[receiver], receivers.y[receiver], receivers.z[receiver]);
  std::uint64_t* mask = receivers.mask(receiver);
  bool added = false;
  ForEachPossibleGroup(samples, planes, receiver, receivers, mask, active, counters,
                       [&](std::size_t word, std::size_t shift, std::size_t first, std::uint64_t inside,
                           std::uint64_t doubtful) HWY_ATTR {
                         if (doubtful != 0 || blocker.perforated) {
                           inside = settle_samples(blocker, r, {samples.points.data() + first, KernelSamples::kGroup},
                                                   inside, doubtful, counters);
                         }
                         mask[word] |= inside << shift;
                         added = added || inside != 0;
                       });
  if (added && std::equal(samples.valid.begin(), samples.valid.end(), mask)) receivers.open[receiver] = 0;
  return added;
}

/// A receiver that the first test could not rule out. `test_samples(planes)` blocks samples and says whether any.
template <class TestSamplesFunction>
HWY_INLINE void TestCandidate(const Blocker& blocker, const KernelSamples& samples, const BatchResult& batch,
                              const EdgePlanes& planes, std::size_t lane, std::size_t receiver,
                              KernelReceivers& receivers, KernelCounters& counters,
                              const TestSamplesFunction& test_samples) {
  bool below = (batch.below >> lane) & 1, flip = false;
  const bool unknown = (batch.side_unknown >> lane) & 1;
  if (unknown) {
    const vec3 r(receivers.x[receiver], receivers.y[receiver], receivers.z[receiver]);
    const int side = orient3d(blocker.corner[0], blocker.corner[1], blocker.corner[2], r);
    ++counters.exact_fallbacks;
    if (side == 0) return;
    below = flip = side < 0;  // the planes of an unknown lane are signed for "above"
  }
  if (!(below ? blocker.samples_below : blocker.samples_above)) return;
  const bool own_plane = !(below ? blocker.all_below : blocker.all_above);
  ++counters.pairs_sampled;
  if (((batch.covered >> lane) & 1) != 0 && !unknown && !own_plane && !blocker.perforated) {
    std::copy(samples.valid.begin(), samples.valid.end(), receivers.mask(receiver));
    receivers.open[receiver] = 0;
    ++counters.pairs_necessary;
    return;
  }
  if (test_samples(ScalePlanes(blocker, planes, lane, flip, below, own_plane))) ++counters.pairs_necessary;
}

}  // namespace HWY_NAMESPACE
}  // namespace halfshade
HWY_AFTER_NAMESPACE();

#endif  // include guard
