// How long does coloured light through translucent surfaces take against Embree's occlusion rays with a filter that
// multiplies it?
#include <embree3/rtcore.h>
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "bench_case.h"
#include "examples/halfshade/scene_source.h"
#include "harness.h"
#include "rasterizer/core/parallel.h"
#include "shadows/raytrace/embree_rays.h"
#include "shadows/solver.h"
#include "shadows/transmittance.h"

namespace halfshade::bench {
namespace {

constexpr int kWidth = 16;
constexpr float kTfar = 1.0f - 0x1p-20f;

/// A pane as the filter reads it.
struct RivalPane {
  const SurfaceFilter* filter = nullptr;
  vec3 uniform{1.0f};
  std::array<vec2, 3> alpha_texel, color_texel;
};

/// The light that a ray still carries, and what it crossed: Embree calls a filter more than once for some hits.
struct CarriedLight {
  static constexpr std::size_t kMost = 32;
  vec3 light{1.0f};
  std::size_t count = 0;
  std::array<unsigned, kMost> crossed;

  bool crosses_first(unsigned pane) {
    if (std::find(crossed.begin(), crossed.begin() + count, pane) != crossed.begin() + count) return false;
    if (count < kMost) crossed[count++] = pane;
    return true;
  }
};

/// What the filter gets besides the hit.
struct LightContext {
  RTCIntersectContext base;
  std::array<CarriedLight, kWidth> carried;
};

vec3 transmittance_of_texels(const RgbAttenuation& a) {
  vec3 t;
  for (int c = 0; c < 3; ++c)
    t[c] = a[c] >= kNoLight ? 0.0f : std::exp2(-static_cast<float>(a[c]) * static_cast<float>(kAttenuationUnit));
  return t;
}

template <class Map>
std::array<std::uint32_t, 2> texel_at(const Map* map, const std::array<vec2, 3>& corners, float b, float c) {
  if (map == nullptr) return {};
  const vec2 at = corners[0] * (1.0f - b - c) + corners[1] * b + corners[2] * c;
  return {wrap_texel(at.x, map->width), map->height - 1 - wrap_texel(at.y, map->height)};
}

/// Panes never stop a ray: they dim it.
void dim(const RTCFilterFunctionNArguments* args) {
  const auto* panes = static_cast<const RivalPane*>(args->geometryUserPtr);
  auto* context = reinterpret_cast<LightContext*>(args->context);
  for (unsigned i = 0; i < args->N; ++i) {
    if (args->valid[i] == 0) continue;
    args->valid[i] = 0;
    const unsigned number = RTCHitN_primID(args->hit, args->N, i);
    CarriedLight& ray = context->carried[RTCRayN_id(args->ray, args->N, i)];
    if (!ray.crosses_first(number)) continue;
    const RivalPane& pane = panes[number];
    vec3& carried = ray.light;
    if (pane.filter->is_uniform()) {
      carried *= pane.uniform;
      continue;
    }
    const float b = RTCHitN_u(args->hit, args->N, i), c = RTCHitN_v(args->hit, args->N, i);
    carried *=
        transmittance_of_texels(pane.filter->at(texel_at(pane.filter->alpha_map(), pane.alpha_texel, b, c),
                                                texel_at(pane.filter->transmittance_map(), pane.color_texel, b, c)));
  }
}

/// The scene in Embree: what blocks, and panes with the filter. No alpha-tested triangles: the scenes here have none.
class Rival {
 public:
  Rival(const Case& c, const Panes& panes, int threads) : case_(c), panes_(panes.triangle.size()) {
    device_ = rtcNewDevice(("threads=" + std::to_string(threads)).c_str());
    scene_ = rtcNewScene(device_);
    const auto add = [&](const LatticeMesh& mesh, bool filtered) {
      if (mesh.triangles.empty()) return;
      RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
      std::memcpy(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, sizeof(vec3),
                                          mesh.positions.size()),
                  mesh.positions.data(), mesh.positions.size() * sizeof(vec3));
      std::memcpy(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                          sizeof(mesh.triangles[0]), mesh.triangles.size()),
                  mesh.triangles.data(), mesh.triangles.size() * sizeof(mesh.triangles[0]));
      if (filtered) {
        rtcSetGeometryUserData(geometry, panes_.data());
        rtcSetGeometryOccludedFilterFunction(geometry, dim);
      }
      rtcCommitGeometry(geometry);
      rtcAttachGeometry(scene_, geometry);
      rtcReleaseGeometry(geometry);
    };
    const Scene& scene = *panes.source->scene;
    for (std::size_t i = 0; i < panes_.size(); ++i) {
      RivalPane& p = panes_[i];
      p.filter = &panes.filter_of(static_cast<std::uint32_t>(i));
      p.uniform = transmittance_of_texels(p.filter->uniform());
      if (p.filter->is_uniform()) continue;
      for (int k = 0; k < 3; ++k) {
        const vec2 uv = scene.triangle_uvs[panes.triangle[i]][k];
        if (const AlphaMap* map = p.filter->alpha_map()) p.alpha_texel[k] = uv * vec2(map->width, map->height);
        if (const ColorMap* map = p.filter->transmittance_map()) p.color_texel[k] = uv * vec2(map->width, map->height);
      }
    }
    add(c.mesh, false);
    add(panes.mesh, true);
    rtcCommitScene(scene_);
  }
  ~Rival() {
    rtcReleaseScene(scene_);
    rtcReleaseDevice(device_);
  }
  Rival(const Rival&) = delete;
  Rival& operator=(const Rival&) = delete;

  /// Packets of 16 samples of one receiver, or of one sample for 16 neighbouring receivers.
  void trace(bool over_receivers, std::vector<vec3>& reaching) const {
    reaching.assign(case_.receivers.size(), vec3(0.0f));
    constexpr std::size_t kPiece = 16;
    const std::vector<std::uint32_t>& order = case_.order;
    parallel_ranges((order.size() + kPiece - 1) / kPiece, 8, [&](std::size_t begin, std::size_t end) {
      LightContext context;
      rtcInitIntersectContext(&context.base);
      context.base.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
      for (std::size_t piece = begin; piece != end; ++piece) {
        const auto group = std::span(order).subspan(piece * kPiece, std::min(kPiece, order.size() - piece * kPiece));
        if (over_receivers) {
          trace_group(context, group, reaching);
        } else {
          for (const std::uint32_t r : group) trace_receiver(context, r, reaching);
        }
      }
    });
  }

 private:
  using Ray = RTCRay16;

  void occluded(LightContext& context, const int* valid, Ray& ray) const {
    for (CarriedLight& c : context.carried) c.light = vec3(1.0f), c.count = 0;
    rtcOccluded16(valid, scene_, &context.base, &ray);
  }
  static void set(Ray& ray, int k, const vec3& r, const vec3& l) {
    ray.org_x[k] = r.x, ray.org_y[k] = r.y, ray.org_z[k] = r.z;
    ray.dir_x[k] = l.x - r.x, ray.dir_y[k] = l.y - r.y, ray.dir_z[k] = l.z - r.z;
    ray.tnear[k] = 0.0f, ray.tfar[k] = kTfar, ray.time[k] = 0.0f;
    ray.mask[k] = ~0u, ray.flags[k] = 0, ray.id[k] = static_cast<unsigned>(k);
  }
  void trace_receiver(LightContext& context, std::uint32_t r, std::vector<vec3>& reaching) const {
    const auto samples = case_.samples.set(case_.receivers.set[r]);
    alignas(64) Ray ray;
    alignas(64) int valid[kWidth];
    vec3 sum(0.0f);
    for (std::size_t i = 0; i < samples.size(); i += kWidth) {
      for (int k = 0; k < kWidth; ++k) {
        const std::size_t at = std::min(i + static_cast<std::size_t>(k), samples.size() - 1);
        valid[k] = i + static_cast<std::size_t>(k) < samples.size() ? -1 : 0;
        set(ray, k, case_.receivers.position[r], samples[at]);
      }
      occluded(context, valid, ray);
      for (int k = 0; k < kWidth; ++k) {
        if (valid[k] != 0 && ray.tfar[k] >= 0.0f) sum += context.carried[static_cast<std::size_t>(k)].light;
      }
    }
    reaching[r] = sum / static_cast<float>(samples.size());
  }
  void trace_group(LightContext& context, std::span<const std::uint32_t> group, std::vector<vec3>& reaching) const {
    alignas(64) Ray ray;
    alignas(64) int valid[kWidth];
    for (int k = 0; k < kWidth; ++k) valid[k] = static_cast<std::size_t>(k) < group.size() ? -1 : 0;
    for (std::uint32_t i = 0; i < case_.samples.count; ++i) {
      for (int k = 0; k < kWidth; ++k) {
        const std::uint32_t r = group[std::min(static_cast<std::size_t>(k), group.size() - 1)];
        set(ray, k, case_.receivers.position[r], case_.samples.set(case_.receivers.set[r])[i]);
      }
      occluded(context, valid, ray);
      for (std::size_t k = 0; k < group.size(); ++k) {
        if (ray.tfar[k] >= 0.0f) reaching[group[k]] += context.carried[k].light;
      }
    }
    for (const std::uint32_t r : group) reaching[r] /= static_cast<float>(case_.samples.count);
  }

  const Case& case_;
  std::vector<RivalPane> panes_;
  RTCDevice device_ = nullptr;
  RTCScene scene_ = nullptr;
};

/// Over receivers that lie on no pane: rays of the others cross their own.
double root_mean_square(const Case& c, const Panes& panes, const std::vector<vec3>& a, const std::vector<vec3>& b) {
  double sum = 0.0, count = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const std::uint32_t own = c.receivers.triangle[i];
    if (own < panes.of_triangle.size() && panes.of_triangle[own] != kNone) continue;
    sum += glm::dot(dvec3(a[i] - b[i]), dvec3(a[i] - b[i])) / 3.0, count += 1.0;
  }
  return std::sqrt(sum / count);
}

void run(const std::vector<std::string>& scenes, const std::string& size, int repeat, int threads) {
  const nlohmann::ordered_json conditions = run_conditions(threads);
  fmt::print("{}, {} threads, {}, sources {}; {} pixels, 256 samples, median of {}\n",
             conditions["cpu"].get<std::string>(), threads, conditions["simd_target"].get<std::string>(),
             conditions["commit"].get<std::string>(), size, repeat);
  fmt::print("{:<24} {:>9} {:>6} {:>9} {:>9} {:>22} {:>24} {:>7} {:>12}\n", "scene", "receivers", "panes", "masks ms",
             "light ms", "embree, samples ms", "embree, receivers ms", "ratio", "RMSE");
  for (const std::string& name : scenes) {
    const SceneSource source = load_scene(name, "", ObjLoadOptions());
    ShadowConfig config;
    const Case c = make_case(name, source.scene, source.view, 0, size, config);
    LatticeMesh whole = make_lattice_mesh(source.scene, c.mesh.frame);
    const Panes panes = find_panes(whole);
    const Rival rival(c, panes, threads);
    VisibilityMasks masks;
    ShadowStats stats;
    std::vector<vec3> ours, by_samples, by_receivers;
    const std::vector<Timing> t = measure_interleaved(
        {[&] { solve_masks(c.mesh, c.receivers, c.light, c.samples, config, masks, stats); },
         [&] { solve_reaching_light(panes, c.receivers, c.light, c.samples, config, masks, {}, ours, stats); },
         [&] { rival.trace(false, by_samples); }, [&] { rival.trace(true, by_receivers); }},
        repeat);
    const double own = t[0].median() + t[1].median(), best = std::min(t[2].median(), t[3].median());
    fmt::print("{:<24} {:>9} {:>6} {:>9.1f} {:>9.1f} {:>22.1f} {:>24.1f} {:>7.2f} {:>12.2e}\n", name,
               c.receivers.size(), panes.triangle.size(), t[0].median(), t[1].median(), t[2].median(), t[3].median(),
               best / own, root_mean_square(c, panes, ours, by_samples));
  }
}

}  // namespace
}  // namespace halfshade::bench

int main(int argc, char** argv) {
  CLI::App app("Coloured light through translucent surfaces against Embree's rays with a filter.",
               "halfshade_transmittance_bench");
  std::vector<std::string> scenes = {"builtin:glass"};
  std::string size = "512x512";
  int threads = 0, repeat = 3;
  app.add_option("scenes", scenes, "OBJ files or builtin:NAME, without alpha-tested triangles")->capture_default_str();
  app.add_option("--size", size, "Picture in pixels, WIDTHxHEIGHT")->capture_default_str();
  app.add_option("--threads", threads, "Threads (0 = all cores)")->check(CLI::Range(0, 1024))->capture_default_str();
  app.add_option("--repeat", repeat, "Repetitions")->check(CLI::Range(1, 1000))->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  return halfshade::bench::run_on_threads("halfshade_transmittance_bench", threads,
                                          [&](int count) { halfshade::bench::run(scenes, size, repeat, count); });
}
