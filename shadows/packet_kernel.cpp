// The exact engine for samples in rows: a packet of receivers, one in each vector lane, sees the light as a picture of
// rows, and triangles are rasterized into all of the packet's pictures at once.
//
// An edge's plane m . (l - c) + d, with l = c + x X + y Y, is zero in row y at x = p + q y. With the error bound e of
// visibility_pair.h the sign is certain where |x - (p + q y)| > e / |m . X|; the slack added to that covers the
// rounding of p, q and of the row's columns. Samples in between go to the exact predicate.
//
// What is decided once for the whole packet: which leaves, which of a leaf's triangles (16 at a time), which rows.
#include <optional>

#include "shadows/exact_kernel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "shadows/packet_kernel.cpp"
#include <hwy/foreach_target.h>

#include "shadows/alpha_lookup-inl.h"
#include "shadows/exact_cluster-inl.h"

HWY_BEFORE_NAMESPACE();
namespace halfshade {
namespace HWY_NAMESPACE {

using IntTag = hn::RebindToSigned<Tag>;
using UintVec = hn::Vec<UintTag>;
constexpr std::size_t kMaxLines = SampleRows::kMaxLines;

/// Receivers [first, first + count), a lane each; lanes beyond repeat the last one and have nothing open.
struct Packet {
  std::size_t first = 0, count = 0;
  Vec3 position, to_center;       // lattice; from there to the light's centre
  Vec distance;                   // bound on |coordinate| of receiver to sample
  Vec height_error, place_error;  // 5 |r - c| / height + 10; 5 |r - c|: see ProjectVertices
  Vec column, row, height;        // of the receivers over the picture, in columns and rows from its centre; in lengths
  UintVec own;                    // own triangle
  vec3 low, high;                 // box around the receivers, lattice
  Shaft shaft;                    // the same in the light's frame, and a rectangle around what is open of the light
  const PictureLines* lines;      // where the rows lie
  std::uint32_t any_open[kMaxLines];                                // what some receiver has open
  alignas(HWY_MAX_BYTES) std::uint32_t open[kMaxLines][kMaxLanes];  // bit i: sample i of the line is not blocked yet
};

/// Rectangles as whole rows and columns of the picture, a lane each; none where first > last.
struct PictureRanges {
  std::int32_t row[2][BlockerTree::kWidth], column[2][BlockerTree::kWidth];  // [first, last]
};

/// Rows and columns that may lie in a rectangle, from lane i of the ranges on.
HWY_INLINE void FindRanges(const SampleRows& rows, const LaneRectangles& q, std::size_t i, PictureRanges& ranges) {
  const Tag d;
  const IntTag di;
  constexpr float kSlack = 1e-3f;
  const Vec least = hn::Set(d, -1.0f), most = hn::Set(d, 65.0f);
  const auto whole = [&](Vec v) { return hn::ConvertTo(di, hn::Min(hn::Max(v, least), most)); };
  const Vec scale = hn::Set(d, rows.scale), row_scale = hn::Set(d, rows.row_scale);
  hn::StoreU(whole(hn::Ceil(hn::MulAdd(q.low[0], scale, hn::Set(d, rows.least_offset - kSlack)))), di,
             ranges.column[0] + i);
  hn::StoreU(whole(hn::Floor(hn::MulAdd(q.high[0], scale, hn::Set(d, rows.most_offset + kSlack)))), di,
             ranges.column[1] + i);
  hn::StoreU(whole(hn::Ceil(hn::MulAdd(q.low[1], row_scale, hn::Set(d, rows.least_row_offset - kSlack)))), di,
             ranges.row[0] + i);
  hn::StoreU(whole(hn::Floor(hn::MulAdd(q.high[1], row_scale, hn::Set(d, rows.most_row_offset + kSlack)))), di,
             ranges.row[1] + i);
}

/// One lane's range, cut to the picture.
struct PictureRange {
  std::int32_t first_row, last_row, first_column, last_column;

  PictureRange(const SampleRows& rows, const PictureRanges& ranges, std::size_t lane)
      : first_row(std::max(ranges.row[0][lane], 0)),
        last_row(std::min(ranges.row[1][lane], static_cast<std::int32_t>(rows.rows) - 1)),
        first_column(std::max(ranges.column[0][lane], 0)),
        last_column(std::min(ranges.column[1][lane], static_cast<std::int32_t>(rows.columns) - 1)) {}

  /// Its columns of the word that starts at column `from`.
  std::uint32_t bits(std::int32_t from) const {
    const std::int32_t first = std::max(first_column - from, 0), last = std::min(last_column - from, 31);
    return first > last ? 0 : (~0u << first) & (~0u >> (31 - last));
  }

  /// visit(line) for the lines in which some receiver has a sample of the range open, until it returns true.
  template <class Visit>
  HWY_INLINE bool for_open_lines(const SampleRows& rows, const Packet& packet, const Visit& visit) const {
    for (std::uint32_t from = 0, line = 0; from < rows.columns; from += SampleRows::kWord, line += rows.rows) {
      const std::uint32_t wanted = bits(static_cast<std::int32_t>(from));
      for (std::int32_t row = first_row; row <= last_row; ++row) {
        const std::uint32_t at = line + static_cast<std::uint32_t>(row);
        if ((packet.any_open[at] & wanted) != 0 && visit(at)) return true;
      }
    }
    return false;
  }
  HWY_INLINE bool is_open(const SampleRows& rows, const Packet& packet) const {
    return for_open_lines(rows, packet, [](std::uint32_t) { return true; });
  }
};

/// Of the lanes in `active` (lane i of the ranges is the first), those whose rectangle may hold a sample that some
/// receiver has open.
HWY_INLINE std::uint64_t LanesOverOpenSamples(const SampleRows& rows, const LaneRectangles& q, std::uint64_t active,
                                              const Packet& packet, std::size_t i, const PictureRanges& ranges) {
  const Tag d;
  const Rectangle& light = packet.shaft.light;
  active &=
      Bits(hn::And(hn::And(hn::Le(q.low[0], hn::Set(d, light.high_u)), hn::Ge(q.high[0], hn::Set(d, light.low_u))),
                   hn::And(hn::Le(q.low[1], hn::Set(d, light.high_v)), hn::Ge(q.high[1], hn::Set(d, light.low_v)))));
  std::uint64_t kept = 0;
  for (; active != 0; active &= active - 1) {
    const auto lane = static_cast<std::size_t>(std::countr_zero(active));
    kept |= std::uint64_t{PictureRange(rows, ranges, i + lane).is_open(rows, packet)} << lane;
  }
  return kept;
}

/// Boxes from `i` on, of those listed for the cluster.
HWY_INLINE std::uint64_t BoxesOverOpenSamples(const SampleRows& rows, const float* const low[3],
                                              const float* const high[3], std::size_t i, const Packet& packet) {
  LaneRectangles q;
  const std::uint64_t between = Bits(ProjectBoxes(packet.shaft, low, high, i, q));
  const Vec pad = hn::Set(Tag(), ProjectionPad(packet.shaft.low[2]) + rows.deviation);
  for (int k = 0; k < 2; ++k) q.low[k] = hn::Sub(q.low[k], pad), q.high[k] = hn::Add(q.high[k], pad);
  if (between == 0) return 0;
  PictureRanges ranges;
  FindRanges(rows, q, 0, ranges);
  return LanesOverOpenSamples(rows, q, between, packet, 0, ranges);
}

/// Triangles of a leaf as the packet sees them. Bits are triangles.
struct LeafView {
  std::uint32_t above = 0, below = 0;  // the plane lies above (below) all receivers, along the triangle's normal
  std::uint32_t active = 0;            // may hide something from some receiver
  std::uint32_t bounded = 0;           // all of it projects onto the light's plane
  std::uint32_t kept = 0;              // active, and over what some receiver has open
  alignas(HWY_MAX_BYTES) float pad[BlockerTree::kWidth];  // rounding of a corner's place on the light, in lengths
  PictureRanges ranges;
};

/// On which side of the planes the packet's box lies, and so whether they separate it from samples.
HWY_INLINE void FindSides(const BlockerTree::Leaf& leaf, std::size_t i, const Packet& packet, const vec3& half,
                          const Vec3& to_corner, LeafView& view) {
  const Tag d;
  const Vec3 normal{hn::LoadU(d, leaf.normal[0] + i), hn::LoadU(d, leaf.normal[1] + i),
                    hn::LoadU(d, leaf.normal[2] + i)};
  const Vec side = Dot(normal, to_corner);
  const Vec reach = Dot({hn::Abs(normal.x), hn::Abs(normal.y), hn::Abs(normal.z)}, Splat(half));
  const Vec far = hn::Add(Norm1(to_corner), hn::Set(d, half.x + half.y + half.z));
  const Vec error = hn::MulAdd(hn::Mul(hn::LoadU(d, leaf.side_error + i), far), hn::Set(d, 2.0f), reach);
  const auto above = static_cast<std::uint32_t>(Bits(hn::Gt(side, error))),
             below = static_cast<std::uint32_t>(Bits(hn::Lt(side, hn::Neg(error))));
  const bool outside_box = packet.low.x > leaf.box_high.x || packet.low.y > leaf.box_high.y ||
                           packet.low.z > leaf.box_high.z || packet.high.x < leaf.box_low.x ||
                           packet.high.y < leaf.box_low.y || packet.high.z < leaf.box_low.z;
  const std::uint32_t in_leaf = (1u << std::min<std::size_t>(leaf.count - i, hn::Lanes(d))) - 1;
  const std::uint32_t samples_above = leaf.samples_above >> i,
                      samples_below = (leaf.samples_below & ~(outside_box ? leaf.back_faces_only : 0u)) >> i;
  view.above |= above << i, view.below |= below << i;
  view.active |= (((samples_above & ~below) | (samples_below & ~above)) & in_leaf) << i;
}

/// Rectangles around what the triangles hide of the light's plane from any of the receivers in `box`; corners are given
/// from the point `from` amid them. From r, a point v projects
/// to v + (v - r) w with w = v_z / (r_z - v_z).
HWY_INLINE LaneMask ProjectOntoLight(const LightFrame& frame, const std::array<Vec3, 3>& to_corner, const vec3& from,
                                     const Shaft& box, LaneRectangles& q, Vec& pad) {
  const Tag d;
  const Vec3 axes[2] = {Splat(vec3(frame.u)), Splat(vec3(frame.v))}, normal = Splat(vec3(frame.n));
  const vec3 middle(frame.to_frame(dvec3(from)));
  float half[3];
  for (int k = 0; k < 3; ++k) half[k] = std::max(box.high[k] - middle[k], middle[k] - box.low[k]) + 1e-6f;
  Vec least = hn::Set(d, 1e30f), farthest = hn::Zero(d);
  Vec nearest[2] = {least, least}, last[2] = {hn::Neg(least), hn::Neg(least)};  // of (v - r)
  Vec place_low[2] = {least, least}, place_high[2] = {hn::Neg(least), hn::Neg(least)};
  for (int axis = 0; axis < 2; ++axis) q.low[axis] = least, q.high[axis] = hn::Neg(least);
  for (const Vec3& c : to_corner) {
    const Vec up = Dot(c, normal), z = hn::Add(up, hn::Set(d, middle[2]));
    const Vec near = hn::Sub(hn::Neg(up), hn::Set(d, half[2])), far = hn::Sub(hn::Set(d, half[2]), up);  // r_z - v_z
    least = hn::Min(least, near);
    farthest = hn::Max(farthest, Norm1(c));
    const Vec w0 = hn::Div(z, near), w1 = hn::Div(z, far);
    for (int axis = 0; axis < 2; ++axis) {
      const Vec away = Dot(c, axes[axis]), place = hn::Add(away, hn::Set(d, middle[axis]));
      const Vec a = hn::Sub(away, hn::Set(d, half[axis])), b = hn::Add(away, hn::Set(d, half[axis]));
      const Vec a0 = hn::Mul(a, w0), a1 = hn::Mul(a, w1), b0 = hn::Mul(b, w0), b1 = hn::Mul(b, w1);
      q.low[axis] = hn::Min(q.low[axis], hn::Add(place, hn::Min(hn::Min(a0, a1), hn::Min(b0, b1))));
      q.high[axis] = hn::Max(q.high[axis], hn::Add(place, hn::Max(hn::Max(a0, a1), hn::Max(b0, b1))));
      nearest[axis] = hn::Min(nearest[axis], a), last[axis] = hn::Max(last[axis], b);
      place_low[axis] = hn::Min(place_low[axis], place), place_high[axis] = hn::Max(place_high[axis], place);
    }
  }
  // Triangles that reach the height of a receiver project without bounds, but only away from the receivers.
  farthest = hn::Add(farthest, hn::Set(d, half[0] + half[1] + half[2]));
  const LaneMask bounded = hn::Gt(least, hn::Mul(farthest, hn::Set(d, 1e-5f)));
  const Vec magnified = hn::Div(hn::Mul(farthest, hn::Set(d, 1e-6f * (box.high[2] + 4.0f))), least);
  pad = hn::Add(magnified, hn::Set(d, ProjectionPad(box.low[2])));
  const Vec everywhere = hn::Set(d, 1e9f), margin = hn::Set(d, 2e-5f);
  for (int axis = 0; axis < 2; ++axis) {
    const Vec low =
        hn::IfThenElse(hn::Gt(nearest[axis], margin), hn::Sub(place_low[axis], margin), hn::Neg(everywhere));
    const Vec high = hn::IfThenElse(hn::Lt(last[axis], hn::Neg(margin)), hn::Add(place_high[axis], margin), everywhere);
    q.low[axis] = hn::IfThenElse(bounded, hn::Sub(q.low[axis], pad), low);
    q.high[axis] = hn::IfThenElse(bounded, hn::Add(q.high[axis], pad), high);
  }
  return bounded;
}

/// Triangles from `i` on.
HWY_INLINE void ViewTriangles(const ExactScene& scene, const BlockerTree::Leaf& leaf, std::size_t i,
                              const Packet& packet, LeafView& view) {
  const Tag d;
  const vec3 middle = 0.5f * (packet.low + packet.high);
  const vec3 half = glm::max(packet.high - middle, middle - packet.low) * (1.0f + 0x1p-20f);
  std::array<Vec3, 3> to_corner;
  for (std::size_t k = 0; k < 3; ++k) {
    to_corner[k] = Subtract(
        {hn::LoadU(d, leaf.corner[k][0] + i), hn::LoadU(d, leaf.corner[k][1] + i), hn::LoadU(d, leaf.corner[k][2] + i)},
        Splat(middle));
  }
  FindSides(leaf, i, packet, half, to_corner[0], view);
  const std::uint64_t active = (view.active >> i) & ((std::uint64_t{1} << hn::Lanes(d)) - 1);
  if (active == 0) return;
  LaneRectangles q;
  Vec pad;
  view.bounded |=
      static_cast<std::uint32_t>(Bits(ProjectOntoLight(scene.frame, to_corner, middle, packet.shaft, q, pad))) << i;
  hn::StoreU(pad, d, view.pad + i);
  FindRanges(*scene.rows, q, i, view.ranges);
  view.kept |= static_cast<std::uint32_t>(LanesOverOpenSamples(*scene.rows, q, active, packet, i, view.ranges)) << i;
}

/// Vertices of a leaf as each receiver sees them before the light, in columns and rows; `error` bounds how far they may
/// lie off, in lengths along either axis.
struct ProjectedVertices {
  alignas(HWY_MAX_BYTES) float column[3 * BlockerTree::kWidth][kMaxLanes], row[3 * BlockerTree::kWidth][kMaxLanes],
      error[3 * BlockerTree::kWidth][kMaxLanes];
};

/// Those in `wanted`, which must lie between the receivers and the light.
HWY_INLINE void ProjectVertices(const ExactScene& scene, const BlockerTree::Leaf& leaf, std::uint64_t wanted,
                                const Packet& packet, ProjectedVertices& projected) {
  const Tag d;
  const SampleRows& rows = *scene.rows;
  const Vec3 axis_x = Splat(rows.axis_x * rows.scale), axis_y = Splat(rows.axis_y * rows.row_scale),
             down = Splat(vec3(-scene.frame.n));
  for (; wanted != 0; wanted &= wanted - 1) {
    const auto v = static_cast<std::size_t>(std::countr_zero(wanted));
    const Vec3 way = Subtract(Splat({leaf.vertex[0][v], leaf.vertex[1][v], leaf.vertex[2][v]}), packet.position);
    const Vec inverse = hn::Div(hn::Set(d, 1.0f), Dot(way, down)), scale = hn::Mul(packet.height, inverse);
    hn::Store(hn::MulAdd(Dot(way, axis_x), scale, packet.column), d, projected.column[v]);
    hn::Store(hn::MulAdd(Dot(way, axis_y), scale, packet.row), d, projected.row[v]);
    // In units of 2^-24: a coordinate along an axis is within 5 |way|, the depth as well, the height within 5 |r - c|.
    const Vec length = Norm1(way);
    const Vec relative = hn::MulAdd(hn::Mul(hn::Set(d, 5.0f), length), inverse, packet.height_error);
    hn::Store(hn::Mul(hn::Set(d, 0x1.1p-24f), hn::MulAdd(hn::Mul(length, scale), relative, packet.place_error)), d,
              projected.error[v]);
  }
}

/// Bits of the columns between low and high, rounded to whole ones within HalfPlane's slack.
HWY_INLINE UintVec ColumnsBetween(Vec low, Vec high, Vec offset, Vec rest) {
  const Tag d;
  const UintTag du;
  // A float of 2^23 and more is a whole number, which stands in its lowest bits.
  const Vec shifter = hn::Set(d, 0x1p23f), zero = hn::Zero(d);
  const UintVec shifter_bits = hn::Set(du, 0x4b000000u), ones = hn::Set(du, ~0u);
  const Vec from = hn::Add(hn::Max(hn::Add(low, offset), zero), shifter);  // columns left out at the start
  const Vec past = hn::Add(hn::Max(hn::Sub(rest, high), zero), shifter);   // and at the end
  const UintVec first = hn::Sub(hn::BitCast(du, from), shifter_bits),
                last = hn::Sub(hn::BitCast(du, past), shifter_bits);
#if HWY_TARGET <= HWY_AVX2 && HWY_ARCH_X86  // shifts by 32 and more leave nothing
  return hn::And(hn::Shl(ones, first), hn::Shr(ones, last));
#else
  const UintVec most = hn::Set(du, 31u);
  const auto some = hn::And(hn::RebindMask(du, hn::Lt(from, hn::Set(d, 0x1p23f + 32.0f))),
                            hn::RebindMask(du, hn::Lt(past, hn::Set(d, 0x1p23f + 32.0f))));
  return hn::IfThenElseZero(some, hn::And(hn::Shl(ones, hn::And(first, most)), hn::Shr(ones, hn::And(last, most))));
#endif
}

/// Lines of the picture, as bits.
struct LineSet {
  std::uint64_t bits[kMaxLines / 64] = {};
  void add(std::uint32_t line) { bits[line / 64] |= std::uint64_t{1} << (line % 64); }
  bool has(std::uint32_t line) const { return (bits[line / 64] >> (line % 64)) & 1; }
  template <class Visit>
  HWY_INLINE void for_each(const Visit& visit) const {
    for (std::uint32_t word = 0; word < kMaxLines / 64; ++word) {
      for (std::uint64_t rest = bits[word]; rest != 0; rest &= rest - 1) {
        visit(64 * word + static_cast<std::uint32_t>(std::countr_zero(rest)));
      }
    }
  }
};

/// The receivers that have a sample open in the rectangle around a projected triangle, and the lines where they have.
HWY_INLINE LaneMask ReceiversOverOpenSamples(const SampleRows& rows, const std::array<std::uint8_t, 3>& corner,
                                             float pad, const ProjectedVertices& v, const PictureRange& range,
                                             const Packet& packet, LineSet& lines) {
  const Tag d;
  const UintTag du;
  constexpr float kSlack = 1e-3f;
  const auto least = [&](const float(*p)[kMaxLanes]) HWY_ATTR {
    return hn::Min(hn::Load(d, p[corner[0]]), hn::Min(hn::Load(d, p[corner[1]]), hn::Load(d, p[corner[2]])));
  };
  const auto most = [&](const float(*p)[kMaxLanes]) HWY_ATTR {
    return hn::Max(hn::Load(d, p[corner[0]]), hn::Max(hn::Load(d, p[corner[1]]), hn::Load(d, p[corner[2]])));
  };
  const Vec low = least(v.column), high = most(v.column);
  const float column_pad = pad * rows.scale + kSlack, row_pad = pad * rows.row_scale + kSlack;
  const Vec first_row = hn::Add(least(v.row), hn::Set(d, rows.least_row_offset - row_pad)),
            last_row = hn::Add(most(v.row), hn::Set(d, rows.most_row_offset + row_pad));
  UintVec columns[SampleRows::kMaxColumns / SampleRows::kWord];
  for (std::uint32_t word = 0; word * SampleRows::kWord < rows.columns; ++word) {
    const float from = static_cast<float>(word * SampleRows::kWord);
    columns[word] = ColumnsBetween(low, high, hn::Set(d, rows.least_offset - from - column_pad + 0.5f),
                                   hn::Set(d, 31.5f - rows.most_offset + from - column_pad));
  }
  LaneMask receivers = hn::Lt(low, low);
  range.for_open_lines(rows, packet, [&](std::uint32_t line) HWY_ATTR {
    const Vec row = hn::Set(d, static_cast<float>(line % rows.rows));
    const UintVec open = hn::And(hn::Load(du, packet.open[line]), columns[line / rows.rows]);
    const LaneMask here =
        hn::And(hn::RebindMask(d, hn::Ne(open, hn::Zero(du))), hn::And(hn::Le(first_row, row), hn::Ge(last_row, row)));
    if (!hn::AllFalse(d, here)) lines.add(line);
    receivers = hn::Or(receivers, here);
    return false;
  });
  return receivers;
}

/// A half plane of the picture in each lane: column x of row y is inside beyond p + q y, towards larger x where `up`.
/// In columns; `least` and `most` are p less and p plus what is uncertain.
struct HalfPlane {
  Vec least, most, slope;
  LaneMask up;
};

/// 1 / a within 4 units of 2^-24.
HWY_INLINE Vec Reciprocal(Vec a) {
  const Tag d;
#if HWY_ARCH_X86
  const Vec r = hn::ApproximateReciprocal(a);
  return hn::Mul(r, hn::NegMulAdd(a, r, hn::Set(d, 2.0f)));
#else
  return hn::Div(hn::Set(d, 1.0f), a);
#endif
}

/// a x + b y + c >= 0 in units of length, certain beyond `error`.
HWY_INLINE HalfPlane SolveForX(const SampleRows& rows, Vec a, Vec b, Vec c, Vec error) {
  const Tag d;
  const Vec tiny = hn::Set(d, 0x1p-80f);
  a = hn::IfThenElse(hn::Lt(hn::Abs(a), tiny), tiny, a);
  error = hn::Max(error, hn::Set(d, 0x1p-76f));  // also covers what `tiny` changed
  const Vec inverse = hn::Mul(Reciprocal(a), hn::Set(d, rows.scale));
  const Vec p = hn::Neg(hn::Mul(c, inverse));
  HalfPlane h;
  h.slope = hn::Neg(hn::Mul(b, inverse));
  // p, q and p + q y are each within six units of 2^-24; columns are rounded at 2^-16 of one, and to whole ones by
  // adding a half less that much.
  const Vec rounding = hn::MulAdd(hn::Abs(h.slope), hn::Set(d, rows.reach_y), hn::Abs(p));
  const Vec slack = hn::MulAdd(rounding, hn::Set(d, 0x1p-20f), hn::Set(d, 0x1p-15f));
  const Vec width = hn::MulAdd(hn::Mul(error, hn::Set(d, 1.0f + 0x1p-20f)), hn::Abs(inverse), slack);
  h.least = hn::Sub(p, width);
  h.most = hn::Add(p, width);
  h.up = hn::Gt(a, hn::Zero(d));
  return h;
}

/// A triangle before it is rasterized.
struct PacketTriangle {
  const Blocker* blocker;  // for the exact predicate and textures
  std::array<vec3, 3> corner;
  bool perforated;
  std::array<HalfPlane, 4> planes;  // through receiver and edge, oriented for a plane above the receiver; its own plane
  std::size_t count;                // 3; 4 where samples lie on both sides of its plane
};

/// Limits of all lanes in order: two (the same twice where there is one) from below, two from above.
struct Limits {
  std::uint8_t low[2], high[2];
};
constexpr Limits kLimits[8] = {{{0, 0}, {0, 0}}, {{0, 0}, {1, 2}}, {{1, 1}, {0, 2}}, {{0, 1}, {2, 2}},
                               {{2, 2}, {0, 1}}, {{0, 2}, {1, 1}}, {{1, 2}, {0, 0}}, {{0, 0}, {0, 0}}};

/// The picture of a triangle, line by line.
///
/// Mostly all receivers of a packet see an edge from the same side; then two limits from below and two from above
/// suffice. Else every half plane limits from either side, by lane.
class Outline {
 public:
  Outline(const PacketTriangle& triangle, const std::array<LaneMask, 4>& up, std::uint64_t lanes)
      : triangle_(triangle), up_(up) {
    std::size_t way = 0;
    bool alike = triangle.count == 3;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint64_t bits = Bits(up[k]) & lanes;
      alike = alike && (bits == 0 || bits == lanes);
      way |= std::size_t{bits != 0} << k;
    }
    simple_ = alike && way != 0 && way != 7;
    const Limits& limits = kLimits[way];
    for (int k = 0; k < 2; ++k) {
      low_[k] = &triangle.planes[limits.low[k]], high_[k] = &triangle.planes[limits.high[k]];
    }
  }

  /// Samples that may be inside.
  HWY_INLINE UintVec possible(Vec y, Vec offset, Vec rest) const {
    if (!simple_) return all_limits(y, offset, rest, true);
    const auto at = [&](Vec p, Vec q) { return hn::MulAdd(q, y, p); };
    return ColumnsBetween(hn::Max(at(low_[0]->least, low_[0]->slope), at(low_[1]->least, low_[1]->slope)),
                          hn::Min(at(high_[0]->most, high_[0]->slope), at(high_[1]->most, high_[1]->slope)), offset,
                          rest);
  }

  /// Samples that are certainly inside.
  HWY_INLINE UintVec inside(Vec y, Vec offset, Vec rest) const {
    if (!simple_) return all_limits(y, offset, rest, false);
    const auto at = [&](Vec p, Vec q) { return hn::MulAdd(q, y, p); };
    return ColumnsBetween(hn::Max(at(low_[0]->most, low_[0]->slope), at(low_[1]->most, low_[1]->slope)),
                          hn::Min(at(high_[0]->least, high_[0]->slope), at(high_[1]->least, high_[1]->slope)), offset,
                          rest);
  }

 private:
  UintVec all_limits(Vec y, Vec offset, Vec rest, bool outwards) const {
    const Tag d;
    Vec low = hn::Set(d, -1e30f), high = hn::Set(d, 1e30f);
    for (std::size_t k = 0; k < triangle_.count; ++k) {
      const HalfPlane& h = triangle_.planes[k];
      const Vec least = hn::MulAdd(h.slope, y, h.least), most = hn::MulAdd(h.slope, y, h.most);
      low = hn::IfThenElse(up_[k], hn::Max(low, outwards ? least : most), low);
      high = hn::IfThenElse(up_[k], high, hn::Min(high, outwards ? most : least));
    }
    return ColumnsBetween(low, high, offset, rest);
  }

  const PacketTriangle& triangle_;
  const std::array<LaneMask, 4>& up_;
  bool simple_;
  const HalfPlane *low_[2], *high_[2];
};

/// Edges around a patch of triangles, each from a vertex to the next, as the receivers see them in columns and rows.
struct PatchOutline {
  static constexpr std::uint32_t kMost = 31;  // and so it winds around nothing more than 15 times
  std::uint32_t count = 0;
  std::uint8_t from[kMost + 1], to[kMost + 1];
  alignas(HWY_MAX_BYTES) float slope[kMost + 1][kMaxLanes], width[kMost + 1][kMaxLanes];  // columns a row; uncertainty
  std::uint32_t on_row[SampleRows::kMaxRows];  // edges that cross the row for some receiver, as bits
};

/// A packet at work on its receivers.
class PacketSolver {
 public:
  PacketSolver(const ExactScene& scene, KernelReceivers& receivers, ExactScratch& scratch)
      : scene_(scene), rows_(*scene.rows), receivers_(receivers), scratch_(scratch), counters_(scratch.counters) {}

  HWY_INLINE void Solve(std::size_t first, std::size_t count) {
    if (!Begin(first, count)) return;
    const std::size_t lanes = hn::Lanes(Tag());
    const float* const low[3] = {scratch_.low[0].data(), scratch_.low[1].data(), scratch_.low[2].data()};
    const float* const high[3] = {scratch_.high[0].data(), scratch_.high[1].data(), scratch_.high[2].data()};
    bool any = false;
    for (std::size_t i = 0; i < scratch_.leaf.size(); i += lanes) {
      for (std::uint64_t bits = BoxesOverOpenSamples(rows_, low, high, i, packet_); bits != 0; bits &= bits - 1) {
        ++scratch_.leaves_tested;
        const std::uint32_t leaf = scratch_.leaf[i + static_cast<std::size_t>(std::countr_zero(bits))];
        if (!RasterizeLeaf(scene_.tree->leaves[leaf])) continue;
        any = true;
        if (!FindOpenPart()) {
          StoreMasks();
          return;
        }
      }
    }
    if (any) StoreMasks();
  }

 private:
  bool Begin(std::size_t first, std::size_t count);
  bool FindOpenPart();
  bool RasterizeLeaf(const BlockerTree::Leaf& leaf);
  bool RasterizeTriangle(const BlockerTree::Leaf& leaf, std::size_t lane, LaneMask active);
  std::uint32_t FindPatch(const BlockerTree::Leaf& leaf);
  HWY_INLINE LaneMask SetOutline(const BlockerTree::Leaf& leaf, std::uint64_t projected);
  HWY_INLINE UintVec WindLine(std::uint32_t line, UintVec& doubtful) const;
  bool RasterizePatch(const BlockerTree::Leaf& leaf, std::uint32_t patch, std::uint64_t projected,
                      LaneMask& not_patched);
  void SettlePatch(const BlockerTree::Leaf& leaf, std::uint32_t patch, std::uint32_t line,
                   const std::uint32_t* doubtful, std::uint32_t* blocked);
  void StoreMasks();

  HWY_INLINE void SetPlanes(const BlockerTree::Leaf& leaf, std::size_t lane, PacketTriangle& triangle) const;
  HWY_INLINE LaneMask FindBelow(const PacketTriangle& triangle, LaneMask& active, const LineSet& lines);
  HWY_INLINE bool Rasterize(const PacketTriangle& triangle, const LineSet& lines, LaneMask below, LaneMask active);
  HWY_INLINE std::array<LaneMask, 4> Orient(const PacketTriangle& triangle, LaneMask below) const;
  void Settle(const PacketTriangle& triangle, std::uint32_t line, const std::uint32_t* possible, std::uint32_t* inside);

  vec3 Position(std::size_t lane) const {
    const std::size_t i = packet_.first + lane;
    return {receivers_.x[i], receivers_.y[i], receivers_.z[i]};
  }

  const ExactScene& scene_;
  const SampleRows& rows_;
  KernelReceivers& receivers_;
  ExactScratch& scratch_;
  KernelCounters& counters_;
  Packet packet_;
  LineSet changed_lines_;
  LeafView view_;                                 // of the leaf at work
  PatchOutline outline_;                          // of the patch at work
  ProjectedVertices vertices_;                    // of the leaf at work
  std::optional<TexelLookup> texels_[kMaxLanes];  // of the perforated triangle at work, made when first needed
};

/// Positions, boxes and pictures; all samples are open.
bool PacketSolver::Begin(std::size_t first, std::size_t count) {
  const Tag d;
  const UintTag du;
  packet_.first = first, packet_.count = count;
  packet_.low = vec3(1e30f), packet_.high = vec3(-1e30f);
  Shaft& shaft = packet_.shaft;
  for (int k = 0; k < 3; ++k) shaft.low[k] = 1e30f, shaft.high[k] = -1e30f;
  for (std::size_t i = 0; i < count; ++i) {
    const vec3 r = Position(i), p(scene_.frame.to_frame(dvec3(r)));
    packet_.low = glm::min(packet_.low, r), packet_.high = glm::max(packet_.high, r);
    for (int k = 0; k < 3; ++k)
      shaft.low[k] = std::min(shaft.low[k], p[k]), shaft.high[k] = std::max(shaft.high[k], p[k]);
  }
  packet_.position = {hn::LoadU(d, &receivers_.x[first]), hn::LoadU(d, &receivers_.y[first]),
                      hn::LoadU(d, &receivers_.z[first])};
  packet_.own = hn::LoadU(du, &receivers_.own[first]);
  packet_.to_center = Subtract(Splat(scene_.samples->center), packet_.position);
  const Vec3 from_center = Subtract(packet_.position, Splat(scene_.samples->center));
  packet_.column = Dot(from_center, Splat(rows_.axis_x * rows_.scale));
  packet_.row = Dot(from_center, Splat(rows_.axis_y * rows_.row_scale));
  packet_.height = Dot(from_center, Splat(vec3(scene_.frame.n)));
  packet_.place_error = hn::Mul(hn::Set(d, 5.0f), Norm1(from_center));
  packet_.height_error = hn::Add(hn::Div(packet_.place_error, packet_.height), hn::Set(d, 10.0f));
  packet_.distance =
      hn::Add(NormMax(packet_.to_center), hn::Set(d, scene_.samples->reach + rows_.deviation / kDeterminantError));
  const auto in_packet = hn::RebindMask(du, hn::FirstN(d, count));
  for (std::uint32_t line = 0; line < rows_.lines; ++line) {
    packet_.any_open[line] = rows_.valid[line];
    hn::Store(hn::IfThenElseZero(in_packet, hn::Set(du, rows_.valid[line])), du, packet_.open[line]);
  }
  scratch_.lines.place(*scene_.rows, receivers_.set.data() + first, count);
  packet_.lines = &scratch_.lines;
  for (std::uint64_t& word : changed_lines_.bits) word = ~std::uint64_t{0};
  return FindOpenPart();
}

/// What some receiver has open, after lines changed; false where nothing is.
bool PacketSolver::FindOpenPart() {
  std::uint32_t columns[2] = {0, 0}, first = ~0u, last = 0;
  for (std::uint32_t line = 0; line < rows_.lines; ++line) {
    if (changed_lines_.has(line)) {
      std::uint32_t all = 0;
      for (std::size_t k = 0; k < hn::Lanes(Tag()); ++k) all |= packet_.open[line][k];
      packet_.any_open[line] = all;
    }
    if (packet_.any_open[line] == 0) continue;
    columns[line / rows_.rows] |= packet_.any_open[line];
    first = std::min(first, line % rows_.rows), last = std::max(last, line % rows_.rows);
  }
  changed_lines_ = LineSet();
  const std::uint64_t all = columns[0] | std::uint64_t{columns[1]} << 32;
  if (all == 0) return false;
  const float pad = ProjectionPad(packet_.shaft.low[2]) + rows_.deviation;
  const auto low = static_cast<float>(std::countr_zero(all)), high = static_cast<float>(63 - std::countl_zero(all));
  packet_.shaft.light = {(low - rows_.most_offset) / rows_.scale - pad,
                         (static_cast<float>(first) - rows_.most_row_offset) / rows_.row_scale - pad,
                         (high - rows_.least_offset) / rows_.scale + pad,
                         (static_cast<float>(last) - rows_.least_row_offset) / rows_.row_scale + pad};
  return true;
}

/// Up to 16 triangles; true where samples were blocked.
bool PacketSolver::RasterizeLeaf(const BlockerTree::Leaf& leaf) {
  counters_.pairs_tested += leaf.count * packet_.count;
  LeafView& view = view_;
  view.above = view.below = view.bounded = view.active = view.kept = 0;
  for (std::size_t i = 0; i < leaf.count; i += hn::Lanes(Tag())) ViewTriangles(scene_, leaf, i, packet_, view);
  if (view.kept == 0) return false;
  std::uint64_t vertices = 0;
  for (std::uint32_t rest = view.kept & view.bounded; rest != 0; rest &= rest - 1) {
    const auto lane = static_cast<std::size_t>(std::countr_zero(rest));
    for (const auto& vertex : leaf.corner_vertex) vertices |= std::uint64_t{1} << vertex[lane];
  }
  ProjectVertices(scene_, leaf, vertices, packet_, vertices_);
  const Tag d;
  const LaneMask everyone = hn::FirstN(d, packet_.count), none = hn::Lt(hn::Set(d, 0.0f), hn::Zero(d));
  bool added = false;
  std::uint32_t in_patch = 0;
  LaneMask not_patched = none;
  if (!rows_.place.empty() && std::popcount(view.kept) >= 3) {
    in_patch = FindPatch(leaf);
    if (in_patch != 0) added = RasterizePatch(leaf, in_patch, vertices, not_patched);
  }
  for (std::uint32_t rest = view.kept; rest != 0; rest &= rest - 1) {
    const auto lane = static_cast<std::size_t>(std::countr_zero(rest));
    const LaneMask asked = (in_patch >> lane) & 1 ? not_patched : everyone;
    if (!hn::AllFalse(d, asked)) added |= RasterizeTriangle(leaf, lane, asked);
  }
  return added;
}

/// Triangles that are seen from one side by all receivers, lie whole between them and the whole light, and are opaque:
/// a sample is blocked where the outlines of the triangles wind around it, and edges between two of them cancel. Fills
/// outline_; empty where patches of this leaf would not pay, or could wind around a sample 16 times.
std::uint32_t PacketSolver::FindPatch(const BlockerTree::Leaf& leaf) {
  const UintTag du;
  const LeafView& view = view_;
  std::uint32_t patch = ((view.above & ~leaf.samples_below) | (view.below & ~leaf.samples_above)) & view.bounded &
                        view.active & ~leaf.perforated;
  const float most = 0.02f / std::max(rows_.scale, rows_.row_scale);
  for (std::uint32_t rest = patch; rest != 0; rest &= rest - 1) {
    const auto lane = static_cast<std::size_t>(std::countr_zero(rest));
    const bool is_own = !hn::AllFalse(du, hn::Eq(packet_.own, hn::Set(du, leaf.triangle[lane])));
    if (is_own || view.pad[lane] > most) patch &= ~(1u << lane);
  }
  const int wanted = std::popcount(patch & view.kept);
  if (wanted < 3) return 0;
  std::uint64_t once[2] = {0, 0}, twice[2] = {0, 0}, thrice = 0;  // uses of edges, by direction
  for (std::uint32_t rest = patch; rest != 0; rest &= rest - 1) {
    const auto lane = static_cast<std::size_t>(std::countr_zero(rest));
    const std::uint32_t turned = (view.below >> lane) & 1;
    for (const auto& edge : leaf.corner_edge) {
      const std::uint64_t bit = std::uint64_t{1} << (edge[lane] & ~BlockerTree::kReversed);
      const std::uint32_t way = (edge[lane] & BlockerTree::kReversed ? 1u : 0u) ^ turned;
      thrice |= twice[way] & bit;
      twice[way] |= once[way] & bit;
      once[way] |= bit;
    }
  }
  const std::uint64_t both = once[0] & once[1];
  if (thrice != 0 || (both & (twice[0] ^ twice[1])) != 0) return 0;
  outline_.count = 0;
  for (std::uint32_t way = 0; way < 2; ++way) {
    const std::uint64_t single = once[way] & ~both;
    const int uses = std::popcount(single) + std::popcount(single & twice[way]);
    if (static_cast<int>(outline_.count) + uses > std::min(static_cast<int>(PatchOutline::kMost), 4 * wanted)) return 0;
    for (std::uint64_t rest = single; rest != 0; rest &= rest - 1) {
      const auto edge = static_cast<std::size_t>(std::countr_zero(rest));
      const std::uint8_t a = leaf.edge_vertex[way][edge], b = leaf.edge_vertex[1 - way][edge];
      outline_.from[outline_.count] = a, outline_.to[outline_.count++] = b;
      if ((twice[way] >> edge) & 1) outline_.from[outline_.count] = a, outline_.to[outline_.count++] = b;
    }
  }
  return patch;
}

/// Vertices of the outline, and its edges as the receivers see them. Returns the receivers for which no vertex lies on
/// a row, so far as can be told.
HWY_INLINE LaneMask PacketSolver::SetOutline(const BlockerTree::Leaf& leaf, std::uint64_t projected) {
  const Tag d;
  std::uint64_t used = 0;
  for (std::uint32_t e = 0; e < outline_.count; ++e) used |= std::uint64_t{1} << outline_.from[e];
  ProjectVertices(scene_, leaf, used & ~projected, packet_, vertices_);
  const Vec row_offset = hn::Set(d, 0.5f * (rows_.least_row_offset + rows_.most_row_offset));
  const Vec spread =
      hn::Set(d, rows_.most_row_offset - rows_.least_row_offset + rows_.deviation * rows_.row_scale + 1e-5f);
  const Vec row_scale = hn::Set(d, rows_.row_scale), end = hn::Set(d, static_cast<float>(rows_.rows));
  LaneMask on_row = hn::Lt(end, end);
  for (std::uint64_t rest = used; rest != 0; rest &= rest - 1) {
    const auto v = static_cast<std::size_t>(std::countr_zero(rest));
    const Vec row = hn::Add(hn::Load(d, vertices_.row[v]), row_offset), nearest = hn::Round(row);
    const Vec error = hn::MulAdd(hn::Load(d, vertices_.error[v]), row_scale, spread);
    on_row = hn::Or(on_row, hn::And(hn::Le(hn::Abs(hn::Sub(row, nearest)), error),
                                    hn::And(hn::Ge(nearest, hn::Zero(d)), hn::Lt(nearest, end))));
  }
  std::fill_n(outline_.on_row, rows_.rows, 0u);
  for (std::uint32_t e = 0; e < outline_.count; ++e) {
    const std::size_t a = outline_.from[e], b = outline_.to[e];
    const Vec xa = hn::Load(d, vertices_.column[a]), ya = hn::Load(d, vertices_.row[a]),
              dx = hn::Sub(hn::Load(d, vertices_.column[b]), xa), dy = hn::Sub(hn::Load(d, vertices_.row[b]), ya);
    const Vec slope = hn::Div(dx, hn::IfThenElse(hn::Eq(dy, hn::Zero(d)), hn::Set(d, 1.0f), dy));
    const Vec error =
        hn::Add(hn::Max(hn::Load(d, vertices_.error[a]), hn::Load(d, vertices_.error[b])), hn::Set(d, rows_.deviation));
    Vec width = hn::Mul(error, hn::MulAdd(hn::Abs(slope), row_scale, hn::Set(d, rows_.scale)));
    width = hn::MulAdd(hn::Add(hn::Abs(xa), hn::Abs(dx)), hn::Set(d, 0x1p-20f), width);
    width = hn::Add(width, hn::Set(d, 0x1p-16f));
    hn::Store(slope, d, outline_.slope[e]);
    hn::Store(width, d, outline_.width[e]);
    // Edges to the right of the picture hide nothing of it.
    const Vec left = hn::Sub(hn::Min(xa, hn::Add(xa, dx)), width), yb = hn::Add(ya, dy);
    if (hn::AllTrue(d, hn::Gt(left, hn::Set(d, static_cast<float>(rows_.columns) - rows_.least_offset)))) continue;
    const float low = hn::GetLane(hn::MinOfLanes(d, hn::Min(ya, yb))),
                high = hn::GetLane(hn::MaxOfLanes(d, hn::Max(ya, yb)));
    const auto first = static_cast<std::int32_t>(std::max(low + rows_.least_row_offset - 1e-3f, 0.0f));
    const float last = std::min(high + rows_.most_row_offset + 1e-3f, static_cast<float>(rows_.rows) - 1.0f);
    for (std::int32_t row = first; static_cast<float>(row) <= last; ++row) outline_.on_row[row] |= 1u << e;
  }
  return hn::Not(on_row);
}

/// Numbers of four bits, one for each sample of a line.
struct WindingNumbers {
  UintVec bit[4];
  HWY_INLINE void Add(UintVec one) {
    for (UintVec& b : bit) {
      const UintVec carry = hn::And(b, one);
      b = hn::Xor(b, one), one = carry;
    }
  }
  HWY_INLINE void Subtract(UintVec one) {
    for (UintVec& b : bit) {
      const UintVec borrow = hn::AndNot(b, one);
      b = hn::Xor(b, one), one = borrow;
    }
  }
};

/// One line of a patch: the samples that it winds around, and those so near to an outline that this is not certain.
HWY_INLINE UintVec PacketSolver::WindLine(std::uint32_t line, UintVec& doubtful) const {
  const Tag d;
  const UintTag du;
  const PictureLines& l = *packet_.lines;
  const Vec y = hn::Set(d, rows_.place[line]), offset = hn::Load(d, l.offset[line]), rest = hn::Load(d, l.rest[line]);
  const Vec shifter = hn::Set(d, 0x1p23f), half = hn::Set(d, 0.5f);
  const UintVec zero = hn::Zero(du), ones = hn::Set(du, ~0u), shifter_bits = hn::Set(du, 0x4b000000u);
  WindingNumbers winding{{zero, zero, zero, zero}};
  doubtful = zero;
  for (std::uint32_t edges = outline_.on_row[line % rows_.rows]; edges != 0; edges &= edges - 1) {
    const auto e = static_cast<std::size_t>(std::countr_zero(edges));
    const std::size_t a = outline_.from[e], b = outline_.to[e];
    const Vec ya = hn::Load(d, vertices_.row[a]);
    const LaneMask behind = hn::Le(ya, y), before = hn::Le(hn::Load(d, vertices_.row[b]), y);
    const LaneMask crossing = hn::Xor(behind, before);
    const Vec x = hn::MulAdd(hn::Load(d, outline_.slope[e]), hn::Sub(y, ya), hn::Load(d, vertices_.column[a]));
    const Vec place = hn::Min(hn::Max(hn::Add(x, offset), hn::Zero(d)), hn::Set(d, 33.0f));
    const Vec from = hn::Add(place, shifter);
    const Vec width = hn::Load(d, outline_.width[e]);
    const Vec off = hn::Abs(hn::Sub(place, hn::Sub(from, shifter)));  // a half where x is a column
    const LaneMask unsure = hn::And(crossing, hn::Ge(off, hn::Sub(half, width)));
    if (!hn::AllFalse(d, unsure)) {
      doubtful =
          hn::Or(doubtful, hn::IfThenElseZero(hn::RebindMask(du, unsure),
                                              ColumnsBetween(hn::Sub(x, width), hn::Add(x, width), offset, rest)));
    }
    const UintVec first = hn::Sub(hn::BitCast(du, from), shifter_bits);
#if HWY_TARGET <= HWY_AVX2 && HWY_ARCH_X86
    const UintVec beyond = hn::Shl(ones, first);
#else
    const UintVec beyond =
        hn::IfThenElseZero(hn::Lt(first, hn::Set(du, 32u)), hn::Shl(ones, hn::And(first, hn::Set(du, 31u))));
#endif
    const LaneMask down = hn::AndNot(behind, before), up = hn::AndNot(before, behind);
    if (!hn::AllFalse(d, down)) winding.Add(hn::IfThenElseZero(hn::RebindMask(du, down), beyond));
    if (!hn::AllFalse(d, up)) winding.Subtract(hn::IfThenElseZero(hn::RebindMask(du, up), beyond));
  }
  return hn::Or(hn::Or(winding.bit[0], winding.bit[1]), hn::Or(winding.bit[2], winding.bit[3]));
}

/// Doubtful samples of a line by the exact predicate: does a triangle of the patch block them?
void PacketSolver::SettlePatch(const BlockerTree::Leaf& leaf, std::uint32_t patch, std::uint32_t line,
                               const std::uint32_t* doubtful, std::uint32_t* blocked) {
  for (std::size_t lane = 0; lane < packet_.count; ++lane) {
    const std::size_t first =
        std::size_t{receivers_.set[packet_.first + lane]} * scene_.samples->padded + rows_.first_sample(line);
    for (std::uint32_t rest = doubtful[lane]; rest != 0; rest &= rest - 1) {
      const auto bit = static_cast<std::size_t>(std::countr_zero(rest));
      bool is_blocked = false;
      for (std::uint32_t t = patch; t != 0 && !is_blocked; t &= t - 1) {
        const auto k = static_cast<std::size_t>(std::countr_zero(t));
        const PictureRange range(rows_, view_.ranges, k);
        const auto row = static_cast<std::int32_t>(line % rows_.rows),
                   column = static_cast<std::int32_t>(line / rows_.rows * SampleRows::kWord + bit);
        if (row < range.first_row || row > range.last_row || column < range.first_column || column > range.last_column)
          continue;
        ++counters_.exact_fallbacks;
        const auto& corner = scene_.tree->blockers[leaf.first + k].corner;
        is_blocked = blocks(corner[0], corner[1], corner[2], Position(lane), scene_.samples->points[first + bit]);
      }
      blocked[lane] |= std::uint32_t{is_blocked} << bit;
    }
  }
}

/// A patch into all pictures but those of `not_patched`, which need its triangles one by one.
bool PacketSolver::RasterizePatch(const BlockerTree::Leaf& leaf, std::uint32_t patch, std::uint64_t projected,
                                  LaneMask& not_patched) {
  const Tag d;
  const UintTag du;
  const LaneMask patched = hn::And(hn::FirstN(d, packet_.count), SetOutline(leaf, projected));
  not_patched = hn::AndNot(patched, hn::FirstN(d, packet_.count));
  LineSet lines;
  for (std::uint32_t rest = patch & view_.kept; rest != 0; rest &= rest - 1) {
    PictureRange(rows_, view_.ranges, static_cast<std::size_t>(std::countr_zero(rest)))
        .for_open_lines(rows_, packet_, [&](std::uint32_t line) {
          lines.add(line);
          return false;
        });
  }
  ++counters_.pairs_sampled;
  const UintVec wanted = hn::VecFromMask(du, hn::RebindMask(du, patched));
  bool added = false;
  lines.for_each([&](std::uint32_t line) HWY_ATTR {
    const UintVec open = hn::Load(du, packet_.open[line]), asked = hn::And(open, wanted);
    UintVec doubtful;
    ++counters_.sample_tests;
    UintVec blocked = hn::And(WindLine(line, doubtful), asked);
    doubtful = hn::And(doubtful, asked);
    if (!hn::AllTrue(du, hn::Eq(doubtful, hn::Zero(du)))) {
      alignas(HWY_MAX_BYTES) std::uint32_t in_doubt[kMaxLanes], does[kMaxLanes];
      hn::Store(doubtful, du, in_doubt), hn::Store(hn::AndNot(doubtful, blocked), du, does);
      SettlePatch(leaf, patch, line, in_doubt, does);
      blocked = hn::Load(du, does);
    }
    if (hn::AllTrue(du, hn::Eq(blocked, hn::Zero(du)))) return;
    hn::Store(hn::AndNot(blocked, open), du, packet_.open[line]);
    changed_lines_.add(line);
    added = true;
  });
  counters_.pairs_necessary += added;
  return added;
}

/// The planes through receivers and edges, and the triangle's own where it cuts the light.
HWY_INLINE void PacketSolver::SetPlanes(const BlockerTree::Leaf& leaf, std::size_t lane,
                                        PacketTriangle& triangle) const {
  const Tag d;
  const Vec3 axis_x = Splat(rows_.axis_x), axis_y = Splat(rows_.axis_y);
  for (std::size_t k = 0; k < 3; ++k) {
    const std::size_t next = (k + 1) % 3;
    const vec3 edge = triangle.corner[next] - triangle.corner[k];
    const float edge_norm = std::fabs(edge.x) + std::fabs(edge.y) + std::fabs(edge.z);
    const Vec3 to_corner = Subtract(Splat(triangle.corner[k]), packet_.position);
    const Vec3 m = Cross(to_corner, Splat(edge));
    const Vec error = hn::Mul(hn::Mul(hn::Set(d, kDeterminantError * edge_norm), Norm1(to_corner)), packet_.distance);
    triangle.planes[k] = SolveForX(rows_, Dot(m, axis_x), Dot(m, axis_y), Dot(m, packet_.to_center), error);
  }
  triangle.count = 3;
  if (((leaf.samples_above & leaf.samples_below) >> lane & 1) == 0) return;
  const Blocker& b = *triangle.blocker;
  const float error = b.plane_error + b.side_error * (rows_.deviation / kDeterminantError);
  triangle.planes[3] =
      SolveForX(rows_, hn::Set(d, glm::dot(b.normal, rows_.axis_x)), hn::Set(d, glm::dot(b.normal, rows_.axis_y)),
                hn::Set(d, b.plane_at_center), hn::Set(d, error));
  triangle.count = 4;
}

/// Half planes turned to where the receiver sees the triangle from.
HWY_INLINE std::array<LaneMask, 4> PacketSolver::Orient(const PacketTriangle& triangle, LaneMask below) const {
  std::array<LaneMask, 4> up;
  for (std::size_t k = 0; k < 4; ++k) up[k] = hn::Xor(triangle.planes[k < triangle.count ? k : 0].up, below);
  return up;
}

/// The lanes whose receiver lies above the plane, along the normal ("the plane is below it"). Takes those for which the
/// triangle hides nothing out of `active`.
HWY_INLINE LaneMask PacketSolver::FindBelow(const PacketTriangle& triangle, LaneMask& active, const LineSet& lines) {
  const Tag d;
  const Blocker& b = *triangle.blocker;
  const Vec3 to_corner = Subtract(Splat(triangle.corner[0]), packet_.position);
  const Vec side = Dot(Splat(b.normal), to_corner), error = hn::Mul(hn::Set(d, b.side_error), Norm1(to_corner));
  LaneMask below = hn::Lt(side, hn::Neg(error));
  const LaneMask none = hn::Lt(hn::Set(d, 0.0f), hn::Zero(d));
  LaneMask wanted = hn::Or(b.samples_above ? hn::Gt(side, error) : none, b.samples_below ? below : none);
  const LaneMask unknown = hn::And(active, hn::Le(hn::Abs(side), error));
  if (!hn::AllFalse(d, unknown)) {
    // Only the exact predicate can tell; it is asked for receivers that would lose something one way or the other.
    LaneMask matters = none;
    for (const LaneMask turned : {none, hn::Not(none)}) {
      const std::array<LaneMask, 4> up = Orient(triangle, turned);
      const Outline outline(triangle, up, Bits(unknown));
      lines.for_each([&](std::uint32_t line) HWY_ATTR {
        const UintTag du;
        const PictureLines& l = *packet_.lines;
        const UintVec possible =
            hn::And(outline.possible(hn::Load(d, l.y[line]), hn::Load(d, l.offset[line]), hn::Load(d, l.rest[line])),
                    hn::Load(du, packet_.open[line]));
        matters = hn::Or(matters, hn::RebindMask(d, hn::Ne(possible, hn::Zero(du))));
      });
    }
    for (std::uint64_t rest = Bits(hn::And(unknown, matters)); rest != 0; rest &= rest - 1) {
      const auto lane = static_cast<std::size_t>(std::countr_zero(rest));
      ++counters_.exact_fallbacks;
      const int sign = orient3d(triangle.corner[0], triangle.corner[1], triangle.corner[2], Position(lane));
      if (sign == 0 || !(sign < 0 ? b.samples_below : b.samples_above)) continue;
      const LaneMask this_lane = LanesFromBits(1u << lane, 0);
      wanted = hn::Or(wanted, this_lane);
      if (sign < 0) below = hn::Or(below, this_lane);
    }
  }
  active = hn::And(active, wanted);
  return below;
}

/// Doubtful and perforated samples of a line; `possible` and `inside` are per receiver.
void PacketSolver::Settle(const PacketTriangle& triangle, std::uint32_t line, const std::uint32_t* possible,
                          std::uint32_t* inside) {
  const auto& [a, b, c] = triangle.corner;
  for (std::size_t lane = 0; lane < packet_.count; ++lane) {
    if (possible[lane] == 0) continue;
    const std::size_t first =
        std::size_t{receivers_.set[packet_.first + lane]} * scene_.samples->padded + rows_.first_sample(line);
    for (std::uint32_t doubtful = possible[lane] & ~inside[lane]; doubtful != 0; doubtful &= doubtful - 1) {
      const auto bit = static_cast<std::size_t>(std::countr_zero(doubtful));
      ++counters_.exact_fallbacks;
      inside[lane] |= std::uint32_t{blocks(a, b, c, Position(lane), scene_.samples->points[first + bit])} << bit;
    }
    if (!triangle.perforated || inside[lane] == 0) continue;
    const AlphaTriangle& alpha = *triangle.blocker->alpha;
    if (!texels_[lane]) texels_[lane].emplace(alpha, Position(lane));
    inside[lane] = OpaqueSamples(alpha, *texels_[lane], Position(lane), &rows_.point_x[first], &rows_.point_y[first],
                                 &rows_.point_z[first], inside[lane], counters_.exact_fallbacks);
  }
}

HWY_INLINE bool PacketSolver::Rasterize(const PacketTriangle& triangle, const LineSet& lines, LaneMask below,
                                        LaneMask active) {
  const Tag d;
  const UintTag du;
  const std::array<LaneMask, 4> up = Orient(triangle, below);
  const Outline outline(triangle, up, Bits(active));
  const auto wanted = hn::VecFromMask(du, hn::RebindMask(du, active));
  bool added = false;
  lines.for_each([&](std::uint32_t line) HWY_ATTR {
    const PictureLines& l = *packet_.lines;
    const Vec y = hn::Load(d, l.y[line]), offset = hn::Load(d, l.offset[line]), rest = hn::Load(d, l.rest[line]);
    const UintVec open = hn::Load(du, packet_.open[line]), asked = hn::And(open, wanted);
    const UintVec possible = hn::And(asked, outline.possible(y, offset, rest));
    ++counters_.sample_tests;
    if (hn::AllTrue(du, hn::Eq(possible, hn::Zero(du)))) return;
    UintVec inside = hn::And(asked, outline.inside(y, offset, rest));
    if (triangle.perforated || !hn::AllTrue(du, hn::Eq(possible, inside))) {
      alignas(HWY_MAX_BYTES) std::uint32_t may[kMaxLanes], does[kMaxLanes];
      hn::Store(possible, du, may), hn::Store(inside, du, does);
      Settle(triangle, line, may, does);
      inside = hn::Load(du, does);
      if (hn::AllTrue(du, hn::Eq(inside, hn::Zero(du)))) return;
    }
    hn::Store(hn::AndNot(inside, open), du, packet_.open[line]);
    changed_lines_.add(line);
    added = true;
  });
  return added;
}

/// One triangle into the pictures of the receivers in `active`; true where samples were blocked.
bool PacketSolver::RasterizeTriangle(const BlockerTree::Leaf& leaf, std::size_t lane, LaneMask active) {
  const Tag d;
  const UintTag du;
  const PictureRange range(rows_, view_.ranges, lane);
  active = hn::And(active, hn::RebindMask(d, hn::Ne(packet_.own, hn::Set(du, leaf.triangle[lane]))));
  LineSet lines;
  if ((view_.bounded >> lane) & 1) {
    const std::array<std::uint8_t, 3> corner = {leaf.corner_vertex[0][lane], leaf.corner_vertex[1][lane],
                                                leaf.corner_vertex[2][lane]};
    active =
        hn::And(active, ReceiversOverOpenSamples(rows_, corner, view_.pad[lane], vertices_, range, packet_, lines));
  } else {
    range.for_open_lines(rows_, packet_, [&](std::uint32_t line) {
      lines.add(line);
      return false;
    });
  }
  if (hn::AllFalse(d, active)) return false;
  PacketTriangle triangle;
  triangle.blocker = &scene_.tree->blockers[leaf.first + lane];
  triangle.perforated = (leaf.perforated >> lane) & 1;
  if (triangle.perforated) std::fill(std::begin(texels_), std::end(texels_), std::nullopt);
  for (std::size_t k = 0; k < 3; ++k) {
    triangle.corner[k] = {leaf.corner[k][0][lane], leaf.corner[k][1][lane], leaf.corner[k][2][lane]};
  }
  SetPlanes(leaf, lane, triangle);
  const bool above = (view_.above >> lane) & 1, below = (view_.below >> lane) & 1;
  const LaneMask none = hn::Lt(hn::Set(d, 0.0f), hn::Zero(d));
  LaneMask is_below = below ? hn::Not(none) : none;
  if (!above && !below) {
    is_below = FindBelow(triangle, active, lines);
    if (hn::AllFalse(d, active)) return false;
  }
  ++counters_.pairs_sampled;
  if (!Rasterize(triangle, lines, is_below, active)) return false;
  ++counters_.pairs_necessary;
  return true;
}

void PacketSolver::StoreMasks() {
  for (std::size_t lane = 0; lane < packet_.count; ++lane) {
    std::uint64_t* mask = receivers_.mask(packet_.first + lane);
    for (std::uint32_t line = 0; line < rows_.lines; ++line) {
      const std::uint64_t blocked = rows_.valid[line] & ~packet_.open[line][lane];
      if (blocked == 0) continue;
      const std::size_t first = rows_.first_sample(line), shift = first % 64;
      mask[first / 64] |= blocked << shift;
      if (shift > 32 && blocked >> (64 - shift) != 0) mask[first / 64 + 1] |= blocked >> (64 - shift);
    }
  }
}

void SolvePackets(const ExactScene& scene, std::size_t begin, std::size_t end, KernelReceivers& receivers,
                  ExactScratch& scratch) {
  if (!ListLeaves(scene, begin, end, receivers, scratch)) return;
  const std::size_t lanes = hn::Lanes(Tag());
  PacketSolver solver(scene, receivers, scratch);
  for (std::size_t i = begin; i < end; i += lanes) solver.Solve(i, std::min(lanes, end - i));
}

}  // namespace HWY_NAMESPACE
}  // namespace halfshade
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace halfshade {

void PictureLines::place(const SampleRows& rows, const std::uint8_t* set, std::size_t count) {
  const bool alike = std::all_of(set, set + count, [&](std::uint8_t s) { return s == set[0]; });
  if (alike && placed == set[0]) return;
  for (std::uint32_t line = 0; line < rows.lines; ++line) {
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const std::size_t at = std::size_t{set[std::min(lane, count - 1)]} * rows.lines + line;
      y[line][lane] = rows.y[at], offset[line][lane] = rows.offset[at] + 0.5f,
      rest[line][lane] = 31.5f - rows.offset[at];
    }
  }
  placed = alike ? set[0] : kMixed;
}

HWY_EXPORT(SolvePackets);

void solve_packets(const ExactScene& scene, std::size_t begin, std::size_t end, KernelReceivers& receivers,
                   ExactScratch& scratch) {
  HWY_DYNAMIC_DISPATCH(SolvePackets)(scene, begin, end, receivers, scratch);
}

}  // namespace halfshade
#endif
