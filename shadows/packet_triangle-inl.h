// A triangle taken singly as a packet of receivers sees it before the light, per instruction set: half planes of the
// picture of rows, and the columns of a line between them. Included once per Highway target by packet_kernel.cpp.
//
// An edge's plane m . (l - c) + d, with l = c + x X + y Y, is zero in row y at x = p + q y. With the error bound e of
// visibility_pair.h the sign is certain where |x - (p + q y)| > e / |m . X|; the slack added to that covers the
// rounding of p, q and of the row's columns.

#if defined(HALFSHADE_PACKET_TRIANGLE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef HALFSHADE_PACKET_TRIANGLE_INL_H_
#undef HALFSHADE_PACKET_TRIANGLE_INL_H_
#else
#define HALFSHADE_PACKET_TRIANGLE_INL_H_
#endif

#include "shadows/packet-inl.h"

HWY_BEFORE_NAMESPACE();
namespace halfshade {
namespace HWY_NAMESPACE {

/// A half plane of the picture in each lane: column x of row y is inside beyond p + q y, towards larger x where `up`.
/// In columns; `least` and `most` are p less and p plus what is uncertain.
struct HalfPlane {
  Vec least, most, slope;
  LaneMask up;
};

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
  std::array<vec3, 3> corner;
  BlockerPlane plane;
  bool samples_above, samples_below;  // some sample may lie on that side of the plane
  const AlphaTriangle* alpha;         // null where it is opaque
  std::array<HalfPlane, 4> planes;  // through receiver and edge, oriented for a plane above the receiver; its own plane
  std::size_t count;                // 3; 4 where samples lie on both sides of its plane
  bool cuts_cloud = false;          // samples that lie in no plane are on both sides of its plane
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

}  // namespace HWY_NAMESPACE
}  // namespace halfshade
HWY_AFTER_NAMESPACE();

#endif  // include guard
