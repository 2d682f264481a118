// Packets of receivers, per instruction set: how they see boxes, triangles and vertices before the light as rectangles
// and places of a picture of rows. Included once per Highway target by packet_kernel.cpp.

#if defined(HALFSHADE_PACKET_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef HALFSHADE_PACKET_INL_H_
#undef HALFSHADE_PACKET_INL_H_
#else
#define HALFSHADE_PACKET_INL_H_
#endif

#include "shadows/exact_cluster-inl.h"

HWY_BEFORE_NAMESPACE();
namespace halfshade {
namespace HWY_NAMESPACE {

using IntTag = hn::RebindToSigned<Tag>;
using UintVec = hn::Vec<UintTag>;
constexpr std::size_t kMaxLines = SampleRows::kMaxLines;

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

/// Receivers as boxes.
struct ReceiverBox {
  vec3 low{1e30f}, high{-1e30f};  // lattice
  Shaft shaft{
      {1e30f, 1e30f, 1e30f}, {-1e30f, -1e30f, -1e30f}, {}, 0.0f};  // the light's frame, and what of the light is asked

  void add(const LightFrame& frame, const vec3& r) {
    const vec3 p(frame.to_frame(dvec3(r)));
    low = glm::min(low, r), high = glm::max(high, r);
    for (int k = 0; k < 3; ++k)
      shaft.low[k] = std::min(shaft.low[k], p[k]), shaft.high[k] = std::max(shaft.high[k], p[k]);
  }
};

/// Receivers [first, first + count), a lane each; lanes beyond repeat the last one and have nothing open.
struct Packet : ReceiverBox {
  const KernelReceivers* receivers = nullptr;
  std::size_t first = 0, count = 0;
  const std::uint8_t* set = nullptr;  // of each receiver
  bool has_one_set = true;
  Vec3 position, to_center;       // lattice; from there to the light's centre
  Vec distance;                   // bound on |coordinate| of receiver to sample
  Vec height_error, place_error;  // 5 |r - c| / height + 14; 5 |r - c|: see PlaceVertex
  Vec column, row, height;        // of the receivers over the picture, in columns and rows from its centre; in lengths
  UintVec own;                    // own triangle
  const PictureLines* lines;      // where the rows lie; samples anywhere:
  const PlacedSamples* places;
  float open_low[2], open_high[2];    // columns and rows from the centre between which lies what some receiver has open
  std::uint32_t any_open[kMaxLines];  // what some receiver has open
  alignas(HWY_MAX_BYTES) std::uint32_t open[kMaxLines][kMaxLanes];  // bit i: sample i of the line is not blocked yet

  vec3 at(std::size_t lane) const {
    return {receivers->x[first + lane], receivers->y[first + lane], receivers->z[first + lane]};
  }
};

/// The samples of a line that a packet's receiver is asked for, by bit.
struct LinePoints {
  LinePoints(const SampleRows& rows, const Packet& packet, std::size_t lane, std::uint32_t line)
      : x(rows.line_points(rows.point_x, packet.set[lane], line)),
        y(rows.line_points(rows.point_y, packet.set[lane], line)),
        z(rows.line_points(rows.point_z, packet.set[lane], line)) {}
  vec3 operator[](std::size_t bit) const { return {x[bit], y[bit], z[bit]}; }

  const float *x, *y, *z;
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
  const Vec least = hn::Set(d, -1.0f), most = hn::Set(d, float{SampleRows::kMaxRows} + 1.0f);
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

  /// visit(line, samples that some receiver has open) for the lines in which the range holds such, until it returns
  /// true.
  template <class Visit>
  HWY_INLINE bool for_open_lines(const SampleRows& rows, const Packet& packet, const Visit& visit) const {
    for (std::uint32_t from = 0, line = 0; from < rows.columns; from += SampleRows::kWord, line += rows.rows) {
      const std::uint32_t wanted = bits(static_cast<std::int32_t>(from));
      for (std::int32_t row = first_row; row <= last_row; ++row) {
        const std::uint32_t at = line + static_cast<std::uint32_t>(row);
        const std::uint32_t open = packet.any_open[at] & wanted;
        if (open != 0 && visit(at, open)) return true;
      }
    }
    return false;
  }
  HWY_INLINE bool is_open(const SampleRows& rows, const Packet& packet) const {
    return for_open_lines(rows, packet, [](std::uint32_t, std::uint32_t) { return true; });
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

/// Triangles that hide samples below them from receivers in a box: not those of closed components that none lies
/// within, whose back faces suffice.
HWY_INLINE std::uint32_t SamplesBelow(const BlockerFit::Leaf& leaf, const vec3& low, const vec3& high) {
  const bool outside_box = low.x > leaf.box_high.x || low.y > leaf.box_high.y || low.z > leaf.box_high.z ||
                           high.x < leaf.box_low.x || high.y < leaf.box_low.y || high.z < leaf.box_low.z;
  return leaf.samples_below & ~(outside_box ? leaf.back_faces_only : 0u);
}

/// On which side of the planes a box of receivers lies, and so whether they separate it from samples. Fills above,
/// below and active.
template <class View>
HWY_INLINE void FindSides(const BlockerTree::Leaf& leaf, const BlockerFit::Leaf& fit, std::size_t i, const vec3& low,
                          const vec3& high, const vec3& half, const Vec3& to_corner, View& view) {
  const Tag d;
  const Vec3 normal{hn::LoadU(d, leaf.normal[0] + i), hn::LoadU(d, leaf.normal[1] + i),
                    hn::LoadU(d, leaf.normal[2] + i)};
  const Vec side = Dot(normal, to_corner);
  const Vec reach = Dot({hn::Abs(normal.x), hn::Abs(normal.y), hn::Abs(normal.z)}, Splat(half));
  const Vec far = hn::Add(Norm1(to_corner), hn::Set(d, half.x + half.y + half.z));
  const Vec error = hn::MulAdd(hn::Mul(hn::LoadU(d, leaf.side_error + i), far), hn::Set(d, 2.0f), reach);
  const auto above = static_cast<std::uint32_t>(Bits(hn::Gt(side, error))),
             below = static_cast<std::uint32_t>(Bits(hn::Lt(side, hn::Neg(error))));
  const std::uint32_t in_leaf = (1u << std::min<std::size_t>(leaf.count - i, hn::Lanes(d))) - 1;
  const std::uint32_t samples_above = fit.samples_above >> i, samples_below = SamplesBelow(fit, low, high) >> i;
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
  // Triangles that reach the height of a receiver project without bounds, but only away from the receivers, and at
  // least as far as from their lowest height.
  farthest = hn::Add(farthest, hn::Set(d, half[0] + half[1] + half[2]));
  const LaneMask bounded = hn::Gt(least, hn::Mul(farthest, hn::Set(d, 1e-5f)));
  const Vec magnified = hn::Div(hn::Mul(farthest, hn::Set(d, 1e-6f * (box.high[2] + 4.0f))), least);
  pad = hn::Add(magnified, hn::Set(d, ProjectionPad(box.low[2])));
  const Vec everywhere = hn::Set(d, 1e9f), margin = hn::Set(d, 2e-5f), zero = hn::Zero(d);
  const Vec depth = hn::Add(hn::Max(hn::Sub(hn::Set(d, box.high[2]), lowest), zero), margin);
  // What lies behind the plane z = 0 may project nearer to them.
  const LaneMask behind = hn::Lt(lowest, hn::Set(d, box.floor < 0.0f ? 0.0f : -1e30f));
  const Vec away_by = hn::Div(hn::Mul(hn::Max(hn::Sub(lowest, margin), zero), hn::Set(d, 0.999f)), depth);
  for (int axis = 0; axis < 2; ++axis) {
    const Vec low = hn::IfThenElse(
        hn::AndNot(behind, hn::Gt(nearest[axis], margin)),
        hn::MulAdd(hn::Sub(nearest[axis], margin), away_by, hn::Sub(place_low[axis], margin)), hn::Neg(everywhere));
    const Vec high =
        hn::IfThenElse(hn::AndNot(behind, hn::Lt(last[axis], hn::Neg(margin))),
                       hn::MulAdd(hn::Add(last[axis], margin), away_by, hn::Add(place_high[axis], margin)), everywhere);
    q.low[axis] = hn::IfThenElse(bounded, hn::Sub(q.low[axis], pad), low);
    q.high[axis] = hn::IfThenElse(bounded, hn::Add(q.high[axis], pad), high);
  }
  return bounded;
}

/// Triangles from `i` on.
HWY_INLINE void ViewTriangles(const ExactScene& scene, std::size_t index, std::size_t i, const Packet& packet,
                              LeafView& view) {
  const Tag d;
  const BlockerTree::Leaf& leaf = scene.tree->leaves[index];
  const vec3 middle = 0.5f * (packet.low + packet.high);
  const vec3 half = glm::max(packet.high - middle, middle - packet.low) * (1.0f + 0x1p-20f);
  std::array<Vec3, 3> to_corner;
  for (std::size_t k = 0; k < 3; ++k) {
    to_corner[k] = Subtract(
        {hn::LoadU(d, leaf.corner[k][0] + i), hn::LoadU(d, leaf.corner[k][1] + i), hn::LoadU(d, leaf.corner[k][2] + i)},
        Splat(middle));
  }
  FindSides(leaf, scene.fit->leaves[index], i, packet.low, packet.high, half, to_corner[0], view);
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

/// Vertices as each receiver sees them before the light, in columns and rows; `error` bounds how far they may lie off,
/// in lengths along either axis.
struct ProjectedVertices {
  static constexpr std::size_t kMost = 255;
  alignas(HWY_MAX_BYTES) float column[kMost][kMaxLanes], row[kMost][kMaxLanes], error[kMost][kMaxLanes];
};

/// A vertex between the receivers and the light, by what leads to it from each of them: `x` and `y` in columns and
/// rows, `down` against the light's normal; each within `units` length / 2^24 of the truth.
HWY_INLINE void PlaceVertex(const Packet& packet, Vec x, Vec y, Vec down, Vec length, float units, std::size_t slot,
                            ProjectedVertices& projected) {
  const Tag d;
  const Vec inverse = Reciprocal(down), scale = hn::Mul(packet.height, inverse);
  hn::Store(hn::MulAdd(x, scale, packet.column), d, projected.column[slot]);
  hn::Store(hn::MulAdd(y, scale, packet.row), d, projected.row[slot]);
  // In units of 2^-24: x and y are within `units` length, the depth as well, the height within 5 |r - c|, the
  // reciprocal within 4; the rest is rounding. Packet::height_error allows for 5 units.
  const Vec known = hn::Add(packet.height_error, hn::Set(d, units - 5.0f));
  const Vec relative = hn::MulAdd(hn::Mul(hn::Set(d, units), length), inverse, known);
  hn::Store(hn::Mul(hn::Set(d, 0x1.1p-24f), hn::MulAdd(hn::Mul(length, scale), relative, packet.place_error)), d,
            projected.error[slot]);
}

/// Projects vertices, which must lie between the receivers and the light.
class VertexProjection {
 public:
  VertexProjection(const ExactScene& scene, const Packet& packet)
      : packet_(packet),
        axis_x_(Splat(scene.rows->axis_x * scene.rows->scale)),
        axis_y_(Splat(scene.rows->axis_y * scene.rows->row_scale)),
        down_(Splat(vec3(-scene.frame.n))) {}

  HWY_INLINE void Project(const vec3& vertex, std::size_t slot, ProjectedVertices& projected) const {
    const Vec3 way = Subtract(Splat(vertex), packet_.position);
    PlaceVertex(packet_, Dot(way, axis_x_), Dot(way, axis_y_), Dot(way, down_), Norm1(way), 5.0f, slot, projected);
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
  range.for_open_lines(rows, packet, [&](std::uint32_t line, std::uint32_t) HWY_ATTR {
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

/// The receivers for which a triangle reaches into the pyramid between them and what is open of the light: all but
/// those with all corners beyond one of its sides or behind them. From r, a point at r + way lies over column
/// column(r) + way_x height / down, and so beyond column c where way_x height > (c - column(r)) down, also for points
/// behind the receiver.
HWY_INLINE LaneMask ReceiversBelow(const SampleRows& rows, const LightFrame& frame, const BlockerTree::Leaf& leaf,
                                   std::size_t triangle, const Packet& packet) {
  const Tag d;
  const Vec3 down_axis = Splat(vec3(-frame.n));
  const Vec3 axis[2] = {Splat(rows.axis_x * rows.scale), Splat(rows.axis_y * rows.row_scale)};
  const float scale[2] = {rows.scale, rows.row_scale};
  const Vec place[2] = {packet.column, packet.row};
  // In units of 2^-24: a coordinate of `way` is within 5 |way|, column and height of the receiver within 6 |r - c|; and
  // samples lie off the light's plane by `deviation`.
  const Vec unit = hn::Set(d, 0x1p-20f);
  const Vec spread = hn::MulAdd(hn::Add(packet.height, packet.place_error), unit, hn::Set(d, 2.0f * rows.deviation));
  Vec limit[2][2], off[2][2];  // [axis][side]: from the receiver to the side; its error, a unit of |way|
  for (int k = 0; k < 2; ++k) {
    const float pad = rows.deviation * scale[k] + 1e-3f;
    limit[k][0] = hn::Sub(hn::Set(d, packet.open_low[k] - pad), place[k]);
    limit[k][1] = hn::Sub(hn::Set(d, packet.open_high[k] + pad), place[k]);
    for (int side = 0; side < 2; ++side)
      off[k][side] = hn::MulAdd(hn::Abs(limit[k][side]), unit, hn::Mul(spread, hn::Set(d, scale[k])));
  }
  const LaneMask none = hn::Lt(hn::Zero(d), hn::Zero(d)), all = hn::Not(none);
  LaneMask beyond[2][2] = {{all, all}, {all, all}}, behind = all;
  for (std::size_t c = 0; c < 3; ++c) {
    const Vec3 way = Subtract(Splat(leaf.corner_at(c, triangle)), packet.position);
    const Vec down = Dot(way, down_axis), length = Norm1(way);
    behind = hn::And(behind, hn::Lt(down, hn::Neg(hn::Mul(length, unit))));
    for (int k = 0; k < 2; ++k) {
      const Vec across = hn::Mul(Dot(way, axis[k]), packet.height);
      const Vec past_low = hn::MulAdd(off[k][0], length, across), past_high = hn::NegMulAdd(off[k][1], length, across);
      beyond[k][0] = hn::And(beyond[k][0], hn::Lt(past_low, hn::Mul(limit[k][0], down)));
      beyond[k][1] = hn::And(beyond[k][1], hn::Gt(past_high, hn::Mul(limit[k][1], down)));
    }
  }
  return hn::Not(hn::Or(behind, hn::Or(hn::Or(beyond[0][0], beyond[0][1]), hn::Or(beyond[1][0], beyond[1][1]))));
}

}  // namespace HWY_NAMESPACE
}  // namespace halfshade
HWY_AFTER_NAMESPACE();

#endif  // include guard
