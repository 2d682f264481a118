#include "shadows/raytrace/embree_rays.h"

#include <embree3/rtcore.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <numeric>

#include "rasterizer/core/parallel.h"
#include "rasterizer/core/stopwatch.h"
#include "shadows/alpha.h"

namespace halfshade {
namespace {

constexpr float kTfar = 1.0f - 0x1p-20f;
constexpr int kVariants = 6;  // trees: {fast, robust} x {low, medium, high}

int variant(const EmbreeMode& mode) { return (mode.robust ? 3 : 0) + static_cast<int>(mode.quality); }

/// k where the samples are a k x k grid with k a power of two of at least 4, else 0.
std::uint32_t grid_side(std::uint32_t count) {
  const auto k = static_cast<std::uint32_t>(std::lround(std::sqrt(static_cast<double>(count))));
  return k >= 4 && k * k == count && std::has_single_bit(k) ? k : 0;
}

/// Row-major indices of a grid in Morton order, so that 4, 8 and 16 in a row form blocks of 2x2, 4x2 and 4x4.
std::vector<std::uint32_t> block_order(std::uint32_t count) {
  const std::uint32_t k = grid_side(count);
  std::vector<std::uint32_t> order(count);
  for (std::uint32_t i = 0; i < count && k > 0; ++i) {
    std::uint32_t x = 0, y = 0;
    for (std::uint32_t bit = 0; bit < 16; ++bit) {
      x |= (i >> (2 * bit) & 1) << bit;
      y |= (i >> (2 * bit + 1) & 1) << bit;
    }
    order[i] = y * k + x;
  }
  return order;
}

template <int width>
struct Packet;
template <>
struct Packet<4> {
  using Ray = RTCRay4;
  static constexpr auto occluded = rtcOccluded4;
};
template <>
struct Packet<8> {
  using Ray = RTCRay8;
  static constexpr auto occluded = rtcOccluded8;
};
template <>
struct Packet<16> {
  using Ray = RTCRay16;
  static constexpr auto occluded = rtcOccluded16;
};

/// Texture of one alpha-tested triangle, in texels.
struct TriangleTexture {
  const AlphaMap* map;
  std::uint32_t threshold;
  std::array<vec2, 3> texel;  // v counted from the picture's bottom
};

/// Embree's callback at hits of alpha-tested triangles: a hit on a transparent texel does not count.
void alpha_filter(const RTCFilterFunctionNArguments* args) {
  const auto* textures = static_cast<const TriangleTexture*>(args->geometryUserPtr);
  for (unsigned i = 0; i < args->N; ++i) {
    if (args->valid[i] == 0) continue;
    const TriangleTexture& t = textures[RTCHitN_primID(args->hit, args->N, i)];
    const float b = RTCHitN_u(args->hit, args->N, i), c = RTCHitN_v(args->hit, args->N, i);
    const vec2 at = t.texel[0] * (1.0f - b - c) + t.texel[1] * b + t.texel[2] * c;
    const std::uint32_t x = wrap_texel(at.x, t.map->width), y = t.map->height - 1 - wrap_texel(at.y, t.map->height);
    if (t.map->alpha[std::size_t{y} * t.map->width + x] < t.threshold) args->valid[i] = 0;
  }
}

/// Packets whose rays start at `receiver(lane)`; only directions and tfar change from call to call.
template <int width, class Receiver>
void start_rays(typename Packet<width>::Ray& ray, const Receiver& receiver) {
  for (std::size_t k = 0; k < width; ++k) {
    const vec3 r = receiver(k);
    ray.org_x[k] = r.x, ray.org_y[k] = r.y, ray.org_z[k] = r.z;
    ray.tnear[k] = 0.0f, ray.time[k] = 0.0f, ray.mask[k] = ~0u, ray.id[k] = 0, ray.flags[k] = 0;
  }
}

/// Positions as three arrays, so that packets are filled by vector instructions.
struct PointArrays {
  std::vector<float> x, y, z;
  void push_back(const vec3& p) { x.push_back(p.x), y.push_back(p.y), z.push_back(p.z); }
};

}  // namespace

struct EmbreeRays::State {
  State(const LatticeMesh& m, const ReceiverArray& r, const LightSamples& s) : mesh(m), receivers(r), samples(s) {}

  const LatticeMesh& mesh;
  const ReceiverArray& receivers;
  const LightSamples& samples;
  RTCDevice device = nullptr;
  std::array<RTCScene, kVariants> scenes{};
  std::array<double, kVariants> build_ms{};
  std::vector<std::uint32_t> opaque, perforated;  // triangles of the two geometries
  std::vector<TriangleTexture> textures;          // [perforated]
  std::vector<std::uint32_t> blocks;              // block order -> sample
  PointArrays rows, squares;                      // samples [set][padded_count], in their own and in block order
  std::size_t padded_count = 0;                   // samples of a set, rounded up to whole packets

  void add_geometry(RTCScene scene, const std::vector<std::uint32_t>& triangles, bool alpha);
  RTCScene build(bool robust, BuildQuality quality);

  template <int width>
  void trace_receiver(RTCScene scene, RTCIntersectContext& context, std::uint32_t receiver, bool in_blocks,
                      VisibilityMasks& masks) const;
  void trace_singly(RTCScene scene, RTCIntersectContext& context, std::uint32_t receiver, VisibilityMasks& masks) const;
  template <int width>
  void trace_group(RTCScene scene, RTCIntersectContext& context, std::span<const std::uint32_t> group,
                   VisibilityMasks& masks) const;
  template <int width>
  void trace_range(const EmbreeMode& mode, RTCIntersectContext& context, std::span<const std::uint32_t> order,
                   VisibilityMasks& masks) const;
};

void EmbreeRays::State::add_geometry(RTCScene scene, const std::vector<std::uint32_t>& triangles, bool alpha) {
  if (triangles.empty()) return;
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  void* positions = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, sizeof(vec3),
                                            mesh.positions.size());
  std::memcpy(positions, mesh.positions.data(), mesh.positions.size() * sizeof(vec3));
  auto* corners = static_cast<std::array<std::uint32_t, 3>*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(std::uint32_t), triangles.size()));
  for (std::size_t i = 0; i < triangles.size(); ++i) corners[i] = mesh.triangles[triangles[i]];
  if (alpha) {
    rtcSetGeometryUserData(geometry, textures.data());
    rtcSetGeometryOccludedFilterFunction(geometry, alpha_filter);
  }
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene, geometry);
  rtcReleaseGeometry(geometry);
}

RTCScene EmbreeRays::State::build(bool robust, BuildQuality quality) {
  static constexpr RTCBuildQuality kQualities[] = {RTC_BUILD_QUALITY_LOW, RTC_BUILD_QUALITY_MEDIUM,
                                                   RTC_BUILD_QUALITY_HIGH};
  RTCScene scene = rtcNewScene(device);
  rtcSetSceneFlags(scene, robust ? RTC_SCENE_FLAG_ROBUST : RTC_SCENE_FLAG_NONE);
  rtcSetSceneBuildQuality(scene, kQualities[static_cast<int>(quality)]);
  add_geometry(scene, opaque, false);
  add_geometry(scene, perforated, true);
  rtcCommitScene(scene);
  return scene;
}

/// All samples of one receiver, `width` at a time. The arrays of samples are padded to whole packets.
template <int width>
void EmbreeRays::State::trace_receiver(RTCScene scene, RTCIntersectContext& context, std::uint32_t receiver,
                                       bool in_blocks, VisibilityMasks& masks) const {
  const PointArrays& points = in_blocks ? squares : rows;
  const vec3 r = receivers.position[receiver];
  const std::size_t first = std::size_t{receivers.set[receiver]} * padded_count;
  std::uint64_t* mask = masks.words.data() + receiver * masks.words_per_receiver;
  alignas(64) int valid[width];
  alignas(64) typename Packet<width>::Ray ray;
  start_rays<width>(ray, [r](std::size_t) { return r; });
  for (std::uint32_t i = 0; i < samples.count; i += width) {
    const float *x = &points.x[first + i], *y = &points.y[first + i], *z = &points.z[first + i];
    const int lanes = std::min(width, static_cast<int>(samples.count - i));
    for (int k = 0; k < width; ++k) {
      valid[k] = k < lanes ? -1 : 0;
      ray.dir_x[k] = x[k] - r.x, ray.dir_y[k] = y[k] - r.y, ray.dir_z[k] = z[k] - r.z;
      ray.tfar[k] = kTfar;
    }
    Packet<width>::occluded(valid, scene, &context, &ray);
    std::uint64_t bits = 0;
    for (int k = 0; k < lanes; ++k) bits |= std::uint64_t{ray.tfar[k] < 0.0f} << k;
    if (!in_blocks) {
      mask[i / 64] |= bits << (i % 64);  // packet widths divide 64
    } else {
      for (; bits != 0; bits &= bits - 1) {
        const std::uint32_t sample = blocks[i + static_cast<std::uint32_t>(std::countr_zero(bits))];
        mask[sample / 64] |= std::uint64_t{1} << (sample % 64);
      }
    }
  }
}

void EmbreeRays::State::trace_singly(RTCScene scene, RTCIntersectContext& context, std::uint32_t receiver,
                                     VisibilityMasks& masks) const {
  const vec3 r = receivers.position[receiver];
  const std::span<const vec3> set = samples.set(receivers.set[receiver]);
  std::uint64_t* mask = masks.words.data() + receiver * masks.words_per_receiver;
  for (std::uint32_t i = 0; i < samples.count; ++i) {
    const vec3 d = set[i] - r;
    RTCRay ray{r.x, r.y, r.z, 0.0f, d.x, d.y, d.z, 0.0f, kTfar, ~0u, 0, 0};
    rtcOccluded1(scene, &context, &ray);
    mask[i / 64] |= std::uint64_t{ray.tfar < 0.0f} << (i % 64);
  }
}

/// Sample by sample, the same one for up to `width` receivers.
template <int width>
void EmbreeRays::State::trace_group(RTCScene scene, RTCIntersectContext& context, std::span<const std::uint32_t> group,
                                    VisibilityMasks& masks) const {
  alignas(64) int valid[width];
  alignas(64) typename Packet<width>::Ray ray;
  std::array<vec3, width> r;
  std::array<const vec3*, width> set;
  for (std::size_t k = 0; k < width; ++k) {
    const std::uint32_t receiver = group[k < group.size() ? k : 0];
    valid[k] = k < group.size() ? -1 : 0;
    r[k] = receivers.position[receiver];
    set[k] = samples.set(receivers.set[receiver]).data();
  }
  start_rays<width>(ray, [&r](std::size_t k) { return r[k]; });
  for (std::uint32_t i = 0; i < samples.count; ++i) {
    for (std::size_t k = 0; k < width; ++k) {
      const vec3 d = set[k][i] - r[k];
      ray.dir_x[k] = d.x, ray.dir_y[k] = d.y, ray.dir_z[k] = d.z, ray.tfar[k] = kTfar;
    }
    Packet<width>::occluded(valid, scene, &context, &ray);
    for (std::size_t k = 0; k < group.size(); ++k) {
      masks.words[group[k] * masks.words_per_receiver + i / 64] |= std::uint64_t{ray.tfar[k] < 0.0f} << (i % 64);
    }
  }
}

template <int width>
void EmbreeRays::State::trace_range(const EmbreeMode& mode, RTCIntersectContext& context,
                                    std::span<const std::uint32_t> order, VisibilityMasks& masks) const {
  RTCScene scene = scenes[variant(mode)];
  if (mode.order == PacketOrder::kReceivers) {
    for (std::size_t i = 0; i < order.size(); i += width) {
      trace_group<width>(scene, context, order.subspan(i, std::min<std::size_t>(width, order.size() - i)), masks);
    }
  } else {
    for (const std::uint32_t r : order) {
      trace_receiver<width>(scene, context, r, mode.order == PacketOrder::kSampleBlocks, masks);
    }
  }
}

std::string EmbreeMode::name() const {
  static constexpr const char* kOrders[] = {"samples", "blocks", "receivers"};
  static constexpr const char* kQualities[] = {"low", "medium", "high"};
  std::string text = std::to_string(width);
  if (width > 1) text += std::string(" ") + kOrders[static_cast<int>(order)] + (coherent ? " coherent" : "");
  return text + (robust ? " robust " : " fast ") + kQualities[static_cast<int>(quality)];
}

std::vector<EmbreeMode> embree_modes(std::uint32_t sample_count) {
  std::vector<EmbreeMode> modes;
  for (const bool robust : {false, true}) {
    for (const BuildQuality quality : {BuildQuality::kLow, BuildQuality::kMedium, BuildQuality::kHigh}) {
      modes.push_back({1, PacketOrder::kSamples, false, robust, quality});
      for (const int width : {4, 8, 16}) {
        for (const PacketOrder order : {PacketOrder::kSamples, PacketOrder::kSampleBlocks, PacketOrder::kReceivers}) {
          if (order == PacketOrder::kSampleBlocks && grid_side(sample_count) == 0) continue;
          for (const bool coherent : {false, true}) modes.push_back({width, order, coherent, robust, quality});
        }
      }
    }
  }
  return modes;
}

EmbreeMode best_embree_mode(std::uint32_t sample_count, bool robust) {
  const PacketOrder order = grid_side(sample_count) == 0 ? PacketOrder::kSamples : PacketOrder::kSampleBlocks;
  return {16, order, false, robust, BuildQuality::kMedium};
}

EmbreeRays::EmbreeRays(const LatticeMesh& mesh, const ReceiverArray& receivers, const LightSamples& samples,
                       int threads)
    : state_(std::make_unique<State>(mesh, receivers, samples)) {
  State& s = *state_;
  s.device = rtcNewDevice(("threads=" + std::to_string(threads)).c_str());
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    if (mesh.alpha_map(t) == kNone) {
      s.opaque.push_back(t);
      continue;
    }
    const Material& material = mesh.scene->materials[mesh.scene->triangle_materials[t]];
    TriangleTexture texture{&mesh.scene->alpha_maps[material.alpha_map], opaque_threshold(material.alpha_cutoff), {}};
    for (int i = 0; i < 3; ++i)
      texture.texel[i] = mesh.scene->triangle_uvs[t][i] * vec2(texture.map->width, texture.map->height);
    s.textures.push_back(texture);
    s.perforated.push_back(t);
  }
  s.blocks = block_order(samples.count);
  s.padded_count = (samples.count + 15) / 16 * 16;
  for (std::uint32_t set = 0; set < samples.sets; ++set) {
    for (std::size_t i = 0; i < s.padded_count; ++i) {
      const std::size_t sample = std::min<std::size_t>(i, samples.count - 1);
      s.rows.push_back(samples.set(set)[sample]);
      s.squares.push_back(samples.set(set)[s.blocks[sample]]);
    }
  }
}

EmbreeRays::~EmbreeRays() {
  for (RTCScene scene : state_->scenes) {
    if (scene != nullptr) rtcReleaseScene(scene);
  }
  rtcReleaseDevice(state_->device);
}

double EmbreeRays::build_ms(const EmbreeMode& mode) {
  RTCScene& scene = state_->scenes[variant(mode)];
  if (scene == nullptr) {
    Stopwatch watch;
    scene = state_->build(mode.robust, mode.quality);
    state_->build_ms[variant(mode)] = watch.lap();
  }
  return state_->build_ms[variant(mode)];
}

void EmbreeRays::trace(const EmbreeMode& mode, std::span<const std::uint32_t> order, VisibilityMasks& masks) const {
  const State& s = *state_;
  constexpr std::size_t kPiece = 16, kGrain = 8;  // whole packets stay together
  parallel_ranges((order.size() + kPiece - 1) / kPiece, kGrain, [&](std::size_t begin, std::size_t end) {
#if defined(__SSE2__)
    _mm_setcsr(_mm_getcsr() | 0x8040u);  // flush denormals, as Embree recommends; parallel_ranges restores the word
#endif
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    if (mode.coherent) context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    const auto part = order.subspan(begin * kPiece, std::min(end * kPiece, order.size()) - begin * kPiece);
    switch (mode.width) {
      case 4:
        s.trace_range<4>(mode, context, part, masks);
        break;
      case 8:
        s.trace_range<8>(mode, context, part, masks);
        break;
      case 16:
        s.trace_range<16>(mode, context, part, masks);
        break;
      default:
        for (const std::uint32_t r : part) s.trace_singly(s.scenes[variant(mode)], context, r, masks);
    }
  });
}

bool embree_available() { return true; }

}  // namespace halfshade
