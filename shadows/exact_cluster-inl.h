// The shaft from a cluster of receivers to the light against the tree of blockers, per instruction set. Included once
// per Highway target by packet_kernel.cpp.

#if defined(HALFSHADE_EXACT_CLUSTER_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef HALFSHADE_EXACT_CLUSTER_INL_H_
#undef HALFSHADE_EXACT_CLUSTER_INL_H_
#else
#define HALFSHADE_EXACT_CLUSTER_INL_H_
#endif

#include "shadows/edge_planes-inl.h"
#include "shadows/packet_kernel.h"

HWY_BEFORE_NAMESPACE();
namespace halfshade {
namespace HWY_NAMESPACE {

/// A rectangle in the light's plane.
struct Rectangle {
  float low_u = 1e30f, low_v = 1e30f, high_u = -1e30f, high_v = -1e30f;
};

/// Receivers as a box in the light's frame (a point for a single one), and what of the light they ask for.
struct Shaft {
  float low[3], high[3];
  Rectangle light;     // padded for rounding
  float floor = 0.0f;  // height of the lowest sample; 0 where all lie in the plane
};

/// Rounding of a projection onto the light's plane: coordinates are below 4 and carry 1e-6, and the samples lie that
/// near to the plane, which grazing receivers see magnified.
HWY_INLINE float ProjectionPad(float z) { return 1e-5f + 2e-6f / z; }

/// Rectangles on the light's plane.
struct LaneRectangles {
  Vec low[2], high[2];
};

/// Where boxes project to, as seen by any of the receivers; the lanes whose box reaches between the receivers and the
/// light. Box and receivers project onto the light's plane as q = r + (p - r) k with k = z_r / (z_r - z_p); the
/// extremes lie at extreme p, r and k.
HWY_INLINE LaneMask ProjectBoxes(const Shaft& s, const float* const low[3], const float* const high[3], std::size_t i,
                                 LaneRectangles& q) {
  const Tag d;
  const Vec floor = hn::Set(d, s.floor), tiny = hn::Set(d, 1e-30f);
  const Vec z_low = hn::Max(hn::LoadU(d, low[2] + i), floor), z_high = hn::LoadU(d, high[2] + i);
  const Vec r_low = hn::Set(d, s.low[2]), r_high = hn::Set(d, s.high[2]);
  // What lies behind the plane z = 0 projects towards the receivers, the more the lower they are.
  const auto from = [&](Vec z, Vec above, Vec below) HWY_ATTR {
    const Vec r = hn::IfThenElse(hn::Lt(z, hn::Zero(d)), below, above);
    return hn::Div(r, hn::Max(hn::Sub(r, z), tiny));
  };
  const Vec near = from(z_low, r_high, r_low), far = from(hn::Max(z_high, floor), r_low, r_high);
  for (int k = 0; k < 2; ++k) {
    const Vec a = hn::Set(d, s.low[k]), b = hn::Set(d, s.high[k]);
    const Vec to_low = hn::Sub(hn::LoadU(d, low[k] + i), b), to_high = hn::Sub(hn::LoadU(d, high[k] + i), a);
    q.low[k] = hn::Add(b, hn::Min(hn::Mul(to_low, near), hn::Mul(to_low, far)));
    q.high[k] = hn::Add(a, hn::Max(hn::Mul(to_high, near), hn::Mul(to_high, far)));
  }
  return hn::And(hn::Lt(z_low, r_high), hn::Ge(z_high, floor));
}

/// Which of the boxes can hold a point between the receivers and the light?
HWY_INLINE LaneMask MeetsShaft(const Shaft& s, const float* const low[3], const float* const high[3], std::size_t i) {
  const Tag d;
  LaneRectangles q;
  LaneMask meets = ProjectBoxes(s, low, high, i, q);
  const float light_low[2] = {s.light.low_u, s.light.low_v}, light_high[2] = {s.light.high_u, s.light.high_v};
  for (int k = 0; k < 2; ++k) {
    meets = hn::And(meets,
                    hn::And(hn::Le(q.low[k], hn::Set(d, light_high[k])), hn::Ge(q.high[k], hn::Set(d, light_low[k]))));
  }
  return meets;
}

/// Groups whose box meets the cluster's shaft, into scratch.group.
HWY_INLINE void CollectGroups(const BlockerFit& fit, const Shaft& shaft, ExactScratch& scratch) {
  const std::size_t lanes = hn::Lanes(Tag());
  scratch.group.clear();
  for (int k = 0; k < 3; ++k) scratch.low[k].clear(), scratch.high[k].clear();
  scratch.stack.assign(1, 0);
  while (!scratch.stack.empty()) {
    const BlockerTree::Node& node = fit.nodes[scratch.stack.back()];
    scratch.stack.pop_back();
    const float* const low[3] = {node.low[0], node.low[1], node.low[2]};
    const float* const high[3] = {node.high[0], node.high[1], node.high[2]};
    for (std::size_t i = 0; i < node.count; i += lanes) {
      for (std::uint64_t bits = Bits(MeetsShaft(shaft, low, high, i)); bits != 0; bits &= bits - 1) {
        const std::size_t at = i + static_cast<std::size_t>(std::countr_zero(bits));
        if (at >= node.count) continue;
        const std::uint32_t child = node.child[at];
        if (!fit.nodes[child].is_group) {
          scratch.stack.push_back(child);
          continue;
        }
        scratch.group.push_back(child);
        for (int k = 0; k < 3; ++k) {
          scratch.low[k].push_back(node.low[k][at]);
          scratch.high[k].push_back(node.high[k][at]);
        }
      }
    }
  }
}

/// What hides much is tested before what hides little: first the groups that hid something from the last cluster, most
/// of it first, then those whose box covers the largest share of the light.
HWY_INLINE void SortGroups(const Shaft& shaft, ExactScratch& scratch) {
  const std::size_t count = scratch.group.size();
  scratch.keys.clear();
  const float r[3] = {0.5f * (shaft.low[0] + shaft.high[0]), 0.5f * (shaft.low[1] + shaft.high[1]),
                      0.5f * (shaft.low[2] + shaft.high[2])};
  for (std::uint32_t i = 0; i < count; ++i) {
    const float z = 0.5f * (std::max(scratch.low[2][i], 0.0f) + scratch.high[2][i]);
    const float k = r[2] / std::max(r[2] - z, 1e-6f);
    float area = 1.0f;
    const float light_low[2] = {shaft.light.low_u, shaft.light.low_v},
                light_high[2] = {shaft.light.high_u, shaft.light.high_v};
    for (int axis = 0; axis < 2; ++axis) {
      const float a = std::max(r[axis] + (scratch.low[axis][i] - r[axis]) * k, light_low[axis]);
      const float b = std::min(r[axis] + (scratch.high[axis][i] - r[axis]) * k, light_high[axis]);
      area *= std::max(b - a, 0.0f);
    }
    constexpr float kAboveAnyArea = 100.0f;  // coordinates are below 4
    float& gain = scratch.gain[scratch.group[i]];
    scratch.keys.emplace_back(gain > 0.0f ? -kAboveAnyArea - gain : -area, i);
    gain = gain < 0.5f ? 0.0f : 0.25f * gain;
  }
  std::sort(scratch.keys.begin(), scratch.keys.end());
  const auto reorder = [&](auto& values, auto& old) {
    old = values;
    for (std::size_t i = 0; i < count; ++i) values[i] = old[scratch.keys[i].second];
  };
  reorder(scratch.group, scratch.old_group);
  for (int k = 0; k < 3; ++k) {
    reorder(scratch.low[k], scratch.old_bound), reorder(scratch.high[k], scratch.old_bound);
    scratch.low[k].resize(count + kMaxLanes, 1e30f);  // padding: boxes that no shaft meets
    scratch.high[k].resize(count + kMaxLanes, -1e30f);
  }
}

HWY_INLINE LaneMask LanesFromBits(std::uint32_t bits, std::size_t first) {
  const Tag d;
  std::uint8_t bytes[8] = {};
  const std::uint32_t shifted = bits >> first;
  hwy::CopyBytes<4>(&shifted, bytes);
  return hn::LoadMaskBits(d, bytes);
}

/// Where the receivers of a box, all above it, see the box around a cloud of samples before the plane z = 0: a sample l
/// at l + (l - r) k with k = l_z / (r_z - l_z).
HWY_INLINE Rectangle ProjectCloud(const SampleCloud& cloud, const Shaft& box) {
  const float below = cloud.low.z, above = cloud.high.z;
  const float k[2] = {below / ((below < 0.0f ? box.low[2] : box.high[2]) - below),
                      above / ((above < 0.0f ? box.high[2] : box.low[2]) - above)};
  float low[2], high[2];
  for (int axis = 0; axis < 2; ++axis) {
    const float away_low = cloud.low[axis] - box.high[axis], away_high = cloud.high[axis] - box.low[axis];
    const float by[4] = {away_low * k[0], away_low * k[1], away_high * k[0], away_high * k[1]};
    low[axis] = cloud.low[axis] + *std::min_element(by, by + 4);
    high[axis] = cloud.high[axis] + *std::max_element(by, by + 4);
  }
  return {low[0], low[1], high[0], high[1]};
}

/// From a box of receivers to the light.
HWY_INLINE Shaft ShaftToLight(const ExactScene& scene, Shaft shaft) {
  Rectangle light{scene.rows->low.x, scene.rows->low.y, scene.rows->high.x, scene.rows->high.y};
  if (scene.cloud != nullptr) light = ProjectCloud(*scene.cloud, shaft), shaft.floor = scene.cloud->low.z;
  const float pad = ProjectionPad(shaft.low[2]);
  shaft.light = {light.low_u - pad, light.low_v - pad, light.high_u + pad, light.high_v + pad};
  return shaft;
}

}  // namespace HWY_NAMESPACE
}  // namespace halfshade
HWY_AFTER_NAMESPACE();

#endif  // include guard
