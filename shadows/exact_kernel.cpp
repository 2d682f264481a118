#include "shadows/exact_kernel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "shadows/exact_kernel.cpp"
#include <hwy/foreach_target.h>

#include "shadows/exact_cluster-inl.h"

HWY_BEFORE_NAMESPACE();
namespace halfshade {
namespace HWY_NAMESPACE {

/// The groups of samples that are not blocked yet.
HWY_INLINE Rectangle OpenRectangle(const ExactScene& scene, std::size_t set, const std::uint64_t* mask,
                                   std::size_t words) {
  const SampleRectangles& groups = *scene.rectangles;
  Rectangle open;
  for (std::size_t word = 0; word < words; word += 16) {
    std::uint64_t bits = OpenGroups(scene.samples->valid.data(), mask, word, std::min<std::size_t>(16, words - word));
    for (; bits != 0; bits &= bits - 1) {
      const std::size_t g =
          set * scene.samples->group_stride + 4 * word + static_cast<std::size_t>(std::countr_zero(bits));
      open.low_u = std::min(open.low_u, groups.low_u[g]), open.high_u = std::max(open.high_u, groups.high_u[g]);
      open.low_v = std::min(open.low_v, groups.low_v[g]), open.high_v = std::max(open.high_v, groups.high_v[g]);
    }
  }
  return open;
}

/// The same part of the light in lattice space, around the light's centre.
HWY_INLINE LightRegion RegionOf(const ExactScene& scene, const Rectangle& open) {
  const float cu = 0.5f * (open.low_u + open.high_u), cv = 0.5f * (open.low_v + open.high_v);
  const float pad = (std::fabs(cu) + std::fabs(cv)) * 0x1p-18f;
  const float hu = 0.5f * (open.high_u - open.low_u) * (1.0f + 0x1p-18f) + pad;
  const float hv = 0.5f * (open.high_v - open.low_v) * (1.0f + 0x1p-18f) + pad;
  const vec3 u(scene.frame.u), v(scene.frame.v), n(scene.frame.n);
  return {Splat(u * cu + v * cv), {Splat(u * hu), Splat(v * hv), Splat(n * (scene.rectangles->thickness + pad))}};
}

/// One receiver of a cluster while it is solved.
struct OpenReceiver {
  std::size_t index;
  vec3 position;
  Shaft shaft;
  LightRegion region;
  std::array<std::uint32_t, SampleRectangles::kBins> bins;  // [row], bits of bins with samples that are not blocked yet
};

/// Bounding rectangles of the lanes' triangles as ranges of bins; all bins where the projection is not bounded.
struct BinRanges {
  alignas(HWY_MAX_BYTES) std::int32_t first_column[kMaxLanes],
      last_column[kMaxLanes], first_row[kMaxLanes], last_row[kMaxLanes];
};

HWY_INLINE void RangesOf(const SampleRectangles& grid, const ProjectedLanes& projected, BinRanges& ranges) {
  const Tag d;
  const hn::RebindToSigned<Tag> di;
  const float bins_low[2] = {grid.bins_low.x, grid.bins_low.y},
              per_unit[2] = {grid.bins_per_unit.x, grid.bins_per_unit.y};
  std::int32_t* const first[2] = {ranges.first_column, ranges.first_row};
  std::int32_t* const last[2] = {ranges.last_column, ranges.last_row};
  const Vec end = hn::Set(d, static_cast<float>(SampleRectangles::kBins)), before = hn::Set(d, -1.0f);
  for (int axis = 0; axis < 2; ++axis) {
    const Vec origin = hn::Set(d, bins_low[axis]), scale = hn::Set(d, per_unit[axis]), slack = hn::Set(d, 1e-3f);
    const Vec a = hn::Sub(hn::Mul(hn::Sub(projected.low[axis], origin), scale), slack);
    const Vec b = hn::Add(hn::Mul(hn::Sub(projected.high[axis], origin), scale), slack);
    // Samples on the far border were put into the last bin: ranges that begin just behind it still reach it.
    const Vec from = hn::IfThenElse(projected.bounded, hn::Min(hn::Max(hn::Sub(a, slack), before), end), hn::Zero(d));
    const Vec to = hn::IfThenElse(projected.bounded, hn::Min(hn::Max(b, before), end), end);
    hn::Store(hn::ConvertTo(di, hn::Floor(from)), di, first[axis]);
    hn::Store(hn::ConvertTo(di, hn::Floor(to)), di, last[axis]);
  }
}

/// A lane's range cut to the bins that exist: rows first..last and the columns as bits; no rows where it misses.
struct BinRange {
  std::int32_t first_row = 0, last_row = -1;
  std::uint32_t columns = 0;
};

HWY_INLINE BinRange RangeOfLane(const BinRanges& ranges, std::size_t lane) {
  constexpr std::int32_t kLast = SampleRectangles::kBins - 1;
  const std::int32_t c0 = std::max(ranges.first_column[lane], 0), c1 = std::min(ranges.last_column[lane], kLast);
  if (c0 > c1) return {};
  return {std::max(ranges.first_row[lane], 0), std::min(ranges.last_row[lane], kLast),
          (~0u << c0) & (~0u >> (kLast - c1))};
}

/// Does the range hold a bin with an open sample?
HWY_INLINE bool RangeIsOpen(const OpenReceiver& receiver, const BinRange& range) {
  std::uint32_t open = 0;
  for (std::int32_t row = range.first_row; row <= range.last_row; ++row)
    open |= receiver.bins[static_cast<std::size_t>(row)];
  return (open & range.columns) != 0;
}

/// Few samples, one by one: the open ones of a small triangle's range.
struct FewSamples {
  static constexpr std::uint32_t kMost = 12;
  std::array<std::uint16_t, kMost> index;  // kernel order
  std::uint32_t count = 0;
  bool too_many = false;
};

HWY_INLINE FewSamples SamplesInRange(const SampleRectangles& grid, std::size_t set, const OpenReceiver& receiver,
                                     const BinRange& range) {
  constexpr std::size_t kBins = SampleRectangles::kBins;
  FewSamples few;
  if (range.last_row - range.first_row > 7) few.too_many = true;
  for (std::int32_t row = range.first_row; row <= range.last_row && !few.too_many; ++row) {
    const auto r = static_cast<std::size_t>(row);
    for (std::uint32_t bits = receiver.bins[r] & range.columns; bits != 0; bits &= bits - 1) {
      const std::size_t bin = set * (kBins * kBins + 1) + r * kBins + static_cast<std::size_t>(std::countr_zero(bits));
      for (std::uint32_t k = grid.bin_begin[bin]; k < grid.bin_begin[bin + 1]; ++k) {
        if (few.count == FewSamples::kMost) {
          few.too_many = true;
          return few;
        }
        few.index[few.count++] = grid.binned[k];
      }
    }
  }
  return few;
}

HWY_INLINE bool TestFewSamples(const Blocker& blocker, const KernelSamples& samples, const ScaledPlanes& planes,
                               const FewSamples& few, std::size_t receiver, KernelReceivers& receivers,
                               KernelCounters& counters) {
  const std::size_t offset = std::size_t{receivers.set[receiver]} * samples.padded;
  std::uint64_t* mask = receivers.masks.data() + receiver * receivers.words;
  bool added = false;
  for (std::uint32_t i = 0; i < few.count; ++i) {
    const std::size_t s = few.index[i], at = offset + s;
    const std::uint64_t bit = std::uint64_t{1} << (s % 64);
    if ((mask[s / 64] & bit) != 0) continue;
    float least = 1e30f;
    for (int k = 0; k < planes.count; ++k) {
      const float value =
          planes.mx[k] * samples.x[at] + (planes.my[k] * samples.y[at] + (planes.mz[k] * samples.z[at] + planes.d[k]));
      least = std::min(least, value);
    }
    ++counters.sample_tests;
    if (!(least >= -1.0f)) continue;
    const bool certain = least > 1.0f;
    if (!certain || blocker.perforated) {
      const vec3 r(receivers.x[receiver], receivers.y[receiver], receivers.z[receiver]);
      if (settle_samples(blocker, r, {samples.points.data() + at, 1}, certain, !certain, counters) == 0) continue;
    }
    mask[s / 64] |= bit;
    added = true;
  }
  if (added && std::equal(samples.valid.begin(), samples.valid.end(), mask)) receivers.open[receiver] = 0;
  return added;
}

/// Up to 16 triangles against the open part of the light; true where bits were added.
HWY_INLINE bool TestLeaf(const ExactScene& scene, std::size_t index, const OpenReceiver& receiver,
                         KernelReceivers& receivers, EdgePlanes& planes, KernelCounters& counters) {
  const std::size_t lanes = hn::Lanes(Tag());
  const KernelSamples& samples = *scene.samples;
  const BlockerTree::Leaf& leaf = scene.tree->leaves[index];
  const std::uint64_t before = counters.pairs_necessary;
  counters.pairs_tested += leaf.count;
  for (std::size_t i = 0; i < leaf.count; i += lanes) {
    PairLanes pairs;
    std::array<Vec3, 3> corner;
    std::uint64_t active =
        FacingLanes(leaf, scene.fit->leaves[index], i, receiver.position, receivers.own[receiver.index], pairs, corner);
    if (active == 0) continue;
    BinRanges ranges;
    RangesOf(*scene.rectangles, ProjectTriangles(scene.frame, pairs.to_corner, receiver.shaft), ranges);
    for (std::uint64_t rest = active; rest != 0; rest &= rest - 1) {
      const auto lane = static_cast<std::size_t>(std::countr_zero(rest));
      if (!RangeIsOpen(receiver, RangeOfLane(ranges, lane))) active &= ~(std::uint64_t{1} << lane);
    }
    if (active == 0) continue;
    pairs.active = LanesFromBits(static_cast<std::uint32_t>(active), 0);
    SetEdges(samples, receiver.position, corner, pairs);
    const BatchResult batch = TestEdges(pairs, receiver.region, planes);
    for (std::uint64_t rest = batch.candidates; rest != 0; rest &= rest - 1) {
      const auto lane = static_cast<std::size_t>(std::countr_zero(rest));
      const Blocker blocker = blocker_at(*scene.tree, *scene.fit, index, i + lane, samples);
      const FewSamples few =
          SamplesInRange(*scene.rectangles, receivers.set[receiver.index], receiver, RangeOfLane(ranges, lane));
      TestCandidate(
          blocker, samples, batch, planes, lane, receiver.index, receivers, counters, [&](const ScaledPlanes& p) {
            return few.too_many ? TestSamples(blocker, samples, p, receiver.index, receivers, counters)
                                : TestFewSamples(blocker, samples, p, few, receiver.index, receivers, counters);
          });
    }
  }
  return counters.pairs_necessary != before;
}

/// Closes the bins whose samples are all blocked.
HWY_INLINE void SetOpenBins(const ExactScene& scene, std::size_t set, const std::uint64_t* mask, std::size_t words,
                            OpenReceiver& receiver) {
  const SampleRectangles& grid = *scene.rectangles;
  constexpr std::size_t kBins = SampleRectangles::kBins;
  receiver.bins = {};
  const std::uint16_t* bin_of_sample = grid.bin_of_sample.data() + set * scene.samples->padded;
  for (std::size_t w = 0; w < words; ++w) {
    for (std::uint64_t open = scene.samples->valid[w] & ~mask[w]; open != 0; open &= open - 1) {
      const std::uint32_t bin = bin_of_sample[64 * w + static_cast<std::size_t>(std::countr_zero(open))];
      receiver.bins[bin / kBins] |= 1u << (bin % kBins);
    }
  }
}

HWY_INLINE void SetOpenPart(const ExactScene& scene, const KernelReceivers& receivers, OpenReceiver& receiver) {
  const Rectangle open = OpenRectangle(scene, receivers.set[receiver.index],
                                       receivers.masks.data() + receiver.index * receivers.words, receivers.words);
  const float pad = ProjectionPad(receiver.shaft.low[2]);
  receiver.shaft.light = {open.low_u - pad, open.low_v - pad, open.high_u + pad, open.high_v + pad};
  receiver.region = RegionOf(scene, open);
}

HWY_INLINE void SolveReceiver(const ExactScene& scene, std::size_t index, KernelReceivers& receivers,
                              ExactScratch& scratch) {
  const std::size_t lanes = hn::Lanes(Tag());
  OpenReceiver receiver;
  receiver.index = index;
  receiver.position = {receivers.x[index], receivers.y[index], receivers.z[index]};
  const vec3 p(scene.frame.to_frame(dvec3(receiver.position)));
  for (int k = 0; k < 3; ++k) receiver.shaft.low[k] = receiver.shaft.high[k] = p[k];
  SetOpenPart(scene, receivers, receiver);
  receiver.bins = scene.rectangles->occupied[receivers.set[index]];
  const std::uint64_t* mask = receivers.masks.data() + index * receivers.words;
  const float* const low[3] = {scratch.low[0].data(), scratch.low[1].data(), scratch.low[2].data()};
  const float* const high[3] = {scratch.high[0].data(), scratch.high[1].data(), scratch.high[2].data()};
  EdgePlanes planes;
  for (std::size_t i = 0; i < scratch.leaf.size(); i += lanes) {
    for (std::uint64_t bits = Bits(MeetsShaft(receiver.shaft, low, high, i)); bits != 0; bits &= bits - 1) {
      const std::uint32_t leaf = scratch.leaf[i + static_cast<std::size_t>(std::countr_zero(bits))];
      ++scratch.leaves_tested;
      if (!TestLeaf(scene, leaf, receiver, receivers, planes, scratch.counters)) continue;
      if (receivers.open[index] == 0) return;
      SetOpenPart(scene, receivers, receiver);
      SetOpenBins(scene, receivers.set[index], mask, receivers.words, receiver);
    }
  }
}

void SolveCluster(const ExactScene& scene, std::size_t begin, std::size_t end, KernelReceivers& receivers,
                  ExactScratch& scratch) {
  if (!ListLeaves<false>(scene, begin, end, receivers, scratch)) return;
  for (std::size_t i = begin; i < end; ++i) SolveReceiver(scene, i, receivers, scratch);
}

}  // namespace HWY_NAMESPACE
}  // namespace halfshade
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace halfshade {

HWY_EXPORT(SolveCluster);

void solve_cluster(const ExactScene& scene, std::size_t begin, std::size_t end, KernelReceivers& receivers,
                   ExactScratch& scratch) {
  HWY_DYNAMIC_DISPATCH(SolveCluster)(scene, begin, end, receivers, scratch);
}

}  // namespace halfshade
#endif
