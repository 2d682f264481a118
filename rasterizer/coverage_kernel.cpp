#include "rasterizer/coverage_kernel.h"

#include <algorithm>
#include <cstdlib>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "rasterizer/coverage_kernel.cpp"
#include "hwy/foreach_target.h"
// highway.h must follow foreach_target.h
#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace halfshade {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

// floor(e / divisor) in every lane, exact for quotients in [-65, 65], on the right side of that range otherwise.
// The estimate has three rounding errors of 2^-24 relative, at most 2^-15 for |quotient| <= 66 plus 2^-17 from the
// shift by 128: it is off by at most one, which the remainder tells. divisor is 1 .. 2^23.
template <class D, class V>
HWY_INLINE V FloorDivide(D d, V e, std::int32_t divisor) {
  const hn::RebindToFloat<D> df;
  const auto estimate = hn::Mul(hn::ConvertTo(df, e), hn::Set(df, 1.0f / static_cast<float>(divisor)));
  const auto clamped = hn::Min(hn::Max(estimate, hn::Set(df, -66.0f)), hn::Set(df, 66.0f));
  // Shifted to be positive, so that truncation rounds down.
  V quotient = hn::Sub(hn::ConvertTo(d, hn::Add(clamped, hn::Set(df, 128.0f))), hn::Set(d, 128));
  const V remainder = hn::Sub(e, hn::Mul(quotient, hn::Set(d, divisor)));
  quotient = hn::Add(quotient, hn::VecFromMask(d, hn::Lt(remainder, hn::Zero(d))));
  return hn::Sub(quotient, hn::VecFromMask(d, hn::Gt(remainder, hn::Set(d, divisor - 1))));
}

// Spans of rows first_row .. first_row + lanes - 1; rows past the box hold nonsense.
template <class D>
HWY_INLINE hn::VFromD<hn::RebindToUnsigned<D>> CoverLanes(D d, const TileTriangle& t, std::int32_t first_row) {
  auto begin = hn::Zero(d);
  auto end = hn::Set(d, t.width);
  const auto lane = hn::Iota(d, 0);
  for (std::size_t k = 0; k != 3; ++k) {
    const auto e = hn::Add(hn::Set(d, t.e[k] + first_row * t.b[k]), hn::Mul(hn::Set(d, t.b[k]), lane));
    if (t.a[k] == 0) {
      end = hn::IfThenZeroElse(hn::Lt(e, hn::Zero(d)), end);
    } else if (t.a[k] > 0) {  // inside from x >= ceil(-e / a) on
      begin = hn::Max(begin, hn::Neg(FloorDivide(d, e, t.a[k])));
    } else {  // inside up to x = floor(e / -a)
      end = hn::Min(end, hn::Add(FloorDivide(d, e, -t.a[k]), hn::Set(d, 1)));
    }
  }
  const auto column = hn::Set(d, t.column);
  const auto packed = hn::Or(hn::Add(begin, column), hn::ShiftLeft<16>(hn::Add(end, column)));
  return hn::BitCast(hn::RebindToUnsigned<D>(), hn::IfThenElseZero(hn::Lt(begin, end), packed));
}

void CoverRows(const TileTriangle* HWY_RESTRICT triangles, std::size_t count, RowSpan* HWY_RESTRICT spans,
               std::size_t capacity) {
  const hn::CappedTag<std::int32_t, kTileSize> d;
  const hn::RebindToUnsigned<decltype(d)> du;
  const std::size_t lanes = hn::Lanes(d);
  std::size_t written = 0;
  for (std::size_t i = 0; i != count; ++i) {
    const TileTriangle& triangle = triangles[i];
    for (std::size_t row = 0; row < triangle.height; row += lanes) {
      const auto rows = CoverLanes(d, triangle, static_cast<std::int32_t>(row));
      const std::size_t useful = std::min<std::size_t>(lanes, triangle.height - row);
      if (written + lanes <= capacity) {
        hn::StoreU(rows, du, spans + written);  // lanes past the box are overwritten by what follows
      } else {
        HWY_ALIGN RowSpan tail[kTileSize];
        hn::Store(rows, du, tail);
        std::copy_n(tail, useful, spans + written);
      }
      written += useful;
    }
  }
}

std::int64_t KernelTarget() { return HWY_TARGET; }

}  // namespace HWY_NAMESPACE
}  // namespace halfshade
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace halfshade {

HWY_EXPORT(CoverRows);
HWY_EXPORT(KernelTarget);

void cover_rows(std::span<const TileTriangle> triangles, std::span<RowSpan> spans) {
  HWY_DYNAMIC_DISPATCH(CoverRows)(triangles.data(), triangles.size(), spans.data(), spans.size());
}

std::int64_t coverage_kernel_target() { return HWY_DYNAMIC_DISPATCH(KernelTarget)(); }

}  // namespace halfshade
#endif  // HWY_ONCE
