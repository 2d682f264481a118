// Samples anywhere in the pictures of a packet, per instruction set: where rows are found by one multiplication, these
// are asked one by one, each for all receivers of the packet at once. Included once per Highway target by
// packet_kernel.cpp.

#if defined(HALFSHADE_PACKET_ANYWHERE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef HALFSHADE_PACKET_ANYWHERE_INL_H_
#undef HALFSHADE_PACKET_ANYWHERE_INL_H_
#else
#define HALFSHADE_PACKET_ANYWHERE_INL_H_
#endif

#include "shadows/packet_outline-inl.h"
#include "shadows/packet_triangle-inl.h"

HWY_BEFORE_NAMESPACE();
namespace halfshade {
namespace HWY_NAMESPACE {

/// Where a sample lies in each receiver's picture.
struct SamplePlace {
  Vec column, row;

  SamplePlace() = default;
  SamplePlace(const PlacedSamples& places, std::size_t at) {
    const Tag d;
    if (places.column != nullptr) {
      column = hn::Set(d, places.column[at]), row = hn::Set(d, places.row[at]);
    } else {
      column = hn::Load(d, places.place[at].column), row = hn::Load(d, places.place[at].row);
    }
  }
};

/// The samples of a packet's receivers. Where they differ between receivers: in their sets, or because they are a cloud
/// (`is_cloud`). A sample l of that is seen from r at l + (l - r) k with k = l_z / (r_z - l_z).
HWY_INLINE void PlaceSamples(const SampleRows& rows, bool is_cloud, const Packet& packet, PlacedSamples& places) {
  const Tag d;
  const std::uint8_t* const set = packet.set;
  const std::size_t first = std::size_t{set[0]} * rows.stride;
  places.column = places.row = nullptr;
  std::uint32_t used[kMaxLines];
  for (std::uint32_t line = 0; line < rows.lines; ++line) {
    used[line] = 0;
    for (std::size_t k = 0; k < kMaxLanes; ++k) {
      places.valid[line][k] = k < packet.count ? rows.valid_of(set[k], line) : 0;
      used[line] |= places.valid[line][k];
    }
  }
  if (packet.has_one_set && !is_cloud) {
    places.column = rows.column_of.data() + first, places.row = rows.row_of.data() + first;
    return;
  }
  places.place.resize(rows.stride), places.bounds.resize(rows.stride);
  const LaneMask in_packet = hn::FirstN(d, packet.count);
  const auto lowest = [&](Vec v) HWY_ATTR {
    return hn::GetLane(hn::MinOfLanes(d, hn::IfThenElse(in_packet, v, hn::Set(d, 1e30f))));
  };
  const auto highest = [&](Vec v) HWY_ATTR {
    return hn::GetLane(hn::MaxOfLanes(d, hn::IfThenElse(in_packet, v, hn::Set(d, -1e30f))));
  };
  for (std::uint32_t line = 0; line < rows.lines; ++line) {
    for (std::uint32_t bits = used[line]; bits != 0; bits &= bits - 1) {
      const std::size_t at = line * SampleRows::kWord + static_cast<std::size_t>(std::countr_zero(bits));
      const auto of_lanes = [&](const std::vector<float>& values) HWY_ATTR {
        if (packet.has_one_set) return hn::Set(d, values[first + at]);
        alignas(HWY_MAX_BYTES) float value[kMaxLanes];
        for (std::size_t k = 0; k < hn::Lanes(d); ++k)
          value[k] = values[std::size_t{set[std::min(k, packet.count - 1)]} * rows.stride + at];
        return hn::Load(d, value);
      };
      Vec column = of_lanes(rows.column_of), row = of_lanes(rows.row_of);
      if (is_cloud) {
        const Vec z = of_lanes(rows.height_of), k = hn::Div(z, hn::Sub(packet.height, z));
        column = hn::MulAdd(hn::Sub(column, packet.column), k, column);
        row = hn::MulAdd(hn::Sub(row, packet.row), k, row);
      }
      hn::Store(column, d, places.place[at].column), hn::Store(row, d, places.place[at].row);
      places.bounds[at] = {lowest(column), highest(column), lowest(row), highest(row)};
    }
  }
}

/// What SampleRows says of where samples lie, of a cloud as a packet sees it.
HWY_INLINE void BoundPlaces(const SampleCloud& cloud, const Packet& packet, const PlacedSamples& places,
                            SampleRows& rows) {
  rows.least_offset = rows.least_row_offset = 1e30f, rows.most_offset = rows.most_row_offset = -1e30f;
  float reach_row = 0.0f;
  for (std::uint32_t line = 0; line < rows.lines; ++line) {
    std::uint32_t used = 0;
    for (std::size_t k = 0; k < packet.count; ++k) used |= places.valid[line][k];
    const auto row = static_cast<float>(line % rows.rows);
    for (; used != 0; used &= used - 1) {
      const auto bit = static_cast<std::uint32_t>(std::countr_zero(used));
      const auto column = static_cast<float>(line / rows.rows * SampleRows::kWord + bit);
      const PlacedSamples::Bounds& b = places.bounds[line * SampleRows::kWord + bit];
      rows.least_offset = std::min(rows.least_offset, column - b.high_column);
      rows.most_offset = std::max(rows.most_offset, column - b.low_column);
      rows.least_row_offset = std::min(rows.least_row_offset, row - b.high_row);
      rows.most_row_offset = std::max(rows.most_row_offset, row - b.low_row);
      reach_row = std::max({reach_row, -b.low_row, b.high_row});
    }
  }
  rows.reach_y = reach_row / rows.row_scale;
  // In units of 2^-24: a coordinate of a sample is within |l - c|, one of a receiver and its height within 6 |r - c|,
  // and so k within its share of 7 (|r - c| + |l - c|) / (r_z - l_z); the rest is rounding.
  const Tag d;
  const vec3 size = glm::max(glm::abs(cloud.low), glm::abs(cloud.high));
  const float reach = size.x + size.y + size.z;
  const float far = reach + 0.2f * hn::GetLane(hn::MaxOfLanes(d, packet.place_error));  // which is 5 |r - c|
  const float above = packet.shaft.low[2] - cloud.high.z, k = size.z / above;
  rows.deviation = 0x1.1p-24f * (far * k * (8.0f * far / above + 20.0f) + 8.0f * reach);
}

/// A triangle's half planes, turned so that all limit from below: a sample is inside one where
/// sign column + slope row > limit.
class TriangleAnywhere {
 public:
  TriangleAnywhere(const SampleRows& rows, const PacketTriangle& triangle, const std::array<LaneMask, 4>& up)
      : count_(triangle.count) {
    const Tag d;
    const Vec one = hn::Set(d, 1.0f), per_row = hn::Set(d, 1.0f / rows.row_scale);
    for (std::size_t k = 0; k < count_; ++k) {
      const HalfPlane& h = triangle.planes[k];
      const Vec slope = hn::Mul(h.slope, per_row);
      sign_[k] = hn::IfThenElse(up[k], one, hn::Neg(one));
      slope_[k] = hn::IfThenElse(up[k], hn::Neg(slope), slope);
      inside_[k] = hn::IfThenElse(up[k], h.most, hn::Neg(h.least));
      possible_[k] = hn::IfThenElse(up[k], h.least, hn::Neg(h.most));
    }
  }

  HWY_INLINE void Test(const SamplePlace& p, LaneMask& possible, LaneMask& inside) const {
    const auto place = [&](std::size_t k)
                           HWY_ATTR { return hn::MulAdd(sign_[k], p.column, hn::Mul(slope_[k], p.row)); };
    possible = hn::Ge(place(0), possible_[0]), inside = hn::Gt(place(0), inside_[0]);
    for (std::size_t k = 1; k < count_; ++k) {
      possible = hn::And(possible, hn::Ge(place(k), possible_[k]));
      inside = hn::And(inside, hn::Gt(place(k), inside_[k]));
    }
  }

 private:
  std::size_t count_;
  Vec sign_[4], slope_[4], inside_[4], possible_[4];
};

/// Rounding of a sample's row, and of where an edge crosses it, in rows.
constexpr float kRowRounding = 2e-5f;

/// The edges as the receivers see them.
///
/// Where the ends of edges are rounded, the same for all edges that they belong to, a sample that no edge comes nearer
/// to than that is wound around as often as before. So only samples near to an edge are doubtful.
HWY_INLINE void GroupOutline::SetAnywhere() {
  const Tag d;
  const IntTag di;
  const Vec row_scale = hn::Set(d, rows_.row_scale), scale = hn::Set(d, rows_.scale), half = hn::Set(d, 0.5f);
  for (std::uint32_t e = 0; e < edges_.count; ++e) {
    const std::size_t a = edges_.from[e], b = edges_.to[e];
    const Vec xa = hn::Load(d, vertices_.column[a]), xb = hn::Load(d, vertices_.column[b]),
              ya = hn::Load(d, vertices_.row[a]), yb = hn::Load(d, vertices_.row[b]);
    const Vec dx = hn::Sub(xb, xa), dy = hn::Sub(yb, ya);
    const Vec error =
        hn::Add(hn::Max(hn::Load(d, vertices_.error[a]), hn::Load(d, vertices_.error[b])), hn::Set(d, rows_.deviation));
    const Vec off = hn::MulAdd(error, row_scale, hn::Set(d, kRowRounding));
    const LaneMask level = hn::Le(hn::Abs(dy), hn::Mul(off, hn::Set(d, 4.0f)));
    const Vec slope = hn::IfThenZeroElse(level, hn::Mul(dx, Reciprocal(hn::IfThenElse(level, hn::Set(d, 1.0f), dy))));
    const Vec rounding = hn::MulAdd(hn::Add(hn::Abs(xa), hn::Abs(xb)), hn::Set(d, 0x1p-19f), hn::Set(d, 0x1p-15f));
    Vec width = hn::MulAdd(error, scale, hn::MulAdd(hn::Abs(slope), off, rounding));
    width = hn::Add(width, hn::IfThenElseZero(level, hn::Mul(hn::Abs(dx), half)));
    hn::Store(slope, d, edges_.slope[e]);
    hn::Store(width, d, edges_.width[e]);
    hn::Store(hn::IfThenElse(level, hn::MulAdd(dx, half, xa), hn::NegMulAdd(slope, ya, xa)), d, edges_.column[e]);
    hn::Store(ya, d, edges_.end_row[0][e]);
    hn::Store(yb, d, edges_.end_row[1][e]);
    if (e < edges_.fixed) continue;
    const LaneMask positive = LanesFromBits(edges_.turn[e] >> 16, 0), negative = LanesFromBits(edges_.turn[e], 0);
    const auto turned = hn::IfThenElseZero(hn::RebindMask(di, negative), hn::Set(di, -1));
    hn::Store(hn::IfThenElse(hn::RebindMask(di, positive), hn::Set(di, 1), turned), di, edges_.sign[e]);
  }
  for (std::uint32_t e = edges_.count; e % hn::Lanes(d) != 0; ++e)
    edges_.rows.low[e] = 1e30f, edges_.rows.high[e] = -1e30f;
}

/// The receivers for which a row passes between the ends of an edge, or nearly so.
HWY_INLINE LaneMask GroupOutline::EndsNear(std::size_t e, Vec row) const {
  const Tag d;
  const Vec ya = hn::Load(d, edges_.end_row[0][e]), yb = hn::Load(d, edges_.end_row[1][e]);
  const Vec error =
      hn::Add(hn::Max(hn::Load(d, vertices_.error[edges_.from[e]]), hn::Load(d, vertices_.error[edges_.to[e]])),
              hn::Set(d, rows_.deviation));
  const Vec off = hn::MulAdd(error, hn::Set(d, rows_.row_scale), hn::Set(d, kRowRounding));
  return hn::And(hn::Ge(row, hn::Sub(hn::Min(ya, yb), off)), hn::Le(row, hn::Add(hn::Max(ya, yb), off)));
}

/// The receivers for which the outline winds around a sample, and those for which that is uncertain.
HWY_INLINE LaneMask GroupOutline::WindSample(std::size_t at, LaneMask& doubtful) const {
  const Tag d;
  const IntTag di;
  const PlacedSamples& places = *packet_.places;
  const SamplePlace sample(places, at);
  const PlacedSamples::Bounds bounds =
      places.column == nullptr
          ? places.bounds[at]
          : PlacedSamples::Bounds{places.column[at], places.column[at], places.row[at], places.row[at]};
  const Vec low_column = hn::Set(d, bounds.low_column), high_column = hn::Set(d, bounds.high_column),
            low_row = hn::Set(d, bounds.low_row), high_row = hn::Set(d, bounds.high_row);
  auto around = hn::Zero(di);
  doubtful = hn::Lt(low_row, low_row);
  const auto ends_behind = [&](std::size_t e, int end)
                               HWY_ATTR { return hn::Le(hn::Load(d, edges_.end_row[end][e]), sample.row); };
  using Signs = decltype(around);
  const auto cross = [&](LaneMask to, LaneMask from, Signs sign) HWY_ATTR {
    around = hn::IfThenElse(hn::RebindMask(di, to), hn::Add(around, sign), around);
    around = hn::IfThenElse(hn::RebindMask(di, from), hn::Sub(around, sign), around);
  };
  const auto wind_beside = [&](std::uint64_t bits, std::size_t first, const auto& sign_of) HWY_ATTR {
    for (; bits != 0; bits &= bits - 1) {
      const std::size_t e = first + static_cast<std::size_t>(std::countr_zero(bits));
      cross(ends_behind(e, 1), ends_behind(e, 0), sign_of(e));
    }
  };
  const auto wind_over = [&](std::uint64_t bits, std::size_t first, const auto& sign_of) HWY_ATTR {
    for (; bits != 0; bits &= bits - 1) {
      const std::size_t e = first + static_cast<std::size_t>(std::countr_zero(bits));
      const Vec x = hn::MulAdd(hn::Load(d, edges_.slope[e]), sample.row, hn::Load(d, edges_.column[e]));
      const Vec beyond = hn::Sub(sample.column, x);
      const LaneMask right = hn::Gt(beyond, hn::Zero(d)), near = hn::Le(hn::Abs(beyond), hn::Load(d, edges_.width[e]));
      const auto sign = sign_of(e);
      if (!hn::AllFalse(d, near)) {
        const LaneMask is_edge = hn::RebindMask(d, hn::Ne(sign, hn::Zero(di)));
        doubtful = hn::Or(doubtful, hn::And(hn::And(near, is_edge), EndsNear(e, sample.row)));
      }
      cross(hn::And(right, ends_behind(e, 1)), hn::And(right, ends_behind(e, 0)), sign);
    }
  };
  const auto one = hn::Set(di, 1);
  const auto plus = [&](std::size_t) HWY_ATTR { return one; };
  const auto turned = [&](std::size_t e) HWY_ATTR { return hn::Load(di, edges_.sign[e]); };
  for (std::size_t first = 0; first < edges_.count; first += hn::Lanes(d)) {
    const LaneMask on_row = hn::And(hn::Le(hn::Load(d, edges_.rows.low + first), high_row),
                                    hn::Ge(hn::Load(d, edges_.rows.high + first), low_row));
    const LaneMask reaches = hn::And(on_row, hn::Le(hn::Load(d, edges_.columns.low + first), high_column));
    if (hn::AllFalse(d, reaches)) continue;
    const std::uint64_t meet = Bits(reaches),
                        over = Bits(hn::And(reaches, hn::Ge(hn::Load(d, edges_.columns.high + first), low_column))),
                        beside = meet ^ over;
    const std::uint64_t fixed =
        first >= edges_.fixed ? 0 : ~std::uint64_t{0} >> (64 - std::min<std::size_t>(edges_.fixed - first, 64));
    wind_over(over & fixed, first, plus), wind_beside(beside & fixed, first, plus);
    wind_over(over & ~fixed, first, turned), wind_beside(beside & ~fixed, first, turned);
  }
  return hn::RebindMask(d, hn::Ne(around, hn::Zero(di)));
}

}  // namespace HWY_NAMESPACE
}  // namespace halfshade
HWY_AFTER_NAMESPACE();

#endif  // include guard
