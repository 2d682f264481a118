#include "shadows/volume_kernel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "shadows/volume_kernel.cpp"
#include <hwy/foreach_target.h>

#include "shadows/crossing.h"
#include "shadows/edge_planes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace halfshade {
namespace HWY_NAMESPACE {

/// Sum of float rounding errors when a plane is evaluated at a point with |coordinate| <= 2: below 1.1e-6.
constexpr float kPlaneError = 0x1p-19f;

/// Which of the volumes [i, i + lanes) can the box meet?
HWY_INLINE std::uint64_t VolumesAtBox(const VolumeLanes& v, std::size_t i, const LatticeBox& box) {
  const Tag d;
  LaneMask meets = hn::FirstN(d, hn::Lanes(d));
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const int k = static_cast<int>(axis);
    meets = hn::And(meets, hn::Le(hn::LoadU(d, &v.low[axis][i]), hn::Set(d, box.high[k])));
    meets = hn::And(meets, hn::Ge(hn::LoadU(d, &v.high[axis][i]), hn::Set(d, box.low[k])));
  }
  if (hn::AllFalse(d, meets)) return 0;
  const vec3 center = (box.low + box.high) * 0.5f, half = (box.high - box.low) * (0.5f + 0x1p-20f);
  for (std::size_t plane = 0; plane < 4; ++plane) {
    const Vec nx = hn::LoadU(d, &v.nx[plane][i]), ny = hn::LoadU(d, &v.ny[plane][i]),
              nz = hn::LoadU(d, &v.nz[plane][i]);
    const Vec at = Dot({nx, ny, nz}, Splat(center));
    const Vec reach = Dot({hn::Abs(nx), hn::Abs(ny), hn::Abs(nz)}, Splat(half));
    const Vec most = hn::Add(hn::Add(at, reach), hn::Set(d, kPlaneError));
    meets = hn::And(meets, hn::Ge(most, hn::LoadU(d, &v.offset[plane][i])));
  }
  return Bits(meets);
}

HWY_INLINE void ListVolumes(const VolumeLanes& volumes, const LatticeBox& box, std::vector<std::uint32_t>& list) {
  list.clear();
  const std::size_t lanes = hn::Lanes(Tag());
  for (std::size_t i = 0; i < volumes.size(); i += lanes) {
    for (std::uint64_t bits = VolumesAtBox(volumes, i, box); bits != 0; bits &= bits - 1) {
      list.push_back(static_cast<std::uint32_t>(i + static_cast<std::size_t>(std::countr_zero(bits))));
    }
  }
}

/// The same for one volume.
HWY_INLINE bool VolumeAtBox(const VolumeLanes& v, std::size_t i, const LatticeBox& box) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const int k = static_cast<int>(axis);
    if (v.low[axis][i] > box.high[k] || v.high[axis][i] < box.low[k]) return false;
  }
  for (std::size_t plane = 0; plane < 4; ++plane) {
    const vec3 n(v.nx[plane][i], v.ny[plane][i], v.nz[plane][i]);
    const vec3 best(n.x > 0.0f ? box.high.x : box.low.x, n.y > 0.0f ? box.high.y : box.low.y,
                    n.z > 0.0f ? box.high.z : box.low.z);
    if (glm::dot(n, best) + kPlaneError < v.offset[plane][i]) return false;
  }
  return true;
}

/// Receivers [first, first + count) that still ask, are not on the blocker, and lie inside the four planes (section
/// 2.3), one bit each.
HWY_INLINE std::uint64_t ReceiversInside(const VolumeLanes& v, std::size_t volume, std::uint32_t triangle,
                                         bool only_open, const KernelReceivers& receivers, std::size_t first,
                                         std::size_t count) {
  const Tag d;
  const UintTag du;
  const Vec3 r{hn::LoadU(d, &receivers.x[first]), hn::LoadU(d, &receivers.y[first]), hn::LoadU(d, &receivers.z[first])};
  const auto own = hn::Eq(hn::LoadU(du, &receivers.own[first]), hn::Set(du, triangle));
  LaneMask inside = hn::AndNot(hn::RebindMask(d, own), hn::FirstN(d, count));
  if (only_open) {
    inside = hn::And(inside, hn::RebindMask(d, hn::Ne(hn::LoadU(du, &receivers.open[first]), hn::Zero(du))));
  }
  for (std::size_t plane = 0; plane < 4; ++plane) {
    const Vec3 n = Splat({v.nx[plane][volume], v.ny[plane][volume], v.nz[plane][volume]});
    const Vec value = hn::Add(Dot(n, r), hn::Set(d, kPlaneError));
    inside = hn::And(inside, hn::Ge(value, hn::Set(d, v.offset[plane][volume])));
  }
  return Bits(inside);
}

/// J as scaled planes, and S with the scales taken back: coordinate = sum(texel[k] * plane[k]) / sum(error[k] *
/// plane[k]).
struct PairProjection {
  ScaledPlanes planes;
  float error[3], u[3], v[3];   // errors are the inverse scales, relative to the largest
  float constant, per_inverse;  // error of a texture coordinate in texels: constant + per_inverse / sum
  bool textured = false;        // false: opaque, or texels too many for float
};

HWY_INLINE PairProjection ScaleProjection(const VolumeBlocker& b, const SampleProjection& j, bool below, bool own_plane,
                                          bool use_texture) {
  PairProjection p;
  const double largest = std::max({j.error[0], j.error[1], j.error[2]});
  double sum = 0.0;
  for (std::size_t k = 0; k < 3; ++k) {
    const double scale = 1.0 / j.error[k];
    p.planes.mx[k] = static_cast<float>(j.normal[k].x * scale);
    p.planes.my[k] = static_cast<float>(j.normal[k].y * scale);
    p.planes.mz[k] = static_cast<float>(j.normal[k].z * scale);
    p.planes.d[k] = static_cast<float>(j.offset[k] * scale);
    const double relative = j.error[k] / largest;
    p.error[k] = static_cast<float>(relative);
    p.u[k] = static_cast<float>(b.texels.u[(k + 2) % 3] * relative);
    p.v[k] = static_cast<float>(b.texels.v[(k + 2) % 3] * relative);
    sum += relative;
  }
  if (own_plane) {
    const float scale = (below ? -1.0f : 1.0f) / std::max(b.blocker.plane_error, 0x1p-123f);
    p.planes.mx[3] = b.blocker.normal.x * scale;
    p.planes.my[3] = b.blocker.normal.y * scale;
    p.planes.mz[3] = b.blocker.normal.z * scale;
    p.planes.d[3] = b.blocker.plane_at_center * scale;
    p.planes.count = 4;
  }
  // Every plane value is off by at most 1. Value k moves the quotient u = N / Z by (u_k - u) / Z relative units, so
  // that all together move it by less than reach sum / (Z - sum), which is below 2 reach sum / Z from Z = 2 sum on;
  // before that the bound exceeds the reach and lets no texel pass but the only one there is. Rounding of coefficients,
  // products, sums of positive terms and the division: 9 units of 2^-24 together.
  p.per_inverse = static_cast<float>(2.05 * sum * b.texels.reach);
  p.constant = static_cast<float>(10.0 * 0x1p-24 * b.texels.reach);
  p.textured = use_texture && b.opacity != nullptr && b.texels.reach < 0x1p20;
  return p;
}

/// Bits of one group of samples.
struct GroupResult {
  std::uint64_t inside = 0, possible = 0;  // certainly inside the outline; not certainly outside
  std::uint64_t texel_known = 0, opaque = 0;
};

/// x - size * floor(x / size) for whole numbers 0 <= x < 2^20: half a texel keeps the quotient's rounding away from the
/// next whole number.
HWY_INLINE Vec Wrap(Vec x, Vec size, Vec inverse_size) {
  const Tag d;
  const Vec quotient = hn::Floor(hn::Mul(hn::Add(x, hn::Set(d, 0.5f)), inverse_size));
  return hn::Sub(x, hn::Mul(quotient, size));
}

/// Planes of 15 operations and, where a sample is inside, texture coordinates of 12 (section 2.4).
HWY_INLINE GroupResult TestTexturedGroup(const PairProjection& p, const OpacityBits& opacity, const float* x,
                                         const float* y, const float* z) {
  const Tag d;
  const hn::RebindToSigned<Tag> di;
  const UintTag du;
  GroupResult result;
  const Vec width = hn::Set(d, static_cast<float>(opacity.width)),
            height = hn::Set(d, static_cast<float>(opacity.height));
  const Vec per_width = hn::Set(d, 1.0f / static_cast<float>(opacity.width)),
            per_height = hn::Set(d, 1.0f / static_cast<float>(opacity.height));
  for (std::size_t i = 0; i < KernelSamples::kGroup; i += hn::Lanes(d)) {
    const Vec px = hn::LoadU(d, x + i), py = hn::LoadU(d, y + i), pz = hn::LoadU(d, z + i);
    const Vec a = PlaneValue(p.planes, 0, px, py, pz), b = PlaneValue(p.planes, 1, px, py, pz),
              c = PlaneValue(p.planes, 2, px, py, pz);
    Vec least = hn::Min(a, hn::Min(b, c));
    if (p.planes.count == 4) least = hn::Min(least, PlaneValue(p.planes, 3, px, py, pz));
    const LaneMask inside = hn::Gt(least, hn::Set(d, 1.0f));
    result.inside |= Bits(inside) << i;
    result.possible |= Bits(hn::Ge(least, hn::Set(d, -1.0f))) << i;
    if (hn::AllFalse(d, inside)) continue;
    const auto row = [&](const float* m) {
      return hn::MulAdd(hn::Set(d, m[0]), a, hn::MulAdd(hn::Set(d, m[1]), b, hn::Mul(hn::Set(d, m[2]), c)));
    };
    const Vec inverse = hn::Div(hn::Set(d, 1.0f), row(p.error));
    const Vec u = hn::Mul(row(p.u), inverse), v = hn::Mul(row(p.v), inverse);
    const Vec column = hn::Floor(u), up = hn::Floor(v), one = hn::Set(d, 1.0f);
    const Vec fu = hn::Sub(u, column), fv = hn::Sub(v, up);
    const Vec border = hn::Min(hn::Min(fu, hn::Sub(one, fu)), hn::Min(fv, hn::Sub(one, fv)));
    const Vec error = hn::MulAdd(hn::Set(d, p.per_inverse), inverse, hn::Set(d, p.constant));
    const LaneMask known = hn::And(inside, hn::Gt(border, error));
    const auto texel_x = hn::ConvertTo(di, hn::IfThenElseZero(known, Wrap(column, width, per_width)));
    const auto texel_y = hn::ConvertTo(di, hn::IfThenElseZero(known, Wrap(up, height, per_height)));
    const auto index = hn::Add(hn::Mul(texel_y, hn::Set(di, static_cast<std::int32_t>(opacity.width))), texel_x);
    const auto word = hn::GatherIndex(du, opacity.bits.data(), hn::ShiftRight<5>(index));
    const auto bit = hn::And(hn::Shr(word, hn::And(hn::BitCast(du, index), hn::Set(du, 31))), hn::Set(du, 1));
    result.texel_known |= Bits(known) << i;
    result.opaque |= Bits(hn::And(known, hn::RebindMask(d, hn::Ne(bit, hn::Zero(du))))) << i;
  }
  return result;
}

/// Settles what float left open, by crossings.
HWY_INLINE std::uint64_t SettleCrossings(const VolumeBlocker& b, const vec3& receiver, std::span<const vec3> samples,
                                         std::uint64_t inside, std::uint64_t doubtful, bool use_texture,
                                         KernelCounters& counters) {
  const auto& [p, q, s] = b.blocker.corner;
  counters.exact_fallbacks += static_cast<std::uint64_t>(std::popcount(doubtful));
  for (std::uint64_t rest = doubtful; rest != 0; rest &= rest - 1) {
    const int bit = std::countr_zero(rest);
    if (crosses(p, q, s, receiver, samples[static_cast<std::size_t>(bit)])) inside |= std::uint64_t{1} << bit;
  }
  if (!use_texture || b.opacity == nullptr || inside == 0) return inside;
  return settle_samples(b.blocker, receiver, samples, inside, 0, counters);
}

/// One triangle and one receiver in its volume: all samples, or with masks those that are not blocked yet.
class Pair {
 public:
  Pair(const VolumeScene& scene, const VolumeBlocker& blocker, int light_side, std::size_t receiver,
       KernelReceivers& receivers, VolumeSink* sink, KernelCounters& counters)
      : samples_(*scene.samples),
        blocker_(blocker),
        light_side_(light_side),
        place_(receiver),
        receivers_(receivers),
        sink_(sink),
        counters_(counters),
        use_texture_(scene.use_textures),
        position_(receivers.x[receiver], receivers.y[receiver], receivers.z[receiver]) {}

  void run() {
    const auto& [p, q, s] = blocker_.blocker.corner;
    const int side = orient3d(p, q, s, position_);
    const bool below = side < 0;
    if (light_side_ != 0 && side != light_side_) return;  // in the other side's volume by its padding
    if (side == 0 || !(below ? blocker_.blocker.samples_below : blocker_.blocker.samples_above)) return;
    ++counters_.pairs_sampled;
    projection_ = make_sample_projection(blocker_.blocker, samples_, position_, side);
    const bool own_plane = !(below ? blocker_.blocker.all_below : blocker_.blocker.all_above);
    pair_ = ScaleProjection(blocker_, projection_, below, own_plane, use_texture_);
    for (std::size_t word = 0; word < receivers_.words; word += 16) TestWords(word);
    if (!added_) return;
    ++counters_.pairs_necessary;
    if (sink_ == nullptr && std::equal(samples_.valid.begin(), samples_.valid.end(), receivers_.mask(place_))) {
      receivers_.open[place_] = 0;
    }
  }

 private:
  HWY_INLINE void TestWords(std::size_t word) {
    constexpr std::uint64_t kNothing[16] = {};
    const std::size_t set = receivers_.set[place_], count = std::min<std::size_t>(16, receivers_.words - word);
    std::uint64_t* mask = receivers_.mask(place_);
    const std::uint64_t open = sink_ != nullptr ? OpenGroups(samples_.valid.data() + word, kNothing, 0, count)
                                                : OpenGroups(samples_.valid.data(), mask, word, count);
    const GroupBits groups = TestGroups(pair_.planes, samples_, set * samples_.group_stride + 4 * word, open);
    for (std::uint64_t rest = groups.possible; rest != 0; rest &= rest - 1) {
      const auto in_words = static_cast<std::size_t>(std::countr_zero(rest));
      const std::size_t first = (4 * word + in_words) * KernelSamples::kGroup, w = first / 64, shift = first % 64;
      const std::uint64_t wanted =
          ((samples_.valid[w] & (sink_ != nullptr ? ~std::uint64_t{0} : ~mask[w])) >> shift) & 0xffff;
      const std::uint64_t bits =
          TestGroupOfPair(set * samples_.padded + first, ((groups.inside >> in_words) & 1) != 0, wanted);
      if (bits == 0) continue;
      added_ = true;
      if (sink_ != nullptr) {
        sink_->add(blocker_, place_, projection_, first, bits);
      } else {
        mask[w] |= bits << shift;
      }
    }
  }

  HWY_INLINE std::uint64_t TestGroupOfPair(std::size_t at, bool covered, std::uint64_t wanted) {
    GroupResult r;
    if (pair_.textured) {
      r = TestTexturedGroup(pair_, *blocker_.opacity, &samples_.x[at], &samples_.y[at], &samples_.z[at]);
      counters_.sample_tests += KernelSamples::kGroup;
    } else if (covered) {
      r.inside = r.possible = wanted;
    } else {
      TestGroup(pair_.planes, &samples_.x[at], &samples_.y[at], &samples_.z[at], r.inside, r.possible);
      counters_.sample_tests += KernelSamples::kGroup;
    }
    if (blocker_.opacity == nullptr || !use_texture_) r.texel_known = r.opaque = r.inside;
    const std::uint64_t hidden = r.inside & r.opaque & wanted;
    const std::uint64_t inside = r.inside & ~r.texel_known & wanted, doubtful = r.possible & ~r.inside & wanted;
    if ((inside | doubtful) == 0) return hidden;
    const std::span<const vec3> points{samples_.points.data() + at, KernelSamples::kGroup};
    return hidden |
           (sink_ != nullptr ? SettleCrossings(blocker_, position_, points, inside, doubtful, use_texture_, counters_)
                             : settle_samples(blocker_.blocker, position_, points, inside, doubtful, counters_));
  }

  const KernelSamples& samples_;
  const VolumeBlocker& blocker_;
  int light_side_;
  std::size_t place_;
  KernelReceivers& receivers_;
  VolumeSink* sink_;
  KernelCounters& counters_;
  bool use_texture_, added_ = false;
  vec3 position_;
  SampleProjection projection_;
  PairProjection pair_;
};

void SolveVolumeBlock(const VolumeScene& scene, std::size_t block, KernelReceivers& receivers, VolumeSink* sink,
                      VolumeScratch& scratch) {
  constexpr std::size_t kTile = ReceiverTiles::kTile, kTiles = ReceiverTiles::kTilesPerBlock;
  const std::size_t lanes = hn::Lanes(Tag());
  const VolumeLanes& volumes = *scene.volumes;
  ListVolumes(volumes, scene.tiles->blocks[block], scratch.of_block);
  const std::size_t end_tile = std::min(scene.tiles->tiles.size(), (block + 1) * kTiles);
  for (std::size_t tile = block * kTiles; tile < end_tile; ++tile) {
    const std::size_t end = std::min(scene.tiles->order.size(), (tile + 1) * kTile);
    for (const std::uint32_t volume : scratch.of_block) {
      if (!VolumeAtBox(volumes, volume, scene.tiles->tiles[tile])) continue;
      ++scratch.volumes_listed;
      const VolumeBlocker& blocker = scene.blockers[volumes.blocker[volume]];
      for (std::size_t i = tile * kTile; i < end; i += lanes) {
        scratch.receivers_tested += std::min(lanes, end - i);
        std::uint64_t inside = ReceiversInside(volumes, volume, blocker.blocker.triangle, sink == nullptr, receivers, i,
                                               std::min(lanes, end - i));
        scratch.counters.pairs_tested += static_cast<std::uint64_t>(std::popcount(inside));
        for (; inside != 0; inside &= inside - 1) {
          const std::size_t place = i + static_cast<std::size_t>(std::countr_zero(inside));
          Pair(scene, blocker, volumes.light_side[volume], place, receivers, sink, scratch.counters).run();
        }
      }
    }
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace halfshade
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace halfshade {

HWY_EXPORT(SolveVolumeBlock);

void VolumeLanes::add(const SoftShadowVolume& volume, std::uint32_t blocker_index) {
  constexpr double kEverywhere = 4.0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const int k = static_cast<int>(axis);
    low[axis].push_back(static_cast<float>(std::max(volume.low[k], -kEverywhere)));
    high[axis].push_back(static_cast<float>(std::min(volume.high[k], kEverywhere)));
  }
  for (std::size_t plane = 0; plane < 4; ++plane) {
    const vec3 n(volume.normal[plane]);
    nx[plane].push_back(n.x), ny[plane].push_back(n.y), nz[plane].push_back(n.z);
    offset[plane].push_back(static_cast<float>(volume.offset[plane]));
  }
  light_side.push_back(static_cast<std::int8_t>(volume.light_side));
  blocker.push_back(blocker_index);
}

void VolumeLanes::pad() {
  const std::size_t padded = size() + kPadding;
  for (auto& x : low) x.resize(padded, 1e30f);
  for (auto& x : high) x.resize(padded, -1e30f);
  for (auto* planes : {&nx, &ny, &nz, &offset}) {
    for (auto& x : *planes) x.resize(padded, 0.0f);
  }
}

void solve_volume_block(const VolumeScene& scene, std::size_t block, KernelReceivers& receivers, VolumeSink* sink,
                        VolumeScratch& scratch) {
  HWY_DYNAMIC_DISPATCH(SolveVolumeBlock)(scene, block, receivers, sink, scratch);
}

}  // namespace halfshade
#endif
