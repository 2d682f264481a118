// Texels of an alpha-tested triangle for a packet of receivers at a time, per instruction set. Included once per
// Highway target by packet_kernel.cpp.
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

#include <cassert>

#include "shadows/alpha_lookup-inl.h"
#include "shadows/packet_anywhere-inl.h"

HWY_BEFORE_NAMESPACE();
namespace halfshade {
namespace HWY_NAMESPACE {

class PacketTexels {
 public:
  /// For receivers of the packet before a triangle that they see within `range`; false where texels cannot be numbered
  /// by 31 bits.
  bool Set(const ExactScene& scene, const Packet& packet, const AlphaTriangle& triangle, const PictureRange& range);

  /// Of the samples `asked` of a line, one word for each receiver and all blocked by the triangle, those whose texel is
  /// opaque; `open` are those that are not decided.
  HWY_INLINE UintVec Opaque(std::uint32_t line, UintVec asked, UintVec& open);

 private:
  /// Columns and rows from the light's centre; of a cloud, whose samples are not projected here, lengths above its
  /// plane.
  using Place = std::array<Vec, 3>;
  /// A function of the place, a double for each receiver.
  struct Linear {
    alignas(HWY_MAX_BYTES) double at_center[kMaxLanes], by[3][kMaxLanes];
  };
  /// The same around the place of reference, with the sign that makes the denominator positive there.
  struct Step {
    Vec at, by[3];
    HWY_INLINE Vec operator()(const Place& away, bool is_cloud) const {
      const Vec v = hn::MulAdd(by[0], away[0], hn::MulAdd(by[1], away[1], at));
      return is_cloud ? hn::MulAdd(by[2], away[2], v) : v;
    }
    /// Of |the function| where the place is within `away` of the reference.
    HWY_INLINE Vec Reach(const Place& away) const {
      return hn::MulAdd(hn::Abs(by[0]), away[0],
                        hn::MulAdd(hn::Abs(by[1]), away[1], hn::MulAdd(hn::Abs(by[2]), away[2], hn::Abs(at))));
    }
  };
  using IntVec = hn::Vec<IntTag>;
  void FindPlanes();
  HWY_INLINE Place PlaceOf(std::uint32_t line, std::uint32_t i) const;
  void Refer(const Place& place, const Place& away);
  void ReferToLine(std::uint32_t line, std::uint32_t any);
  template <bool kWraps>
  HWY_INLINE IntVec Texel(int axis, Vec floor) const;
  /// Sanitizers do not see what vectors gather.
  bool IsInMap(IntVec word_at) const {
    alignas(HWY_MAX_BYTES) std::int32_t at[kMaxLanes];
    hn::Store(word_at, IntTag(), at);
    return std::all_of(at, at + hn::Lanes(IntTag()),
                       [&](std::int32_t a) { return a >= 0 && std::size_t(a) + 4 <= triangle_->map->alpha.size(); });
  }
  template <bool kWraps>
  HWY_INLINE UintVec Lookup(std::uint32_t line, std::uint32_t any, UintVec& known) const;

  const ExactScene* scene_ = nullptr;
  const Packet* packet_ = nullptr;
  const AlphaTriangle* triangle_ = nullptr;
  Linear coordinate_[2], sum_;                        // numerators of u and v, in texels; denominator
  double most_[2];                                    // |coordinate| of the corners, in texels
  alignas(HWY_MAX_BYTES) float rounding_[kMaxLanes];  // of the denominator; of a numerator for each texel of `most_`
  float off_place_ = 0.0f;                            // samples lie so far off their places, along any axis
  // Since Refer:
  bool for_line_ = false;  // the samples of a line alone
  Place reference_;
  Step step_[2], sum_step_;
  IntVec first_[2];           // the whole numbers, wrapped into the texture
  LaneMask is_good_, wraps_;  // receivers for which float is enough, for which texels may lie beyond the border
  Vec most_off_;              // from the middle of a texel, along either axis: farther away the texel is open
};

bool PacketTexels::Set(const ExactScene& scene, const Packet& packet, const AlphaTriangle& triangle,
                       const PictureRange& range) {
  scene_ = &scene, packet_ = &packet, triangle_ = &triangle;
  const std::size_t size = std::size_t{triangle.width} * triangle.height;
  if (size < 4 || size >= std::size_t{1} << 31) return false;
  FindPlanes();
  for_line_ = scene.cloud != nullptr;  // whose samples in a range may lie far apart
  if (for_line_) return true;
  const Tag d;
  const SampleRows& rows = *scene.rows;
  const vec2 low(static_cast<float>(range.first_column) - rows.most_offset,
                 static_cast<float>(range.first_row) - rows.most_row_offset),
      high(static_cast<float>(range.last_column) - rows.least_offset,
           static_cast<float>(range.last_row) - rows.least_row_offset),
      middle = 0.5f * (low + high), away = 0.5f * (high - low) + 0.1f;
  Refer({hn::Set(d, middle.x), hn::Set(d, middle.y), hn::Zero(d)},
        {hn::Set(d, away.x), hn::Set(d, away.y), hn::Zero(d)});
  return true;
}

/// Of each receiver's sample i of a line.
HWY_INLINE PacketTexels::Place PacketTexels::PlaceOf(std::uint32_t line, std::uint32_t i) const {
  const Tag d;
  const SampleRows& rows = *scene_->rows;
  const std::size_t at = line * SampleRows::kWord + i;
  if (!rows.anywhere) {
    const PictureLines& l = *packet_->lines;
    return {hn::Sub(hn::Set(d, static_cast<float>(i) + 0.5f), hn::Load(d, l.offset[line])),
            hn::Mul(hn::Load(d, l.y[line]), hn::Set(d, rows.row_scale)), hn::Zero(d)};
  }
  if (scene_->cloud == nullptr) {
    const SamplePlace p(*packet_->places, at);
    return {p.column, p.row, hn::Zero(d)};
  }
  if (packet_->has_one_set) {
    const std::size_t from = std::size_t{packet_->set[0]} * rows.stride + at;
    return {hn::Set(d, rows.column_of[from]), hn::Set(d, rows.row_of[from]), hn::Set(d, rows.height_of[from])};
  }
  alignas(HWY_MAX_BYTES) float place[3][kMaxLanes];
  for (std::size_t lane = 0; lane < hn::Lanes(d); ++lane) {
    const std::size_t from = std::size_t{packet_->set[std::min(lane, packet_->count - 1)]} * rows.stride + at;
    place[0][lane] = rows.column_of[from], place[1][lane] = rows.row_of[from], place[2][lane] = rows.height_of[from];
  }
  return {hn::Load(d, place[0]), hn::Load(d, place[1]), hn::Load(d, place[2])};
}

/// The three functions, and how far off they may be.
void PacketTexels::FindPlanes() {
  const SampleRows& rows = *scene_->rows;
  const vec3& center = scene_->samples->center;
  const AlphaTriangle& triangle = *triangle_;
  const WideTag d;
  const NarrowTag narrow;
  const Tag df;
  struct Wide3 {
    Wide x, y, z;
  };
  const auto dot = [&](const Wide3& a, const Wide3& b)
                       HWY_ATTR { return hn::MulAdd(a.x, b.x, hn::MulAdd(a.y, b.y, hn::Mul(a.z, b.z))); };
  const auto norm1 = [&](const Wide3& a)
                         HWY_ATTR { return hn::Add(hn::Abs(a.x), hn::Add(hn::Abs(a.y), hn::Abs(a.z))); };
  const auto splat = [&](const dvec3& a) HWY_ATTR { return Wide3{hn::Set(d, a.x), hn::Set(d, a.y), hn::Set(d, a.z)}; };
  const Wide3 by_column = splat(dvec3(rows.axis_x) / double{rows.scale}),
              by_row = splat(dvec3(rows.axis_y) / double{rows.row_scale}), by_height = splat(scene_->frame.n);
  // Samples of a cloud are at their own places, rounded.
  off_place_ = 1.75f * rows.deviation;
  if (scene_->cloud != nullptr) {
    const vec3 reach = glm::max(glm::abs(scene_->cloud->low), glm::abs(scene_->cloud->high));
    off_place_ = 0x1p-23f * (reach.x + reach.y + reach.z);
  }
  double texel[3][2];
  most_[0] = most_[1] = 0.0;
  for (std::size_t i = 0; i < 3; ++i) {
    texel[i][0] = static_cast<double>(triangle.u[i]) * (triangle.width / kUvUnitsPerOne);
    texel[i][1] = static_cast<double>(triangle.v[i]) * (triangle.height / kUvUnitsPerOne);
    for (int k = 0; k < 2; ++k) most_[k] = std::max(most_[k], std::fabs(texel[i][k]) + 1.0);
  }
  alignas(HWY_MAX_BYTES) float position[3][kMaxLanes];
  hn::Store(packet_->position.x, df, position[0]), hn::Store(packet_->position.y, df, position[1]);
  hn::Store(packet_->position.z, df, position[2]);
  for (std::size_t lane = 0; lane < hn::Lanes(df); lane += hn::Lanes(d)) {
    const auto coordinate = [&](int axis)
                                HWY_ATTR { return hn::PromoteTo(d, hn::LoadU(narrow, position[axis] + lane)); };
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
      hn::Store(dot(p, by_column), d, to.by[0] + lane), hn::Store(dot(p, by_row), d, to.by[1] + lane);
      hn::Store(dot(p, by_height), d, to.by[2] + lane);
    };
    store(sum, sum_);
    // As in TexelLookup, with four times as many units of 2^-53 for the steps that come here.
    const double picture = rows.columns / double{rows.scale} + rows.rows / double{rows.row_scale};
    const Wide away = hn::Add(norm1(to_center), hn::Set(d, 4.0 * (picture + 1.0)));
    const Wide rounding = hn::Mul(hn::Set(d, 64.0 * 0x1p-53), hn::Mul(size_of, away));
    for (int k = 0; k < 2; ++k) store(plane[k], coordinate_[k]);
    hn::StoreU(hn::DemoteTo(narrow, rounding), narrow, rounding_ + lane);
  }
}

/// Takes a place of reference for samples that lie within `away` of it.
void PacketTexels::Refer(const Place& reference, const Place& away) {
  const WideTag d;
  const NarrowTag narrow;
  const Tag df;
  const IntTag di;
  reference_ = reference;
  alignas(HWY_MAX_BYTES) float place[3][kMaxLanes], numerator[2][4][kMaxLanes], denominator[4][kMaxLanes];
  alignas(HWY_MAX_BYTES) float whole[2][kMaxLanes];
  for (int k = 0; k < 3; ++k) hn::Store(reference[k], df, place[k]);
  for (std::size_t lane = 0; lane < hn::Lanes(df); lane += hn::Lanes(d)) {
    Wide at[3];
    for (int k = 0; k < 3; ++k) at[k] = hn::PromoteTo(d, hn::LoadU(narrow, place[k] + lane));
    const auto value = [&](const Linear& f) HWY_ATTR {
      Wide v = hn::Load(d, f.at_center + lane);
      for (int k = 0; k < 3; ++k) v = hn::MulAdd(hn::Load(d, f.by[k] + lane), at[k], v);
      return v;
    };
    const Wide s = value(sum_), sign = hn::CopySignToAbs(hn::Set(d, 1.0), s), inverse = hn::Div(hn::Set(d, 1.0), s);
    const auto store = [&](Wide v, float* to)
                           HWY_ATTR { hn::StoreU(hn::DemoteTo(narrow, hn::Mul(v, sign)), narrow, to + lane); };
    store(s, denominator[0]);
    for (int k = 0; k < 3; ++k) store(hn::Load(d, sum_.by[k] + lane), denominator[k + 1]);
    for (int axis = 0; axis < 2; ++axis) {
      const Linear& f = coordinate_[axis];
      const Wide u = value(f), ratio = hn::Mul(u, inverse);
      const Wide m = hn::IfThenElseZero(hn::Lt(hn::Abs(ratio), hn::Set(d, most_[axis])), hn::Floor(ratio));
      store(hn::NegMulAdd(m, s, u), numerator[axis][0]);
      for (int k = 0; k < 3; ++k)
        store(hn::NegMulAdd(m, hn::Load(d, sum_.by[k] + lane), hn::Load(d, f.by[k] + lane)), numerator[axis][k + 1]);
      const Wide wrapped = Wrap(m, axis == 0 ? triangle_->width : triangle_->height);
      hn::StoreU(hn::DemoteTo(narrow, wrapped), narrow, whole[axis] + lane);
    }
  }
  const auto step_of = [&](const float(*v)[kMaxLanes]) HWY_ATTR {
    return Step{hn::Load(df, v[0]), {hn::Load(df, v[1]), hn::Load(df, v[2]), hn::Load(df, v[3])}};
  };
  sum_step_ = step_of(denominator);
  // In units of 2^-24: a numerator is within 6 of its reach, the denominator as well, the ratio within 12 of itself. A
  // step in columns or rows is a difference of two places, which are rounded at 2^-24 of 64.
  const Vec units = hn::Set(df, 6.0f * 0x1p-24f);
  const SampleRows& rows = *scene_->rows;
  const Vec place_error[3] = {hn::Set(df, 64.0f * 0x1p-23f + off_place_ * rows.scale),
                              hn::Set(df, 64.0f * 0x1p-23f + off_place_ * rows.row_scale), hn::Set(df, off_place_)};
  const auto moved = [&](const Step& s) HWY_ATTR {
    return hn::MulAdd(hn::Abs(s.by[0]), place_error[0],
                      hn::MulAdd(hn::Abs(s.by[1]), place_error[1], hn::Mul(hn::Abs(s.by[2]), place_error[2])));
  };
  const Vec rounding = hn::Load(df, rounding_), sum_reach = sum_step_.Reach(away);
  const Vec off_sum = hn::MulAdd(units, sum_reach, hn::Add(rounding, moved(sum_step_)));
  // The least that the denominator may be.
  const Vec least = hn::Sub(hn::Sub(hn::Add(sum_step_.at, sum_step_.at), sum_reach), off_sum);
  const LaneMask positive = hn::Gt(least, hn::Zero(df));
  const Vec inverse_least = hn::Div(hn::Set(df, 1.0f), hn::IfThenElse(positive, least, hn::Set(df, 1e-20f)));
  Vec margin = hn::Zero(df);
  wraps_ = hn::Lt(margin, margin);
  for (int k = 0; k < 2; ++k) {
    step_[k] = step_of(numerator[k]);
    const Vec first = hn::Load(df, whole[k]), reach = step_[k].Reach(away), ratio = hn::Mul(reach, inverse_least);
    first_[k] = hn::ConvertTo(di, first);
    const Vec off = hn::MulAdd(
        units, reach, hn::MulAdd(hn::Set(df, static_cast<float>(2.0001 * most_[k])), rounding, moved(step_[k])));
    const Vec relative = hn::MulAdd(off_sum, inverse_least, hn::Add(units, units));
    margin = hn::Max(margin, hn::Mul(hn::MulAdd(off, inverse_least, hn::Mul(ratio, relative)), hn::Set(df, 1.001f)));
    const float size = static_cast<float>(k == 0 ? triangle_->width : triangle_->height);
    const Vec far = hn::Add(ratio, hn::Set(df, 2.0f));
    wraps_ = hn::Or(wraps_,
                    hn::Or(hn::Lt(hn::Sub(first, far), hn::Zero(df)), hn::Ge(hn::Add(first, far), hn::Set(df, size))));
    // Texels that are wrapped lie at most one texture away.
    is_good_ = k == 0 ? hn::Lt(far, hn::Set(df, size)) : hn::And(is_good_, hn::Lt(far, hn::Set(df, size)));
  }
  // A narrower reference might leave less open.
  const float most_margin = for_line_ ? 0.4f : 1.0f / 128.0f;
  is_good_ = hn::And(hn::And(is_good_, positive), hn::Lt(margin, hn::Set(df, most_margin)));
  most_off_ = hn::Sub(hn::Set(df, 0.5f - 1e-6f), margin);
}

/// The column or row of texels from the whole number of reference.
template <bool kWraps>
HWY_INLINE hn::Vec<IntTag> PacketTexels::Texel(int axis, Vec floor) const {
  const IntTag di;
  const auto texel = hn::Add(hn::ConvertTo(di, floor), first_[axis]);
  if (!kWraps) return texel;
  const auto size = hn::Set(di, static_cast<std::int32_t>(axis == 0 ? triangle_->width : triangle_->height));
  const auto from_zero = hn::IfThenElse(hn::Lt(texel, hn::Zero(di)), hn::Add(texel, size), texel);
  return hn::IfThenElse(hn::Lt(from_zero, size), from_zero, hn::Sub(from_zero, size));
}

/// Opaque samples of `any`, for all receivers; `known` are those whose texel is certain.
template <bool kWraps>
HWY_INLINE UintVec PacketTexels::Lookup(std::uint32_t line, std::uint32_t any, UintVec& known) const {
  const Tag d;
  const UintTag du;
  const IntTag di;
  const bool in_rows = !scene_->rows->anywhere, is_cloud = scene_->cloud != nullptr;
  const auto first = static_cast<std::uint32_t>(std::countr_zero(any));
  const auto* const alpha = reinterpret_cast<const std::int32_t*>(triangle_->map->alpha.data());
  const auto width = hn::Set(di, static_cast<std::int32_t>(triangle_->width)),
             top = hn::Set(di, static_cast<std::int32_t>(triangle_->height) - 1);
  const auto most_clear = hn::Set(di, static_cast<std::int32_t>(triangle_->threshold) - 1);
  const Vec half = hn::Set(d, 0.5f);
  // Receivers that ask for nothing here may see the texture wrap all the same.
  const LaneMask usable = kWraps ? is_good_ : hn::AndNot(wraps_, is_good_);
  Vec numerator[2], denominator;
  const auto step_to = [&](const Place& place) HWY_ATTR {
    const Place away{hn::Sub(place[0], reference_[0]), hn::Sub(place[1], reference_[1]),
                     hn::Sub(place[2], reference_[2])};
    for (int k = 0; k < 2; ++k) numerator[k] = step_[k](away, is_cloud);
    denominator = sum_step_(away, is_cloud);
  };
  step_to(PlaceOf(line, first));
  const Vec at_first[3] = {numerator[0], numerator[1], denominator};
  UintVec opaque = hn::Zero(du);
  known = opaque;
  for (; any != 0; any &= any - 1) {
    const UintVec bit = hn::Set(du, any & (0u - any));
    const auto i = static_cast<std::uint32_t>(std::countr_zero(any));
    if (in_rows) {
      const Vec columns = hn::Set(d, static_cast<float>(i - first));
      for (int k = 0; k < 2; ++k) numerator[k] = hn::MulAdd(step_[k].by[0], columns, at_first[k]);
      denominator = hn::MulAdd(sum_step_.by[0], columns, at_first[2]);
    } else if (i != first) {
      step_to(PlaceOf(line, i));
    }
    const Vec inverse = Reciprocal(denominator);
    const Vec u = hn::Mul(numerator[0], inverse), v = hn::Mul(numerator[1], inverse);
    const Vec floor_u = hn::Floor(u), floor_v = hn::Floor(v);
    const Vec off = hn::Max(hn::Abs(hn::Sub(hn::Sub(u, floor_u), half)), hn::Abs(hn::Sub(hn::Sub(v, floor_v), half)));
    const LaneMask certain = hn::And(usable, hn::Lt(off, most_off_));
    const auto column = Texel<kWraps>(0, hn::IfThenElseZero(certain, floor_u)),
               row = hn::Sub(top, Texel<kWraps>(1, hn::IfThenElseZero(certain, floor_v)));
    const auto at = hn::Add(hn::Mul(row, width), column);
    // The byte is the last of a word of four, or is in the first word.
    const auto word_at = hn::Max(hn::Sub(at, hn::Set(di, 3)), hn::Zero(di));
    const auto read_at = hn::IfThenElseZero(hn::RebindMask(di, certain), word_at);
    assert(IsInMap(read_at));
    const UintVec four = hn::BitCast(du, hn::GatherOffset(di, alpha, read_at));
    const UintVec shift = hn::ShiftLeft<3>(hn::BitCast(du, hn::Sub(at, word_at)));
    const auto byte = hn::BitCast(di, hn::And(hn::Shr(four, hn::And(shift, hn::Set(du, 31u))), hn::Set(du, 0xffu)));
    const UintVec sure = hn::IfThenElseZero(hn::RebindMask(du, certain), bit);
    known = hn::Or(known, sure);
    opaque = hn::Or(opaque, hn::IfThenElseZero(hn::RebindMask(du, hn::Gt(byte, most_clear)), sure));
  }
  return opaque;
}

HWY_INLINE UintVec PacketTexels::Opaque(std::uint32_t line, UintVec asked, UintVec& open) {
  const Tag d;
  const UintTag du;
  alignas(HWY_MAX_BYTES) std::uint32_t word[kMaxLanes];
  hn::Store(asked, du, word);
  std::uint32_t any = 0;
  for (std::size_t k = 0; k < hn::Lanes(d); ++k) any |= word[k];
  const LaneMask asking = hn::RebindMask(d, hn::Ne(asked, hn::Zero(du)));
  if (for_line_ || !hn::AllFalse(d, hn::AndNot(is_good_, asking))) {
    // One place of reference is not enough for all of the triangle.
    for_line_ = true;
    ReferToLine(line, any);
  }
  UintVec known;
  const UintVec opaque =
      hn::AllFalse(d, hn::And(wraps_, asking)) ? Lookup<false>(line, any, known) : Lookup<true>(line, any, known);
  open = hn::AndNot(known, asked);
  return hn::And(opaque, asked);
}

/// The middle one of a line's samples as reference.
void PacketTexels::ReferToLine(std::uint32_t line, std::uint32_t any) {
  const Tag d;
  std::uint32_t behind = any;  // from the middle one on
  for (int k = std::popcount(any) / 2; k > 0; --k) behind &= behind - 1;
  const Place reference = PlaceOf(line, static_cast<std::uint32_t>(std::countr_zero(behind)));
  Place away{hn::Zero(d), hn::Zero(d), hn::Zero(d)};
  for (; any != 0; any &= any - 1) {
    const Place p = PlaceOf(line, static_cast<std::uint32_t>(std::countr_zero(any)));
    for (int k = 0; k < 3; ++k) away[k] = hn::Max(away[k], hn::Abs(hn::Sub(p[k], reference[k])));
  }
  Refer(reference, away);
}

}  // namespace HWY_NAMESPACE
}  // namespace halfshade
HWY_AFTER_NAMESPACE();

#endif  // include guard
