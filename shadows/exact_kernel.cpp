#include "shadows/exact_kernel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "shadows/exact_kernel.cpp"
#include <hwy/foreach_target.h>

#include "shadows/edge_planes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace halfshade {
namespace HWY_NAMESPACE {

/// A rectangle in the light's plane.
struct Rectangle {
  float low_u = 1e30f, low_v = 1e30f, high_u = -1e30f, high_v = -1e30f;
};

/// Receivers as a box in the light's frame (a point for a single one), and what of the light they ask for.
struct Shaft {
  float low[3], high[3];
  Rectangle light;  // padded for rounding
};

/// Rounding of a projection onto the light's plane: coordinates are below 4 and carry 1e-6, and the samples lie that
/// near to the plane, which grazing receivers see magnified.
HWY_INLINE float ProjectionPad(float z) { return 1e-5f + 2e-6f / z; }

/// Which of the boxes can hold a point between the receivers and the light? Box and receivers project onto the light's
/// plane as q = r + (p - r) k with k = z_r / (z_r - z_p); the extremes lie at extreme p, r and k.
HWY_INLINE LaneMask MeetsShaft(const Shaft& s, const float* const low[3], const float* const high[3], std::size_t i) {
  const Tag d;
  const Vec zero = hn::Zero(d), tiny = hn::Set(d, 1e-30f);
  const Vec z_low = hn::Max(hn::LoadU(d, low[2] + i), zero), z_high = hn::LoadU(d, high[2] + i);
  const Vec r_low = hn::Set(d, s.low[2]), r_high = hn::Set(d, s.high[2]);
  const Vec near = hn::Div(r_high, hn::Max(hn::Sub(r_high, z_low), tiny));
  const Vec far = hn::Div(r_low, hn::Max(hn::Sub(r_low, hn::Max(z_high, zero)), tiny));
  LaneMask meets = hn::And(hn::Lt(z_low, r_high), hn::Ge(z_high, zero));
  const float light_low[2] = {s.light.low_u, s.light.low_v}, light_high[2] = {s.light.high_u, s.light.high_v};
  for (int k = 0; k < 2; ++k) {
    const Vec a = hn::Set(d, s.low[k]), b = hn::Set(d, s.high[k]);
    const Vec to_low = hn::Sub(hn::LoadU(d, low[k] + i), b), to_high = hn::Sub(hn::LoadU(d, high[k] + i), a);
    const Vec q_low = hn::Add(b, hn::Min(hn::Mul(to_low, near), hn::Mul(to_low, far)));
    const Vec q_high = hn::Add(a, hn::Max(hn::Mul(to_high, near), hn::Mul(to_high, far)));
    meets = hn::And(meets, hn::And(hn::Le(q_low, hn::Set(d, light_high[k])), hn::Ge(q_high, hn::Set(d, light_low[k]))));
  }
  return meets;
}

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

/// Leaves whose box meets the cluster's shaft, into scratch.leaf.
HWY_INLINE void CollectLeaves(const BlockerTree& tree, const Shaft& shaft, ExactScratch& scratch) {
  const std::size_t lanes = hn::Lanes(Tag());
  scratch.leaf.clear();
  for (int k = 0; k < 3; ++k) scratch.low[k].clear(), scratch.high[k].clear();
  scratch.stack.assign(1, 0);
  while (!scratch.stack.empty()) {
    const BlockerTree::Node& node = tree.nodes[scratch.stack.back()];
    scratch.stack.pop_back();
    const float* const low[3] = {node.low[0], node.low[1], node.low[2]};
    const float* const high[3] = {node.high[0], node.high[1], node.high[2]};
    for (std::size_t i = 0; i < node.count; i += lanes) {
      for (std::uint64_t bits = Bits(MeetsShaft(shaft, low, high, i)); bits != 0; bits &= bits - 1) {
        const std::size_t at = i + static_cast<std::size_t>(std::countr_zero(bits));
        if (at >= node.count) continue;
        if ((node.child[at] & BlockerTree::kLeafBit) == 0) {
          scratch.stack.push_back(node.child[at]);
          continue;
        }
        scratch.leaf.push_back(node.child[at] & ~BlockerTree::kLeafBit);
        for (int k = 0; k < 3; ++k) {
          scratch.low[k].push_back(node.low[k][at]);
          scratch.high[k].push_back(node.high[k][at]);
        }
      }
    }
  }
}

/// Largest share of the light first: what hides much is tested before what hides little.
HWY_INLINE void SortLeaves(const Shaft& shaft, ExactScratch& scratch) {
  const std::size_t count = scratch.leaf.size();
  scratch.keys.clear();
  const float r[3] = {0.5f * (shaft.low[0] + shaft.high[0]), 0.5f * (shaft.low[1] + shaft.high[1]),
                      0.5f * (shaft.low[2] + shaft.high[2])};
  for (std::uint32_t i = 0; i < count; ++i) {
    const float z = 0.5f * (std::max(scratch.low[2][i], 0.0f) + scratch.high[2][i]);
    const float k = r[2] / std::max(r[2] - z, 1e-6f);
    float area = 1.0f;
    const float light_low[2] = {shaft.light.low_u, shaft.light.low_v},
                light_high[2] = {shaft.light.high_u, shaft.light.high_v};
    for (int axis = 0; axis < 2; ++axis) {
      const float a = std::max(r[axis] + (scratch.low[axis][i] - r[axis]) * k, light_low[axis]);
      const float b = std::min(r[axis] + (scratch.high[axis][i] - r[axis]) * k, light_high[axis]);
      area *= std::max(b - a, 0.0f);
    }
    scratch.keys.emplace_back(-area, i);
  }
  std::sort(scratch.keys.begin(), scratch.keys.end());
  const auto reorder = [&](auto& values) {
    auto old = values;
    for (std::size_t i = 0; i < count; ++i) values[i] = old[scratch.keys[i].second];
  };
  reorder(scratch.leaf);
  for (int k = 0; k < 3; ++k) {
    reorder(scratch.low[k]), reorder(scratch.high[k]);
    scratch.low[k].resize(count + kMaxLanes, 1e30f);  // padding: boxes that no shaft meets
    scratch.high[k].resize(count + kMaxLanes, -1e30f);
  }
}

HWY_INLINE LaneMask LanesFromBits(std::uint32_t bits, std::size_t first) {
  const Tag d;
  std::uint8_t bytes[8] = {};
  const std::uint32_t shifted = bits >> first;
  hwy::CopyBytes<4>(&shifted, bytes);
  return hn::LoadMaskBits(d, bytes);
}

/// One receiver of a cluster while it is solved.
struct OpenReceiver {
  std::size_t index;
  vec3 position;
  Shaft shaft;
  LightRegion region;
  std::array<std::uint32_t, SampleRectangles::kBins> bins;  // [row], bits of bins with samples that are not blocked yet
};

/// Bounding rectangles of the lanes' triangles, projected onto the light's plane, as ranges of bins.
struct BinRanges {
  alignas(HWY_MAX_BYTES) std::int32_t first_column[kMaxLanes],
      last_column[kMaxLanes], first_row[kMaxLanes], last_row[kMaxLanes];
};

/// A triangle that reaches the receiver's height has no bounded projection: its range is all bins.
HWY_INLINE void ProjectTriangles(const SampleRectangles& grid, const BlockerTree::Leaf& leaf, std::size_t i,
                                 const Shaft& receiver, BinRanges& ranges) {
  const Tag d;
  const hn::RebindToSigned<Tag> di;
  const float r[3] = {receiver.low[0], receiver.low[1], receiver.low[2]};
  const Vec z = hn::Set(d, r[2]);
  Vec low[2] = {hn::Set(d, 1e30f), hn::Set(d, 1e30f)}, high[2] = {hn::Set(d, -1e30f), hn::Set(d, -1e30f)};
  Vec least = hn::Set(d, 1e30f);  // distance to the receiver's height
  for (int k = 0; k < 3; ++k) {
    const Vec below = hn::Sub(z, hn::LoadU(d, leaf.seen[k][2] + i));
    least = hn::Min(least, below);
    const Vec scale = hn::Div(z, below);
    for (int axis = 0; axis < 2; ++axis) {
      const Vec center = hn::Set(d, r[axis]);
      const Vec q = hn::MulAdd(hn::Sub(hn::LoadU(d, leaf.seen[k][axis] + i), center), scale, center);
      low[axis] = hn::Min(low[axis], q);
      high[axis] = hn::Max(high[axis], q);
    }
  }
  // Near the receiver roundings of 1e-7 are magnified like the projection itself.
  const Vec magnified = hn::Mul(hn::Div(z, least), hn::Set(d, 1e-6f * (1.0f + 4.0f / r[2])));
  const Vec pad = hn::Add(magnified, hn::Set(d, ProjectionPad(r[2])));
  const LaneMask bounded = hn::Gt(least, hn::Set(d, 1e-5f * r[2]));
  const float bins_low[2] = {grid.bins_low.x, grid.bins_low.y},
              per_unit[2] = {grid.bins_per_unit.x, grid.bins_per_unit.y};
  std::int32_t* const first[2] = {ranges.first_column, ranges.first_row};
  std::int32_t* const last[2] = {ranges.last_column, ranges.last_row};
  const Vec end = hn::Set(d, static_cast<float>(SampleRectangles::kBins)), before = hn::Set(d, -1.0f);
  for (int axis = 0; axis < 2; ++axis) {
    const Vec origin = hn::Set(d, bins_low[axis]), scale = hn::Set(d, per_unit[axis]), slack = hn::Set(d, 1e-3f);
    const Vec a = hn::Sub(hn::Mul(hn::Sub(hn::Sub(low[axis], pad), origin), scale), slack);
    const Vec b = hn::Add(hn::Mul(hn::Sub(hn::Add(high[axis], pad), origin), scale), slack);
    // Samples on the far border were put into the last bin: ranges that begin just behind it still reach it.
    const Vec from = hn::IfThenElse(bounded, hn::Min(hn::Max(hn::Sub(a, slack), before), end), hn::Zero(d));
    const Vec to = hn::IfThenElse(bounded, hn::Min(hn::Max(b, before), end), end);
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

HWY_INLINE bool OutsideBox(const vec3& p, const BlockerTree::Leaf& leaf) {
  return p.x < leaf.box_low.x || p.y < leaf.box_low.y || p.z < leaf.box_low.z || p.x > leaf.box_high.x ||
         p.y > leaf.box_high.y || p.z > leaf.box_high.z;
}

/// Up to 16 triangles against the open part of the light; true where bits were added.
HWY_INLINE bool TestLeaf(const ExactScene& scene, const BlockerTree::Leaf& leaf, const OpenReceiver& receiver,
                         KernelReceivers& receivers, EdgePlanes& planes, KernelCounters& counters) {
  const Tag d;
  const UintTag du;
  const std::size_t lanes = hn::Lanes(d);
  const KernelSamples& samples = *scene.samples;
  const Vec3 r = Splat(receiver.position);
  const std::uint32_t no_front = OutsideBox(receiver.position, leaf) ? leaf.back_faces_only : 0;
  const std::uint32_t may_below = leaf.samples_below & ~no_front;
  const std::uint64_t before = counters.pairs_necessary;
  counters.pairs_tested += leaf.count;
  for (std::size_t i = 0; i < leaf.count; i += lanes) {
    PairLanes pairs;
    std::array<Vec3, 3> corner;
    for (std::size_t k = 0; k < 3; ++k) {
      corner[k] = {hn::LoadU(d, leaf.corner[k][0] + i), hn::LoadU(d, leaf.corner[k][1] + i),
                   hn::LoadU(d, leaf.corner[k][2] + i)};
      pairs.to_corner[k] = Subtract(corner[k], r);
      pairs.edge_error[k] = hn::LoadU(d, leaf.edge_error[k] + i);
    }
    const Vec3 normal{hn::LoadU(d, leaf.normal[0] + i), hn::LoadU(d, leaf.normal[1] + i),
                      hn::LoadU(d, leaf.normal[2] + i)};
    const Vec side = Dot(normal, pairs.to_corner[0]);
    const Vec side_error = hn::Mul(hn::LoadU(d, leaf.side_error + i), Norm1(pairs.to_corner[0]));
    const LaneMask above = hn::Gt(side, side_error);
    pairs.below = hn::Lt(side, hn::Neg(side_error));
    pairs.unknown = hn::Not(hn::Or(above, pairs.below));
    const LaneMask facing = hn::Or(pairs.unknown, hn::Or(hn::And(above, LanesFromBits(leaf.samples_above, i)),
                                                         hn::And(pairs.below, LanesFromBits(may_below, i))));
    const auto other = hn::Ne(hn::LoadU(du, leaf.triangle + i), hn::Set(du, receivers.own[receiver.index]));
    pairs.active = hn::And(hn::And(hn::FirstN(d, leaf.count - i), facing), hn::RebindMask(d, other));
    std::uint64_t active = Bits(pairs.active);
    if (active == 0) continue;
    BinRanges ranges;
    ProjectTriangles(*scene.rectangles, leaf, i, receiver.shaft, ranges);
    for (std::uint64_t rest = active; rest != 0; rest &= rest - 1) {
      const auto lane = static_cast<std::size_t>(std::countr_zero(rest));
      if (!RangeIsOpen(receiver, RangeOfLane(ranges, lane))) active &= ~(std::uint64_t{1} << lane);
    }
    if (active == 0) continue;
    pairs.active = LanesFromBits(static_cast<std::uint32_t>(active), 0);
    for (std::size_t k = 0; k < 3; ++k) pairs.edge[k] = Subtract(corner[(k + 1) % 3], corner[k]);
    pairs.to_center = Subtract(Splat(samples.center), r);
    pairs.distance = hn::Add(NormMax(pairs.to_center), hn::Set(d, samples.reach));
    const BatchResult batch = TestEdges(pairs, receiver.region, planes);
    for (std::uint64_t rest = batch.candidates; rest != 0; rest &= rest - 1) {
      const auto lane = static_cast<std::size_t>(std::countr_zero(rest));
      const Blocker& blocker = scene.tree->blockers[leaf.first + i + lane];
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
      const BlockerTree::Leaf& leaf =
          scene.tree->leaves[scratch.leaf[i + static_cast<std::size_t>(std::countr_zero(bits))]];
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
  Shaft shaft{{1e30f, 1e30f, 1e30f}, {-1e30f, -1e30f, -1e30f}, {}};
  for (std::size_t i = begin; i < end; ++i) {
    const vec3 p(scene.frame.to_frame(dvec3(receivers.x[i], receivers.y[i], receivers.z[i])));
    for (int k = 0; k < 3; ++k)
      shaft.low[k] = std::min(shaft.low[k], p[k]), shaft.high[k] = std::max(shaft.high[k], p[k]);
  }
  const vec2 low = scene.rectangles->whole_low, high = scene.rectangles->whole_high;
  const float pad = ProjectionPad(shaft.low[2]);
  shaft.light = {low.x - pad, low.y - pad, high.x + pad, high.y + pad};
  CollectLeaves(*scene.tree, shaft, scratch);
  scratch.leaves_listed += scratch.leaf.size();
  if (scratch.leaf.empty()) {
    ++scratch.clusters_lit;
    return;
  }
  SortLeaves(shaft, scratch);
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
