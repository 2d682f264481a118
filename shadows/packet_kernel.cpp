// The exact engine: a packet of receivers, one in each vector lane, sees the light as a picture of rows of samples, and
// triangles are rasterized into all of the packet's pictures at once. Samples too near to an edge for the error bounds
// go to the exact predicate.
//
// What is decided once for the whole packet: which leaves, which of a leaf's triangles (16 at a time), which rows.
#include <optional>

#include "rasterizer/core/stopwatch.h"
#include "shadows/packet_kernel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "shadows/packet_kernel.cpp"
#include <hwy/foreach_target.h>

#include "shadows/cluster_beams-inl.h"
#include "shadows/packet_texels-inl.h"

HWY_BEFORE_NAMESPACE();
namespace halfshade {
namespace HWY_NAMESPACE {

/// A packet at work on its receivers.
class PacketSolver {
 public:
  PacketSolver(const ExactScene& scene, const ReceiverBox& cluster, KernelReceivers& receivers, ExactScratch& scratch)
      : scene_(scene),
        rows_(*scene.rows),
        cluster_(cluster),
        receivers_(receivers),
        scratch_(scratch),
        counters_(scratch.counters),
        outline_(scene, packet_, scratch) {}

  HWY_INLINE void Solve(std::size_t first, std::size_t count) {
    if (!Begin(first, count)) return;
    const std::size_t lanes = hn::Lanes(Tag());
    const float* const low[3] = {scratch_.low[0].data(), scratch_.low[1].data(), scratch_.low[2].data()};
    const float* const high[3] = {scratch_.high[0].data(), scratch_.high[1].data(), scratch_.high[2].data()};
    bool any = false;
    PictureRanges ranges;
    for (std::size_t i = 0; i < scratch_.group.size(); i += lanes) {
      for (std::uint64_t bits = BoxesOverOpenSamples(rows_, low, high, i, packet_, 0, ranges); bits != 0;
           bits &= bits - 1) {
        const std::size_t at = i + static_cast<std::size_t>(std::countr_zero(bits));
        if (!RasterizeGroup(scene_.fit->nodes[scratch_.group[at]], scratch_.groups[at])) continue;
        any = true;
        const bool is_open = FindOpenPart();
        scratch_.gain[scratch_.group[at]] += gain_;
        if (!is_open) {
          StoreMasks();
          return;
        }
      }
    }
    if (any) StoreMasks();
  }

 private:
  bool Begin(std::size_t first, std::size_t count);
  void FindPlaces();
  bool FindOpenPart();
  bool RasterizeGroup(const BlockerTree::Node& group, GroupView& view);
  bool RasterizePatch(const BlockerTree::Node& group, const GroupView& view, const std::uint16_t* patch,
                      std::uint32_t leaves, bool& added);
  void FindTurns(const GroupView& view, std::uint32_t leaves, std::uint16_t* patch);
  void SettlePatch(const BlockerTree::Node& group, const std::uint16_t* patch, std::uint32_t leaves, std::uint32_t line,
                   const std::uint32_t* doubtful, std::uint32_t* blocked);
  const LeafView& ViewLeaf(const BlockerTree::Node& group, std::uint32_t k);
  bool RasterizeLeaf(std::size_t leaf, const LeafView& view, std::uint32_t wanted);
  bool RasterizeTriangle(std::size_t leaf, const LeafView& view, std::size_t lane);
  void StoreMasks();

  HWY_NOINLINE UintVec WindSamples(std::uint32_t line, std::uint32_t asked, UintVec& doubtful) const;
  HWY_NOINLINE UintVec TestSamples(const TriangleAnywhere& triangle, const PictureRange& range, std::uint32_t line,
                                   UintVec& inside) const;
  HWY_INLINE void SetPlanes(PacketTriangle& triangle) const;
  HWY_INLINE LaneMask FindBelow(const PacketTriangle& triangle, LaneMask& active, const PictureRange& range,
                                const LineSet& lines);
  HWY_INLINE bool Rasterize(const PacketTriangle& triangle, const PictureRange& range, const LineSet& lines,
                            LaneMask below, LaneMask active);
  HWY_INLINE std::array<LaneMask, 4> Orient(const PacketTriangle& triangle, LaneMask below) const;
  UintVec Settle(const PacketTriangle& triangle, const PictureRange& range, std::uint32_t line, UintVec possible,
                 UintVec inside);
  UintVec OpaqueOf(const AlphaTriangle& alpha, const PictureRange& range, std::uint32_t line, UintVec inside);

  vec3 Position(std::size_t lane) const {
    const std::size_t i = packet_.first + lane;
    return {receivers_.x[i], receivers_.y[i], receivers_.z[i]};
  }

  /// The samples of a line that a receiver is asked for, by bit.
  struct LinePoints {
    const float *x, *y, *z;
    vec3 operator[](std::size_t bit) const { return {x[bit], y[bit], z[bit]}; }
  };
  LinePoints PointsOf(std::size_t lane, std::uint32_t line) const {
    return {rows_.line_points(rows_.point_x, packet_.set[lane], line),
            rows_.line_points(rows_.point_y, packet_.set[lane], line),
            rows_.line_points(rows_.point_z, packet_.set[lane], line)};
  }

  const ExactScene& scene_;
  const SampleRows& rows_;
  const ReceiverBox& cluster_;
  KernelReceivers& receivers_;
  ExactScratch& scratch_;
  KernelCounters& counters_;
  Packet packet_;
  LineSet changed_lines_;
  float gain_ = 0.0f;                         // of the group at work
  PictureRanges leaf_ranges_;                 // of the group at work
  LeafView views_[BlockerTree::kWidth];       // of its leaves
  std::uint32_t viewed_ = 0;                  // those that are there
  GroupOutline outline_;                      // of the patch at work
  ProjectedVertices vertices_;                // of the leaf at work
  const AlphaTriangle* texels_of_ = nullptr;  // the perforated triangle that these belong to:
  PacketTexels texels_;                       // where `has_texels_`
  bool has_texels_ = false;
  std::optional<TexelLookup> lookups_[kMaxLanes];  // made when first needed
};

/// Positions, boxes and pictures; all samples are open.
bool PacketSolver::Begin(std::size_t first, std::size_t count) {
  const Tag d;
  const UintTag du;
  packet_.first = first, packet_.count = count;
  packet_.set = receivers_.set.data() + first;
  packet_.has_one_set =
      std::all_of(packet_.set, packet_.set + count, [&](std::uint8_t s) { return s == packet_.set[0]; });
  texels_of_ = nullptr;
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
  packet_.height_error = hn::Add(hn::Div(packet_.place_error, packet_.height), hn::Set(d, 14.0f));
  FindPlaces();
  const auto in_packet = hn::RebindMask(du, hn::FirstN(d, count));
  for (std::uint32_t line = 0; line < rows_.lines; ++line)
    hn::Store(rows_.anywhere ? hn::Load(du, scratch_.places.valid[line])
                             : hn::IfThenElseZero(in_packet, hn::Set(du, rows_.valid[line])),
              du, packet_.open[line]);
  for (std::uint64_t& word : changed_lines_.bits) word = ~std::uint64_t{0};
  outline_.Begin();
  return FindOpenPart();
}

/// Where the receivers see their samples.
void PacketSolver::FindPlaces() {
  const Tag d;
  packet_.lines = &scratch_.lines, packet_.places = &scratch_.places;
  float reach = scene_.samples->reach;
  if (rows_.anywhere) {
    PlaceSamples(rows_, scene_.cloud != nullptr, packet_, scratch_.places);
  } else {
    scratch_.lines.place(rows_, packet_.set, packet_.count, packet_.has_one_set);
  }
  if (scene_.cloud != nullptr) {
    BoundPlaces(*scene_.cloud, packet_, scratch_.places, scratch_.rows);
    packet_.shaft.floor = scene_.cloud->low.z;
    const float columns = static_cast<float>(rows_.columns) + std::max(-rows_.least_offset, rows_.most_offset);
    reach = columns / rows_.scale + rows_.reach_y;
  }
  packet_.distance = hn::Add(NormMax(packet_.to_center), hn::Set(d, reach + rows_.deviation / kDeterminantError));
}

/// What some receiver has open, after lines changed; false where nothing is.
bool PacketSolver::FindOpenPart() {
  std::uint32_t columns[2] = {0, 0}, first = ~0u, last = 0;
  gain_ = 0.0f;
  for (std::uint32_t line = 0; line < rows_.lines; ++line) {
    if (changed_lines_.has(line)) {
      std::uint32_t all = 0;
      for (std::size_t k = 0; k < hn::Lanes(Tag()); ++k) all |= packet_.open[line][k];
      gain_ += static_cast<float>(1 + std::popcount(packet_.any_open[line] & ~all));
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
  packet_.open_low[0] = static_cast<float>(std::countr_zero(all)) - rows_.most_offset;
  packet_.open_low[1] = static_cast<float>(first) - rows_.most_row_offset;
  packet_.open_high[0] = static_cast<float>(63 - std::countl_zero(all)) - rows_.least_offset;
  packet_.open_high[1] = static_cast<float>(last) - rows_.least_row_offset;
  packet_.shaft.light = {packet_.open_low[0] / rows_.scale - pad, packet_.open_low[1] / rows_.row_scale - pad,
                         packet_.open_high[0] / rows_.scale + pad, packet_.open_high[1] / rows_.row_scale + pad};
  return true;
}

/// Up to 16 leaves; true where samples were blocked.
bool PacketSolver::RasterizeGroup(const BlockerTree::Node& group, GroupView& view) {
  if (view.known && view.is_empty) return false;
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
  FindTurns(view, leaves, patch);
  int in_patch = 0;
  for (std::uint32_t rest = leaves; rest != 0; rest &= rest - 1)
    in_patch += std::popcount(patch[std::countr_zero(rest)]);
  const bool patched = rows_.has_outlines() && in_patch >= 3 && RasterizePatch(group, view, patch, leaves, added);
  for (std::uint32_t rest = leaves; rest != 0; rest &= rest - 1) {
    const auto k = static_cast<std::uint32_t>(std::countr_zero(rest));
    std::uint32_t wanted = view.patch[k] | view.turns[k] | view.single[k];
    if (patched) wanted &= ~patch[k];
    if (wanted == 0) continue;
    const std::uint32_t leaf = group.first_leaf() + k;
    counters_.pairs_tested += scene_.tree->leaves[leaf].count * packet_.count;
    added |= RasterizeLeaf(leaf, ViewLeaf(group, k), wanted);
  }
  return added;
}

/// From which side each receiver sees the triangles that turn. Those of `leaves` for which that is certain for everyone
/// join the patch, which is returned.
void PacketSolver::FindTurns(const GroupView& view, std::uint32_t leaves, std::uint16_t* patch) {
  const Tag d;
  const LaneMask everyone = hn::FirstN(d, packet_.count);
  std::copy_n(view.patch, BlockerTree::kWidth, patch);
  std::uint32_t* const facing = scratch_.facing.data() + view.facing;
  for (const TurningTriangle& t : std::span(scratch_.turning).subspan(view.first_triangle, view.triangles)) {
    const std::uint32_t leaf = t.place / BlockerTree::kWidth;
    facing[t.place] = 0;
    if ((leaves >> leaf & 1) == 0) continue;
    const Vec3 to_corner = Subtract(Splat(t.corner), packet_.position);
    const Vec side = Dot(Splat(t.normal), to_corner), error = hn::Mul(hn::Set(d, t.side_error), Norm1(to_corner));
    if (!hn::AllFalse(d, hn::And(everyone, hn::Le(hn::Abs(side), error)))) continue;
    patch[leaf] |= static_cast<std::uint16_t>(1u << t.place % BlockerTree::kWidth);
    const auto above = static_cast<std::uint32_t>(Bits(hn::Gt(side, hn::Zero(d))));
    facing[t.place] = (t.samples_above ? above << 16 : 0) | (t.samples_below ? ~above & 0xffff : 0);
  }
}

/// Leaf `k` of the group, looked at once.
const LeafView& PacketSolver::ViewLeaf(const BlockerTree::Node& group, std::uint32_t k) {
  LeafView& view = views_[k];
  if ((viewed_ >> k & 1) != 0) return view;
  viewed_ |= 1u << k;
  const std::uint32_t leaf = group.first_leaf() + k, count = scene_.tree->leaves[leaf].count;
  view.above = view.below = view.bounded = view.active = view.kept = 0;
  for (std::size_t i = 0; i < count; i += hn::Lanes(Tag())) ViewTriangles(scene_, leaf, i, packet_, view);
  return view;
}

/// The triangles of `wanted`, one by one; true where samples were blocked.
bool PacketSolver::RasterizeLeaf(std::size_t index, const LeafView& view, std::uint32_t wanted) {
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

/// Doubtful samples of a line by the exact predicate: does a triangle of the patch block them?
void PacketSolver::SettlePatch(const BlockerTree::Node& group, const std::uint16_t* patch, std::uint32_t leaves,
                               std::uint32_t line, const std::uint32_t* doubtful, std::uint32_t* blocked) {
  const auto row = static_cast<std::int32_t>(line % rows_.rows);
  const auto within = [&](const PictureRanges& ranges, std::size_t i, std::int32_t column) {
    return row >= ranges.row[0][i] && row <= ranges.row[1][i] && column >= ranges.column[0][i] &&
           column <= ranges.column[1][i];
  };
  for (std::size_t lane = 0; lane < packet_.count; ++lane) {
    if (doubtful[lane] == 0) continue;
    const LinePoints points = PointsOf(lane, line);
    for (std::uint32_t rest = doubtful[lane]; rest != 0; rest &= rest - 1) {
      const auto bit = static_cast<std::size_t>(std::countr_zero(rest));
      const auto column = static_cast<std::int32_t>(line / rows_.rows * SampleRows::kWord + bit);
      bool is_blocked = false;
      for (std::uint32_t some = leaves; some != 0 && !is_blocked; some &= some - 1) {
        const auto k = static_cast<std::uint32_t>(std::countr_zero(some));
        if (patch[k] == 0 || !within(leaf_ranges_, k, column)) continue;
        const BlockerTree::Leaf& leaf = scene_.tree->leaves[group.first_leaf() + k];
        const LeafView& seen = ViewLeaf(group, k);
        for (std::uint32_t t = patch[k] & seen.active; t != 0 && !is_blocked; t &= t - 1) {
          const auto i = static_cast<std::size_t>(std::countr_zero(t));
          if (!within(seen.ranges, i, column)) continue;
          ++counters_.exact_fallbacks;
          is_blocked =
              blocks(leaf.corner_at(0, i), leaf.corner_at(1, i), leaf.corner_at(2, i), Position(lane), points[bit]);
        }
      }
      blocked[lane] |= std::uint32_t{is_blocked} << bit;
    }
  }
}

/// `asked` samples of a line as WindLine gives them.
UintVec PacketSolver::WindSamples(std::uint32_t line, std::uint32_t asked, UintVec& doubtful) const {
  const UintTag du;
  UintVec blocked = hn::Zero(du);
  doubtful = blocked;
  for (; asked != 0; asked &= asked - 1) {
    const UintVec bit = hn::Set(du, asked & (0u - asked));
    LaneMask unsure;
    const LaneMask hidden =
        outline_.WindSample(line * SampleRows::kWord + static_cast<std::size_t>(std::countr_zero(asked)), unsure);
    blocked = hn::Or(blocked, hn::IfThenElseZero(hn::RebindMask(du, hidden), bit));
    doubtful = hn::Or(doubtful, hn::IfThenElseZero(hn::RebindMask(du, unsure), bit));
  }
  return blocked;
}

/// The group's patch into all pictures; false where its triangles must be taken one by one.
bool PacketSolver::RasterizePatch(const BlockerTree::Node& group, const GroupView& view, const std::uint16_t* patch,
                                  std::uint32_t leaves, bool& added) {
  const UintTag du;
  if (!outline_.Collect(view)) return false;
  if (outline_.empty()) return true;
  rows_.anywhere ? outline_.SetAnywhere() : outline_.Set();
  LineSet lines;
  std::uint32_t asked[kMaxLines];  // of samples anywhere: those that the patch may hide
  for (std::uint32_t rest = leaves; rest != 0; rest &= rest - 1) {
    const auto k = static_cast<std::size_t>(std::countr_zero(rest));
    if (patch[k] == 0) continue;
    PictureRange(rows_, leaf_ranges_, k).for_open_lines(rows_, packet_, [&](std::uint32_t line, std::uint32_t open) {
      asked[line] = lines.has(line) ? asked[line] | open : open;
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
    UintVec blocked = rows_.anywhere ? WindSamples(line, asked[line], doubtful) : outline_.WindLine(line, doubtful);
    blocked = hn::And(blocked, open);
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
HWY_INLINE void PacketSolver::SetPlanes(PacketTriangle& triangle) const {
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
HWY_INLINE std::array<LaneMask, 4> PacketSolver::Orient(const PacketTriangle& triangle, LaneMask below) const {
  std::array<LaneMask, 4> up;
  for (std::size_t k = 0; k < 4; ++k) up[k] = hn::Xor(triangle.planes[k < triangle.count ? k : 0].up, below);
  return up;
}

/// Of a line's samples that are in the range and open to somebody, those that may be inside the triangle, and those
/// that certainly are.
UintVec PacketSolver::TestSamples(const TriangleAnywhere& triangle, const PictureRange& range, std::uint32_t line,
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
HWY_INLINE LaneMask PacketSolver::FindBelow(const PacketTriangle& triangle, LaneMask& active, const PictureRange& range,
                                            const LineSet& lines) {
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
      const int sign = orient3d(triangle.corner[0], triangle.corner[1], triangle.corner[2], Position(lane));
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
UintVec PacketSolver::Settle(const PacketTriangle& triangle, const PictureRange& range, std::uint32_t line,
                             UintVec possible, UintVec inside) {
  const UintTag du;
  const UintVec doubtful = hn::AndNot(inside, possible);
  if (!hn::AllTrue(du, hn::Eq(doubtful, hn::Zero(du)))) {
    const auto& [a, b, c] = triangle.corner;
    alignas(HWY_MAX_BYTES) std::uint32_t in_doubt[kMaxLanes], does[kMaxLanes];
    hn::Store(doubtful, du, in_doubt), hn::Store(inside, du, does);
    for (std::size_t lane = 0; lane < packet_.count; ++lane) {
      if (in_doubt[lane] == 0) continue;
      const LinePoints points = PointsOf(lane, line);
      for (std::uint32_t rest = in_doubt[lane]; rest != 0; rest &= rest - 1) {
        const auto bit = static_cast<std::size_t>(std::countr_zero(rest));
        ++counters_.exact_fallbacks;
        does[lane] |= std::uint32_t{blocks(a, b, c, Position(lane), points[bit])} << bit;
      }
    }
    inside = hn::Load(du, does);
  }
  const bool none = hn::AllTrue(du, hn::Eq(inside, hn::Zero(du)));
  return triangle.alpha == nullptr || none ? inside : OpaqueOf(*triangle.alpha, range, line, inside);
}

/// Of a line's samples, all blocked by the triangle, those that meet an opaque texel of it.
UintVec PacketSolver::OpaqueOf(const AlphaTriangle& alpha, const PictureRange& range, std::uint32_t line,
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
    const LinePoints points = PointsOf(lane, line);
    if (!lookups_[lane]) lookups_[lane].emplace(alpha, Position(lane));
    is[lane] |= OpaqueSamples(alpha, *lookups_[lane], Position(lane), points.x, points.y, points.z, asked[lane],
                              counters_.exact_fallbacks);
  }
  return hn::Load(du, is);
}

HWY_INLINE bool PacketSolver::Rasterize(const PacketTriangle& triangle, const PictureRange& range, const LineSet& lines,
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
bool PacketSolver::RasterizeTriangle(std::size_t index, const LeafView& view, std::size_t lane) {
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
  if (!Rasterize(triangle, range, lines, is_below, active)) return false;
  ++counters_.pairs_necessary;
  return true;
}

void PacketSolver::StoreMasks() {
  for (std::size_t lane = 0; lane < packet_.count; ++lane) {
    std::uint64_t* mask = receivers_.mask(packet_.first + lane);
    for (std::uint32_t line = 0; line < rows_.lines; ++line) {
      std::uint64_t blocked = rows_.valid_of(packet_.set[lane], line) & ~packet_.open[line][lane];
      if (blocked == 0) continue;
      if (rows_.anywhere) {
        const std::uint16_t* const sample =
            rows_.sample_of.data() + packet_.set[lane] * rows_.stride + line * SampleRows::kWord;
        for (; blocked != 0; blocked &= blocked - 1) {
          const std::uint16_t s = sample[std::countr_zero(blocked)];
          mask[s / 64] |= std::uint64_t{1} << s % 64;
        }
        continue;
      }
      const std::int32_t first = rows_.first[line];
      if (first < 0) blocked >>= -first;  // columns before the row's first sample
      const std::size_t at = static_cast<std::size_t>(std::max(first, 0)), shift = at % 64;
      mask[at / 64] |= blocked << shift;
      if (shift > 32 && blocked >> (64 - shift) != 0) mask[at / 64 + 1] |= blocked >> (64 - shift);
    }
  }
}

/// A cloud's samples as the middle of the receivers sees them.
void ArrangeCloud(const ExactScene& scene, const ReceiverBox& box, std::span<const std::uint8_t> sets,
                  ExactScratch& scratch) {
  bool is_wanted[256] = {};
  scratch.wanted.clear();
  for (const std::uint8_t set : sets) {
    if (!is_wanted[set]) scratch.wanted.push_back(set);
    is_wanted[set] = true;
  }
  vec3 middle;
  for (int k = 0; k < 3; ++k) middle[k] = 0.5f * (box.shaft.low[k] + box.shaft.high[k]);
  arrange_cloud(*scene.cloud, *scene.samples, scene.frame, middle, scratch.wanted, scratch.rows);
}

/// The cluster packet by packet.
void SolveByPackets(const ExactScene& given, const ReceiverBox& cluster, std::size_t begin, std::size_t end,
                    KernelReceivers& receivers, ExactScratch& scratch) {
  ExactScene scene = given;
  const std::size_t lanes = hn::Lanes(Tag());
  scratch.own_places.clear();
  const std::vector<std::uint32_t>& place = scene.tree->place;
  for (std::size_t i = begin; i < end; ++i) {
    if (receivers.own[i] < place.size() && (i == begin || receivers.own[i] != receivers.own[i - 1]))
      scratch.own_places.push_back(place[receivers.own[i]]);
  }
  std::sort(scratch.own_places.begin(), scratch.own_places.end());
  if (scene.cloud != nullptr) {
    ArrangeCloud(scene, cluster, std::span(receivers.set).subspan(begin, end - begin), scratch);
    scene.rows = &scratch.rows;
  }
  if (scratch.groups.size() < scratch.group.size()) scratch.groups.resize(scratch.group.size());
  for (GroupView& view : scratch.groups) view.known = false;
  scratch.net_edges.count = 0;
  scratch.facing.clear(), scratch.turning.clear();
  PacketSolver solver(scene, cluster, receivers, scratch);
  for (std::size_t i = begin; i < end; i += lanes) solver.Solve(i, std::min(lanes, end - i));
}

void SolveCluster(const ExactScene& scene, std::size_t begin, std::size_t end, KernelReceivers& receivers,
                  ExactScratch& scratch) {
  ReceiverBox cluster;
  for (std::size_t i = begin; i < end; ++i) cluster.add(scene.frame, {receivers.x[i], receivers.y[i], receivers.z[i]});
  if (!ListGroups(scene, cluster.shaft, scratch)) return;
  const BeamChoice::Cluster work{end - begin, scratch.group.size(), scene.samples->count};
  const bool takes_beams = scene.tiles != nullptr && scratch.choice.takes_beams(work, scene.beams);
  Stopwatch watch;
  if (takes_beams) {
    BeamSolver(scene, cluster, receivers, scratch).Solve(begin, end);
    ++scratch.clusters_by_sample;
  } else {
    SolveByPackets(scene, cluster, begin, end, receivers, scratch);
  }
  scratch.choice.took(work, takes_beams, watch.lap());
}

}  // namespace HWY_NAMESPACE
}  // namespace halfshade
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace halfshade {

void PictureLines::place(const SampleRows& rows, const std::uint8_t* set, std::size_t count, bool alike) {
  if (alike && placed == set[0]) return;
  for (std::uint32_t line = 0; line < rows.lines; ++line) {
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const std::size_t at = std::size_t{set[std::min(lane, count - 1)]} * rows.lines + line;
      y[line][lane] = rows.y[at], offset[line][lane] = rows.offset[at] + 0.5f,
      rest[line][lane] = 31.5f - rows.offset[at];
      row_place[line][lane] = rows.place.empty() ? 0.0f : rows.place[at];
    }
  }
  for (std::size_t lane = 0; lane < kLanes; ++lane) row_offset[lane] = rows.row_offset[set[std::min(lane, count - 1)]];
  placed = alike ? set[0] : kMixed;
}

HWY_EXPORT(SolveCluster);

void solve_cluster(const ExactScene& scene, std::size_t begin, std::size_t end, KernelReceivers& receivers,
                   ExactScratch& scratch) {
  HWY_DYNAMIC_DISPATCH(SolveCluster)(scene, begin, end, receivers, scratch);
}

}  // namespace halfshade
#endif
