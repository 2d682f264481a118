#include "shortcuts.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>

#include "rasterizer/core/stopwatch.h"
#include "shadows/exact_engine.h"
#include "shadows/opaque_mesh.h"
#include "shadows/solver.h"

namespace halfshade {
namespace {

using nlohmann::ordered_json;

constexpr int kRuns = 3;

/// Milliseconds of method exact, without what a static scene keeps (certificates are part of that).
double time_of(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light, ShadowConfig config) {
  config.method = ShadowMethod::kExact;
  const LightSamples samples = make_light_samples(light, config, mesh.frame);
  VisibilityMasks masks;
  ShadowStats stats;
  Stopwatch watch;
  solve_masks(mesh, receivers, light, samples, config, masks, stats);
  return watch.lap() - stats.build_ms;
}

double gain_of(const std::function<double()>& without, const std::function<double()>& with) {
  std::vector<double> slow, fast;
  for (int run = 0; run < kRuns; ++run) slow.push_back(without()), fast.push_back(with());
  std::sort(slow.begin(), slow.end()), std::sort(fast.begin(), fast.end());
  return slow[kRuns / 2] / std::max(fast[kRuns / 2], 1e-6);
}

/// Receivers use set 0: the runs that are compared have one set.
ReceiverArray with_one_set(ReceiverArray receivers) {
  std::fill(receivers.set.begin(), receivers.set.end(), std::uint8_t{0});
  return receivers;
}

std::uint64_t count_crossing_plane(const LatticeMesh& mesh, const LightSamples& samples) {
  std::uint64_t count = 0;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    int in_front = 0, behind = 0;
    for (const vec3& p : mesh.corners(t)) {
      const double height = glm::dot(dvec3(p) - samples.center, samples.axis_n);
      in_front += height > 0.0, behind += height < 0.0;
    }
    count += in_front > 0 && behind > 0;
  }
  return count;
}

std::uint64_t count_perforated(const LatticeMesh& mesh) {
  std::uint64_t count = 0;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    count += mesh.scene->materials[mesh.scene->triangle_materials[t]].alpha_map != kNone;
  }
  return count;
}

Shortcut back_faces(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                    const ShadowConfig& config, const ShadowStats& stats, bool measure) {
  Shortcut s{"back-face-only casters",
             stats.certified_blockers > 0,
             stats.certified_blockers,
             stats.triangles,
             "triangles",
             {},
             "closed, consistently wound meshes"};
  if (!measure || !s.on) return s;
  ShadowConfig all_faces = config;
  all_faces.back_face_casters = false;
  s.gain = gain_of([&] { return time_of(mesh, receivers, light, all_faces); },
                   [&] { return time_of(mesh, receivers, light, config); });
  return s;
}

Shortcut single_sided(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                      const ShadowConfig& config, const LightSamples& samples, bool measure) {
  Shortcut s{"single-sided light",
             samples.one_sided,
             samples.one_sided,
             1,
             "lights",
             {},
             "what is behind the light is not solved"};
  if (!measure || !s.on) return s;
  Light both = light;
  both.two_sided = true;
  s.gain = gain_of([&] { return time_of(mesh, receivers, both, config); },
                   [&] { return time_of(mesh, receivers, light, config); });
  return s;
}

Shortcut hard_shadow(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                     const ShadowConfig& config, const LightSamples& samples, bool measure) {
  const bool point = samples.points.size() == 1 && samples.st.size() <= 1 && light.shape == LightShape::kPoint;
  Shortcut s{"hard shadow",
             point,
             point,
             1,
             "lights",
             {},
             point
                 ? "a point needs one sample"
                 : "off: in a penumbra one sample is wrong by up to 1, however narrow it is; gain is that of 1 sample"};
  if (!measure || point || light.shape == LightShape::kSamples) return s;
  ShadowConfig one = config;
  one.light_sample_count = 1;
  s.gain = gain_of([&] { return time_of(mesh, receivers, light, config); },
                   [&] { return time_of(mesh, receivers, light, one); });
  return s;
}

}  // namespace

std::vector<Shortcut> list_shortcuts(const LatticeMesh& scene_mesh, const ReceiverArray& asked, const Light& light,
                                     const ShadowConfig& asked_config, const ShadowStats& stats, bool measure) {
  const OpaqueMesh opaque(scene_mesh);
  const LatticeMesh& mesh = opaque.get();
  const ReceiverArray receivers = with_one_set(asked);
  ShadowConfig config = asked_config;
  config.sample_sets = 1, config.interleave = false, config.progress = nullptr;
  const LightSamples samples = make_light_samples(light, config, mesh.frame);
  const std::uint64_t perforated = count_perforated(mesh), triangles = mesh.triangles.size();
  std::vector<Shortcut> all;
  all.push_back(back_faces(mesh, receivers, light, config, stats, measure));
  all.push_back(single_sided(mesh, receivers, light, config, samples, measure));
  if (samples.flat) {
    const std::uint64_t crossing = count_crossing_plane(mesh, samples);
    all.push_back({"no clipping",
                   crossing == 0,
                   triangles - crossing,
                   triangles,
                   "triangles",
                   {},
                   "do not cross the light's plane; decided per triangle, no switch"});
  }
  all.push_back({"float only",
                 stats.exact_fallbacks == 0,
                 stats.sample_tests - stats.exact_fallbacks,
                 stats.sample_tests,
                 "sample tests",
                 {},
                 "settled by the float filter; decided per test, no switch"});
  all.push_back(hard_shadow(mesh, receivers, light, config, samples, measure));
  all.push_back({"no alpha path",
                 perforated == 0,
                 triangles - perforated,
                 triangles,
                 "triangles",
                 {},
                 "without opacity map; decided per triangle, no switch"});
  all.push_back({"lit clusters",
                 stats.clusters_lit > 0,
                 stats.clusters_lit,
                 (receivers.size() + kClusterReceivers - 1) / kClusterReceivers,
                 "clusters",
                 {},
                 "no blocker's box in the shaft to the light; over all rounds with --max-error"});
  return all;
}

ordered_json shortcuts_json(const std::vector<Shortcut>& shortcuts) {
  ordered_json list = ordered_json::array();
  for (const Shortcut& s : shortcuts) {
    ordered_json one = {{"name", s.name}, {"on", s.on}, {"applied", s.applied}, {"of", s.of}, {"unit", s.unit}};
    if (s.gain) one["gain"] = *s.gain;
    one["note"] = s.note;
    list.push_back(std::move(one));
  }
  return list;
}

void print_shortcuts(std::FILE* out, const std::vector<Shortcut>& shortcuts) {
  for (const Shortcut& s : shortcuts) {
    fmt::print(out, "shortcut   {:24} {:3}  {} of {} {}{}  ({})\n", s.name, s.on ? "on" : "off", s.applied, s.of,
               s.unit, s.gain ? fmt::format(", gain {:.2f}x", *s.gain) : "", s.note);
  }
}

}  // namespace halfshade
