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

/// Receivers as boxes.
struct ReceiverBox {
  vec3 low{1e30f}, high{-1e30f};  // lattice
  Shaft shaft{{1e30f, 1e30f, 1e30f}, {-1e30f, -1e30f, -1e30f}, {}};  // the light's frame, and what of the light is asked

  void add(const LightFrame& frame, const vec3& r) {
    const vec3 p(frame.to_frame(dvec3(r)));
    low = glm::min(low, r), high = glm::max(high, r);
    for (int k = 0; k < 3; ++k) shaft.low[k] = std::min(shaft.low[k], p[k]), shaft.high[k] = std::max(shaft.high[k], p[k]);
  }
};

/// Receivers [first, first + count), a lane each; lanes beyond repeat the last one and have nothing open.
struct Packet : ReceiverBox {
  std::size_t first = 0, count = 0;
  Vec3 position, to_center;       // lattice; from there to the light's centre
  Vec distance;                   // bound on |coordinate| of receiver to sample
  Vec height_error, place_error;  // 5 |r - c| / height + 10; 5 |r - c|: see ProjectVertices
  Vec column, row, height;        // of the receivers over the picture, in columns and rows from its centre; in lengths
  UintVec own;                    // own triangle
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

/// Boxes from `i` on; lane i of the ranges is the first.
HWY_INLINE std::uint64_t BoxesOverOpenSamples(const SampleRows& rows, const float* const low[3],
                                              const float* const high[3], std::size_t i, const Packet& packet,
                                              std::size_t first_range, PictureRanges& ranges) {
  LaneRectangles q;
  const std::uint64_t between = Bits(ProjectBoxes(packet.shaft, low, high, i, q));
  const Vec pad = hn::Set(Tag(), ProjectionPad(packet.shaft.low[2]) + rows.deviation);
  for (int k = 0; k < 2; ++k) q.low[k] = hn::Sub(q.low[k], pad), q.high[k] = hn::Add(q.high[k], pad);
  if (between == 0) return 0;
  FindRanges(rows, q, first_range, ranges);
  return LanesOverOpenSamples(rows, q, between, packet, first_range, ranges);
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

/// On which side of the planes a box of receivers lies, and so whether they separate it from samples. Fills above, below
/// and active.
template <class View>
HWY_INLINE void FindSides(const BlockerTree::Leaf& leaf, std::size_t i, const vec3& low, const vec3& high,
                          const vec3& half, const Vec3& to_corner, View& view) {
  const Tag d;
  const Vec3 normal{hn::LoadU(d, leaf.normal[0] + i), hn::LoadU(d, leaf.normal[1] + i),
                    hn::LoadU(d, leaf.normal[2] + i)};
  const Vec side = Dot(normal, to_corner);
  const Vec reach = Dot({hn::Abs(normal.x), hn::Abs(normal.y), hn::Abs(normal.z)}, Splat(half));
  const Vec far = hn::Add(Norm1(to_corner), hn::Set(d, half.x + half.y + half.z));
  const Vec error = hn::MulAdd(hn::Mul(hn::LoadU(d, leaf.side_error + i), far), hn::Set(d, 2.0f), reach);
  const auto above = static_cast<std::uint32_t>(Bits(hn::Gt(side, error))),
             below = static_cast<std::uint32_t>(Bits(hn::Lt(side, hn::Neg(error))));
  const bool outside_box = low.x > leaf.box_high.x || low.y > leaf.box_high.y || low.z > leaf.box_high.z ||
                           high.x < leaf.box_low.x || high.y < leaf.box_low.y || high.z < leaf.box_low.z;
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
  Vec least = hn::Set(d, 1e30f), lowest = least, farthest = hn::Zero(d);
  Vec nearest[2] = {least, least}, last[2] = {hn::Neg(least), hn::Neg(least)};  // of (v - r)
  Vec place_low[2] = {least, least}, place_high[2] = {hn::Neg(least), hn::Neg(least)};
  for (int axis = 0; axis < 2; ++axis) q.low[axis] = least, q.high[axis] = hn::Neg(least);
  for (const Vec3& c : to_corner) {
    const Vec up = Dot(c, normal), z = hn::Add(up, hn::Set(d, middle[2]));
    const Vec near = hn::Sub(hn::Neg(up), hn::Set(d, half[2])), far = hn::Sub(hn::Set(d, half[2]), up);  // r_z - v_z
    least = hn::Min(least, near);
    lowest = hn::Min(lowest, z);
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
  // Triangles that reach the height of a receiver project without bounds, but only away from the receivers, and at least
  // as far as from their lowest height.
  farthest = hn::Add(farthest, hn::Set(d, half[0] + half[1] + half[2]));
  const LaneMask bounded = hn::Gt(least, hn::Mul(farthest, hn::Set(d, 1e-5f)));
  const Vec magnified = hn::Div(hn::Mul(farthest, hn::Set(d, 1e-6f * (box.high[2] + 4.0f))), least);
  pad = hn::Add(magnified, hn::Set(d, ProjectionPad(box.low[2])));
  const Vec everywhere = hn::Set(d, 1e9f), margin = hn::Set(d, 2e-5f), zero = hn::Zero(d);
  const Vec depth = hn::Add(hn::Max(hn::Sub(hn::Set(d, box.high[2]), lowest), zero), margin);
  const Vec away_by = hn::Div(hn::Mul(hn::Max(hn::Sub(lowest, margin), zero), hn::Set(d, 0.999f)), depth);
  for (int axis = 0; axis < 2; ++axis) {
    const Vec low =
        hn::IfThenElse(hn::Gt(nearest[axis], margin),
                       hn::MulAdd(hn::Sub(nearest[axis], margin), away_by, hn::Sub(place_low[axis], margin)),
                       hn::Neg(everywhere));
    const Vec high =
        hn::IfThenElse(hn::Lt(last[axis], hn::Neg(margin)),
                       hn::MulAdd(hn::Add(last[axis], margin), away_by, hn::Add(place_high[axis], margin)), everywhere);
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
  FindSides(leaf, i, packet.low, packet.high, half, to_corner[0], view);
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

/// Vertices as each receiver sees them before the light, in columns and rows; `error` bounds how far they may lie off, in
/// lengths along either axis.
struct ProjectedVertices {
  static constexpr std::size_t kMost = 255;
  alignas(HWY_MAX_BYTES) float column[kMost][kMaxLanes], row[kMost][kMaxLanes], error[kMost][kMaxLanes];
};

/// Projects vertices, which must lie between the receivers and the light.
class VertexProjection {
 public:
  VertexProjection(const ExactScene& scene, const Packet& packet)
      : packet_(packet),
        axis_x_(Splat(scene.rows->axis_x * scene.rows->scale)),
        axis_y_(Splat(scene.rows->axis_y * scene.rows->row_scale)),
        down_(Splat(vec3(-scene.frame.n))) {}

  HWY_INLINE void Project(const vec3& vertex, std::size_t slot, ProjectedVertices& projected) const {
    const Tag d;
    const Vec3 way = Subtract(Splat(vertex), packet_.position);
    const Vec inverse = hn::Div(hn::Set(d, 1.0f), Dot(way, down_)), scale = hn::Mul(packet_.height, inverse);
    hn::Store(hn::MulAdd(Dot(way, axis_x_), scale, packet_.column), d, projected.column[slot]);
    hn::Store(hn::MulAdd(Dot(way, axis_y_), scale, packet_.row), d, projected.row[slot]);
    // In units of 2^-24: a coordinate along an axis is within 5 |way|, the depth as well, the height within 5 |r - c|.
    const Vec length = Norm1(way);
    const Vec relative = hn::MulAdd(hn::Mul(hn::Set(d, 5.0f), length), inverse, packet_.height_error);
    hn::Store(hn::Mul(hn::Set(d, 0x1.1p-24f), hn::MulAdd(hn::Mul(length, scale), relative, packet_.place_error)), d,
              projected.error[slot]);
  }

 private:
  const Packet& packet_;
  Vec3 axis_x_, axis_y_, down_;
};

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
  static constexpr std::uint32_t kMost = 255;  // and so nothing is wound around more often than 8 bits can say
  static constexpr float kMostError = 0.02f;  // columns or rows that vertices may lie off
  std::uint32_t count = 0, fixed = 0;         // the first `fixed` are edges from `from` to `to` for all receivers
  std::uint8_t from[kMost], to[kMost];        // vertices
  std::uint16_t positive[kMost], negative[kMost];  // receivers for which others are, and for which they run against that
  std::uint8_t first_row[kMost], last_row[kMost];  // the edge crosses no others
  alignas(HWY_MAX_BYTES) float slope[kMost][kMaxLanes], width[kMost][kMaxLanes];  // columns a row; uncertainty
  std::uint64_t on_row[SampleRows::kMaxRows][kMost / 64 + 1];  // edges that may cross the row
  std::uint64_t left_on_row[SampleRows::kMaxRows][kMost / 64 + 1];  // the same, of edges to the left of all that is open
  bool left[kMost];
  bool near_row[kMost];         // an end of the edge lies on a row for some receiver, so far as can be told
};

/// Triangles of one leaf of a group, as bits, as seen by a box of receivers.
struct LeafSides {
  std::uint32_t above = 0, below = 0, active = 0;  // as in LeafView
  std::uint32_t plain = 0;                         // projects onto the light's plane, and well
};

HWY_INLINE void FindSidesOfLeaf(const ExactScene& scene, const BlockerTree::Leaf& leaf, const ReceiverBox& box,
                                LeafSides& sides) {
  const Tag d;
  const vec3 middle = 0.5f * (box.low + box.high);
  const vec3 half = glm::max(box.high - middle, middle - box.low) * (1.0f + 0x1p-20f);
  const auto middle_z = static_cast<float>(scene.frame.to_frame(dvec3(middle)).z);
  const float half_z = std::max(box.shaft.high[2] - middle_z, middle_z - box.shaft.low[2]) + 1e-6f;
  const float most = PatchOutline::kMostError / std::max(scene.rows->scale, scene.rows->row_scale);
  const Vec3 normal = Splat(vec3(scene.frame.n));
  for (std::size_t i = 0; i < leaf.count; i += hn::Lanes(d)) {
    std::array<Vec3, 3> to_corner;
    for (std::size_t k = 0; k < 3; ++k) {
      to_corner[k] = Subtract({hn::LoadU(d, leaf.corner[k][0] + i), hn::LoadU(d, leaf.corner[k][1] + i),
                               hn::LoadU(d, leaf.corner[k][2] + i)},
                              Splat(middle));
    }
    FindSides(leaf, i, box.low, box.high, half, to_corner[0], sides);
    Vec least = hn::Set(d, 1e30f), lowest = least, farthest = hn::Zero(d);
    for (const Vec3& c : to_corner) {
      const Vec up = Dot(c, normal);
      least = hn::Min(least, hn::Neg(hn::Add(up, hn::Set(d, half_z))));
      lowest = hn::Min(lowest, hn::Add(up, hn::Set(d, middle_z)));
      farthest = hn::Max(farthest, Norm1(c));
    }
    farthest = hn::Add(farthest, hn::Set(d, half.x + half.y + half.z));
    // As in ProjectOntoLight: bounded, and with a pad of at most `most`; and in front of the light's plane.
    const LaneMask bounded = hn::Gt(least, hn::Mul(farthest, hn::Set(d, 1e-5f)));
    const Vec magnified = hn::Mul(farthest, hn::Set(d, 1e-6f * (box.shaft.high[2] + 4.0f)));
    const LaneMask good =
        hn::Le(magnified, hn::Mul(least, hn::Set(d, most - ProjectionPad(box.shaft.low[2]))));
    const LaneMask before_light = hn::Gt(lowest, hn::Set(d, 1e-4f + scene.rectangles->thickness));
    sides.plain |= static_cast<std::uint32_t>(Bits(hn::And(hn::And(bounded, good), before_light))) << i;
  }
}

/// What the receivers of a cluster have in common about a group. Its patch are the triangles that lie whole between the
/// receivers and the light, are opaque and nobody's own. A sample is blocked by one of them where their outlines, turned
/// alike, wind around it, and edges between two of them cancel. What is left are the net edges: fixed ones, the same for
/// all receivers, and those of triangles that some receivers may see from above and others from below.
HWY_INLINE void ViewGroup(const ExactScene& scene, const BlockerTree::Node& group, const ReceiverBox& box,
                          ExactScratch& scratch, GroupView& view) {
  constexpr std::uint16_t kAll = 0xffff;
  const BlockerTree& tree = *scene.tree;
  const std::uint32_t first_leaf = group.child[0] & ~BlockerTree::kLeafBit;
  const auto own_begin = std::lower_bound(scratch.own_places.begin(), scratch.own_places.end(),
                                          first_leaf * BlockerTree::kWidth),
             own_end = std::lower_bound(own_begin, scratch.own_places.end(),
                                        (first_leaf + group.count) * BlockerTree::kWidth);
  std::uint8_t turns[BlockerTree::kGroupSlots + 1];
  std::uint16_t positive[BlockerTree::kGroupSlots + 1], negative[BlockerTree::kGroupSlots + 1];
  for (std::uint32_t k = 0; k < group.count; ++k) {
    const BlockerTree::Leaf& leaf = tree.leaves[first_leaf + k];
    LeafSides sides;
    FindSidesOfLeaf(scene, leaf, box, sides);
    std::uint32_t plain = sides.active & sides.plain & ~leaf.perforated;
    for (auto own = own_begin; own != own_end; ++own) {
      if (*own / BlockerTree::kWidth == first_leaf + k) plain &= ~(1u << *own % BlockerTree::kWidth);
    }
    const std::uint32_t known = plain & (sides.above | sides.below);
    view.patch[k] = static_cast<std::uint16_t>(known);
    view.turns[k] = static_cast<std::uint16_t>(plain & ~known);
    view.single[k] = static_cast<std::uint16_t>(sides.active & ~plain);
    for (std::uint32_t lane = 0; lane < BlockerTree::kWidth; ++lane) {
      const std::size_t at = BlockerTree::kWidth * k + lane;
      positive[at] = (known & sides.above) >> lane & 1 ? kAll : 0;
      negative[at] = (known & sides.below) >> lane & 1 ? kAll : 0;
      turns[at] = view.turns[k] >> lane & 1;
    }
  }
  positive[BlockerTree::kGroupSlots] = negative[BlockerTree::kGroupSlots] = 0;
  turns[BlockerTree::kGroupSlots] = 0;
  NetEdges& net = scratch.net_edges;
  view.first = static_cast<std::uint32_t>(net.count);
  net.reserve(net.count + 2 * group.edges + kMaxLanes);
  const vec3* const vertices = tree.vertices.data() + group.first_vertex;
  const auto add = [&](const BlockerTree::Edge& edge, std::uint16_t a, std::uint16_t b) {
    const std::size_t at = net.count++;
    net.vertex[0][at] = a, net.vertex[1][at] = b;
    net.triangle[0][at] = edge.left, net.triangle[1][at] = edge.right;
    for (int axis = 0; axis < 3; ++axis)
      net.end[0][axis][at] = vertices[a][axis], net.end[1][axis][at] = vertices[b][axis];
  };
  const std::span edges(tree.edges.data() + group.first_edge, group.edges);
  const auto facing = [&](std::uint16_t t) { return (positive[t] & 1) - (negative[t] & 1); };
  for (const BlockerTree::Edge& edge : edges) {
    if (turns[edge.left] | turns[edge.right]) continue;
    for (int c = facing(edge.left) - facing(edge.right); c != 0; c += c > 0 ? -1 : 1)
      c > 0 ? add(edge, edge.from, edge.to) : add(edge, edge.to, edge.from);
  }
  view.fixed = static_cast<std::uint32_t>(net.count) - view.first;
  for (const BlockerTree::Edge& edge : edges) {
    if (turns[edge.left] | turns[edge.right]) add(edge, edge.from, edge.to);
  }
  view.turning = static_cast<std::uint32_t>(net.count) - view.first - view.fixed;
  view.known = true;
  if (view.turning == 0) return;
  view.facing = static_cast<std::uint32_t>(scratch.facing.size());
  scratch.facing.insert(scratch.facing.end(), std::begin(positive), std::end(positive));
  scratch.facing.insert(scratch.facing.end(), std::begin(negative), std::end(negative));
}

/// A packet at work on its receivers.
class PacketSolver {
 public:
  PacketSolver(const ExactScene& scene, const ReceiverBox& cluster, KernelReceivers& receivers, ExactScratch& scratch)
      : scene_(scene),
        rows_(*scene.rows),
        cluster_(cluster),
        receivers_(receivers),
        scratch_(scratch),
        counters_(scratch.counters) {}

  HWY_INLINE void Solve(std::size_t first, std::size_t count) {
    if (!Begin(first, count)) return;
    const std::size_t lanes = hn::Lanes(Tag());
    const float* const low[3] = {scratch_.low[0].data(), scratch_.low[1].data(), scratch_.low[2].data()};
    const float* const high[3] = {scratch_.high[0].data(), scratch_.high[1].data(), scratch_.high[2].data()};
    bool any = false;
    PictureRanges ranges;
    for (std::size_t i = 0; i < scratch_.leaf.size(); i += lanes) {
      for (std::uint64_t bits = BoxesOverOpenSamples(rows_, low, high, i, packet_, 0, ranges); bits != 0;
           bits &= bits - 1) {
        const std::size_t at = i + static_cast<std::size_t>(std::countr_zero(bits));
        if (!RasterizeGroup(scene_.tree->nodes[scratch_.leaf[at]], scratch_.groups[at])) continue;
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
  bool RasterizeGroup(const BlockerTree::Node& group, GroupView& view);
  bool RasterizePatch(const BlockerTree::Node& group, const GroupView& view, const std::uint16_t* patch,
                      std::uint32_t leaves, bool& added);
  void FindTurns(const BlockerTree::Node& group, GroupView& view, std::uint32_t leaves, std::uint16_t* certain);
  bool CollectEdges(const BlockerTree::Node& group, const GroupView& view, std::uint32_t first, std::uint32_t end,
                    bool turning);
  HWY_INLINE void SetOutline();
  HWY_INLINE UintVec SamplesNearEnds(std::size_t e, Vec y, Vec offset, Vec rest) const;
  /// How the edge crosses a row, by receiver.
  HWY_INLINE void Turn(std::size_t e, LaneMask& down, LaneMask& up) const {
    const LaneMask positive = LanesFromBits(outline_.positive[e], 0), negative = LanesFromBits(outline_.negative[e], 0);
    const LaneMask turned_down = hn::Or(hn::And(down, positive), hn::And(up, negative));
    up = hn::Or(hn::And(up, positive), hn::And(down, negative)), down = turned_down;
  }
  HWY_INLINE hn::Vec<IntTag> WindLeft(std::uint32_t line) const;
  HWY_INLINE UintVec WindLine(std::uint32_t line, UintVec& doubtful) const;
  template <int kBits>
  HWY_INLINE UintVec WindAround(std::uint32_t line, hn::Vec<IntTag> around, UintVec& doubtful) const;
  void SettlePatch(const BlockerTree::Node& group, const std::uint16_t* patch, std::uint32_t leaves, std::uint32_t line,
                   const std::uint32_t* doubtful, std::uint32_t* blocked);
  const LeafView& ViewLeaf(const BlockerTree::Node& group, std::uint32_t k);
  bool RasterizeLeaf(const BlockerTree::Leaf& leaf, const LeafView& view, std::uint32_t wanted);
  bool RasterizeTriangle(const BlockerTree::Leaf& leaf, const LeafView& view, std::size_t lane);
  void StoreMasks();

  HWY_INLINE void SetPlanes(const BlockerTree::Leaf& leaf, std::size_t lane, PacketTriangle& triangle) const;
  HWY_INLINE LaneMask FindBelow(const PacketTriangle& triangle, LaneMask& active, const LineSet& lines);
  HWY_INLINE bool Rasterize(const PacketTriangle& triangle, const LineSet& lines, LaneMask below, LaneMask active);
  HWY_INLINE std::array<LaneMask, 4> Orient(const PacketTriangle& triangle, LaneMask below) const;
  void Settle(const PacketTriangle& triangle, std::uint32_t line, const std::uint32_t* possible, std::uint32_t* inside);

  /// How far a row may lie off its place, in rows.
  float RowSpread() const {
    return rows_.most_row_offset - rows_.least_row_offset + rows_.deviation * rows_.row_scale + 1e-5f;
  }
  vec3 Position(std::size_t lane) const {
    const std::size_t i = packet_.first + lane;
    return {receivers_.x[i], receivers_.y[i], receivers_.z[i]};
  }

  const ExactScene& scene_;
  const SampleRows& rows_;
  const ReceiverBox& cluster_;
  KernelReceivers& receivers_;
  ExactScratch& scratch_;
  KernelCounters& counters_;
  Packet packet_;
  LineSet changed_lines_;
  PictureRanges leaf_ranges_;                     // of the group at work
  LeafView views_[BlockerTree::kWidth];           // of its leaves
  std::uint32_t viewed_ = 0;                      // those that are there
  PatchOutline outline_;                          // of the patch at work
  ProjectedVertices vertices_;                    // of the patch or leaf at work
  std::uint32_t projected_in_[3 * BlockerTree::kGroupSlots] = {};  // [vertex of a group] call that projected it,
  std::uint8_t slot_of_[3 * BlockerTree::kGroupSlots];             // and where to
  std::uint32_t calls_ = 0, slots_ = 0;
  std::uint32_t in_packet_ = 0;  // its lanes, as bits
  std::optional<TexelLookup> texels_[kMaxLanes];  // of the perforated triangle at work, made when first needed
};

/// Positions, boxes and pictures; all samples are open.
bool PacketSolver::Begin(std::size_t first, std::size_t count) {
  const Tag d;
  const UintTag du;
  packet_.first = first, packet_.count = count;
  in_packet_ = (1u << count) - 1;
  static_cast<ReceiverBox&>(packet_) = ReceiverBox();
  for (std::size_t i = 0; i < count; ++i) packet_.add(scene_.frame, Position(i));
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

/// Up to 16 leaves; true where samples were blocked.
bool PacketSolver::RasterizeGroup(const BlockerTree::Node& group, GroupView& view) {
  const float* const low[3] = {group.low[0], group.low[1], group.low[2]};
  const float* const high[3] = {group.high[0], group.high[1], group.high[2]};
  std::uint32_t leaves = 0;
  for (std::size_t i = 0; i < group.count; i += hn::Lanes(Tag())) {
    leaves |= static_cast<std::uint32_t>(BoxesOverOpenSamples(rows_, low, high, i, packet_, i, leaf_ranges_)) << i;
  }
  leaves &= (1u << group.count) - 1;
  if (leaves == 0) return false;
  if (!view.known) ViewGroup(scene_, group, cluster_, scratch_, view);
  scratch_.leaves_tested += static_cast<std::uint64_t>(std::popcount(leaves));
  viewed_ = 0;
  bool added = false;
  std::uint16_t patch[BlockerTree::kWidth];
  FindTurns(group, view, leaves, patch);
  int in_patch = 0;
  for (std::uint32_t rest = leaves; rest != 0; rest &= rest - 1) in_patch += std::popcount(patch[std::countr_zero(rest)]);
  const bool patched =
      !rows_.place.empty() && in_patch >= 3 && RasterizePatch(group, view, patch, leaves, added);
  for (std::uint32_t rest = leaves; rest != 0; rest &= rest - 1) {
    const auto k = static_cast<std::uint32_t>(std::countr_zero(rest));
    std::uint32_t wanted = view.patch[k] | view.turns[k] | view.single[k];
    if (patched) wanted &= ~patch[k];
    if (wanted == 0) continue;
    const BlockerTree::Leaf& leaf = scene_.tree->leaves[(group.child[0] & ~BlockerTree::kLeafBit) + k];
    counters_.pairs_tested += leaf.count * packet_.count;
    added |= RasterizeLeaf(leaf, ViewLeaf(group, k), wanted);
  }
  return added;
}

/// From which side each receiver sees the triangles that turn. Those of `leaves` for which that is certain for everyone
/// join the patch, which is returned.
void PacketSolver::FindTurns(const BlockerTree::Node& group, GroupView& view, std::uint32_t leaves,
                             std::uint16_t* patch) {
  const Tag d;
  const LaneMask everyone = hn::FirstN(d, packet_.count);
  std::copy_n(view.patch, BlockerTree::kWidth, patch);
  if (view.turning == 0) return;
  std::uint16_t* const positive = scratch_.facing.data() + view.facing;
  std::uint16_t* const negative = positive + BlockerTree::kGroupSlots + 1;
  for (std::uint32_t k = 0; k < group.count; ++k) {
    if (view.turns[k] == 0) continue;
    const bool is_listed = (leaves >> k & 1) != 0;
    const BlockerTree::Leaf& leaf = scene_.tree->leaves[(group.child[0] & ~BlockerTree::kLeafBit) + k];
    const bool outside_box =
        cluster_.low.x > leaf.box_high.x || cluster_.low.y > leaf.box_high.y || cluster_.low.z > leaf.box_high.z ||
        cluster_.high.x < leaf.box_low.x || cluster_.high.y < leaf.box_low.y || cluster_.high.z < leaf.box_low.z;
    const std::uint32_t samples_below = leaf.samples_below & ~(outside_box ? leaf.back_faces_only : 0u);
    for (std::uint32_t rest = view.turns[k]; rest != 0; rest &= rest - 1) {
      const auto lane = static_cast<std::size_t>(std::countr_zero(rest));
      const std::size_t at = BlockerTree::kWidth * k + lane;
      positive[at] = negative[at] = 0;
      if (!is_listed) continue;
      const Vec3 to_corner = Subtract(Splat({leaf.corner[0][0][lane], leaf.corner[0][1][lane], leaf.corner[0][2][lane]}),
                                      packet_.position);
      const Vec side = Dot(Splat({leaf.normal[0][lane], leaf.normal[1][lane], leaf.normal[2][lane]}), to_corner),
                error = hn::Mul(hn::Set(d, leaf.side_error[lane]), Norm1(to_corner));
      if (!hn::AllFalse(d, hn::And(everyone, hn::Le(hn::Abs(side), error)))) continue;
      patch[k] |= static_cast<std::uint16_t>(1u << lane);
      const auto above = static_cast<std::uint16_t>(Bits(hn::Gt(side, hn::Zero(d))));
      if (leaf.samples_above >> lane & 1) positive[at] = above;
      if (samples_below >> lane & 1) negative[at] = static_cast<std::uint16_t>(~above);
    }
  }
}

/// Leaf `k` of the group, looked at once.
const LeafView& PacketSolver::ViewLeaf(const BlockerTree::Node& group, std::uint32_t k) {
  LeafView& view = views_[k];
  if ((viewed_ >> k & 1) != 0) return view;
  viewed_ |= 1u << k;
  const BlockerTree::Leaf& leaf = scene_.tree->leaves[(group.child[0] & ~BlockerTree::kLeafBit) + k];
  view.above = view.below = view.bounded = view.active = view.kept = 0;
  for (std::size_t i = 0; i < leaf.count; i += hn::Lanes(Tag())) ViewTriangles(scene_, leaf, i, packet_, view);
  return view;
}

/// The triangles of `wanted`, one by one; true where samples were blocked.
bool PacketSolver::RasterizeLeaf(const BlockerTree::Leaf& leaf, const LeafView& view, std::uint32_t wanted) {
  const std::uint32_t kept = view.kept & wanted;
  if (kept == 0) return false;
  std::uint64_t vertices = 0;
  for (std::uint32_t rest = kept & view.bounded; rest != 0; rest &= rest - 1) {
    const auto lane = static_cast<std::size_t>(std::countr_zero(rest));
    for (const auto& vertex : leaf.corner_vertex) vertices |= std::uint64_t{1} << vertex[lane];
  }
  const VertexProjection projection(scene_, packet_);
  for (; vertices != 0; vertices &= vertices - 1) {
    const auto v = static_cast<std::size_t>(std::countr_zero(vertices));
    projection.Project({leaf.vertex[0][v], leaf.vertex[1][v], leaf.vertex[2][v]}, v, vertices_);
  }
  bool added = false;
  for (std::uint32_t rest = kept; rest != 0; rest &= rest - 1)
    added |= RasterizeTriangle(leaf, view, static_cast<std::size_t>(std::countr_zero(rest)));
  return added;
}

/// Net edges that may matter for what is open: those that cross its rows and do not lie to the right of it. False where
/// they are too many.
bool PacketSolver::CollectEdges(const BlockerTree::Node& group, const GroupView& view, std::uint32_t first_edge,
                                std::uint32_t end, bool turning) {
  const Tag d;
  const hn::RebindToSigned<Tag> di;
  const LightFrame& frame = scene_.frame;
  const vec3 middle = 0.5f * (packet_.low + packet_.high);
  const vec3 in_frame(frame.to_frame(dvec3(middle)));
  float half[3];
  for (int k = 0; k < 3; ++k)
    half[k] = std::max(packet_.shaft.high[k] - in_frame[k], in_frame[k] - packet_.shaft.low[k]) + 1e-6f;
  const Vec3 axes[2] = {Splat(vec3(frame.u)), Splat(vec3(frame.v))}, normal = Splat(vec3(frame.n));
  const NetEdges& net = scratch_.net_edges;
  const VertexProjection projection(scene_, packet_);
  const std::uint16_t* const positive_of = scratch_.facing.data() + view.facing;
  const std::uint16_t* const negative_of = positive_of + BlockerTree::kGroupSlots + 1;
  const auto slot_of = [&](std::uint16_t v) {
    if (projected_in_[v] != calls_) {
      projected_in_[v] = calls_;
      slot_of_[v] = static_cast<std::uint8_t>(slots_);
      projection.Project(scene_.tree->vertices[group.first_vertex + v], slots_++, vertices_);
    }
    return slot_of_[v];
  };
  for (std::uint32_t e = first_edge; e < end; e += static_cast<std::uint32_t>(hn::Lanes(d))) {
    Vec low[2] = {hn::Set(d, 1e30f), hn::Set(d, 1e30f)}, high[2] = {hn::Set(d, -1e30f), hn::Set(d, -1e30f)};
    for (const auto& v : net.end) {
      const Vec3 c = Subtract({hn::LoadU(d, &v[0][e]), hn::LoadU(d, &v[1][e]), hn::LoadU(d, &v[2][e])}, Splat(middle));
      const Vec up = Dot(c, normal), z = hn::Add(up, hn::Set(d, in_frame.z));
      const Vec w0 = hn::Div(z, hn::Sub(hn::Neg(up), hn::Set(d, half[2]))),
                w1 = hn::Div(z, hn::Sub(hn::Set(d, half[2]), up));
      for (int axis = 0; axis < 2; ++axis) {
        const Vec away = Dot(c, axes[axis]), place = hn::Add(away, hn::Set(d, in_frame[axis]));
        const Vec a = hn::Sub(away, hn::Set(d, half[axis])), b = hn::Add(away, hn::Set(d, half[axis]));
        const Vec a0 = hn::Mul(a, w0), a1 = hn::Mul(a, w1), b0 = hn::Mul(b, w0), b1 = hn::Mul(b, w1);
        low[axis] = hn::Min(low[axis], hn::Add(place, hn::Min(hn::Min(a0, a1), hn::Min(b0, b1))));
        high[axis] = hn::Max(high[axis], hn::Add(place, hn::Max(hn::Max(a0, a1), hn::Max(b0, b1))));
      }
    }
    // Vertices lie off by at most PatchOutline::kMostError columns and rows.
    const Vec pad = hn::Set(d, PatchOutline::kMostError / std::min(rows_.scale, rows_.row_scale));
    const Rectangle& open = packet_.shaft.light;
    const LaneMask may = hn::And(hn::And(hn::Le(hn::Sub(low[1], pad), hn::Set(d, open.high_v)),
                                         hn::Ge(hn::Add(high[1], pad), hn::Set(d, open.low_v))),
                                 hn::Le(hn::Sub(low[0], pad), hn::Set(d, open.high_u)));
    const std::uint64_t beside = Bits(hn::Lt(hn::Add(high[0], pad), hn::Set(d, open.low_u)));
    std::uint64_t bits = Bits(may) & ((std::uint64_t{1} << std::min<std::size_t>(hn::Lanes(d), end - e)) - 1);
    std::uint16_t positive[kMaxLanes] = {}, negative[kMaxLanes] = {};
    std::uint32_t twice = 0;
    if (turning) {
      for (std::uint64_t rest = bits; rest != 0; rest &= rest - 1) {
        const auto lane = static_cast<std::size_t>(std::countr_zero(rest));
        const std::uint16_t left = net.triangle[0][e + lane], right = net.triangle[1][e + lane];
        const std::uint32_t lp = positive_of[left], ln = negative_of[left], rp = positive_of[right],
                            rn = negative_of[right];
        const std::uint32_t plus = (lp & ~rp) | (rn & ~ln), minus = (ln & ~rn) | (rp & ~lp);
        positive[lane] = static_cast<std::uint16_t>(plus), negative[lane] = static_cast<std::uint16_t>(minus);
        if (((plus | minus) & in_packet_) == 0) bits &= ~(std::uint64_t{1} << lane);
        twice |= std::uint32_t{(((lp & rn) | (ln & rp)) & in_packet_) != 0} << lane;
      }
    }
    if (bits == 0) continue;
    if (outline_.count + static_cast<std::uint32_t>(std::popcount(twice)) + static_cast<std::uint32_t>(std::popcount(bits)) > PatchOutline::kMost ||
        slots_ + 2 * static_cast<std::uint32_t>(std::popcount(bits)) > ProjectedVertices::kMost)
      return false;
    alignas(HWY_MAX_BYTES) std::int32_t first[kMaxLanes], last[kMaxLanes];
    const Vec row_scale = hn::Set(d, rows_.row_scale), top = hn::Set(d, static_cast<float>(rows_.rows) - 1.0f);
    const auto row = [&](Vec v, float offset) HWY_ATTR {
      return hn::ConvertTo(di, hn::Min(hn::Max(hn::MulAdd(v, row_scale, hn::Set(d, offset)), hn::Zero(d)), top));
    };
    hn::Store(row(hn::Sub(low[1], pad), rows_.least_row_offset), di, first);
    hn::Store(row(hn::Add(high[1], pad), rows_.most_row_offset), di, last);
    for (; bits != 0; bits &= bits - 1) {
      const auto lane = static_cast<std::size_t>(std::countr_zero(bits));
      const std::uint32_t i = outline_.count++;
      outline_.from[i] = slot_of(net.vertex[0][e + lane]), outline_.to[i] = slot_of(net.vertex[1][e + lane]);
      outline_.first_row[i] = static_cast<std::uint8_t>(first[lane]);
      outline_.last_row[i] = static_cast<std::uint8_t>(last[lane]);
      outline_.left[i] = (beside >> lane & 1) != 0;
      if (!turning) continue;
      outline_.positive[i] = positive[lane], outline_.negative[i] = negative[lane];
      if ((twice >> lane & 1) == 0) continue;
      const std::uint16_t left = net.triangle[0][e + lane], right = net.triangle[1][e + lane];
      const std::uint32_t second = outline_.count++;
      outline_.from[second] = outline_.from[i], outline_.to[second] = outline_.to[i];
      outline_.left[second] = outline_.left[i];
      outline_.first_row[second] = outline_.first_row[i], outline_.last_row[second] = outline_.last_row[i];
      outline_.positive[second] = static_cast<std::uint16_t>(positive_of[left] & negative_of[right]);
      outline_.negative[second] = static_cast<std::uint16_t>(negative_of[left] & positive_of[right]);
    }
  }
  return true;
}

/// The edges as the receivers see them.
HWY_INLINE void PacketSolver::SetOutline() {
  const Tag d;
  const Vec row_scale = hn::Set(d, rows_.row_scale);
  const Vec row_offset = hn::Set(d, 0.5f * (rows_.least_row_offset + rows_.most_row_offset));
  const Vec spread = hn::Set(d, RowSpread());
  for (std::uint32_t row = 0; row < rows_.rows; ++row) {
    for (std::uint64_t& word : outline_.on_row[row]) word = 0;
    for (std::uint64_t& word : outline_.left_on_row[row]) word = 0;
  }
  bool near[ProjectedVertices::kMost];
  for (std::uint32_t v = 0; v < slots_; ++v) {
    const Vec row = hn::Add(hn::Load(d, vertices_.row[v]), row_offset);
    const Vec error = hn::MulAdd(hn::Load(d, vertices_.error[v]), row_scale, spread);
    near[v] = !hn::AllFalse(d, hn::Le(hn::Abs(hn::Sub(row, hn::Round(row))), error));
  }
  for (std::uint32_t e = 0; e < outline_.count; ++e) {
    auto& on_row = outline_.left[e] ? outline_.left_on_row : outline_.on_row;
    for (std::uint32_t row = outline_.first_row[e]; row <= outline_.last_row[e]; ++row)
      on_row[row][e / 64] |= std::uint64_t{1} << (e % 64);
    if (outline_.left[e]) continue;
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
    outline_.near_row[e] = near[a] || near[b];
  }
}

/// Samples of row y that an edge passes so near to, for receivers for which one of its ends lies on the row so far as can
/// be told, that its crossing the row or not is uncertain: within the errors of the ends the edge may turn.
HWY_INLINE UintVec PacketSolver::SamplesNearEnds(std::size_t e, Vec y, Vec offset, Vec rest) const {
  const Tag d;
  const std::size_t a = outline_.from[e], b = outline_.to[e];
  const Vec row_scale = hn::Set(d, rows_.row_scale), spread = hn::Set(d, RowSpread());
  const Vec xa = hn::Load(d, vertices_.column[a]), ya = hn::Load(d, vertices_.row[a]),
            xb = hn::Load(d, vertices_.column[b]), yb = hn::Load(d, vertices_.row[b]);
  const Vec error_a = hn::Load(d, vertices_.error[a]), error_b = hn::Load(d, vertices_.error[b]);
  const Vec off_a = hn::MulAdd(error_a, row_scale, spread), off_b = hn::MulAdd(error_b, row_scale, spread);
  const LaneMask near = hn::Or(hn::Le(hn::Abs(hn::Sub(ya, y)), off_a), hn::Le(hn::Abs(hn::Sub(yb, y)), off_b));
  const Vec off = hn::Add(off_a, off_b), slope = hn::Load(d, outline_.slope[e]);
  const Vec x = hn::MulAdd(slope, hn::Sub(y, ya), xa);
  const Vec reach = hn::MulAdd(hn::Abs(slope), off, hn::Load(d, outline_.width[e]));
  // The edge itself, and what its ends may lie off in columns.
  Vec pad = hn::Mul(hn::Add(hn::Max(error_a, error_b), hn::Set(d, rows_.deviation)), hn::Set(d, rows_.scale));
  pad = hn::Add(pad, hn::MulAdd(hn::Add(hn::Abs(xa), hn::Abs(xb)), hn::Set(d, 0x1p-20f), hn::Set(d, 0x1p-15f)));
  const Vec low = hn::Sub(hn::Min(xa, xb), pad), high = hn::Add(hn::Max(xa, xb), pad);
  const LaneMask level = hn::Le(hn::Abs(hn::Sub(ya, yb)), hn::Mul(off, hn::Set(d, 4.0f)));
  const Vec from = hn::IfThenElse(level, low, hn::Max(low, hn::Sub(x, reach))),
            to = hn::IfThenElse(level, high, hn::Min(high, hn::Add(x, reach)));
  return hn::IfThenElseZero(hn::RebindMask(UintTag(), near), ColumnsBetween(from, to, offset, rest));
}

/// Numbers of a few bits, one for each sample of a line.
template <int kBits>
struct WindingNumbers {
  UintVec bit[kBits];
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
  HWY_INLINE UintVec Any() const {
    UintVec any = bit[0];
    for (int i = 1; i < kBits; ++i) any = hn::Or(any, bit[i]);
    return any;
  }
};

/// How often the edges to the left of what is open wind around a line.
HWY_INLINE hn::Vec<IntTag> PacketSolver::WindLeft(std::uint32_t line) const {
  const Tag d;
  const IntTag di;
  const Vec y = hn::Set(d, rows_.place[line]);
  auto around = hn::Zero(di);
  const auto one = hn::Set(di, 1);
  for (std::size_t word = 0; word < std::size(outline_.left_on_row[0]); ++word) {
    for (std::uint64_t edges = outline_.left_on_row[line % rows_.rows][word]; edges != 0; edges &= edges - 1) {
      const std::size_t e = 64 * word + static_cast<std::size_t>(std::countr_zero(edges));
      const LaneMask behind = hn::Le(hn::Load(d, vertices_.row[outline_.from[e]]), y),
                     before = hn::Le(hn::Load(d, vertices_.row[outline_.to[e]]), y);
      LaneMask down = hn::AndNot(behind, before), up = hn::AndNot(before, behind);
      if (e >= outline_.fixed) Turn(e, down, up);
      around = hn::Add(around, hn::IfThenElseZero(hn::RebindMask(di, down), one));
      around = hn::Sub(around, hn::IfThenElseZero(hn::RebindMask(di, up), one));
    }
  }
  return around;
}

/// One line of a patch: the samples that it winds around, and those so near to an outline that this is not certain.
HWY_INLINE UintVec PacketSolver::WindLine(std::uint32_t line, UintVec& doubtful) const {
  const IntTag di;
  const auto around = WindLeft(line);
  // Nothing is wound around more often than by these and all other edges of the row.
  int others = 0;
  for (const std::uint64_t word : outline_.on_row[line % rows_.rows]) others += std::popcount(word);
  return hn::AllTrue(di, hn::Lt(around, hn::Set(di, 16 - others))) ? WindAround<4>(line, around, doubtful)
                                                                   : WindAround<8>(line, around, doubtful);
}

/// The same, beginning with the number of times that edges to the left wind around the line. The sums are right modulo
/// 2^kBits, and final ones are less than that.
template <int kBits>
HWY_INLINE UintVec PacketSolver::WindAround(std::uint32_t line, hn::Vec<IntTag> around, UintVec& doubtful) const {
  const Tag d;
  const UintTag du;
  const PictureLines& l = *packet_.lines;
  const Vec y = hn::Set(d, rows_.place[line]), offset = hn::Load(d, l.offset[line]), rest = hn::Load(d, l.rest[line]);
  const Vec shifter = hn::Set(d, 0x1p23f), half = hn::Set(d, 0.5f);
  const UintVec zero = hn::Zero(du), ones = hn::Set(du, ~0u), shifter_bits = hn::Set(du, 0x4b000000u);
  doubtful = zero;
  WindingNumbers<kBits> winding;
  for (int i = 0; i < kBits; ++i) {
    winding.bit[i] =
        hn::IfThenElse(hn::TestBit(hn::BitCast(du, around), hn::Set(du, 1u << i)), ones, zero);
  }
  doubtful = zero;
  for (std::size_t word = 0; word < std::size(outline_.on_row[0]); ++word) {
    for (std::uint64_t edges = outline_.on_row[line % rows_.rows][word]; edges != 0; edges &= edges - 1) {
      const std::size_t e = 64 * word + static_cast<std::size_t>(std::countr_zero(edges));
      const std::size_t a = outline_.from[e], b = outline_.to[e];
      const Vec ya = hn::Load(d, vertices_.row[a]);
      const LaneMask behind = hn::Le(ya, y), before = hn::Le(hn::Load(d, vertices_.row[b]), y);
      LaneMask crossing = hn::Xor(behind, before);
      if (e >= outline_.fixed)
        crossing = hn::And(crossing, LanesFromBits(outline_.positive[e] | outline_.negative[e], 0));
      if (outline_.near_row[e]) {
        UintVec near = SamplesNearEnds(e, y, offset, rest);
        if (e >= outline_.fixed) {
          near = hn::IfThenElseZero(
              hn::RebindMask(du, LanesFromBits(outline_.positive[e] | outline_.negative[e], 0)), near);
        }
        doubtful = hn::Or(doubtful, near);
      }
      if (hn::AllFalse(d, crossing)) continue;
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
      LaneMask down = hn::AndNot(behind, before), up = hn::AndNot(before, behind);
      if (e >= outline_.fixed) Turn(e, down, up);
      if (!hn::AllFalse(d, down)) winding.Add(hn::IfThenElseZero(hn::RebindMask(du, down), beyond));
      if (!hn::AllFalse(d, up)) winding.Subtract(hn::IfThenElseZero(hn::RebindMask(du, up), beyond));
    }
  }
  return winding.Any();
}

/// Doubtful samples of a line by the exact predicate: does a triangle of the patch block them?
void PacketSolver::SettlePatch(const BlockerTree::Node& group, const std::uint16_t* patch, std::uint32_t leaves,
                               std::uint32_t line, const std::uint32_t* doubtful, std::uint32_t* blocked) {
  const auto row = static_cast<std::int32_t>(line % rows_.rows);
  const auto within = [&](const PictureRanges& ranges, std::size_t i, std::int32_t column) {
    return row >= ranges.row[0][i] && row <= ranges.row[1][i] && column >= ranges.column[0][i] &&
           column <= ranges.column[1][i];
  };
  for (std::size_t lane = 0; lane < packet_.count; ++lane) {
    const std::size_t first =
        std::size_t{receivers_.set[packet_.first + lane]} * scene_.samples->padded + rows_.first_sample(line);
    for (std::uint32_t rest = doubtful[lane]; rest != 0; rest &= rest - 1) {
      const auto bit = static_cast<std::size_t>(std::countr_zero(rest));
      const auto column = static_cast<std::int32_t>(line / rows_.rows * SampleRows::kWord + bit);
      bool is_blocked = false;
      for (std::uint32_t some = leaves; some != 0 && !is_blocked; some &= some - 1) {
        const auto k = static_cast<std::uint32_t>(std::countr_zero(some));
        if (patch[k] == 0 || !within(leaf_ranges_, k, column)) continue;
        const BlockerTree::Leaf& leaf = scene_.tree->leaves[(group.child[0] & ~BlockerTree::kLeafBit) + k];
        const LeafView& seen = ViewLeaf(group, k);
        for (std::uint32_t t = patch[k]; t != 0 && !is_blocked; t &= t - 1) {
          const auto i = static_cast<std::size_t>(std::countr_zero(t));
          if (!within(seen.ranges, i, column)) continue;
          ++counters_.exact_fallbacks;
          const auto& corner = scene_.tree->blockers[leaf.first + i].corner;
          is_blocked = blocks(corner[0], corner[1], corner[2], Position(lane), scene_.samples->points[first + bit]);
        }
      }
      blocked[lane] |= std::uint32_t{is_blocked} << bit;
    }
  }
}

/// The group's patch into all pictures; false where its triangles must be taken one by one.
bool PacketSolver::RasterizePatch(const BlockerTree::Node& group, const GroupView& view, const std::uint16_t* patch,
                                  std::uint32_t leaves, bool& added) {
  const UintTag du;
  outline_.count = slots_ = 0;
  ++calls_;
  const std::uint32_t turning = view.first + view.fixed;
  if (!CollectEdges(group, view, view.first, turning, false)) return false;
  outline_.fixed = outline_.count;
  if (!CollectEdges(group, view, turning, turning + view.turning, true)) return false;
  if (outline_.count == 0) return true;
  SetOutline();
  LineSet lines;
  for (std::uint32_t rest = leaves; rest != 0; rest &= rest - 1) {
    const auto k = static_cast<std::size_t>(std::countr_zero(rest));
    if (patch[k] == 0) continue;
    PictureRange(rows_, leaf_ranges_, k).for_open_lines(rows_, packet_, [&](std::uint32_t line) {
      lines.add(line);
      return false;
    });
  }
  ++counters_.pairs_sampled;
  bool any = false;
  lines.for_each([&](std::uint32_t line) HWY_ATTR {
    const UintVec open = hn::Load(du, packet_.open[line]);
    UintVec doubtful;
    ++counters_.sample_tests;
    UintVec blocked = hn::And(WindLine(line, doubtful), open);
    doubtful = hn::And(doubtful, open);
    if (!hn::AllTrue(du, hn::Eq(doubtful, hn::Zero(du)))) {
      alignas(HWY_MAX_BYTES) std::uint32_t in_doubt[kMaxLanes], does[kMaxLanes];
      hn::Store(doubtful, du, in_doubt), hn::Store(hn::AndNot(doubtful, blocked), du, does);
      SettlePatch(group, patch, leaves, line, in_doubt, does);
      blocked = hn::Load(du, does);
    }
    if (hn::AllTrue(du, hn::Eq(blocked, hn::Zero(du)))) return;
    hn::Store(hn::AndNot(blocked, open), du, packet_.open[line]);
    changed_lines_.add(line);
    any = true;
  });
  counters_.pairs_necessary += any;
  added |= any;
  return true;
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

/// One triangle into all pictures; true where samples were blocked.
bool PacketSolver::RasterizeTriangle(const BlockerTree::Leaf& leaf, const LeafView& view, std::size_t lane) {
  const Tag d;
  const UintTag du;
  const PictureRange range(rows_, view.ranges, lane);
  LaneMask active = hn::And(hn::FirstN(d, packet_.count),
                            hn::RebindMask(d, hn::Ne(packet_.own, hn::Set(du, leaf.triangle[lane]))));
  LineSet lines;
  if ((view.bounded >> lane) & 1) {
    const std::array<std::uint8_t, 3> corner = {leaf.corner_vertex[0][lane], leaf.corner_vertex[1][lane],
                                                leaf.corner_vertex[2][lane]};
    active =
        hn::And(active, ReceiversOverOpenSamples(rows_, corner, view.pad[lane], vertices_, range, packet_, lines));
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
  const bool above = (view.above >> lane) & 1, below = (view.below >> lane) & 1;
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
  if (!ListLeaves<true>(scene, begin, end, receivers, scratch)) return;
  const std::size_t lanes = hn::Lanes(Tag());
  ReceiverBox cluster;
  scratch.own_places.clear();
  const std::vector<std::uint32_t>& place = scene.tree->place;
  for (std::size_t i = begin; i < end; ++i) {
    cluster.add(scene.frame, {receivers.x[i], receivers.y[i], receivers.z[i]});
    if (receivers.own[i] < place.size() && (i == begin || receivers.own[i] != receivers.own[i - 1]))
      scratch.own_places.push_back(place[receivers.own[i]]);
  }
  std::sort(scratch.own_places.begin(), scratch.own_places.end());
  if (scratch.groups.size() < scratch.leaf.size()) scratch.groups.resize(scratch.leaf.size());
  for (GroupView& view : scratch.groups) view.known = false;
  scratch.net_edges.count = 0;
  scratch.facing.clear();
  PacketSolver solver(scene, cluster, receivers, scratch);
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
