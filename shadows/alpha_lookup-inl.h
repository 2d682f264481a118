// TexelLookup (alpha.h) for a run of light samples at a time, per instruction set: the same bound, the same texels.

#if defined(HALFSHADE_ALPHA_LOOKUP_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef HALFSHADE_ALPHA_LOOKUP_INL_H_
#undef HALFSHADE_ALPHA_LOOKUP_INL_H_
#else
#define HALFSHADE_ALPHA_LOOKUP_INL_H_
#endif

#include <hwy/highway.h>

#include <bit>

#include "shadows/alpha.h"

HWY_BEFORE_NAMESPACE();
namespace halfshade {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using WideTag = hn::ScalableTag<double>;
using NarrowTag = hn::Rebind<float, WideTag>;
using Wide = hn::Vec<WideTag>;
constexpr std::size_t kMaxWideLanes = HWY_MAX_BYTES / sizeof(double);

HWY_INLINE Wide WideDot(const dvec3& a, Wide x, Wide y, Wide z) {
  const WideTag d;
  return hn::MulAdd(hn::Set(d, a.x), x, hn::MulAdd(hn::Set(d, a.y), y, hn::Mul(hn::Set(d, a.z), z)));
}

/// Whole number in [0, size) that differs from `x` by a multiple of `size`. The quotient may be off by one where x is
/// near a multiple; |x| < 2^46, so everything else is exact.
HWY_INLINE Wide Wrap(Wide x, double size) {
  const WideTag d;
  const Wide n = hn::Set(d, size), zero = hn::Zero(d);
  Wide rest = hn::Sub(x, hn::Mul(hn::Floor(hn::Mul(x, hn::Set(d, 1.0 / size))), n));
  rest = hn::IfThenElse(hn::Lt(rest, zero), hn::Add(rest, n), rest);
  return hn::IfThenElse(hn::Ge(rest, n), hn::Sub(rest, n), rest);
}

/// Texels of hn::Lanes(WideTag()) samples at x, y, z (lattice), as row * width + column; the samples whose texel
/// the bound leaves open get -1.
HWY_INLINE void FindTexels(const TexelLookup::Planes& p, const TexturedTriangle& triangle, const vec3& receiver,
                           const float* x, const float* y, const float* z, double* texels) {
  const WideTag d;
  const NarrowTag narrow;
  const Wide sx = hn::Sub(hn::PromoteTo(d, hn::LoadU(narrow, x)), hn::Set(d, double{receiver.x}));
  const Wide sy = hn::Sub(hn::PromoteTo(d, hn::LoadU(narrow, y)), hn::Set(d, double{receiver.y}));
  const Wide sz = hn::Sub(hn::PromoteTo(d, hn::LoadU(narrow, z)), hn::Set(d, double{receiver.z}));
  const Wide one = hn::Set(d, 1.0), sum = WideDot(p.sum, sx, sy, sz), inverse = hn::Div(one, sum);
  const Wide spread = hn::Mul(hn::Set(d, p.error), hn::Add(hn::Abs(sx), hn::Add(hn::Abs(sy), hn::Abs(sz))));
  const Wide share = hn::MulAdd(hn::Mul(hn::Set(d, 2.0), spread), hn::Abs(inverse), hn::Set(d, 12.0 * 0x1p-53));
  const Wide error = hn::Mul(hn::Set(d, 2.0 * p.reach), share);
  const Wide u = hn::Mul(WideDot(p.u, sx, sy, sz), inverse), v = hn::Mul(WideDot(p.v, sx, sy, sz), inverse);
  const Wide column = hn::Floor(u), up = hn::Floor(v);
  const Wide in_column = hn::Sub(u, column), in_row = hn::Sub(v, up);
  const Wide border = hn::Min(hn::Min(in_column, hn::Sub(one, in_column)), hn::Min(in_row, hn::Sub(one, in_row)));
  const auto certain = hn::And(hn::Gt(hn::Abs(sum), hn::Mul(hn::Set(d, 4.0), spread)), hn::Gt(border, error));
  const double width = triangle.width, height = triangle.height;
  const Wide row = hn::Sub(hn::Set(d, height - 1.0), Wrap(up, height));
  const Wide texel = hn::MulAdd(row, hn::Set(d, width), Wrap(column, width));
  hn::StoreU(hn::IfThenElse(certain, texel, hn::Set(d, -1.0)), d, texels);
}

/// Of the samples in `wanted` (bit i: sample i of the arrays, which are readable up to a whole vector), those whose
/// texel is opaque. Requires that the triangle blocks them.
HWY_INLINE std::uint32_t OpaqueSamples(const AlphaTriangle& triangle, const TexelLookup& lookup, const vec3& receiver,
                                       const float* x, const float* y, const float* z, std::uint32_t wanted,
                                       std::uint64_t& exact_fallbacks) {
  const std::size_t lanes = hn::Lanes(WideTag());
  const std::uint32_t chunk_bits = lanes >= 32 ? ~0u : (1u << lanes) - 1;
  std::uint32_t opaque = 0;
  for (std::size_t i = 0; i < 32 && wanted >> i != 0; i += lanes) {
    std::uint32_t chunk = (wanted >> i) & chunk_bits;
    if (chunk == 0) continue;
    alignas(HWY_MAX_BYTES) double texels[kMaxWideLanes];
    FindTexels(lookup.planes(), triangle, receiver, x + i, y + i, z + i, texels);
    for (; chunk != 0; chunk &= chunk - 1) {
      const auto k = static_cast<std::size_t>(std::countr_zero(chunk));
      bool is_opaque;
      if (texels[k] >= 0.0) {
        is_opaque = triangle.map->alpha[static_cast<std::size_t>(texels[k])] >= triangle.threshold;
      } else {
        is_opaque = opaque_at_hit(triangle, receiver, {x[i + k], y[i + k], z[i + k]}, &exact_fallbacks);
      }
      opaque |= std::uint32_t{is_opaque} << (i + k);
    }
  }
  return opaque;
}

}  // namespace HWY_NAMESPACE
}  // namespace halfshade
HWY_AFTER_NAMESPACE();

#endif  // include guard
