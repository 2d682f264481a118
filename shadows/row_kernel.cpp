// The exact engine for samples in rows: a receiver sees the light as a picture with a vector lane per row, and a
// triangle is rasterized into it from the planes through the receiver and its edges.
//
// An edge's plane m . (l - c) + d, with l = c + x X + y Y, is zero in row y at x = p + q y. With the error bound e of
// visibility_pair.h the sign is certain where |x - (p + q y)| > e / |m . X|; the slack added to that covers the
// rounding of p, q and of the row's columns. Samples in between go to the exact predicate.
#include <optional>

#include "shadows/exact_kernel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "shadows/row_kernel.cpp"
#include <hwy/foreach_target.h>

#include "shadows/alpha_lookup-inl.h"
#include "shadows/exact_cluster-inl.h"

HWY_BEFORE_NAMESPACE();
namespace halfshade {
namespace HWY_NAMESPACE {

constexpr std::size_t kMaxRows = SampleRows::kMaxRows;

/// One receiver while it is solved. `open` holds bit i of row j where sample i of the row is not blocked yet.
struct RowReceiver {
  alignas(HWY_MAX_BYTES) std::uint32_t open[kMaxRows];
  std::size_t index;
  vec3 position;
  Shaft shaft;
  const float *y, *offset;   // rows of the receiver's set
  std::size_t first_sample;  // of the receiver's set, in KernelSamples::points
};

/// Half planes in the lanes of a leaf: sample x of row y is inside beyond p + q y, in the direction that `up` says.
struct RowEdges {
  alignas(HWY_MAX_BYTES) float least[3][kMaxLanes], most[3][kMaxLanes], slope[3][kMaxLanes];  // p - e, p + e, q
  std::uint64_t up[3];
};

/// Bits from..to of 32, per lane, from whole numbers; none where from > to.
HWY_INLINE hn::Vec<UintTag> BitRange(Vec from, Vec to) {
  const Tag d;
  const UintTag du;
  const auto last = hn::Set(du, 31u), ones = hn::Set(du, ~0u);
  from = hn::Max(from, hn::Zero(d)), to = hn::Min(to, hn::Set(d, 31.0f));
  const auto some = hn::RebindMask(du, hn::Le(from, to));
  // Whole numbers of 0..31 stand in the lowest bits of their sum with 2^23; what is not in range is masked off.
  const Vec shifter = hn::Set(d, 0x1p23f);
  const auto first_bit = hn::And(hn::BitCast(du, hn::Add(from, shifter)), last);
  const auto last_bit = hn::AndNot(hn::BitCast(du, hn::Add(to, shifter)), last);  // 31 - to
  return hn::IfThenElseZero(some, hn::And(hn::Shl(ones, first_bit), hn::Shr(ones, last_bit)));
}

/// What of the light is open, as a rectangle.
HWY_INLINE void SetOpenRectangle(const SampleRows& rows, RowReceiver& r) {
  std::uint32_t columns = 0, first = 0, last = 0;
  bool any = false;
  for (std::uint32_t j = 0; j < rows.rows; ++j) {
    columns |= r.open[j];
    if (r.open[j] == 0) continue;
    if (!any) first = j;
    any = true, last = j;
  }
  const float pad = ProjectionPad(r.shaft.low[2]) + rows.deviation;
  const auto low = static_cast<float>(std::countr_zero(columns)),
             high = static_cast<float>(31 - std::countl_zero(columns));
  r.shaft.light = {(low - rows.most_offset) / rows.scale - pad, r.y[first] - pad,
                   (high - rows.least_offset) / rows.scale + pad, r.y[last] + pad};
}

HWY_INLINE bool AnyOpen(const SampleRows& rows, const RowReceiver& r) {
  std::uint32_t any = 0;
  for (std::uint32_t j = 0; j < rows.padded; ++j) any |= r.open[j];
  return any != 0;
}

/// Of the lanes in `active`, those whose rectangle on the light may hold an open sample.
HWY_INLINE std::uint64_t LanesOverOpenSamples(const SampleRows& rows, const LaneRectangles& q, std::uint64_t active,
                                              const RowReceiver& r) {
  const Tag d;
  const UintTag du;
  const Rectangle& light = r.shaft.light;
  active &=
      Bits(hn::And(hn::And(hn::Le(q.low[0], hn::Set(d, light.high_u)), hn::Ge(q.high[0], hn::Set(d, light.low_u))),
                   hn::And(hn::Le(q.low[1], hn::Set(d, light.high_v)), hn::Ge(q.high[1], hn::Set(d, light.low_v)))));
  if (active == 0) return 0;
  alignas(HWY_MAX_BYTES) float low[2][kMaxLanes], high[2][kMaxLanes];
  alignas(HWY_MAX_BYTES) std::uint32_t columns[kMaxLanes];
  const Vec scale = hn::Set(d, rows.scale), slack = hn::Set(d, 1e-3f);
  const Vec from = hn::MulSub(q.low[0], scale, slack), to = hn::MulAdd(q.high[0], scale, slack);
  hn::Store(from, d, low[0]), hn::Store(to, d, high[0]);
  hn::Store(q.low[1], d, low[1]), hn::Store(q.high[1], d, high[1]);
  hn::Store(BitRange(hn::Ceil(hn::Add(from, hn::Set(d, rows.least_offset))),
                     hn::Floor(hn::Add(to, hn::Set(d, rows.most_offset)))),
            du, columns);
  std::uint64_t kept = 0;
  for (std::uint64_t rest = active; rest != 0; rest &= rest - 1) {
    const auto lane = static_cast<std::size_t>(std::countr_zero(rest));
    const auto wanted = hn::Set(du, columns[lane]);
    for (std::size_t j = 0; j < rows.padded; j += hn::Lanes(d)) {
      const Vec y = hn::LoadU(d, r.y + j);
      const auto open = hn::And(hn::Load(du, r.open + j), wanted);  // columns of any row: shifts are left out
      const auto in_rows =
          hn::RebindMask(du, hn::And(hn::Ge(y, hn::Set(d, low[1][lane])), hn::Le(y, hn::Set(d, high[1][lane]))));
      const auto near = hn::IfThenElseZero(in_rows, open);
      if (hn::AllTrue(du, hn::Eq(near, hn::Zero(du)))) continue;
      const Vec offset = hn::LoadU(d, r.offset + j);
      const auto exact = BitRange(hn::Ceil(hn::Add(hn::Set(d, low[0][lane]), offset)),
                                  hn::Floor(hn::Add(hn::Set(d, high[0][lane]), offset)));
      if (hn::AllTrue(du, hn::Eq(hn::And(near, exact), hn::Zero(du)))) continue;
      kept |= std::uint64_t{1} << lane;
      break;
    }
  }
  return kept;
}

/// Triangles of a leaf; those without a bounded projection may hide anything.
HWY_INLINE std::uint64_t TrianglesOverOpenSamples(const SampleRows& rows, const ProjectedLanes& projected,
                                                  std::uint64_t active, const RowReceiver& r) {
  const Vec far = hn::Set(Tag(), 1e9f);
  LaneRectangles q;
  for (int k = 0; k < 2; ++k) {
    q.low[k] = hn::IfThenElse(projected.bounded, projected.low[k], hn::Neg(far));
    q.high[k] = hn::IfThenElse(projected.bounded, projected.high[k], far);
  }
  return LanesOverOpenSamples(rows, q, active, r);
}

/// Boxes from `i` on, of those listed for the cluster.
HWY_INLINE std::uint64_t BoxesOverOpenSamples(const SampleRows& rows, const float* const low[3],
                                              const float* const high[3], std::size_t i, const RowReceiver& r) {
  LaneRectangles q;
  const std::uint64_t between = Bits(ProjectBoxes(r.shaft, low, high, i, q));
  const Vec pad = hn::Set(Tag(), ProjectionPad(r.shaft.low[2]) + rows.deviation);
  for (int k = 0; k < 2; ++k) q.low[k] = hn::Sub(q.low[k], pad), q.high[k] = hn::Add(q.high[k], pad);
  return LanesOverOpenSamples(rows, q, between, r);
}

/// The half plane a x + b y + c >= 0, certain beyond `error`, as p - e, p + e, q.
HWY_INLINE void SolveForX(const SampleRows& rows, Vec a, Vec b, Vec c, Vec error, Vec& least, Vec& most, Vec& slope) {
  const Tag d;
  const Vec tiny = hn::Set(d, 0x1p-100f);
  a = hn::IfThenElse(hn::Lt(hn::Abs(a), tiny), tiny, a);
  error = hn::Max(error, hn::Set(d, 0x1p-98f));  // also covers what `tiny` changed
  const Vec inverse = hn::Div(hn::Set(d, 1.0f), a);
  const Vec p = hn::Neg(hn::Mul(c, inverse));
  slope = hn::Neg(hn::Mul(b, inverse));
  // p, q and p + q y are each within three units of 2^-24; columns are rounded at 2^-16 of their distance.
  const Vec rounding = hn::MulAdd(hn::Abs(slope), hn::Set(d, rows.reach_y), hn::Abs(p));
  const Vec slack = hn::MulAdd(rounding, hn::Set(d, 0x1p-21f), hn::Set(d, 0x1p-16f / rows.scale));
  const Vec width = hn::MulAdd(hn::Mul(error, hn::Set(d, 1.0f + 0x1p-20f)), hn::Abs(inverse), slack);
  least = hn::Sub(p, width);
  most = hn::Add(p, width);
}

/// The planes through the receiver and the edges of the lanes' triangles, oriented inwards. Returns the lanes that an
/// edge separates from the open part of the light, whichever way lanes with an unknown side are oriented.
HWY_INLINE std::uint64_t SolveEdges(const SampleRows& rows, const PairLanes& pairs, const Rectangle& open,
                                    RowEdges& edges) {
  const Tag d;
  const Vec center_x = hn::Set(d, 0.5f * (open.low_u + open.high_u)),
            half_x = hn::Set(d, 0.5f * (open.high_u - open.low_u));
  const Vec center_y = hn::Set(d, 0.5f * (open.low_v + open.high_v)),
            half_y = hn::Set(d, 0.5f * (open.high_v - open.low_v));
  LaneMask outside = hn::Gt(hn::Zero(d), hn::Zero(d)), outside_flipped = outside;
  const Vec sign = hn::IfThenElse(pairs.below, hn::Set(d, -0.0f), hn::Zero(d));
  const Vec3 axis_x = Splat(rows.axis_x), axis_y = Splat(rows.axis_y);
  const Vec distance = hn::Add(pairs.distance, hn::Set(d, rows.deviation / kDeterminantError));
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec3 m = Cross(pairs.to_corner[k], pairs.edge[k]);
    const Vec a = hn::Xor(sign, Dot(m, axis_x)), b = hn::Xor(sign, Dot(m, axis_y));
    const Vec c = hn::Xor(sign, Dot(m, pairs.to_center));
    const Vec error = hn::Mul(hn::Mul(pairs.edge_error[k], Norm1(pairs.to_corner[k])), distance);
    Vec least, most, slope;
    SolveForX(rows, a, b, c, error, least, most, slope);
    hn::Store(least, d, edges.least[k]);
    hn::Store(most, d, edges.most[k]);
    hn::Store(slope, d, edges.slope[k]);
    edges.up[k] = Bits(hn::Not(hn::Lt(a, hn::Zero(d))));
    const Vec value = hn::MulAdd(a, center_x, hn::MulAdd(b, center_y, c));
    const Vec reach = hn::MulAdd(hn::Abs(a), half_x, hn::MulAdd(hn::Abs(b), half_y, hn::Add(error, error)));
    outside = hn::Or(outside, hn::Gt(hn::Neg(reach), value));
    outside_flipped = hn::Or(outside_flipped, hn::Gt(value, reach));
  }
  return Bits(hn::And(outside, hn::Or(outside_flipped, hn::Not(pairs.unknown))));
}

/// Samples of rows j.. that may be inside and that certainly are.
struct RowBits {
  hn::Vec<UintTag> possible, inside;
};

/// Where edges leave the order "two limits from below, two from above" to be filled: which edge for each limit, by the
/// three directions. Edges that all look one way have no bounded outline.
struct Limits {
  std::uint8_t low[2], high[2];
};
constexpr Limits kLimits[8] = {{{0, 0}, {0, 0}}, {{0, 0}, {1, 2}}, {{1, 1}, {0, 2}}, {{0, 1}, {2, 2}},
                               {{2, 2}, {0, 1}}, {{0, 2}, {1, 1}}, {{1, 2}, {0, 0}}, {{0, 0}, {0, 0}}};

/// Columns between the limits; `low`, `high` in units of length.
HWY_INLINE hn::Vec<UintTag> ColumnsBetween(const SampleRows& rows, Vec offset, Vec low, Vec high) {
  const Vec scale = hn::Set(Tag(), rows.scale);
  return BitRange(hn::Ceil(hn::MulAdd(low, scale, offset)), hn::Floor(hn::MulAdd(high, scale, offset)));
}

/// A half plane alone.
HWY_INLINE RowBits HalfPlane(const SampleRows& rows, Vec y, Vec offset, float least, float most, float slope, bool up) {
  const Tag d;
  const Vec q = hn::Set(d, slope), far = hn::Set(d, 1e30f);
  const Vec a = hn::MulAdd(q, y, hn::Set(d, least)), b = hn::MulAdd(q, y, hn::Set(d, most));
  if (up) return {ColumnsBetween(rows, offset, a, far), ColumnsBetween(rows, offset, b, far)};
  return {ColumnsBetween(rows, offset, hn::Neg(far), b), ColumnsBetween(rows, offset, hn::Neg(far), a)};
}

/// All half planes, one after the other.
HWY_INLINE RowBits IntersectEdges(const SampleRows& rows, const RowEdges& e, std::size_t lane, Vec y, Vec offset) {
  RowBits bits{hn::Set(UintTag(), ~0u), hn::Set(UintTag(), ~0u)};
  for (int k = 0; k < 3; ++k) {
    const RowBits one =
        HalfPlane(rows, y, offset, e.least[k][lane], e.most[k][lane], e.slope[k][lane], (e.up[k] >> lane) & 1);
    bits.possible = hn::And(bits.possible, one.possible);
    bits.inside = hn::And(bits.inside, one.inside);
  }
  return bits;
}

/// The plane of the triangle itself, for lights that it cuts.
HWY_INLINE RowBits CutByOwnPlane(const SampleRows& rows, const Blocker& blocker, bool below, Vec y, Vec offset,
                                 RowBits bits) {
  const Tag d;
  const float sign = below ? -1.0f : 1.0f;
  const float a = sign * glm::dot(blocker.normal, rows.axis_x), b = sign * glm::dot(blocker.normal, rows.axis_y);
  const float error = blocker.plane_error + blocker.side_error * (rows.deviation / kDeterminantError);
  Vec least, most, slope;
  SolveForX(rows, hn::Set(d, a), hn::Set(d, b), hn::Set(d, sign * blocker.plane_at_center), hn::Set(d, error), least,
            most, slope);
  const RowBits own =
      HalfPlane(rows, y, offset, hn::GetLane(least), hn::GetLane(most), hn::GetLane(slope), !(a < 0.0f));
  return {hn::And(bits.possible, own.possible), hn::And(bits.inside, own.inside)};
}

/// Where both are wanted: two limits from each side, four multiply-adds and one range of bits for all rows.
HWY_INLINE hn::Vec<UintTag> Between(const SampleRows& rows, const Limits& limits, const float (*low)[kMaxLanes],
                                    const float (*high)[kMaxLanes], const RowEdges& e, std::size_t lane, Vec y,
                                    Vec offset) {
  const Tag d;
  const auto at = [&](const float(*p)[kMaxLanes], std::uint8_t k) {
    return hn::MulAdd(hn::Set(d, e.slope[k][lane]), y, hn::Set(d, p[k][lane]));
  };
  return ColumnsBetween(rows, offset, hn::Max(at(low, limits.low[0]), at(low, limits.low[1])),
                        hn::Min(at(high, limits.high[0]), at(high, limits.high[1])));
}

/// The light shows on both sides of the triangle's plane; it is alpha-tested; the rest of it, which is far in memory.
struct RowTriangle {
  bool own_plane, perforated;
  const Blocker* blocker;
};

/// Doubtful and perforated samples of the rows from j on; `possible` and `inside` are per row. `texels` is made for the
/// first row that needs it.
HWY_INLINE void SettleRows(const ExactScene& scene, const RowTriangle& triangle, std::size_t j, const RowReceiver& r,
                           const std::uint32_t* possible, std::uint32_t* inside, std::optional<TexelLookup>& texels,
                           KernelCounters& counters) {
  const SampleRows& rows = *scene.rows;
  const auto& [a, b, c] = triangle.blocker->corner;
  for (std::size_t i = 0; i < hn::Lanes(Tag()) && j + i < rows.rows; ++i) {
    const std::size_t first = r.first_sample + (j + i) * rows.columns;
    for (std::uint32_t doubtful = possible[i] & ~inside[i]; doubtful != 0; doubtful &= doubtful - 1) {
      const auto bit = static_cast<std::size_t>(std::countr_zero(doubtful));
      ++counters.exact_fallbacks;
      inside[i] |= std::uint32_t{blocks(a, b, c, r.position, scene.samples->points[first + bit])} << bit;
    }
    if (!triangle.perforated || inside[i] == 0) continue;
    const AlphaTriangle& alpha = *triangle.blocker->alpha;
    if (!texels) texels.emplace(alpha, r.position);
    inside[i] = OpaqueSamples(alpha, *texels, r.position, &rows.point_x[first], &rows.point_y[first],
                              &rows.point_z[first], inside[i], counters.exact_fallbacks);
  }
}

/// One triangle into the receiver's picture; true where samples were blocked.
HWY_INLINE bool RasterizeTriangle(const ExactScene& scene, const RowTriangle& triangle, const RowEdges& edges,
                                  std::size_t lane, bool below, RowReceiver& r, KernelCounters& counters) {
  const Tag d;
  const UintTag du;
  const SampleRows& rows = *scene.rows;
  const std::size_t way = (edges.up[0] >> lane & 1) | (edges.up[1] >> lane & 1) << 1 | (edges.up[2] >> lane & 1) << 2;
  const bool bounded = way != 0 && way != 7;
  std::optional<TexelLookup> texels;
  bool added = false;
  for (std::size_t j = 0; j < rows.padded; j += hn::Lanes(d)) {
    const Vec y = hn::LoadU(d, r.y + j), offset = hn::LoadU(d, r.offset + j);
    const auto open = hn::Load(du, r.open + j);
    RowBits bits;
    if (bounded && !triangle.own_plane) {
      bits.possible = hn::And(open, Between(rows, kLimits[way], edges.least, edges.most, edges, lane, y, offset));
      if (hn::AllTrue(du, hn::Eq(bits.possible, hn::Zero(du)))) continue;
      bits.inside = hn::And(open, Between(rows, kLimits[way], edges.most, edges.least, edges, lane, y, offset));
    } else {
      bits = IntersectEdges(rows, edges, lane, y, offset);
      if (triangle.own_plane) bits = CutByOwnPlane(rows, *triangle.blocker, below, y, offset, bits);
      bits.possible = hn::And(bits.possible, open), bits.inside = hn::And(bits.inside, open);
      if (hn::AllTrue(du, hn::Eq(bits.possible, hn::Zero(du)))) continue;
    }
    auto blocked = bits.inside;
    if (triangle.perforated || !hn::AllTrue(du, hn::Eq(bits.possible, bits.inside))) {
      alignas(HWY_MAX_BYTES) std::uint32_t possible[kMaxLanes], inside[kMaxLanes];
      hn::Store(bits.possible, du, possible), hn::Store(bits.inside, du, inside);
      SettleRows(scene, triangle, j, r, possible, inside, texels, counters);
      blocked = hn::Load(du, inside);
      if (hn::AllTrue(du, hn::Eq(blocked, hn::Zero(du)))) continue;
    }
    hn::Store(hn::AndNot(blocked, open), du, r.open + j);
    added = true;
  }
  ++counters.pairs_sampled;
  counters.sample_tests += scene.samples->count;
  counters.pairs_necessary += added;
  return added;
}

/// A triangle on whose side the receiver lies only the exact predicate can tell.
HWY_INLINE bool RasterizeGrazing(const ExactScene& scene, const RowTriangle& triangle, const RowEdges& edges,
                                 std::size_t lane, RowReceiver& r, KernelCounters& counters) {
  const Blocker& blocker = *triangle.blocker;
  ++counters.exact_fallbacks;
  const int side = orient3d(blocker.corner[0], blocker.corner[1], blocker.corner[2], r.position);
  if (side == 0 || !(side < 0 ? blocker.samples_below : blocker.samples_above)) return false;
  RowEdges flipped = edges;  // the lane's planes are oriented for a receiver above
  if (side < 0) {
    for (auto& up : flipped.up) up ^= std::uint64_t{1} << lane;
  }
  return RasterizeTriangle(scene, triangle, flipped, lane, side < 0, r, counters);
}

/// Up to 16 triangles; true where samples were blocked.
HWY_INLINE bool RasterizeLeaf(const ExactScene& scene, const BlockerTree::Leaf& leaf, std::uint32_t own, RowReceiver& r,
                              KernelCounters& counters) {
  bool added = false;
  counters.pairs_tested += leaf.count;
  for (std::size_t i = 0; i < leaf.count; i += hn::Lanes(Tag())) {
    PairLanes pairs;
    std::array<Vec3, 3> corner;
    std::uint64_t active = FacingLanes(leaf, i, r.position, own, pairs, corner);
    if (active == 0) continue;
    active = TrianglesOverOpenSamples(*scene.rows, ProjectTriangles(scene.frame, pairs.to_corner, r.shaft), active, r);
    if (active == 0) continue;
    SetEdges(*scene.samples, r.position, corner, pairs);
    RowEdges edges;
    active &= ~SolveEdges(*scene.rows, pairs, r.shaft.light, edges);
    const std::uint64_t below = Bits(pairs.below), unknown = Bits(pairs.unknown);
    for (; active != 0; active &= active - 1) {
      const auto lane = static_cast<std::size_t>(std::countr_zero(active));
      const std::uint32_t bit = 1u << (i + lane);
      const RowTriangle triangle{(leaf.samples_above & leaf.samples_below & bit) != 0, (leaf.perforated & bit) != 0,
                                 &scene.tree->blockers[leaf.first + i + lane]};
      if ((unknown >> lane) & 1) {
        added |= RasterizeGrazing(scene, triangle, edges, lane, r, counters);
      } else {
        added |= RasterizeTriangle(scene, triangle, edges, lane, (below >> lane) & 1, r, counters);
      }
    }
  }
  return added;
}

HWY_INLINE void StoreMask(const SampleRows& rows, const RowReceiver& r, KernelReceivers& receivers) {
  std::uint64_t* mask = receivers.mask(r.index);
  for (std::uint32_t j = 0; j < rows.rows; ++j) {
    const std::uint64_t blocked = rows.valid[j] & ~r.open[j];
    const std::size_t first = std::size_t{j} * rows.columns, shift = first % 64;
    mask[first / 64] |= blocked << shift;
    if (shift + rows.columns > 64) mask[first / 64 + 1] |= blocked >> (64 - shift);
  }
}

HWY_INLINE void SolveRowReceiver(const ExactScene& scene, std::size_t index, KernelReceivers& receivers,
                                 ExactScratch& scratch) {
  const SampleRows& rows = *scene.rows;
  const std::size_t lanes = hn::Lanes(Tag()), set = receivers.set[index];
  RowReceiver r;
  r.index = index;
  r.position = {receivers.x[index], receivers.y[index], receivers.z[index]};
  r.y = rows.y.data() + set * rows.padded, r.offset = rows.offset.data() + set * rows.padded;
  r.first_sample = set * scene.samples->padded;
  std::copy(rows.valid.begin(), rows.valid.end(), r.open);
  const vec3 p(scene.frame.to_frame(dvec3(r.position)));
  for (int k = 0; k < 3; ++k) r.shaft.low[k] = r.shaft.high[k] = p[k];
  SetOpenRectangle(rows, r);
  const float* const low[3] = {scratch.low[0].data(), scratch.low[1].data(), scratch.low[2].data()};
  const float* const high[3] = {scratch.high[0].data(), scratch.high[1].data(), scratch.high[2].data()};
  bool any = false;
  for (std::size_t i = 0; i < scratch.leaf.size(); i += lanes) {
    for (std::uint64_t bits = BoxesOverOpenSamples(rows, low, high, i, r); bits != 0; bits &= bits - 1) {
      const BlockerTree::Leaf& leaf =
          scene.tree->leaves[scratch.leaf[i + static_cast<std::size_t>(std::countr_zero(bits))]];
      ++scratch.leaves_tested;
      if (!RasterizeLeaf(scene, leaf, receivers.own[index], r, scratch.counters)) continue;
      any = true;
      if (!AnyOpen(rows, r)) {
        StoreMask(rows, r, receivers);
        return;
      }
      SetOpenRectangle(rows, r);
    }
  }
  if (any) StoreMask(rows, r, receivers);
}

void SolveRowCluster(const ExactScene& scene, std::size_t begin, std::size_t end, KernelReceivers& receivers,
                     ExactScratch& scratch) {
  if (!ListLeaves(scene, begin, end, receivers, scratch)) return;
  for (std::size_t i = begin; i < end; ++i) SolveRowReceiver(scene, i, receivers, scratch);
}

}  // namespace HWY_NAMESPACE
}  // namespace halfshade
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace halfshade {

HWY_EXPORT(SolveRowCluster);

void solve_row_cluster(const ExactScene& scene, std::size_t begin, std::size_t end, KernelReceivers& receivers,
                       ExactScratch& scratch) {
  HWY_DYNAMIC_DISPATCH(SolveRowCluster)(scene, begin, end, receivers, scratch);
}

}  // namespace halfshade
#endif
