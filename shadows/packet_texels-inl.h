// Texels of an alpha-tested triangle for a packet of receivers at a time, per instruction set. Included once per Highway
// target by packet_kernel.cpp.
//
// A texture coordinate under a sample is a ratio of two linear functions of the sample's place (alpha.h). Near a place
// of reference it is m + (U - m S) / S with a whole number m: the difference, found in double, is small, so that float
// is enough for the steps from there to the samples of a line. What its error bound leaves open is for TexelLookup.

#if defined(HALFSHADE_PACKET_TEXELS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef HALFSHADE_PACKET_TEXELS_INL_H_
#undef HALFSHADE_PACKET_TEXELS_INL_H_
#else
#define HALFSHADE_PACKET_TEXELS_INL_H_
#endif

#include "shadows/alpha_lookup-inl.h"
#include "shadows/packet_anywhere-inl.h"

HWY_BEFORE_NAMESPACE();
namespace halfshade {
namespace HWY_NAMESPACE {

class PacketTexels {
 public:
  /// For receivers of the packet before that triangle; false where texels cannot be numbered by 31 bits.
  bool Set(const SampleRows& rows, const vec3& center, const Packet& packet, const AlphaTriangle& triangle);

  /// Of the samples `asked` of a line, one word for each receiver and all blocked by the triangle, those whose texel is
  /// opaque; `open` are those that are not decided.
  HWY_INLINE UintVec Opaque(const SampleRows& rows, const Packet& packet, std::uint32_t line, UintVec asked,
                            UintVec& open);

 private:
  /// A function of the place in columns and rows, a double for each receiver.
  struct Linear {
    alignas(HWY_MAX_BYTES) double at_center[kMaxLanes], by_column[kMaxLanes], by_row[kMaxLanes];
  };
  /// The same around the place of reference, with the sign that makes the denominator positive there.
  struct Step {
    Vec at, by_column, by_row;
    HWY_INLINE Vec operator()(Vec column, Vec row) const {
      return hn::MulAdd(by_column, column, hn::MulAdd(by_row, row, at));
    }
    HWY_INLINE Vec reach(Vec columns, Vec rows) const {
      return hn::MulAdd(hn::Abs(by_column), columns, hn::MulAdd(hn::Abs(by_row), rows, hn::Abs(at)));
    }
  };
  using IntVec = hn::Vec<IntTag>;
  HWY_INLINE void Refer(Vec column, Vec row);
  HWY_INLINE IntVec Texel(int axis, Vec place, LaneMask& certain) const;

  const AlphaTriangle* triangle_ = nullptr;
  Linear coordinate_[2], sum_;  // numerators of u and v, in texels; denominator
  double most_[2];              // |coordinate| of the corners, in texels
  // What is uncertain of a numerator, beside `sum_error_` for each texel from zero, and of the denominator.
  alignas(HWY_MAX_BYTES) float error_[2][kMaxLanes], sum_error_[kMaxLanes];
  Step step_[2], sum_step_;  // Refer
  IntVec first_[2];          // the whole numbers, wrapped into the texture
  Vec margin_[2];            // of a line: nearer than that to a texel's border the texel is open
};

bool PacketTexels::Set(const SampleRows& rows, const vec3& center, const Packet& packet,
                       const AlphaTriangle& triangle) {
  triangle_ = &triangle;
  const std::size_t size = std::size_t{triangle.width} * triangle.height;
  if (size < 4 || size >= std::size_t{1} << 31) return false;
  const WideTag d;
  const NarrowTag narrow;
  const Tag df;
  struct Wide3 {
    Wide x, y, z;
  };
  const auto dot = [&](const Wide3& a, const Wide3& b) HWY_ATTR {
    return hn::MulAdd(a.x, b.x, hn::MulAdd(a.y, b.y, hn::Mul(a.z, b.z)));
  };
  const auto norm1 = [&](const Wide3& a) HWY_ATTR { return hn::Add(hn::Abs(a.x), hn::Add(hn::Abs(a.y), hn::Abs(a.z))); };
  const auto splat = [&](const dvec3& a) HWY_ATTR { return Wide3{hn::Set(d, a.x), hn::Set(d, a.y), hn::Set(d, a.z)}; };
  const Wide3 by_column = splat(dvec3(rows.axis_x) / double{rows.scale}),
              by_row = splat(dvec3(rows.axis_y) / double{rows.row_scale});
  double texel[3][2];
  most_[0] = most_[1] = 0.0;
  for (std::size_t i = 0; i < 3; ++i) {
    texel[i][0] = static_cast<double>(triangle.u[i]) * (triangle.width / kUvUnitsPerOne);
    texel[i][1] = static_cast<double>(triangle.v[i]) * (triangle.height / kUvUnitsPerOne);
    for (int k = 0; k < 2; ++k) most_[k] = std::max(most_[k], std::fabs(texel[i][k]) + 1.0);
  }
  alignas(HWY_MAX_BYTES) float position[3][kMaxLanes];
  hn::Store(packet.position.x, df, position[0]), hn::Store(packet.position.y, df, position[1]);
  hn::Store(packet.position.z, df, position[2]);
  for (std::size_t lane = 0; lane < hn::Lanes(df); lane += hn::Lanes(d)) {
    const auto coordinate = [&](int axis) HWY_ATTR { return hn::PromoteTo(d, hn::LoadU(narrow, position[axis] + lane)); };
    const Wide3 r{coordinate(0), coordinate(1), coordinate(2)};
    const auto from_receiver = [&](const vec3& p) HWY_ATTR {
      return Wide3{hn::Sub(hn::Set(d, double{p.x}), r.x), hn::Sub(hn::Set(d, double{p.y}), r.y),
                   hn::Sub(hn::Set(d, double{p.z}), r.z)};
    };
    const Wide3 corner[3] = {from_receiver(triangle.corners[0]), from_receiver(triangle.corners[1]),
                             from_receiver(triangle.corners[2])};
    const Wide3 to_center = from_receiver(center);
    const Wide zero = hn::Zero(d);
    Wide3 plane[2] = {{zero, zero, zero}, {zero, zero, zero}}, sum = plane[0];
    Wide size_of = zero;
    for (std::size_t i = 0; i < 3; ++i) {
      const Wide3 &a = corner[(i + 1) % 3], &b = corner[(i + 2) % 3];
      const Wide3 weight{hn::MulSub(a.y, b.z, hn::Mul(a.z, b.y)), hn::MulSub(a.z, b.x, hn::Mul(a.x, b.z)),
                         hn::MulSub(a.x, b.y, hn::Mul(a.y, b.x))};
      for (int k = 0; k < 2; ++k) {
        const Wide t = hn::Set(d, texel[i][k]);
        plane[k] = {hn::MulAdd(weight.x, t, plane[k].x), hn::MulAdd(weight.y, t, plane[k].y),
                    hn::MulAdd(weight.z, t, plane[k].z)};
      }
      sum = {hn::Add(sum.x, weight.x), hn::Add(sum.y, weight.y), hn::Add(sum.z, weight.z)};
      size_of = hn::MulAdd(norm1(a), norm1(b), size_of);
    }
    const auto store = [&](const Wide3& p, Linear& to) HWY_ATTR {
      hn::Store(dot(p, to_center), d, to.at_center + lane);
      hn::Store(dot(p, by_column), d, to.by_column + lane), hn::Store(dot(p, by_row), d, to.by_row + lane);
    };
    store(sum, sum_);
    // As in TexelLookup, with four times as many units of 2^-53 for the steps that come here; and samples lie off their
    // places by `deviation`.
    const double picture = rows.columns / double{rows.scale} + rows.rows / double{rows.row_scale};
    const Wide away = hn::Add(norm1(to_center), hn::Set(d, 4.0 * (picture + 1.0)));
    const Wide rounding = hn::Mul(hn::Set(d, 64.0 * 0x1p-53), hn::Mul(size_of, away));
    const Wide deviation = hn::Set(d, 3.0 * double{rows.deviation});
    const auto as_float = [&](Wide v) HWY_ATTR { return hn::DemoteTo(narrow, hn::Mul(v, hn::Set(d, 1.0001))); };
    for (int k = 0; k < 2; ++k) {
      store(plane[k], coordinate_[k]);
      const Wide off = hn::MulAdd(deviation, norm1(plane[k]), hn::Mul(rounding, hn::Set(d, most_[k])));
      hn::StoreU(as_float(off), narrow, error_[k] + lane);
    }
    hn::StoreU(as_float(hn::MulAdd(deviation, norm1(sum), rounding)), narrow, sum_error_ + lane);
  }
  return true;
}

/// Takes the place of reference.
HWY_INLINE void PacketTexels::Refer(Vec column, Vec row) {
  const WideTag d;
  const NarrowTag narrow;
  const Tag df;
  const IntTag di;
  alignas(HWY_MAX_BYTES) float place[2][kMaxLanes], numerator[2][3][kMaxLanes], denominator[3][kMaxLanes];
  alignas(HWY_MAX_BYTES) float whole[2][kMaxLanes];
  hn::Store(column, df, place[0]), hn::Store(row, df, place[1]);
  for (std::size_t lane = 0; lane < hn::Lanes(df); lane += hn::Lanes(d)) {
    const Wide x = hn::PromoteTo(d, hn::LoadU(narrow, place[0] + lane)),
               y = hn::PromoteTo(d, hn::LoadU(narrow, place[1] + lane));
    const auto at = [&](const Linear& f) HWY_ATTR {
      return hn::MulAdd(hn::Load(d, f.by_column + lane), x,
                        hn::MulAdd(hn::Load(d, f.by_row + lane), y, hn::Load(d, f.at_center + lane)));
    };
    const Wide s = at(sum_), sx = hn::Load(d, sum_.by_column + lane), sy = hn::Load(d, sum_.by_row + lane);
    const Wide sign = hn::CopySignToAbs(hn::Set(d, 1.0), s), inverse = hn::Div(hn::Set(d, 1.0), s);
    const auto store = [&](Wide v, float* to) HWY_ATTR { hn::StoreU(hn::DemoteTo(narrow, v), narrow, to + lane); };
    store(hn::Mul(s, sign), denominator[0]), store(hn::Mul(sx, sign), denominator[1]);
    store(hn::Mul(sy, sign), denominator[2]);
    for (int k = 0; k < 2; ++k) {
      const Linear& f = coordinate_[k];
      const Wide u = at(f), ratio = hn::Mul(u, inverse);
      const Wide m = hn::IfThenElseZero(hn::Lt(hn::Abs(ratio), hn::Set(d, most_[k])), hn::Floor(ratio));
      store(hn::Mul(hn::NegMulAdd(m, s, u), sign), numerator[k][0]);
      store(hn::Mul(hn::NegMulAdd(m, sx, hn::Load(d, f.by_column + lane)), sign), numerator[k][1]);
      store(hn::Mul(hn::NegMulAdd(m, sy, hn::Load(d, f.by_row + lane)), sign), numerator[k][2]);
      store(Wrap(m, k == 0 ? triangle_->width : triangle_->height), whole[k]);
    }
  }
  const auto step_of = [&](const float(*v)[kMaxLanes]) HWY_ATTR {
    return Step{hn::Load(df, v[0]), hn::Load(df, v[1]), hn::Load(df, v[2])};
  };
  sum_step_ = step_of(denominator);
  for (int k = 0; k < 2; ++k) {
    step_[k] = step_of(numerator[k]);
    first_[k] = hn::ConvertTo(di, hn::Load(df, whole[k]));
  }
}

/// The number of the column or row of texels at `place` from the whole number of reference.
HWY_INLINE hn::Vec<IntTag> PacketTexels::Texel(int axis, Vec place, LaneMask& certain) const {
  const Tag d;
  const IntTag di;
  const auto size = static_cast<std::int32_t>(axis == 0 ? triangle_->width : triangle_->height);
  const Vec floor = hn::Floor(place), in_texel = hn::Sub(place, floor);
  const Vec border = hn::Min(in_texel, hn::Sub(hn::Set(d, 1.0f), in_texel));
  certain = hn::And(hn::Gt(border, margin_[axis]), hn::Lt(hn::Abs(floor), hn::Set(d, static_cast<float>(size))));
  const auto all = hn::Set(di, size);
  auto texel = hn::Add(hn::ConvertTo(di, hn::IfThenElseZero(certain, floor)), first_[axis]);
  texel = hn::IfThenElse(hn::Lt(texel, hn::Zero(di)), hn::Add(texel, all), texel);
  return hn::IfThenElse(hn::Lt(texel, all), texel, hn::Sub(texel, all));
}

HWY_INLINE UintVec PacketTexels::Opaque(const SampleRows& rows, const Packet& packet, std::uint32_t line, UintVec asked,
                                        UintVec& open) {
  const Tag d;
  const UintTag du;
  const IntTag di;
  alignas(HWY_MAX_BYTES) std::uint32_t word[kMaxLanes];
  hn::Store(asked, du, word);
  std::uint32_t any = 0;
  for (std::size_t k = 0; k < hn::Lanes(d); ++k) any |= word[k];
  const auto place_of = [&](std::uint32_t i) HWY_ATTR {
    if (rows.anywhere) return SamplePlace(*packet.places, line * SampleRows::kWord + i);
    SamplePlace place;
    const PictureLines& l = *packet.lines;
    place.column = hn::Sub(hn::Set(d, static_cast<float>(i) + 0.5f), hn::Load(d, l.offset[line]));
    place.row = hn::Mul(hn::Load(d, l.y[line]), hn::Set(d, rows.row_scale));
    return place;
  };
  const auto first = static_cast<std::uint32_t>(std::countr_zero(any)),
             last = 31u - static_cast<std::uint32_t>(std::countl_zero(any));
  SamplePlace reference = place_of((first + last) / 2);
  if (rows.anywhere && (any >> (first + last) / 2 & 1) == 0) reference = place_of(first);
  Refer(reference.column, reference.row);
  // How far the samples lie from there.
  Vec columns = hn::Zero(d), rows_off = columns;
  for (std::uint32_t rest = any; rest != 0; rest &= rest - 1) {
    if (!rows.anywhere && (rest != any && (rest & (rest - 1)) != 0)) continue;  // the first and the last
    const SamplePlace p = place_of(static_cast<std::uint32_t>(std::countr_zero(rest)));
    columns = hn::Max(columns, hn::Abs(hn::Sub(p.column, reference.column)));
    rows_off = hn::Max(rows_off, hn::Abs(hn::Sub(p.row, reference.row)));
  }
  // In units of 2^-24: a numerator is within 4 of its reach, the denominator as well, the ratio within 8 of itself. A
  // step in columns or rows is a difference of two places, which are rounded at 2^-24 of 64.
  const Vec unit = hn::Set(d, 0x1p-24f), place_error = hn::Set(d, 64.0f * 0x1p-23f);
  const Vec sum_error = hn::Load(d, sum_error_);
  const auto moved = [&](const Step& s) HWY_ATTR {
    return hn::Mul(place_error, hn::Add(hn::Abs(s.by_column), hn::Abs(s.by_row)));
  };
  const Vec sum_reach = sum_step_.reach(columns, rows_off);
  const Vec off_sum = hn::MulAdd(hn::Mul(unit, hn::Set(d, 4.0f)), sum_reach, hn::Add(sum_error, moved(sum_step_)));
  // The least that the denominator may be.
  const Vec least = hn::Sub(hn::Sub(hn::Add(sum_step_.at, sum_step_.at), sum_reach), off_sum);
  const LaneMask positive = hn::Gt(least, hn::Zero(d));
  const Vec inverse_least = hn::Div(hn::Set(d, 1.0f), hn::IfThenElse(positive, least, hn::Set(d, 1e-20f)));
  for (int k = 0; k < 2; ++k) {
    const Vec reach = step_[k].reach(columns, rows_off);
    const Vec off = hn::Add(hn::MulAdd(hn::Mul(unit, hn::Set(d, 4.0f)), reach, moved(step_[k])),
                            hn::MulAdd(hn::Set(d, static_cast<float>(most_[k] * 1.0001)), sum_error,
                                       hn::Load(d, error_[k])));
    const Vec ratio = hn::Mul(reach, inverse_least);
    margin_[k] = hn::MulAdd(off, inverse_least,
                            hn::Mul(ratio, hn::MulAdd(off_sum, inverse_least, hn::Mul(unit, hn::Set(d, 12.0f)))));
    margin_[k] = hn::Mul(margin_[k], hn::Set(d, 1.001f));
  }
  UintVec opaque = hn::Zero(du), known = opaque;
  const auto* const alpha = reinterpret_cast<const std::int32_t*>(triangle_->map->alpha.data());
  const auto width = hn::Set(di, static_cast<std::int32_t>(triangle_->width)),
             top = hn::Set(di, static_cast<std::int32_t>(triangle_->height) - 1);
  const auto most_clear = hn::Set(di, static_cast<std::int32_t>(triangle_->threshold) - 1);
  for (; any != 0; any &= any - 1) {
    const UintVec bit = hn::Set(du, any & (0u - any));
    const SamplePlace p = place_of(static_cast<std::uint32_t>(std::countr_zero(any)));
    const Vec column = hn::Sub(p.column, reference.column), row = hn::Sub(p.row, reference.row);
    const Vec inverse = Reciprocal(sum_step_(column, row));
    LaneMask certain_u, certain_v;
    const auto u = Texel(0, hn::Mul(step_[0](column, row), inverse), certain_u),
               v = Texel(1, hn::Mul(step_[1](column, row), inverse), certain_v);
    const LaneMask certain = hn::And(positive, hn::And(certain_u, certain_v));
    const auto at = hn::Add(hn::Mul(hn::Sub(top, v), width), u);
    // The byte is the last of a word of four, or is in the first word.
    const auto word_at = hn::IfThenElseZero(hn::RebindMask(di, certain), hn::Max(hn::Sub(at, hn::Set(di, 3)), hn::Zero(di)));
    const UintVec four = hn::BitCast(du, hn::GatherOffset(di, alpha, word_at));
    const UintVec shift = hn::ShiftLeft<3>(hn::BitCast(du, hn::Sub(at, word_at)));
    const auto byte =
        hn::BitCast(di, hn::And(hn::Shr(four, hn::And(shift, hn::Set(du, 31u))), hn::Set(du, 0xffu)));
    const UintVec sure = hn::IfThenElseZero(hn::RebindMask(du, certain), bit);
    known = hn::Or(known, sure);
    opaque = hn::Or(opaque, hn::IfThenElseZero(hn::RebindMask(du, hn::Gt(byte, most_clear)), sure));
  }
  open = hn::AndNot(known, asked);
  return hn::And(opaque, asked);
}

}  // namespace HWY_NAMESPACE
}  // namespace halfshade
HWY_AFTER_NAMESPACE();

#endif  // include guard
