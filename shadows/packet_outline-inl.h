// Patches of triangles by their outlines, per instruction set. What a finely tessellated surface hides is what lies
// within its outline: the edges of a group of leaves that do not cancel between two triangles that are seen alike,
// rasterized as winding numbers into the pictures of a packet. Included once per Highway target by packet_kernel.cpp.

#if defined(HALFSHADE_PACKET_OUTLINE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef HALFSHADE_PACKET_OUTLINE_INL_H_
#undef HALFSHADE_PACKET_OUTLINE_INL_H_
#else
#define HALFSHADE_PACKET_OUTLINE_INL_H_
#endif

#include "shadows/packet-inl.h"

HWY_BEFORE_NAMESPACE();
namespace halfshade {
namespace HWY_NAMESPACE {

/// Edges around a patch of triangles, each from a vertex to the next, as the receivers see them in columns and rows.
struct OutlineEdges {
  static constexpr std::uint32_t kMost = 255;  // and so nothing is wound around more often than 8 bits can say
  static constexpr float kMostError = 0.02f;   // columns or rows that vertices may lie off
  std::uint32_t count = 0, fixed = 0;          // the first `fixed` are edges from `from` to `to` for all receivers
  std::uint8_t from[kMost], to[kMost];         // vertices
  std::uint32_t turn[kMost];  // receivers for which others are (from bit 16 on), and for which they run against that
  std::uint8_t first_row[kMost], last_row[kMost];                                 // the edge crosses no others
  alignas(HWY_MAX_BYTES) float slope[kMost][kMaxLanes], width[kMost][kMaxLanes];  // columns a row; uncertainty
  std::uint64_t on_row[SampleRows::kMaxRows][kMost / 64 + 1];                     // edges that may cross the row
  std::uint64_t left_on_row[SampleRows::kMaxRows]
                           [kMost / 64 + 1];  // the same, of edges to the left of all that is open
  bool left[kMost];
  bool near_row[kMost];  // an end of the edge lies on a row for some receiver, so far as can be told
  // For samples anywhere: boxes around edges over all receivers, in columns and rows, as many as fill a vector.
  struct Boxes {
    alignas(HWY_MAX_BYTES) float low[kMost + 1], high[kMost + 1];
  };
  Boxes columns, rows;
  // By receiver: the column where the edge's line crosses row 0, and the rows of its ends.
  alignas(HWY_MAX_BYTES) float column[kMost][kMaxLanes], end_row[2][kMost][kMaxLanes];
  alignas(HWY_MAX_BYTES) std::int32_t sign[kMost][kMaxLanes];  // 1, -1 where it runs against that, 0 where it is none
};

/// Triangles of one leaf of a group, as bits, as seen by a box of receivers.
struct LeafSides {
  std::uint32_t above = 0, below = 0, active = 0;  // as in LeafView
  std::uint32_t plain = 0;                         // projects onto the light's plane, and well
};

HWY_INLINE void FindSidesOfLeaf(const ExactScene& scene, std::size_t index, const ReceiverBox& box, LeafSides& sides) {
  const Tag d;
  const BlockerTree::Leaf& leaf = scene.tree->leaves[index];
  const vec3 middle = 0.5f * (box.low + box.high);
  const vec3 half = glm::max(box.high - middle, middle - box.low) * (1.0f + 0x1p-20f);
  const auto middle_z = static_cast<float>(scene.frame.to_frame(dvec3(middle)).z);
  const float half_z = std::max(box.shaft.high[2] - middle_z, middle_z - box.shaft.low[2]) + 1e-6f;
  const float most = OutlineEdges::kMostError / std::max(scene.rows->scale, scene.rows->row_scale);
  const Vec3 normal = Splat(vec3(scene.frame.n));
  for (std::size_t i = 0; i < leaf.count; i += hn::Lanes(d)) {
    std::array<Vec3, 3> to_corner;
    for (std::size_t k = 0; k < 3; ++k) {
      to_corner[k] = Subtract({hn::LoadU(d, leaf.corner[k][0] + i), hn::LoadU(d, leaf.corner[k][1] + i),
                               hn::LoadU(d, leaf.corner[k][2] + i)},
                              Splat(middle));
    }
    FindSides(leaf, scene.fit->leaves[index], i, box.low, box.high, half, to_corner[0], sides);
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
    const LaneMask good = hn::Le(magnified, hn::Mul(least, hn::Set(d, most - ProjectionPad(box.shaft.low[2]))));
    const LaneMask before_light = hn::Gt(lowest, hn::Set(d, 1e-4f + std::max(scene.rows->high.z, -scene.rows->low.z)));
    sides.plain |= static_cast<std::uint32_t>(Bits(hn::And(hn::And(bounded, good), before_light))) << i;
  }
}

/// All receivers, as ExactScratch::facing has them.
constexpr std::uint32_t kPositive = 0xffff0000u, kNegative = 0xffffu;

/// What the receivers of a cluster have in common about a group. Its patch are the triangles that lie whole between the
/// receivers and the light, are opaque and nobody's own. A sample is blocked by one of them where their outlines,
/// turned alike, wind around it, and edges between two of them cancel. What is left are the net edges: fixed ones, the
/// same for all receivers, and those of triangles that some receivers may see from above and others from below.
HWY_INLINE void ViewGroup(const ExactScene& scene, const BlockerTree::Node& group, const ReceiverBox& box,
                          ExactScratch& scratch, GroupView& view) {
  const BlockerTree& tree = *scene.tree;
  const std::uint32_t first_leaf = group.first_leaf();
  const auto own_begin = std::lower_bound(scratch.own_places.begin(), scratch.own_places.end(),
                                          first_leaf * BlockerTree::kWidth),
             own_end = std::lower_bound(own_begin, scratch.own_places.end(),
                                        (first_leaf + group.count) * BlockerTree::kWidth);
  view.is_empty = true;
  std::vector<TurningTriangle>& turning_triangles = scratch.turning;
  view.first_triangle = static_cast<std::uint32_t>(turning_triangles.size());
  const std::size_t most = turning_triangles.size() + BlockerTree::kGroupSlots;
  if (turning_triangles.capacity() < most) turning_triangles.reserve(2 * most);
  std::uint8_t turns[BlockerTree::kGroupSlots + 1];
  std::uint32_t facing[BlockerTree::kGroupSlots + 1];
  for (std::uint32_t k = 0; k < group.count; ++k) {
    const BlockerTree::Leaf& leaf = tree.leaves[first_leaf + k];
    const BlockerFit::Leaf& fit = scene.fit->leaves[first_leaf + k];
    LeafSides sides;
    FindSidesOfLeaf(scene, first_leaf + k, box, sides);
    std::uint32_t plain = sides.active & sides.plain & ~leaf.perforated;
    for (auto own = own_begin; own != own_end; ++own) {
      if (*own / BlockerTree::kWidth == first_leaf + k) plain &= ~(1u << *own % BlockerTree::kWidth);
    }
    const std::uint32_t known = plain & (sides.above | sides.below), turning = plain & ~known;
    view.patch[k] = static_cast<std::uint16_t>(known);
    view.turns[k] = static_cast<std::uint16_t>(turning);
    view.single[k] = static_cast<std::uint16_t>(sides.active & ~plain);
    view.is_empty = view.is_empty && sides.active == 0;
    const std::uint32_t samples_below = SamplesBelow(fit, box.low, box.high);
    for (std::uint32_t lane = 0; lane < BlockerTree::kWidth; ++lane) {
      const std::size_t at = BlockerTree::kWidth * k + lane;
      facing[at] =
          ((known & sides.above) >> lane & 1 ? kPositive : 0) | ((known & sides.below) >> lane & 1 ? kNegative : 0);
      turns[at] = turning >> lane & 1;
      if (turns[at] == 0) continue;
      const BlockerPlane plane = leaf.plane_at(lane);
      turning_triangles.push_back({leaf.corner_at(0, lane), plane.normal, plane.side_error,
                                   static_cast<std::uint16_t>(at), (fit.samples_above >> lane & 1) != 0,
                                   (samples_below >> lane & 1) != 0});
    }
  }
  facing[BlockerTree::kGroupSlots] = turns[BlockerTree::kGroupSlots] = 0;
  NetEdges& net = scratch.net_edges;
  view.first = static_cast<std::uint32_t>(net.count);
  const std::size_t wanted = net.count + 2 * group.edges + kMaxLanes;
  if (net.vertex[0].size() < wanted) net.reserve(2 * wanted);
  const vec3* const vertices = tree.vertices.data() + group.first_vertex;
  const auto add = [&](const BlockerTree::Edge& edge, std::uint16_t a, std::uint16_t b) {
    const std::size_t at = net.count++;
    net.vertex[0][at] = a, net.vertex[1][at] = b;
    net.triangle[0][at] = edge.left, net.triangle[1][at] = edge.right;
    for (int axis = 0; axis < 3; ++axis)
      net.end[0][axis][at] = vertices[a][axis], net.end[1][axis][at] = vertices[b][axis];
  };
  const std::span edges(tree.edges.data() + group.first_edge, group.edges);
  const auto side = [&](std::uint16_t t) { return (facing[t] & kPositive ? 1 : 0) - (facing[t] & kNegative ? 1 : 0); };
  for (const BlockerTree::Edge& edge : edges) {
    if (turns[edge.left] | turns[edge.right]) continue;
    for (int c = side(edge.left) - side(edge.right); c != 0; c += c > 0 ? -1 : 1)
      c > 0 ? add(edge, edge.from, edge.to) : add(edge, edge.to, edge.from);
  }
  view.fixed = static_cast<std::uint32_t>(net.count) - view.first;
  for (const BlockerTree::Edge& edge : edges) {
    if (turns[edge.left] | turns[edge.right]) add(edge, edge.from, edge.to);
  }
  view.turning = static_cast<std::uint32_t>(net.count) - view.first - view.fixed;
  view.known = true;
  view.triangles = 0;
  if (view.turning == 0) return;
  view.triangles = static_cast<std::uint32_t>(turning_triangles.size()) - view.first_triangle;
  view.facing = static_cast<std::uint32_t>(scratch.facing.size());
  scratch.facing.insert(scratch.facing.end(), std::begin(facing), std::end(facing));
}

/// The outline of a group's patch as a packet sees it, from net edges to lines of the picture.
class GroupOutline {
 public:
  GroupOutline(const ExactScene& scene, const Packet& packet, const ExactScratch& scratch)
      : scene_(scene), rows_(*scene.rows), packet_(packet), scratch_(scratch) {}

  /// The net edges that may matter for what is open; false where they are too many.
  bool Collect(const GroupView& view) {
    edges_.count = slots_ = 0;
    ++calls_;
    const std::uint32_t turning = view.first + view.fixed;
    if (!CollectEdges(view.first, turning, nullptr)) return false;
    edges_.fixed = edges_.count;
    return view.turning == 0 || CollectEdges(turning, turning + view.turning, scratch_.facing.data() + view.facing);
  }
  /// For a packet anew.
  void Begin();
  bool empty() const { return edges_.count == 0; }
  HWY_INLINE void Set();
  HWY_INLINE UintVec WindLine(std::uint32_t line, UintVec& doubtful) const;
  // For samples anywhere (packet_anywhere-inl.h).
  HWY_INLINE void SetAnywhere();
  HWY_INLINE LaneMask WindSample(std::size_t at, LaneMask& doubtful) const;
  HWY_INLINE LaneMask EndsNear(std::size_t e, Vec row) const;

 private:
  bool CollectEdges(std::uint32_t first, std::uint32_t end, const std::uint32_t* facing);
  HWY_INLINE UintVec SamplesNearEnds(std::size_t e, Vec y, Vec offset, Vec rest) const;
  HWY_INLINE hn::Vec<IntTag> WindLeft(std::uint32_t line) const;
  template <int kBits>
  HWY_INLINE UintVec WindAround(std::uint32_t line, hn::Vec<IntTag> around, UintVec& doubtful) const;
  /// For which it is an edge at all.
  LaneMask Receivers(std::size_t e) const { return LanesFromBits(edges_.turn[e] >> 16 | edges_.turn[e], 0); }
  /// How the edge crosses a row, by receiver.
  HWY_INLINE void Turn(std::size_t e, LaneMask& down, LaneMask& up) const {
    const LaneMask positive = LanesFromBits(edges_.turn[e] >> 16, 0), negative = LanesFromBits(edges_.turn[e], 0);
    const LaneMask turned_down = hn::Or(hn::And(down, positive), hn::And(up, negative));
    up = hn::Or(hn::And(up, positive), hn::And(down, negative)), down = turned_down;
  }
  /// How far a row may lie off its place, in rows.
  float RowSpread() const { return rows_.row_spread + rows_.deviation * rows_.row_scale + 1e-5f; }

  const ExactScene& scene_;
  const SampleRows& rows_;
  const Packet& packet_;
  const ExactScratch& scratch_;
  OutlineEdges edges_;
  ProjectedVertices vertices_;
  vec3 middle_{0.0f};  // of the packet; its receivers lie within `reach_` of it, in the sum of |x_i|
  float reach_ = 0.0f;
  vec3 in_frame_{0.0f};  // the middle, in the light's frame
  // How far the receivers reach to either side of it. Not the larger of both for either side: vertices of the patch lie
  // below all receivers of the cluster, but not below more.
  float before_[3] = {}, beyond_[3] = {};
  Vec3 from_middle_;  // to the receivers, in columns, rows and along the light's normal
  alignas(HWY_MAX_BYTES) float box_[2][2][kMaxLanes];              // of CollectEdges: [axis][end]
  std::uint32_t slots_ = 0;                                        // of vertices_ that are taken
  std::uint32_t calls_ = 0;                                        // of Collect
  std::uint32_t projected_in_[3 * BlockerTree::kGroupSlots] = {};  // [vertex of a group] call that projected it,
  std::uint8_t slot_of_[3 * BlockerTree::kGroupSlots];             // and where to
};

void GroupOutline::Begin() {
  const Tag d;
  middle_ = 0.5f * (packet_.low + packet_.high);
  const vec3 half = glm::max(packet_.high - middle_, middle_ - packet_.low);
  reach_ = (half.x + half.y + half.z) * (1.0f + 0x1p-20f);
  const Vec3 from_middle = Subtract(packet_.position, Splat(middle_));
  from_middle_ = {hn::Mul(Dot(from_middle, Splat(vec3(scene_.frame.u))), hn::Set(d, rows_.scale)),
                  hn::Mul(Dot(from_middle, Splat(vec3(scene_.frame.v))), hn::Set(d, rows_.row_scale)),
                  Dot(from_middle, Splat(vec3(scene_.frame.n)))};
  in_frame_ = vec3(scene_.frame.to_frame(dvec3(middle_)));
  for (int k = 0; k < 3; ++k) {
    before_[k] = in_frame_[k] - packet_.shaft.low[k] + 1e-6f;
    beyond_[k] = packet_.shaft.high[k] - in_frame_[k] + 1e-6f;
  }
}

/// Net edges that may matter for what is open: those that cross its rows and do not lie to the right of it. False where
/// they are too many. `facing` is for edges of triangles that turn.
bool GroupOutline::CollectEdges(std::uint32_t first_edge, std::uint32_t end, const std::uint32_t* facing) {
  const Tag d;
  const UintTag du;
  const IntTag di;
  const LightFrame& frame = scene_.frame;
  const Vec3 axes[2] = {Splat(vec3(frame.u)), Splat(vec3(frame.v))}, normal = Splat(vec3(frame.n));
  const NetEdges& net = scratch_.net_edges;
  const std::uint32_t in_packet = ((1u << packet_.count) - 1) * 0x10001u;
  const Vec row_scale = hn::Set(d, rows_.row_scale), top = hn::Set(d, static_cast<float>(rows_.rows) - 1.0f);
  constexpr float kSlack = 1e-3f;
  alignas(HWY_MAX_BYTES) float place_of[2][3][kMaxLanes], length_of[2][kMaxLanes];  // ends, from the middle
  const auto slot_of = [&](std::size_t i, std::size_t lane, std::uint16_t v) HWY_ATTR {
    if (projected_in_[v] != calls_) {
      projected_in_[v] = calls_;
      slot_of_[v] = static_cast<std::uint8_t>(slots_);
      // What leads from a receiver to the end is a difference: of what leads to either from the middle. So it is within
      // 7 (|end - middle| + |receiver - middle|) / 2^24.
      const auto way = [&](int axis, Vec from) HWY_ATTR { return hn::Sub(hn::Set(d, place_of[i][axis][lane]), from); };
      PlaceVertex(packet_, way(0, from_middle_.x), way(1, from_middle_.y), hn::Neg(way(2, from_middle_.z)),
                  hn::Set(d, length_of[i][lane]), 7.0f, slots_++, vertices_);
    }
    return slot_of_[v];
  };
  for (std::uint32_t e = first_edge; e < end; e += static_cast<std::uint32_t>(hn::Lanes(d))) {
    Vec low[2] = {hn::Set(d, 1e30f), hn::Set(d, 1e30f)}, high[2] = {hn::Set(d, -1e30f), hn::Set(d, -1e30f)};
    for (std::size_t i = 0; i < 2; ++i) {
      const Vec3 c =
          Subtract({hn::LoadU(d, &net.end[i][0][e]), hn::LoadU(d, &net.end[i][1][e]), hn::LoadU(d, &net.end[i][2][e])},
                   Splat(middle_));
      const Vec up = Dot(c, normal), z = hn::Add(up, hn::Set(d, in_frame_.z));
      const Vec w0 = hn::Div(z, hn::Sub(hn::Neg(up), hn::Set(d, before_[2]))),
                w1 = hn::Div(z, hn::Sub(hn::Set(d, beyond_[2]), up));
      for (int axis = 0; axis < 2; ++axis) {
        const Vec away = Dot(c, axes[axis]), place = hn::Add(away, hn::Set(d, in_frame_[axis]));
        const Vec a = hn::Sub(away, hn::Set(d, beyond_[axis])), b = hn::Add(away, hn::Set(d, before_[axis]));
        const Vec a0 = hn::Mul(a, w0), a1 = hn::Mul(a, w1), b0 = hn::Mul(b, w0), b1 = hn::Mul(b, w1);
        low[axis] = hn::Min(low[axis], hn::Add(place, hn::Min(hn::Min(a0, a1), hn::Min(b0, b1))));
        high[axis] = hn::Max(high[axis], hn::Add(place, hn::Max(hn::Max(a0, a1), hn::Max(b0, b1))));
        hn::Store(hn::Mul(away, hn::Set(d, axis == 0 ? rows_.scale : rows_.row_scale)), d, place_of[i][axis]);
      }
      hn::Store(up, d, place_of[i][2]);
      hn::Store(hn::Add(Norm1(c), hn::Set(d, reach_)), d, length_of[i]);
    }
    // Vertices lie off by at most OutlineEdges::kMostError columns and rows.
    const Vec pad = hn::Set(d, OutlineEdges::kMostError / std::min(rows_.scale, rows_.row_scale));
    const Rectangle& open = packet_.shaft.light;
    const std::uint64_t beside = Bits(hn::Lt(hn::Add(high[0], pad), hn::Set(d, open.low_u)));
    // Rows that may be crossed; short edges may lie between two.
    const Vec first_row = hn::Max(hn::Ceil(hn::MulAdd(hn::Max(hn::Sub(low[1], pad), hn::Set(d, open.low_v)), row_scale,
                                                      hn::Set(d, rows_.least_row_offset - kSlack))),
                                  hn::Zero(d)),
              last_row = hn::Min(hn::Floor(hn::MulAdd(hn::Min(hn::Add(high[1], pad), hn::Set(d, open.high_v)),
                                                      row_scale, hn::Set(d, rows_.most_row_offset + kSlack))),
                                 top);
    LaneMask may = hn::And(hn::And(hn::Le(hn::Sub(low[0], pad), hn::Set(d, open.high_u)), hn::FirstN(d, end - e)),
                           hn::Le(first_row, last_row));
    if (hn::AllFalse(d, may)) continue;
    alignas(HWY_MAX_BYTES) std::int32_t first[kMaxLanes], last[kMaxLanes];
    alignas(HWY_MAX_BYTES) std::uint32_t turn[kMaxLanes], turn_twice[kMaxLanes];
    std::uint64_t twice = 0;
    if (facing != nullptr) {
      const hn::Rebind<std::uint16_t, Tag> d16;
      const UintVec left = hn::GatherIndex(du, facing, hn::PromoteTo(di, hn::LoadU(d16, &net.triangle[0][e]))),
                    right = hn::GatherIndex(du, facing, hn::PromoteTo(di, hn::LoadU(d16, &net.triangle[1][e])));
      const auto reversed = [](UintVec v) HWY_ATTR { return hn::Or(hn::ShiftLeft<16>(v), hn::ShiftRight<16>(v)); };
      const UintVec asked = hn::Set(du, in_packet);
      const UintVec once = hn::And(hn::Or(hn::AndNot(right, left), hn::AndNot(reversed(left), reversed(right))), asked),
                    again = hn::And(hn::And(left, reversed(right)), asked);
      hn::Store(once, du, turn), hn::Store(again, du, turn_twice);
      may = hn::And(may, hn::RebindMask(d, hn::Ne(once, hn::Zero(du))));
      twice = Bits(hn::And(may, hn::RebindMask(d, hn::Ne(again, hn::Zero(du)))));
    }
    std::uint64_t bits = Bits(may);
    if (bits == 0) continue;
    const auto count = static_cast<std::uint32_t>(std::popcount(bits));
    if (edges_.count + static_cast<std::uint32_t>(std::popcount(twice)) + count > OutlineEdges::kMost ||
        slots_ + 2 * count > ProjectedVertices::kMost)
      return false;
    hn::Store(hn::ConvertTo(di, first_row), di, first), hn::Store(hn::ConvertTo(di, last_row), di, last);
    if (rows_.anywhere) {
      const Vec around = hn::Add(pad, hn::Set(d, rows_.deviation));
      for (int axis = 0; axis < 2; ++axis) {
        const Vec scale = axis == 0 ? hn::Set(d, rows_.scale) : row_scale;
        hn::Store(hn::MulAdd(hn::Sub(low[axis], around), scale, hn::Set(d, -kSlack)), d, box_[axis][0]);
        hn::Store(hn::MulAdd(hn::Add(high[axis], around), scale, hn::Set(d, kSlack)), d, box_[axis][1]);
      }
    }
    const auto set_box = [&](std::uint32_t i, std::size_t lane) {
      if (!rows_.anywhere) return;
      edges_.columns.low[i] = box_[0][0][lane], edges_.columns.high[i] = box_[0][1][lane];
      edges_.rows.low[i] = box_[1][0][lane], edges_.rows.high[i] = box_[1][1][lane];
    };
    for (; bits != 0; bits &= bits - 1) {
      const auto lane = static_cast<std::size_t>(std::countr_zero(bits));
      const std::uint32_t i = edges_.count++;
      edges_.from[i] = slot_of(0, lane, net.vertex[0][e + lane]);
      edges_.to[i] = slot_of(1, lane, net.vertex[1][e + lane]);
      edges_.first_row[i] = static_cast<std::uint8_t>(first[lane]);
      edges_.last_row[i] = static_cast<std::uint8_t>(last[lane]);
      edges_.left[i] = (beside >> lane & 1) != 0;
      set_box(i, lane);
      if (facing == nullptr) continue;
      edges_.turn[i] = turn[lane];
      if ((twice >> lane & 1) == 0) continue;
      const std::uint32_t second = edges_.count++;
      edges_.from[second] = edges_.from[i], edges_.to[second] = edges_.to[i];
      edges_.left[second] = edges_.left[i];
      edges_.first_row[second] = edges_.first_row[i], edges_.last_row[second] = edges_.last_row[i];
      edges_.turn[second] = turn_twice[lane];
      set_box(second, lane);
    }
  }
  return true;
}

/// The edges as the receivers see them.
HWY_INLINE void GroupOutline::Set() {
  const Tag d;
  const Vec row_scale = hn::Set(d, rows_.row_scale);
  const Vec row_offset = hn::Load(d, packet_.lines->row_offset);
  const Vec spread = hn::Set(d, RowSpread());
  for (std::uint32_t row = 0; row < rows_.rows; ++row) {
    for (std::uint64_t& word : edges_.on_row[row]) word = 0;
    for (std::uint64_t& word : edges_.left_on_row[row]) word = 0;
  }
  bool near[ProjectedVertices::kMost];
  alignas(HWY_MAX_BYTES) float behind[ProjectedVertices::kMost][kMaxLanes];  // the row that the vertex lies behind
  for (std::uint32_t v = 0; v < slots_; ++v) {
    const Vec row = hn::Add(hn::Load(d, vertices_.row[v]), row_offset);
    const Vec error = hn::MulAdd(hn::Load(d, vertices_.error[v]), row_scale, spread);
    near[v] = !hn::AllFalse(d, hn::Le(hn::Abs(hn::Sub(row, hn::Round(row))), error));
    hn::Store(hn::Floor(row), d, behind[v]);
  }
  for (std::uint32_t e = 0; e < edges_.count; ++e) {
    // Many short edges lie between two rows for all receivers.
    if (!near[edges_.from[e]] && !near[edges_.to[e]] &&
        hn::AllTrue(d, hn::Eq(hn::Load(d, behind[edges_.from[e]]), hn::Load(d, behind[edges_.to[e]]))))
      continue;
    auto& on_row = edges_.left[e] ? edges_.left_on_row : edges_.on_row;
    for (std::uint32_t row = edges_.first_row[e]; row <= edges_.last_row[e]; ++row)
      on_row[row][e / 64] |= std::uint64_t{1} << (e % 64);
    if (edges_.left[e]) continue;
    const std::size_t a = edges_.from[e], b = edges_.to[e];
    const Vec xa = hn::Load(d, vertices_.column[a]), ya = hn::Load(d, vertices_.row[a]),
              dx = hn::Sub(hn::Load(d, vertices_.column[b]), xa), dy = hn::Sub(hn::Load(d, vertices_.row[b]), ya);
    // Where so small a difference crosses a row, both ends lie near it.
    const Vec slope =
        hn::Mul(dx, Reciprocal(hn::IfThenElse(hn::Lt(hn::Abs(dy), hn::Set(d, 1e-6f)), hn::Set(d, 1.0f), dy)));
    const Vec error =
        hn::Add(hn::Max(hn::Load(d, vertices_.error[a]), hn::Load(d, vertices_.error[b])), hn::Set(d, rows_.deviation));
    Vec width = hn::Mul(error, hn::MulAdd(hn::Abs(slope), row_scale, hn::Set(d, rows_.scale)));
    width = hn::MulAdd(hn::Add(hn::Abs(xa), hn::Abs(dx)), hn::Set(d, 0x1p-20f), width);
    width = hn::Add(width, hn::Set(d, 0x1p-16f));
    hn::Store(slope, d, edges_.slope[e]);
    hn::Store(width, d, edges_.width[e]);
    edges_.near_row[e] = near[a] || near[b];
  }
}

/// Samples of row y that an edge passes so near to, for receivers for which one of its ends lies on the row so far as
/// can be told, that its crossing the row or not is uncertain: within the errors of the ends the edge may turn.
HWY_INLINE UintVec GroupOutline::SamplesNearEnds(std::size_t e, Vec y, Vec offset, Vec rest) const {
  const Tag d;
  const std::size_t a = edges_.from[e], b = edges_.to[e];
  const Vec row_scale = hn::Set(d, rows_.row_scale), spread = hn::Set(d, RowSpread());
  const Vec xa = hn::Load(d, vertices_.column[a]), ya = hn::Load(d, vertices_.row[a]),
            xb = hn::Load(d, vertices_.column[b]), yb = hn::Load(d, vertices_.row[b]);
  const Vec error_a = hn::Load(d, vertices_.error[a]), error_b = hn::Load(d, vertices_.error[b]);
  const Vec off_a = hn::MulAdd(error_a, row_scale, spread), off_b = hn::MulAdd(error_b, row_scale, spread);
  const LaneMask near = hn::Or(hn::Le(hn::Abs(hn::Sub(ya, y)), off_a), hn::Le(hn::Abs(hn::Sub(yb, y)), off_b));
  const Vec off = hn::Add(off_a, off_b), slope = hn::Load(d, edges_.slope[e]);
  const Vec x = hn::MulAdd(slope, hn::Sub(y, ya), xa);
  const Vec reach = hn::MulAdd(hn::Abs(slope), off, hn::Load(d, edges_.width[e]));
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
  /// One more, or less where `minus` is set as well: -1 has all bits set.
  HWY_INLINE void Add(UintVec one, UintVec minus) {
    UintVec carry = hn::And(bit[0], one);
    bit[0] = hn::Xor(bit[0], one);
    for (int i = 1; i < kBits; ++i) {
      const UintVec b = bit[i];
      bit[i] = hn::Xor(b, hn::Xor(minus, carry));
      carry = hn::Or(hn::And(b, minus), hn::And(carry, hn::Or(b, minus)));
    }
  }
  HWY_INLINE UintVec Any() const {
    UintVec any = bit[0];
    for (int i = 1; i < kBits; ++i) any = hn::Or(any, bit[i]);
    return any;
  }
};

/// How often the edges to the left of what is open wind around a line.
HWY_INLINE hn::Vec<IntTag> GroupOutline::WindLeft(std::uint32_t line) const {
  const Tag d;
  const IntTag di;
  const Vec y = hn::Load(d, packet_.lines->row_place[line]);
  auto around = hn::Zero(di);
  const auto one = hn::Set(di, 1);
  for (std::size_t word = 0; word < std::size(edges_.left_on_row[0]); ++word) {
    for (std::uint64_t edges = edges_.left_on_row[line % rows_.rows][word]; edges != 0; edges &= edges - 1) {
      const std::size_t e = 64 * word + static_cast<std::size_t>(std::countr_zero(edges));
      const LaneMask behind = hn::Le(hn::Load(d, vertices_.row[edges_.from[e]]), y),
                     before = hn::Le(hn::Load(d, vertices_.row[edges_.to[e]]), y);
      LaneMask down = hn::AndNot(behind, before), up = hn::AndNot(before, behind);
      if (e >= edges_.fixed) Turn(e, down, up);
      around = hn::Add(around, hn::IfThenElseZero(hn::RebindMask(di, down), one));
      around = hn::Sub(around, hn::IfThenElseZero(hn::RebindMask(di, up), one));
    }
  }
  return around;
}

/// One line of a patch: the samples that it winds around, and those so near to an outline that this is not certain.
HWY_INLINE UintVec GroupOutline::WindLine(std::uint32_t line, UintVec& doubtful) const {
  const IntTag di;
  const auto around = WindLeft(line);
  // Nothing is wound around more often than by these and all other edges of the row.
  int others = 0;
  for (const std::uint64_t word : edges_.on_row[line % rows_.rows]) others += std::popcount(word);
  return hn::AllTrue(di, hn::Lt(around, hn::Set(di, 16 - others))) ? WindAround<4>(line, around, doubtful)
                                                                   : WindAround<8>(line, around, doubtful);
}

/// The same, beginning with the number of times that edges to the left wind around the line. The sums are right modulo
/// 2^kBits, and final ones are less than that.
template <int kBits>
HWY_INLINE UintVec GroupOutline::WindAround(std::uint32_t line, hn::Vec<IntTag> around, UintVec& doubtful) const {
  const Tag d;
  const UintTag du;
  const PictureLines& l = *packet_.lines;
  const Vec y = hn::Load(d, l.row_place[line]), offset = hn::Load(d, l.offset[line]), rest = hn::Load(d, l.rest[line]);
  const Vec shifter = hn::Set(d, 0x1p23f), half = hn::Set(d, 0.5f);
  const UintVec zero = hn::Zero(du), ones = hn::Set(du, ~0u), shifter_bits = hn::Set(du, 0x4b000000u);
  doubtful = zero;
  WindingNumbers<kBits> winding;
  for (int i = 0; i < kBits; ++i) {
    winding.bit[i] = hn::IfThenElse(hn::TestBit(hn::BitCast(du, around), hn::Set(du, 1u << i)), ones, zero);
  }
  doubtful = zero;
  for (std::size_t word = 0; word < std::size(edges_.on_row[0]); ++word) {
    for (std::uint64_t edges = edges_.on_row[line % rows_.rows][word]; edges != 0; edges &= edges - 1) {
      const std::size_t e = 64 * word + static_cast<std::size_t>(std::countr_zero(edges));
      const std::size_t a = edges_.from[e], b = edges_.to[e];
      const Vec ya = hn::Load(d, vertices_.row[a]);
      const LaneMask behind = hn::Le(ya, y), before = hn::Le(hn::Load(d, vertices_.row[b]), y);
      LaneMask crossing = hn::Xor(behind, before);
      if (e >= edges_.fixed) crossing = hn::And(crossing, Receivers(e));
      if (edges_.near_row[e]) {
        UintVec near = SamplesNearEnds(e, y, offset, rest);
        if (e >= edges_.fixed) {
          near = hn::IfThenElseZero(hn::RebindMask(du, Receivers(e)), near);
        }
        doubtful = hn::Or(doubtful, near);
      }
      if (hn::AllFalse(d, crossing)) continue;
      const Vec x = hn::MulAdd(hn::Load(d, edges_.slope[e]), hn::Sub(y, ya), hn::Load(d, vertices_.column[a]));
      const Vec place = hn::Min(hn::Max(hn::Add(x, offset), hn::Zero(d)), hn::Set(d, 33.0f));
      const Vec from = hn::Add(place, shifter);
      const Vec width = hn::Load(d, edges_.width[e]);
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
      if (e >= edges_.fixed) Turn(e, down, up);
      winding.Add(hn::IfThenElseZero(hn::RebindMask(du, hn::Or(down, up)), beyond),
                  hn::IfThenElseZero(hn::RebindMask(du, up), beyond));
    }
  }
  return winding.Any();
}

}  // namespace HWY_NAMESPACE
}  // namespace halfshade
HWY_AFTER_NAMESPACE();

#endif  // include guard
