// Beams from a cluster of receivers to one light sample after the other, per instruction set. Included once per Highway
// target by packet_kernel.cpp.
//
// Packets draw whole pictures of the light, which is slow where most of what they draw hides nothing new: a wide light
// behind thousands of small parts. Here a sample looks at the receivers as the hard alias-free shadow map of Sintorn,
// Eisemann, Assarsson 2008 (section 3) does: leaves and receivers meet where their slopes from the sample, (x - u) / z
// and (y - v) / z in the light's frame, overlap. What that costs hardly grows with the light, but with every sample.
// Leaves are listed for a tile of 16 neighbouring samples at a time. The masks are the same bits.

#if defined(HALFSHADE_CLUSTER_BEAMS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef HALFSHADE_CLUSTER_BEAMS_INL_H_
#undef HALFSHADE_CLUSTER_BEAMS_INL_H_
#else
#define HALFSHADE_CLUSTER_BEAMS_INL_H_
#endif

#include "shadows/packet-inl.h"

HWY_BEFORE_NAMESPACE();
namespace halfshade {
namespace HWY_NAMESPACE {

constexpr std::size_t kRun = 16;  // receivers that are looked at together, whatever the vectors hold

/// The bits of a mask over lanes [i, i + lanes) of 16.
HWY_INLINE std::uint32_t BitsAt(LaneMask mask, std::size_t i) { return static_cast<std::uint32_t>(Bits(mask)) << i; }

/// The planes through a sample s and the edges of a leaf's triangles, and the triangles' own, [plane][triangle]. Beyond
/// +-1 the sign of m . (r - s) + offset is certain; a receiver r for which all four are positive is blocked.
class SamplePlanes {
 public:
  /// `back_faces_only`: triangles that cast only where the sample lies above them; `reach`: bound on |coordinate| of
  /// s to receiver.
  void Set(const BlockerTree::Leaf& leaf, std::uint32_t back_faces_only, const vec3& sample, float reach);

  /// Triangles that may block one receiver, given from the sample, and those that certainly do.
  HWY_INLINE std::uint32_t Possible(const vec3& r, std::uint32_t& inside) const {
    const Tag d;
    const Vec one = hn::Set(d, 1.0f), minus_one = hn::Set(d, -1.0f);
    std::uint32_t possible = 0;
    inside = 0;
    for (std::size_t i = 0; i < BlockerTree::kWidth; i += hn::Lanes(d)) {
      const Vec3 to = Splat(r);
      const Vec e0 = At(0, i, to), e1 = At(1, i, to), e2 = At(2, i, to);
      const Vec edges = hn::Min(hn::Min(e0, e1), e2), least = hn::Min(edges, At(3, i, to));
      inside |= BitsAt(hn::Gt(least, one), i), possible |= BitsAt(hn::Ge(least, minus_one), i);
      if (HWY_UNLIKELY(unsure_ != 0)) {  // the edges' planes may be turned the wrong way
        const Vec most = hn::Max(hn::Max(e0, e1), e2);
        possible |= unsure_ & BitsAt(hn::Or(hn::Ge(edges, minus_one), hn::Le(most, one)), i);
      }
    }
    inside &= usable_ & ~unsure_;
    return possible & usable_;
  }

  /// Triangles that may block some receiver of a box, given from the sample by its middle and half its size.
  HWY_INLINE std::uint32_t Possible(const vec3& middle, const vec3& half) const {
    const Tag d;
    std::uint32_t possible = unsure_;
    for (std::size_t i = 0; i < BlockerTree::kWidth; i += hn::Lanes(d)) {
      Vec most = hn::Set(d, 1e30f);
      for (std::size_t k = 0; k < 4; ++k) {
        const Vec3 m = Plane(k, i);
        const Vec reach = Dot({hn::Abs(m.x), hn::Abs(m.y), hn::Abs(m.z)}, Splat(half));
        most = hn::Min(most, hn::Add(At(k, i, Splat(middle)), reach));
      }
      possible |= BitsAt(hn::Ge(most, hn::Set(d, -2.0f)), i);  // a unit more for the box's own rounding
    }
    return possible & usable_;
  }

  /// One triangle, receivers in the lanes; not where sides are unsure.
  HWY_INLINE LaneMask Possible(std::size_t triangle, const Vec3& r, LaneMask& inside) const {
    const Tag d;
    Vec least = hn::Set(d, 1e30f);
    for (std::size_t k = 0; k < 4; ++k) {
      const Vec at = Dot({hn::Set(d, x_[k][triangle]), hn::Set(d, y_[k][triangle]), hn::Set(d, z_[k][triangle])}, r);
      least = hn::Min(least, hn::Add(at, hn::Set(d, k == 3 ? offset_[triangle] : 0.0f)));
    }
    inside = hn::Gt(least, hn::Set(d, 1.0f));
    return hn::Ge(least, hn::Set(d, -1.0f));
  }

  bool any() const { return usable_ != 0; }
  bool any_unsure() const { return unsure_ != 0; }

 private:
  HWY_INLINE Vec3 Plane(std::size_t k, std::size_t i) const {
    const Tag d;
    return {hn::Load(d, x_[k] + i), hn::Load(d, y_[k] + i), hn::Load(d, z_[k] + i)};
  }
  HWY_INLINE Vec At(std::size_t k, std::size_t i, const Vec3& r) const {
    const Vec at = Dot(Plane(k, i), r);
    return k == 3 ? hn::Add(at, hn::Load(Tag(), offset_ + i)) : at;
  }

  alignas(HWY_MAX_BYTES) float x_[4][BlockerTree::kWidth], y_[4][BlockerTree::kWidth], z_[4][BlockerTree::kWidth];
  alignas(HWY_MAX_BYTES) float offset_[BlockerTree::kWidth];  // of the fourth; the others meet the sample
  std::uint32_t usable_ = 0;                                  // triangles that may block something
  std::uint32_t unsure_ = 0;                                  // of these, planes in which the sample may lie
};

void SamplePlanes::Set(const BlockerTree::Leaf& leaf, std::uint32_t back_faces_only, const vec3& sample, float reach) {
  const Tag d;
  const Vec least = hn::Set(d, 0x1p-100f);  // keeps reciprocals finite
  std::uint32_t above = 0, below = 0;
  for (std::size_t i = 0; i < BlockerTree::kWidth; i += hn::Lanes(d)) {
    std::array<Vec3, 3> corner, to_corner;
    for (std::size_t k = 0; k < 3; ++k) {
      corner[k] = {hn::LoadU(d, leaf.corner[k][0] + i), hn::LoadU(d, leaf.corner[k][1] + i),
                   hn::LoadU(d, leaf.corner[k][2] + i)};
      to_corner[k] = Subtract(corner[k], Splat(sample));
    }
    const auto store = [&](std::size_t k, const Vec3& m, Vec scale) HWY_ATTR {
      hn::Store(hn::Mul(m.x, scale), d, x_[k] + i);
      hn::Store(hn::Mul(m.y, scale), d, y_[k] + i);
      hn::Store(hn::Mul(m.z, scale), d, z_[k] + i);
    };
    const Vec3 normal{hn::LoadU(d, leaf.normal[0] + i), hn::LoadU(d, leaf.normal[1] + i),
                      hn::LoadU(d, leaf.normal[2] + i)};
    const Vec side_error = hn::LoadU(d, leaf.side_error + i);
    const Vec side = Dot(normal, to_corner[0]), error = hn::Mul(side_error, Norm1(to_corner[0]));
    above |= BitsAt(hn::Gt(side, error), i), below |= BitsAt(hn::Lt(side, hn::Neg(error)), i);
    const Vec sign = hn::And(side, hn::Set(d, -0.0f));
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3 edge = Subtract(corner[(k + 1) % 3], corner[k]);
      const Vec bound = hn::Mul(hn::Mul(Norm1(edge), Norm1(to_corner[k])), hn::Set(d, kDeterminantError * reach));
      store(k, Cross(to_corner[k], edge), hn::Xor(sign, Reciprocal(hn::Max(bound, least))));
    }
    // n . (r - s) - n . (a - s): twice the error of the second for the difference.
    const Vec bound = hn::MulAdd(side_error, hn::Set(d, 3.0f * reach), hn::Add(error, error));
    const Vec scale = hn::Xor(sign, Reciprocal(hn::Max(bound, least)));
    store(3, normal, scale);
    hn::Store(hn::Neg(hn::Mul(side, scale)), d, offset_ + i);
  }
  usable_ = ((1u << leaf.count) - 1) & ~(above & back_faces_only);
  unsure_ = usable_ & ~(above | below);
}

/// A cluster at work.
class BeamSolver {
 public:
  BeamSolver(const ExactScene& scene, const ReceiverBox& cluster, KernelReceivers& receivers, ExactScratch& scratch)
      : scene_(scene), cluster_(cluster), receivers_(receivers), scratch_(scratch), beams_(scratch.beams) {}

  /// Receivers [begin, end), at most kMostReceivers, which may meet the groups of scratch.group.
  void Solve(std::size_t begin, std::size_t end) {
    Begin(begin, end);
    const KernelSamples& samples = *scene_.tiles;
    for (std::size_t first = 0; first < samples.count; first += kTile) {
      const std::size_t count = std::min<std::size_t>(kTile, samples.count - first);
      if (!ListLeaves(std::span(samples.points).subspan(first, count))) continue;
      for (std::size_t i = 0; i < count; ++i) SolveSample(i, samples.points[first + i], samples.order[first + i]);
    }
    StoreMasks();
  }

 private:
  static constexpr std::size_t kRuns = BeamScratch::kRuns, kMostReceivers = kRuns * kRun;
  static constexpr std::size_t kTile = KernelSamples::kGroup;
  /// Rounding of slopes, times 1 / z: coordinates are below 4.
  static constexpr float kPad = 4e-6f;

  static constexpr std::size_t kSlopes = BeamScratch::kSlopes;

  /// Slopes between which a sample sees something.
  struct Slopes {
    Vec low[kSlopes], high[kSlopes];

    Slopes() {
      const Tag d;
      for (std::size_t k = 0; k < kSlopes; ++k) low[k] = hn::Set(d, 1e30f), high[k] = hn::Set(d, -1e30f);
    }
    HWY_INLINE void Add(const std::array<Vec, kSlopes>& slope) {
      for (std::size_t k = 0; k < kSlopes; ++k)
        low[k] = hn::Min(low[k], slope[k]), high[k] = hn::Max(high[k], slope[k]);
    }
  };
  /// Of a point that is seen at the first two.
  static HWY_INLINE std::array<Vec, kSlopes> SlopesOf(Vec x, Vec y) { return {x, y, hn::Add(x, y), hn::Sub(x, y)}; }
  struct Window {
    float low[kSlopes], high[kSlopes];
  };

  void Begin(std::size_t begin, std::size_t end);
  bool CanBlockOwn(std::size_t i, const BlockerTree::Leaf& leaf, const BlockerFit::Leaf& fit) const;
  bool ListLeaves(std::span<const vec3> tile);
  void FindSlopes(std::size_t i);
  void Tighten(std::size_t at);
  void SolveSample(std::size_t i, const vec3& sample, std::uint32_t number);
  std::uint32_t RunsBehind(std::size_t at, const Window& leaf) const;
  void TestLeaf(std::size_t at, const vec3& sample, Window leaf);
  std::uint32_t TestRun(std::size_t run, std::uint32_t leaf, const vec3& sample, std::uint32_t asked);
  void StoreMasks();

  /// The slopes of leaves from a sample off the tile's middle.
  HWY_INLINE Slopes SeeLeaves(std::size_t i) const {
    const Tag d;
    const BeamScratch::Slopes& slopes = beams_.leaf_slopes;
    const Vec near = hn::LoadU(d, slopes.near.data() + i), far = hn::LoadU(d, slopes.far.data() + i);
    Slopes s;
    for (std::size_t k = 0; k < kSlopes; ++k) {
      const Vec a = hn::Mul(near, hn::Set(d, off_[k])), b = hn::Mul(far, hn::Set(d, off_[k]));
      s.low[k] = hn::Sub(hn::LoadU(d, slopes.low[k].data() + i), hn::Max(a, b));
      s.high[k] = hn::Sub(hn::LoadU(d, slopes.high[k].data() + i), hn::Min(a, b));
    }
    return s;
  }
  Window SeeLeaf(std::size_t at) const {
    const BeamScratch::Slopes& slopes = beams_.leaf_slopes;
    Window w;
    for (std::size_t k = 0; k < kSlopes; ++k) {
      const float near = slopes.near[at] * off_[k], far = slopes.far[at] * off_[k];
      w.low[k] = slopes.low[k][at] - std::max(near, far), w.high[k] = slopes.high[k][at] - std::min(near, far);
    }
    return w;
  }
  vec3 Position(std::size_t i) const {
    return {receivers_.x[begin_ + i], receivers_.y[begin_ + i], receivers_.z[begin_ + i]};
  }
  bool IsBlocked(std::size_t i, std::uint32_t leaf, std::size_t triangle, const vec3& sample) {
    ++scratch_.counters.exact_fallbacks;
    const BlockerTree::Leaf& l = scene_.tree->leaves[leaf];
    return blocks(l.corner_at(0, triangle), l.corner_at(1, triangle), l.corner_at(2, triangle), Position(i), sample);
  }

  const ExactScene& scene_;
  const ReceiverBox& cluster_;
  KernelReceivers& receivers_;
  ExactScratch& scratch_;
  BeamScratch& beams_;
  std::size_t begin_ = 0, count_ = 0;
  float middle_[2] = {}, off_plane_ = 0.0f;  // of the samples of the tile at work: where, at most how far
  float receiver_pad_ = 0.0f;                // of slopes of receivers
  float off_[kSlopes] = {};                  // of the sample at work
  vec3 place_[kTile];                        // of the samples, light's frame
  alignas(HWY_MAX_BYTES) float run_low_[kSlopes][kRuns], run_high_[kSlopes][kRuns];  // slopes from the sample at work
  std::uint16_t open_[kRuns];
  std::uint32_t open_runs_ = 0;
  SamplePlanes planes_;
};

void BeamSolver::Begin(std::size_t begin, std::size_t end) {
  begin_ = begin, count_ = end - begin;
  const std::vector<std::uint32_t>& place = scene_.tree->place;
  std::fill_n(beams_.farthest, kRuns, -1e30f);
  std::fill_n(beams_.box_low, kRuns, vec3(1e30f)), std::fill_n(beams_.box_high, kRuns, vec3(-1e30f));
  std::fill_n(beams_.valid, kRuns, std::uint16_t{0});
  for (std::size_t i = 0; i < kMostReceivers; ++i) {
    const std::size_t at = std::min(i, count_ - 1), run = i / kRun;
    const vec3 r = Position(at), p(scene_.frame.to_frame(dvec3(r)));
    const std::uint32_t own = receivers_.own[begin + at];
    beams_.height[i] = p.z, beams_.inverse[i] = 1.0f / p.z;
    beams_.x[i] = p.x * beams_.inverse[i], beams_.y[i] = p.y * beams_.inverse[i];
    const std::size_t turned = i % kRun * kRuns + run;
    beams_.x_by_run[turned] = beams_.x[i], beams_.y_by_run[turned] = beams_.y[i];
    beams_.inverse_by_run[turned] = beams_.inverse[i];
    beams_.own[i] = own < place.size() ? place[own] : kNone;
    beams_.leaf_to_skip[i] = kNone;
    if (i >= count_) continue;
    if (beams_.own[i] != kNone) {
      const std::uint32_t leaf = beams_.own[i] / BlockerTree::kWidth;
      if (!CanBlockOwn(i, scene_.tree->leaves[leaf], scene_.fit->leaves[leaf])) beams_.leaf_to_skip[i] = leaf;
    }
    beams_.box_low[run] = glm::min(beams_.box_low[run], r), beams_.box_high[run] = glm::max(beams_.box_high[run], r);
    beams_.farthest[run] = std::max(beams_.farthest[run], p.z + 2e-6f);
    beams_.valid[run] |= static_cast<std::uint16_t>(1u << i % kRun);
  }
  beams_.blocked.assign(scene_.tiles->count * kRuns, 0);
}

/// May a triangle of its own leaf block the receiver? Most leaves are flat or bulge.
bool BeamSolver::CanBlockOwn(std::size_t i, const BlockerTree::Leaf& leaf, const BlockerFit::Leaf& fit) const {
  const Tag d;
  const vec3 r = Position(i);
  struct {
    std::uint32_t above = 0, below = 0, active = 0;
  } view;
  for (std::size_t j = 0; j < leaf.count; j += hn::Lanes(d)) {
    const Vec3 corner{hn::LoadU(d, leaf.corner[0][0] + j), hn::LoadU(d, leaf.corner[0][1] + j),
                      hn::LoadU(d, leaf.corner[0][2] + j)};
    FindSides(leaf, fit, j, r, r, vec3(0.0f), Subtract(corner, Splat(r)), view);
  }
  return (view.active & ~(1u << beams_.own[i] % BlockerTree::kWidth)) != 0;
}

/// Leaves that may lie between the cluster and the samples of the tile; false where there are none.
bool BeamSolver::ListLeaves(std::span<const vec3> tile) {
  const std::size_t lanes = hn::Lanes(Tag());
  Shaft shaft = cluster_.shaft;
  Rectangle light;
  float off_plane = 0.0f;
  for (std::size_t i = 0; i < tile.size(); ++i) {
    const vec3 p = place_[i] = vec3(scene_.frame.to_frame(dvec3(tile[i])));
    light.low_u = std::min(light.low_u, p.x), light.high_u = std::max(light.high_u, p.x);
    light.low_v = std::min(light.low_v, p.y), light.high_v = std::max(light.high_v, p.y);
    off_plane = std::max(off_plane, std::fabs(p.z));
  }
  middle_[0] = 0.5f * (light.low_u + light.high_u), middle_[1] = 0.5f * (light.low_v + light.high_v);
  const float pad = ProjectionPad(shaft.low[2]), inverse = 1.0f / shaft.low[2];
  shaft.light = {light.low_u - pad, light.low_v - pad, light.high_u + pad, light.high_v + pad};
  // A sample off the plane by dz sees slopes off by dz / z of themselves.
  off_plane_ = off_plane, receiver_pad_ = inverse * (kPad + 8.0f * inverse * off_plane);
  beams_.clear_leaves();
  const float* const group_low[3] = {scratch_.low[0].data(), scratch_.low[1].data(), scratch_.low[2].data()};
  const float* const group_high[3] = {scratch_.high[0].data(), scratch_.high[1].data(), scratch_.high[2].data()};
  for (std::size_t i = 0; i < scratch_.group.size(); i += lanes) {
    for (std::uint64_t bits = Bits(MeetsShaft(shaft, group_low, group_high, i)); bits != 0; bits &= bits - 1) {
      const BlockerTree::Node& group =
          scene_.fit->nodes[scratch_.group[i + static_cast<std::size_t>(std::countr_zero(bits))]];
      const float* const low[3] = {group.low[0], group.low[1], group.low[2]};
      const float* const high[3] = {group.high[0], group.high[1], group.high[2]};
      for (std::size_t j = 0; j < group.count; j += lanes) {
        for (std::uint64_t rest = Bits(MeetsShaft(shaft, low, high, j)); rest != 0; rest &= rest - 1) {
          const std::size_t k = j + static_cast<std::size_t>(std::countr_zero(rest));
          if (k < group.count) beams_.add_leaf(group, k);
        }
      }
    }
  }
  const std::size_t count = beams_.leaf.size();
  if (count == 0) return false;
  beams_.pad_leaves();
  for (std::size_t i = 0; i < count; i += lanes) FindSlopes(i);
  return true;
}

/// Leaves' boxes as the tile's middle sees them. What lies behind the light counts as just before it.
void BeamSolver::FindSlopes(std::size_t i) {
  const Tag d;
  BeamScratch::Slopes& slopes = beams_.leaf_slopes;
  const Vec one = hn::Set(d, 1.0f), tiny = hn::Set(d, 1e-9f);
  const Vec near = hn::Div(one, hn::Max(hn::LoadU(d, beams_.leaf_low[2].data() + i), tiny)),
            far = hn::Div(one, hn::Max(hn::LoadU(d, beams_.leaf_high[2].data() + i), tiny));
  const Vec pad =
      hn::MulAdd(near, hn::MulAdd(near, hn::Set(d, 8.0f * off_plane_), hn::Set(d, kPad)), hn::Set(d, receiver_pad_));
  for (std::size_t k = 0; k < 2; ++k) {
    const Vec middle = hn::Set(d, middle_[k]);
    const Vec a = hn::Sub(hn::LoadU(d, beams_.leaf_low[k].data() + i), middle),
              b = hn::Sub(hn::LoadU(d, beams_.leaf_high[k].data() + i), middle);
    hn::StoreU(hn::Sub(hn::Min(hn::Mul(a, near), hn::Mul(a, far)), pad), d, slopes.low[k].data() + i);
    hn::StoreU(hn::Add(hn::Max(hn::Mul(b, near), hn::Mul(b, far)), pad), d, slopes.high[k].data() + i);
  }
  for (std::size_t k = 2; k < kSlopes; ++k) {  // not known before the leaf is tight
    hn::StoreU(hn::Set(d, -1e30f), d, slopes.low[k].data() + i),
        hn::StoreU(hn::Set(d, 1e30f), d, slopes.high[k].data() + i);
  }
  hn::StoreU(near, d, slopes.near.data() + i), hn::StoreU(far, d, slopes.far.data() + i);
}

/// The slopes of a leaf's corners instead of its box's.
HWY_NOINLINE void BeamSolver::Tighten(std::size_t at) {
  const Tag d;
  beams_.is_tight[at] = true;
  if (!(beams_.leaf_low[2][at] > 1e-3f)) return;
  const BlockerTree::Leaf& leaf = scene_.tree->leaves[beams_.leaf[at]];
  const Vec3 axes[2] = {Splat(vec3(scene_.frame.u)), Splat(vec3(scene_.frame.v))}, normal = Splat(vec3(scene_.frame.n));
  const Vec3 origin = Splat(vec3(scene_.frame.origin));
  Slopes seen;
  for (std::size_t i = 0; i < BlockerTree::kWidth; i += hn::Lanes(d)) {
    for (const auto& corner : leaf.corner) {
      const Vec3 p =
          Subtract({hn::LoadU(d, corner[0] + i), hn::LoadU(d, corner[1] + i), hn::LoadU(d, corner[2] + i)}, origin);
      const Vec inverse = Reciprocal(Dot(p, normal));
      const Vec x = hn::Mul(hn::Sub(Dot(p, axes[0]), hn::Set(d, middle_[0])), inverse),
                y = hn::Mul(hn::Sub(Dot(p, axes[1]), hn::Set(d, middle_[1])), inverse);
      seen.Add(SlopesOf(x, y));
    }
  }
  BeamScratch::Slopes& slopes = beams_.leaf_slopes;
  const float near = slopes.near[at];
  for (std::size_t k = 0; k < kSlopes; ++k) {
    const float pad = (near * (2.0f * kPad + 8.0f * near * off_plane_) + receiver_pad_) *
                      (k < 2 ? 1.0f : 2.0f);  // two slopes' errors
    slopes.low[k][at] = std::max(slopes.low[k][at], hn::GetLane(hn::MinOfLanes(d, seen.low[k])) - pad);
    slopes.high[k][at] = std::min(slopes.high[k][at], hn::GetLane(hn::MaxOfLanes(d, seen.high[k])) + pad);
  }
}

/// Sample `i` of the tile.
void BeamSolver::SolveSample(std::size_t i, const vec3& sample, std::uint32_t number) {
  const Tag d;
  const std::size_t lanes = hn::Lanes(d), count = beams_.leaf.size();
  for (int k = 0; k < 2; ++k) off_[k] = place_[i][k] - middle_[k];
  off_[2] = off_[0] + off_[1], off_[3] = off_[0] - off_[1];
  const Vec u = hn::Set(d, place_[i].x), v = hn::Set(d, place_[i].y);
  float low[kSlopes], high[kSlopes];  // of all receivers
  std::fill_n(low, kSlopes, 1e30f), std::fill_n(high, kSlopes, -1e30f);
  for (std::size_t j = 0; j < kRuns; j += lanes) {
    Slopes runs;
    for (std::size_t r = 0; r < kRun; ++r) {
      const std::size_t at = r * kRuns + j;
      const Vec inverse = hn::Load(d, beams_.inverse_by_run + at);
      const Vec x = hn::NegMulAdd(inverse, u, hn::Load(d, beams_.x_by_run + at)),
                y = hn::NegMulAdd(inverse, v, hn::Load(d, beams_.y_by_run + at));
      runs.Add(SlopesOf(x, y));
    }
    for (std::size_t k = 0; k < kSlopes; ++k) {
      hn::Store(runs.low[k], d, run_low_[k] + j), hn::Store(runs.high[k], d, run_high_[k] + j);
      low[k] = std::min(low[k], hn::GetLane(hn::MinOfLanes(d, runs.low[k])));
      high[k] = std::max(high[k], hn::GetLane(hn::MaxOfLanes(d, runs.high[k])));
    }
  }
  for (std::size_t j = 0; j < kMostReceivers; j += lanes) {
    const Vec inverse = hn::Load(d, beams_.inverse + j);
    hn::Store(hn::NegMulAdd(inverse, u, hn::Load(d, beams_.x + j)), d, beams_.slope[0] + j);
    hn::Store(hn::NegMulAdd(inverse, v, hn::Load(d, beams_.y + j)), d, beams_.slope[1] + j);
  }
  std::copy_n(beams_.valid, kRuns, open_);
  open_runs_ = (1u << (count_ + kRun - 1) / kRun) - 1;
  const Vec farthest = hn::Set(d, cluster_.shaft.high[2] + kPad);
  for (std::size_t j = 0; j < count && open_runs_ != 0; j += lanes) {
    const Slopes leaves = SeeLeaves(j);
    LaneMask meets = hn::Lt(hn::LoadU(d, beams_.leaf_low[2].data() + j), farthest);
    for (std::size_t k = 0; k < kSlopes; ++k) {
      meets = hn::And(meets,
                      hn::And(hn::Le(leaves.low[k], hn::Set(d, high[k])), hn::Ge(leaves.high[k], hn::Set(d, low[k]))));
    }
    std::uint64_t bits = Bits(meets);
    if (bits == 0) continue;
    alignas(HWY_MAX_BYTES) float leaf_low[kSlopes][kMaxLanes], leaf_high[kSlopes][kMaxLanes];
    for (std::size_t k = 0; k < kSlopes; ++k)
      hn::Store(leaves.low[k], d, leaf_low[k]), hn::Store(leaves.high[k], d, leaf_high[k]);
    for (; bits != 0; bits &= bits - 1) {
      const auto lane = static_cast<std::size_t>(std::countr_zero(bits));
      Window leaf;
      for (std::size_t k = 0; k < kSlopes; ++k) leaf.low[k] = leaf_low[k][lane], leaf.high[k] = leaf_high[k][lane];
      TestLeaf(j + lane, sample, leaf);
    }
  }
  std::uint16_t* const blocked = beams_.blocked.data() + number * kRuns;
  for (std::size_t run = 0; run < kRuns; ++run)
    blocked[run] = static_cast<std::uint16_t>(beams_.valid[run] & ~open_[run]);
}

/// The runs that hold receivers which are open and may lie behind a leaf.
HWY_INLINE std::uint32_t BeamSolver::RunsBehind(std::size_t at, const Window& leaf) const {
  const Tag d;
  const Vec lowest = hn::Set(d, beams_.leaf_low[2][at] - kPad);
  std::uint32_t runs = 0;
  for (std::size_t run = 0; run < kRuns; run += hn::Lanes(d)) {
    LaneMask overlap = hn::Gt(hn::Load(d, beams_.farthest + run), lowest);
    for (std::size_t k = 0; k < kSlopes; ++k) {
      overlap = hn::And(overlap, hn::And(hn::Le(hn::Load(d, run_low_[k] + run), hn::Set(d, leaf.high[k])),
                                         hn::Ge(hn::Load(d, run_high_[k] + run), hn::Set(d, leaf.low[k]))));
    }
    runs |= BitsAt(overlap, run);
  }
  return runs & open_runs_;
}

/// A leaf against all receivers that may lie behind it.
HWY_INLINE void BeamSolver::TestLeaf(std::size_t at, const vec3& sample, Window leaf) {
  const Tag d;
  const UintTag du;
  std::uint32_t runs = RunsBehind(at, leaf);
  if (runs != 0 && !beams_.is_tight[at]) {
    Tighten(at);
    leaf = SeeLeaf(at);
    runs = RunsBehind(at, leaf);
  }
  const std::uint32_t index = beams_.leaf[at];
  const Vec lowest = hn::Set(d, beams_.leaf_low[2][at] - kPad);
  bool is_set = false;
  for (; runs != 0; runs &= runs - 1) {
    const auto run = static_cast<std::size_t>(std::countr_zero(runs));
    std::uint32_t asked = 0;
    for (std::size_t i = 0; i < kRun; i += hn::Lanes(d)) {
      const std::size_t r = run * kRun + i;
      LaneMask within = hn::Gt(hn::Load(d, beams_.height + r), lowest);
      const auto slope = SlopesOf(hn::Load(d, beams_.slope[0] + r), hn::Load(d, beams_.slope[1] + r));
      for (std::size_t k = 0; k < kSlopes; ++k) {
        within = hn::And(
            within, hn::And(hn::Le(slope[k], hn::Set(d, leaf.high[k])), hn::Ge(slope[k], hn::Set(d, leaf.low[k]))));
      }
      const auto other = hn::Ne(hn::Load(du, beams_.leaf_to_skip + r), hn::Set(du, index));
      asked |= BitsAt(hn::And(within, hn::RebindMask(d, other)), i);
    }
    asked &= open_[run];
    if (asked == 0) continue;
    if (!is_set) {
      is_set = true;
      ++scratch_.leaves_tested;
      const BlockerFit::Leaf& fit = scene_.fit->leaves[index];
      const vec3 reach = glm::max(glm::abs(cluster_.low - sample), glm::abs(cluster_.high - sample));
      planes_.Set(scene_.tree->leaves[index], fit.samples_below & ~SamplesBelow(fit, cluster_.low, cluster_.high),
                  sample, std::max(reach.x, std::max(reach.y, reach.z)) * (1.0f + 0x1p-20f));
      if (!planes_.any()) return;
    }
    scratch_.counters.pairs_tested += static_cast<std::uint64_t>(std::popcount(asked));
    open_[run] &= static_cast<std::uint16_t>(~TestRun(run, index, sample, asked));
    if (open_[run] == 0) open_runs_ &= ~(1u << run);
  }
}

/// Which of the receivers of a run are asked for and blocked?
HWY_INLINE std::uint32_t BeamSolver::TestRun(std::size_t run, std::uint32_t leaf, const vec3& sample,
                                             std::uint32_t asked) {
  const Tag d;
  constexpr int kManyReceivers = 6;
  std::uint32_t blocked = 0;
  const auto own_triangle = [&](std::size_t lane, std::size_t triangle) {
    return beams_.own[run * kRun + lane] == leaf * BlockerTree::kWidth + triangle;
  };
  if (std::popcount(asked) >= kManyReceivers && !planes_.any_unsure()) {
    const vec3 low = beams_.box_low[run], high = beams_.box_high[run], middle = 0.5f * (low + high);
    const vec3 half = glm::max(high - middle, middle - low) * (1.0f + 0x1p-20f) + 1e-6f;
    std::uint32_t triangles = planes_.Possible(middle - sample, half);
    if (std::popcount(triangles) < std::popcount(asked)) {  // triangle by triangle
      for (; triangles != 0 && (asked & ~blocked) != 0; triangles &= triangles - 1) {
        const auto triangle = static_cast<std::size_t>(std::countr_zero(triangles));
        ++scratch_.counters.sample_tests;
        std::uint32_t possible = 0, inside = 0;
        for (std::size_t i = 0; i < kRun; i += hn::Lanes(d)) {
          const std::size_t at = begin_ + run * kRun + i;
          const Vec3 r = Subtract(
              {hn::LoadU(d, &receivers_.x[at]), hn::LoadU(d, &receivers_.y[at]), hn::LoadU(d, &receivers_.z[at])},
              Splat(sample));
          LaneMask is;
          possible |= BitsAt(planes_.Possible(triangle, r, is), i), inside |= BitsAt(is, i);
        }
        for (possible &= asked & ~blocked; possible != 0; possible &= possible - 1) {
          const auto lane = static_cast<std::size_t>(std::countr_zero(possible));
          if (own_triangle(lane, triangle)) continue;
          if ((inside >> lane & 1) != 0 || IsBlocked(run * kRun + lane, leaf, triangle, sample)) blocked |= 1u << lane;
        }
      }
      return blocked;
    }
  }
  for (; asked != 0; asked &= asked - 1) {  // receiver by receiver
    const auto lane = static_cast<std::size_t>(std::countr_zero(asked));
    ++scratch_.counters.sample_tests;
    std::uint32_t inside;
    std::uint32_t possible = planes_.Possible(Position(run * kRun + lane) - sample, inside);
    for (; possible != 0; possible &= possible - 1) {
      const auto triangle = static_cast<std::size_t>(std::countr_zero(possible));
      if (own_triangle(lane, triangle)) continue;
      if ((inside >> triangle & 1) == 0 && !IsBlocked(run * kRun + lane, leaf, triangle, sample)) continue;
      blocked |= 1u << lane;
      break;
    }
  }
  return blocked;
}

void BeamSolver::StoreMasks() {
  for (std::size_t s = 0; s < scene_.tiles->count; ++s) {
    for (std::size_t run = 0; run < kRuns; ++run) {
      for (std::uint32_t rest = beams_.blocked[s * kRuns + run]; rest != 0; rest &= rest - 1) {
        const std::size_t i = begin_ + run * kRun + static_cast<std::size_t>(std::countr_zero(rest));
        receivers_.mask(i)[s / 64] |= std::uint64_t{1} << s % 64;
      }
    }
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace halfshade
HWY_AFTER_NAMESPACE();

#endif  // include guard
