// Triangles that a packet of receivers takes singly, per instruction set: those that have no part in an outline, being
// textured, a receiver's own, so near to its height that they project badly, or too few. Each is drawn into all
// pictures at once. Samples too near to an edge for the error bounds go to the exact predicate. Included once per
// Highway target by packet_kernel.cpp.

#if defined(HALFSHADE_PACKET_SINGLES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef HALFSHADE_PACKET_SINGLES_INL_H_
#undef HALFSHADE_PACKET_SINGLES_INL_H_
#else
#define HALFSHADE_PACKET_SINGLES_INL_H_
#endif

#include <optional>

#include "shadows/packet_anywhere-inl.h"
#include "shadows/packet_texels-inl.h"

HWY_BEFORE_NAMESPACE();
namespace halfshade {
namespace HWY_NAMESPACE {

/// Of one packet after the other.
class SingleTriangles {
 public:
  /// `changed`: lines of the packet in which samples were blocked.
  SingleTriangles(const ExactScene& scene, Packet& packet, LineSet& changed, KernelCounters& counters)
      : scene_(scene), rows_(*scene.rows), packet_(packet), changed_lines_(changed), counters_(counters) {}

  /// For a packet anew.
  void Begin() { texels_of_ = nullptr; }
  bool Rasterize(std::size_t leaf, const LeafView& view, std::uint32_t wanted);

 private:
  bool RasterizeTriangle(std::size_t leaf, const LeafView& view, std::size_t lane);
  HWY_NOINLINE UintVec TestSamples(const TriangleAnywhere& triangle, const PictureRange& range, std::uint32_t line,
                                   UintVec& inside) const;
  HWY_INLINE void SetPlanes(PacketTriangle& triangle) const;
  HWY_INLINE LaneMask FindBelow(const PacketTriangle& triangle, LaneMask& active, const PictureRange& range,
                                const LineSet& lines);
  HWY_INLINE bool Draw(const PacketTriangle& triangle, const PictureRange& range, const LineSet& lines, LaneMask below,
                       LaneMask active);
  HWY_INLINE std::array<LaneMask, 4> Orient(const PacketTriangle& triangle, LaneMask below) const;
  UintVec Settle(const PacketTriangle& triangle, const PictureRange& range, std::uint32_t line, UintVec possible,
                 UintVec inside);
  UintVec OpaqueOf(const AlphaTriangle& alpha, const PictureRange& range, std::uint32_t line, UintVec inside);

  const ExactScene& scene_;
  const SampleRows& rows_;
  Packet& packet_;
  LineSet& changed_lines_;
  KernelCounters& counters_;
  ProjectedVertices vertices_;                // of the leaf at work
  const AlphaTriangle* texels_of_ = nullptr;  // the perforated triangle that these belong to:
  PacketTexels texels_;                       // where `has_texels_`
  bool has_texels_ = false;
  std::optional<TexelLookup> lookups_[kMaxLanes];  // made when first needed
};

/// The triangles of `wanted`, one by one; true where samples were blocked.
bool SingleTriangles::Rasterize(std::size_t index, const LeafView& view, std::uint32_t wanted) {
  const BlockerTree::Leaf& leaf = scene_.tree->leaves[index];
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
    added |= RasterizeTriangle(index, view, static_cast<std::size_t>(std::countr_zero(rest)));
  return added;
}

/// The planes through receivers and edges, and the triangle's own where it cuts the light.
HWY_INLINE void SingleTriangles::SetPlanes(PacketTriangle& triangle) const {
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
  if (!triangle.samples_above || !triangle.samples_below) return;
  if (scene_.cloud != nullptr) {
    // Above all samples it hides what lies behind it.
    const auto is_above = [&](const vec3& p) {
      return scene_.frame.to_frame(dvec3(p)).z > double{scene_.cloud->high.z};
    };
    triangle.cuts_cloud = !std::all_of(triangle.corner.begin(), triangle.corner.end(), is_above);
    return;
  }
  const BlockerPlane& plane = triangle.plane;
  const SampleSides sides = sides_of_samples(plane, triangle.corner[0], *scene_.samples);
  const float error = sides.plane_error + plane.side_error * (rows_.deviation / kDeterminantError);
  triangle.planes[3] =
      SolveForX(rows_, hn::Set(d, glm::dot(plane.normal, rows_.axis_x)),
                hn::Set(d, glm::dot(plane.normal, rows_.axis_y)), hn::Set(d, sides.plane_at_center), hn::Set(d, error));
  triangle.count = 4;
}

/// Half planes turned to where the receiver sees the triangle from.
HWY_INLINE std::array<LaneMask, 4> SingleTriangles::Orient(const PacketTriangle& triangle, LaneMask below) const {
  std::array<LaneMask, 4> up;
  for (std::size_t k = 0; k < 4; ++k) up[k] = hn::Xor(triangle.planes[k < triangle.count ? k : 0].up, below);
  return up;
}

/// Of a line's samples that are in the range and open to somebody, those that may be inside the triangle, and those
/// that certainly are.
UintVec SingleTriangles::TestSamples(const TriangleAnywhere& triangle, const PictureRange& range, std::uint32_t line,
                                     UintVec& inside) const {
  const UintTag du;
  UintVec possible = hn::Zero(du);
  inside = possible;
  const auto from = static_cast<std::int32_t>(line / rows_.rows * SampleRows::kWord);
  for (std::uint32_t asked = range.bits(from) & packet_.any_open[line]; asked != 0; asked &= asked - 1) {
    const auto i = static_cast<std::size_t>(std::countr_zero(asked));
    const UintVec bit = hn::Set(du, 1u << i);
    LaneMask may, is;
    triangle.Test(SamplePlace(*packet_.places, line * SampleRows::kWord + i), may, is);
    possible = hn::Or(possible, hn::IfThenElseZero(hn::RebindMask(du, may), bit));
    inside = hn::Or(inside, hn::IfThenElseZero(hn::RebindMask(du, is), bit));
  }
  return possible;
}

/// The lanes whose receiver lies above the plane, along the normal ("the plane is below it"). Takes those for which the
/// triangle hides nothing out of `active`.
HWY_INLINE LaneMask SingleTriangles::FindBelow(const PacketTriangle& triangle, LaneMask& active,
                                               const PictureRange& range, const LineSet& lines) {
  const Tag d;
  const BlockerPlane& plane = triangle.plane;
  const Vec3 to_corner = Subtract(Splat(triangle.corner[0]), packet_.position);
  const Vec side = Dot(Splat(plane.normal), to_corner), error = hn::Mul(hn::Set(d, plane.side_error), Norm1(to_corner));
  LaneMask below = hn::Lt(side, hn::Neg(error));
  const LaneMask none = hn::Lt(hn::Set(d, 0.0f), hn::Zero(d));
  LaneMask wanted = hn::Or(triangle.samples_above ? hn::Gt(side, error) : none, triangle.samples_below ? below : none);
  const LaneMask unknown = hn::And(active, hn::Le(hn::Abs(side), error));
  if (!hn::AllFalse(d, unknown)) {
    // Only the exact predicate can tell; it is asked for receivers that would lose something one way or the other.
    LaneMask matters = none;
    for (const LaneMask turned : {none, hn::Not(none)}) {
      const std::array<LaneMask, 4> up = Orient(triangle, turned);
      const Outline outline(triangle, up, Bits(unknown));
      std::optional<TriangleAnywhere> anywhere;
      if (rows_.anywhere) anywhere.emplace(rows_, triangle, up);
      lines.for_each([&](std::uint32_t line) HWY_ATTR {
        const UintTag du;
        const PictureLines& l = *packet_.lines;
        UintVec inside;
        const UintVec possible = hn::And(
            rows_.anywhere
                ? TestSamples(*anywhere, range, line, inside)
                : outline.possible(hn::Load(d, l.y[line]), hn::Load(d, l.offset[line]), hn::Load(d, l.rest[line])),
            hn::Load(du, packet_.open[line]));
        matters = hn::Or(matters, hn::RebindMask(d, hn::Ne(possible, hn::Zero(du))));
      });
    }
    for (std::uint64_t rest = Bits(hn::And(unknown, matters)); rest != 0; rest &= rest - 1) {
      const auto lane = static_cast<std::size_t>(std::countr_zero(rest));
      ++counters_.exact_fallbacks;
      const int sign = orient3d(triangle.corner[0], triangle.corner[1], triangle.corner[2], packet_.at(lane));
      if (sign == 0 || !(sign < 0 ? triangle.samples_below : triangle.samples_above)) continue;
      const LaneMask this_lane = LanesFromBits(1u << lane, 0);
      wanted = hn::Or(wanted, this_lane);
      if (sign < 0) below = hn::Or(below, this_lane);
    }
  }
  active = hn::And(active, wanted);
  return below;
}

/// The samples of a line that the triangle blocks, of those that it may block and those that it certainly meets.
UintVec SingleTriangles::Settle(const PacketTriangle& triangle, const PictureRange& range, std::uint32_t line,
                                UintVec possible, UintVec inside) {
  const UintTag du;
  const UintVec doubtful = hn::AndNot(inside, possible);
  if (!hn::AllTrue(du, hn::Eq(doubtful, hn::Zero(du)))) {
    const auto& [a, b, c] = triangle.corner;
    alignas(HWY_MAX_BYTES) std::uint32_t in_doubt[kMaxLanes], does[kMaxLanes];
    hn::Store(doubtful, du, in_doubt), hn::Store(inside, du, does);
    for (std::size_t lane = 0; lane < packet_.count; ++lane) {
      if (in_doubt[lane] == 0) continue;
      const LinePoints points(rows_, packet_, lane, line);
      for (std::uint32_t rest = in_doubt[lane]; rest != 0; rest &= rest - 1) {
        const auto bit = static_cast<std::size_t>(std::countr_zero(rest));
        ++counters_.exact_fallbacks;
        does[lane] |= std::uint32_t{blocks(a, b, c, packet_.at(lane), points[bit])} << bit;
      }
    }
    inside = hn::Load(du, does);
  }
  const bool none = hn::AllTrue(du, hn::Eq(inside, hn::Zero(du)));
  return triangle.alpha == nullptr || none ? inside : OpaqueOf(*triangle.alpha, range, line, inside);
}

/// Of a line's samples, all blocked by the triangle, those that meet an opaque texel of it.
UintVec SingleTriangles::OpaqueOf(const AlphaTriangle& alpha, const PictureRange& range, std::uint32_t line,
                                  UintVec inside) {
  const UintTag du;
  if (texels_of_ != &alpha) {
    texels_of_ = &alpha;
    has_texels_ = texels_.Set(scene_, packet_, alpha, range);
    std::fill(std::begin(lookups_), std::end(lookups_), std::nullopt);
  }
  UintVec opaque = hn::Zero(du), open = inside;
  if (has_texels_) opaque = texels_.Opaque(line, inside, open);
  if (hn::AllTrue(du, hn::Eq(open, hn::Zero(du)))) return opaque;
  alignas(HWY_MAX_BYTES) std::uint32_t asked[kMaxLanes], is[kMaxLanes];
  hn::Store(open, du, asked), hn::Store(opaque, du, is);
  for (std::size_t lane = 0; lane < packet_.count; ++lane) {
    if (asked[lane] == 0) continue;
    const LinePoints points(rows_, packet_, lane, line);
    if (!lookups_[lane]) lookups_[lane].emplace(alpha, packet_.at(lane));
    is[lane] |= OpaqueSamples(alpha, *lookups_[lane], packet_.at(lane), points.x, points.y, points.z, asked[lane],
                              counters_.exact_fallbacks);
  }
  return hn::Load(du, is);
}

HWY_INLINE bool SingleTriangles::Draw(const PacketTriangle& triangle, const PictureRange& range, const LineSet& lines,
                                      LaneMask below, LaneMask active) {
  const Tag d;
  const UintTag du;
  const std::array<LaneMask, 4> up = Orient(triangle, below);
  const Outline outline(triangle, up, Bits(active));
  std::optional<TriangleAnywhere> anywhere;
  if (rows_.anywhere) anywhere.emplace(rows_, triangle, up);
  const auto wanted = hn::VecFromMask(du, hn::RebindMask(du, active));
  bool added = false;
  lines.for_each([&](std::uint32_t line) HWY_ATTR {
    const PictureLines& l = *packet_.lines;
    const Vec y = hn::Load(d, l.y[line]), offset = hn::Load(d, l.offset[line]), rest = hn::Load(d, l.rest[line]);
    const UintVec open = hn::Load(du, packet_.open[line]), asked = hn::And(open, wanted);
    UintVec inside;
    const UintVec possible = hn::And(
        asked, rows_.anywhere ? TestSamples(*anywhere, range, line, inside) : outline.possible(y, offset, rest));
    ++counters_.sample_tests;
    if (hn::AllTrue(du, hn::Eq(possible, hn::Zero(du)))) return;
    inside = hn::And(asked, rows_.anywhere ? inside : outline.inside(y, offset, rest));
    if (triangle.cuts_cloud) inside = hn::Zero(du);
    if (triangle.alpha != nullptr || !hn::AllTrue(du, hn::Eq(possible, inside))) {
      inside = Settle(triangle, range, line, possible, inside);
      if (hn::AllTrue(du, hn::Eq(inside, hn::Zero(du)))) return;
    }
    hn::Store(hn::AndNot(inside, open), du, packet_.open[line]);
    changed_lines_.add(line);
    added = true;
  });
  return added;
}

/// One triangle into all pictures; true where samples were blocked.
bool SingleTriangles::RasterizeTriangle(std::size_t index, const LeafView& view, std::size_t lane) {
  const Tag d;
  const UintTag du;
  const BlockerTree::Leaf& leaf = scene_.tree->leaves[index];
  const BlockerFit::Leaf& fit = scene_.fit->leaves[index];
  const PictureRange range(rows_, view.ranges, lane);
  LaneMask active =
      hn::And(hn::FirstN(d, packet_.count), hn::RebindMask(d, hn::Ne(packet_.own, hn::Set(du, leaf.triangle[lane]))));
  LineSet lines;
  if ((view.bounded >> lane) & 1) {
    const std::array<std::uint8_t, 3> corner = {leaf.corner_vertex[0][lane], leaf.corner_vertex[1][lane],
                                                leaf.corner_vertex[2][lane]};
    active = hn::And(active, ReceiversOverOpenSamples(rows_, corner, view.pad[lane], vertices_, range, packet_, lines));
  } else {
    active = hn::And(active, ReceiversBelow(rows_, scene_.frame, leaf, lane, packet_));
    if (hn::AllFalse(d, active)) return false;
    range.for_open_lines(rows_, packet_, [&](std::uint32_t line, std::uint32_t) {
      lines.add(line);
      return false;
    });
  }
  if (hn::AllFalse(d, active)) return false;
  PacketTriangle triangle;
  triangle.alpha = (leaf.perforated >> lane & 1) != 0 ? &scene_.fit->alpha_of(*scene_.tree, index, lane) : nullptr;
  for (std::size_t k = 0; k < 3; ++k) triangle.corner[k] = leaf.corner_at(k, lane);
  triangle.plane = leaf.plane_at(lane);
  triangle.samples_above = fit.samples_above >> lane & 1, triangle.samples_below = fit.samples_below >> lane & 1;
  SetPlanes(triangle);
  const bool above = (view.above >> lane) & 1, below = (view.below >> lane) & 1;
  const LaneMask none = hn::Lt(hn::Set(d, 0.0f), hn::Zero(d));
  LaneMask is_below = below ? hn::Not(none) : none;
  if (!above && !below) {
    is_below = FindBelow(triangle, active, range, lines);
    if (hn::AllFalse(d, active)) return false;
  }
  ++counters_.pairs_sampled;
  if (!Draw(triangle, range, lines, is_below, active)) return false;
  ++counters_.pairs_necessary;
  return true;
}

}  // namespace HWY_NAMESPACE
}  // namespace halfshade
HWY_AFTER_NAMESPACE();

#endif  // include guard
