// One call: receivers read once, then light by light: samples, lit receivers, masks, results into the caller's memory.
#include "halfshade/shadow_solver.h"

#include <bit>

#include "rasterizer/core/parallel.h"
#include "rasterizer/core/stopwatch.h"
#include "shadows/irradiance.h"
#include "shadows/solver.h"
#include "shadows/workspace.h"

namespace halfshade {
namespace {

[[noreturn]] void usage(const std::string& what) { throw Error(ErrorCode::kUsage, what); }

/// One call at a time.
class Occupied {
 public:
  explicit Occupied(Workspace::Impl& workspace) : workspace_(workspace) {
    if (workspace_.busy.exchange(true, std::memory_order_acquire)) usage("the workspace is in use by another call");
  }
  ~Occupied() { workspace_.busy.store(false, std::memory_order_release); }
  Occupied(const Occupied&) = delete;
  Occupied& operator=(const Occupied&) = delete;

 private:
  Workspace::Impl& workspace_;
};

/// What one call is about.
struct Call {
  const ShadowScene::Impl& scene;
  const ShadowConfig& config;
  std::span<const Light> lights;
  Workspace::Impl& workspace;
  const ShadowOutput& output;
  std::size_t words;  // per receiver and light
  std::uint32_t frame;
};

bool wants_irradiance(const ShadowOutput& out) { return !out.irradiance.empty() || !out.total_irradiance.empty(); }

void check_output(const Call& call, std::size_t receivers, bool has_normals) {
  const ShadowOutput& out = call.output;
  const auto require = [](std::size_t size, std::size_t wanted, const char* what) {
    if (size == 0 || size == wanted) return;
    usage(std::string("output: ") + std::to_string(size) + " entries for " + what + ", " + std::to_string(wanted) +
          " are needed");
  };
  const std::size_t all = receivers * call.lights.size();
  require(out.masks.size(), all * call.words, "masks");
  require(out.visibility.size(), all, "visibility");
  require(out.irradiance.size(), all, "irradiance");
  require(out.total_irradiance.size(), receivers, "total irradiance");
  const bool integral = wants_irradiance(out);
  if (integral && !has_normals) usage("output: irradiance needs receivers with normals");
  if ((integral || !out.masks.empty()) && !yields_masks(call.config)) {
    usage(std::string("output: method '") + name_of(call.config.method) + "' yields visibility alone");
  }
}

bool same_geometry(const Light& a, const Light& b) {
  return a.shape == b.shape && a.center == b.center && a.u == b.u && a.v == b.v && a.normal == b.normal &&
         a.radius == b.radius && a.points == b.points && a.two_sided == b.two_sided && a.axes == b.axes;
}

void copy_geometry(const Light& from, Light& to) {
  to.shape = from.shape, to.center = from.center, to.u = from.u, to.v = from.v, to.normal = from.normal;
  to.radius = from.radius, to.points = from.points, to.two_sided = from.two_sided, to.axes = from.axes;
}

bool same_image(const EmissionImage& a, const EmissionImage& b) {
  return a.width == b.width && a.height == b.height && a.rgb == b.rgb;
}

KeptLight& place_of(const Call& call, std::size_t index) {
  return call.workspace.lights[index % call.workspace.lights.size()];
}

SampleKey key_of(const Call& call) {
  const ShadowConfig& c = call.config;
  return {c.pattern,  c.light_sample_count, c.sample_sets, c.seed,
          call.frame, c.interleave,         c.rotate_sets, call.scene.mesh.frame};
}

/// Are the samples of light `index` there from an earlier call?
bool is_kept(const Call& call, std::size_t index) {
  const KeptLight& kept = place_of(call, index);
  return kept.filled && kept.key == key_of(call) && same_geometry(kept.light, call.lights[index]);
}

/// What the light emits, which may be wrong where its samples are kept. Texels are looked at only where they will be
/// read: there may be millions.
void check_emission(const Call& call, std::size_t index) {
  const Light& light = call.lights[index];
  const auto require_none = [&](const std::string& fault) {
    if (fault.empty()) return;
    throw Error(ErrorCode::kBadInput, "light " + std::to_string(index) + " '" + light.name + "': " + fault);
  };
  if (!is_emission(light.emission)) require_none("the emission is negative or not finite");
  if (light.emission_image.empty()) return;
  if (light.shape != LightShape::kRectangle) require_none("only rectangles have emission images");
  require_none(size_fault(light.emission_image));
  if (wants_irradiance(call.output)) require_none(texel_fault(light.emission_image));
}

void check_lights(const Call& call) {
  if (call.frame >= kMaxFrames) {
    usage("frame: " + std::to_string(call.frame) + " is not below " + std::to_string(kMaxFrames));
  }
  for (std::size_t i = 0; i < call.lights.size(); ++i) {
    const Light& light = call.lights[i];
    if (!is_kept(call, i)) check_light(light, call.config);
    for (const dvec3& p : light_box(light)) {
      if (in_reach(call.scene.mesh.frame, p)) continue;
      throw Error(ErrorCode::kBadInput, "light " + std::to_string(i) + " '" + light.name +
                                            "' is outside the scene's reach; ShadowScene::extend widens it");
    }
    check_emission(call, i);
  }
}

/// The samples of a light, from an earlier call where they are the same.
KeptLight& keep_light(const Call& call, std::size_t index) {
  KeptLight& kept = place_of(call, index);
  const bool same = is_kept(call, index);
  if (!same) {
    const SampleKey key = key_of(call);
    if (!(kept.filled && kept.key == key)) {  // weights go by the samples' places within the light
      kept.weights.clear();
      kept.image.rgb.clear();
    }
    kept.filled = kept.prepared = false;
    ShadowConfig config = call.config;
    config.frame = call.frame;
    kept.samples = make_light_samples(call.lights[index], config, call.scene.mesh.frame, std::move(kept.samples));
    kept.key = key;
    copy_geometry(call.lights[index], kept.light);
    kept.filled = true;
  }
  ++(same ? call.workspace.stats.lights_kept : call.workspace.stats.lights_made);
  return kept;
}

std::span<const vec3> emission_weights(const Light& light, KeptLight& kept) {
  if (light.emission_image.empty()) return {};
  if (kept.weights.empty() || !same_image(light.emission_image, kept.image)) {
    kept.image.rgb.clear();  // belongs to no weights until both are there
    kept.weights = sample_emission(light.emission_image, kept.samples);
    kept.image = light.emission_image;
  }
  return kept.weights;
}

/// Counters of one light into those of the call.
void add_stats(const ShadowStats& light, SolveStats& all) {
  all.build_ms += light.build_ms, all.index_ms += light.index_ms, all.cull_ms += light.cull_ms;
  all.test_ms += light.test_ms;
  all.receivers += light.receivers, all.triangles = light.triangles;
  all.pairs_tested += light.pairs_tested, all.pairs_sampled += light.pairs_sampled;
  all.pairs_necessary += light.pairs_necessary, all.sample_tests += light.sample_tests;
  all.exact_fallbacks += light.exact_fallbacks, all.lists_occupied += light.lists_occupied;
  all.lists_longest = std::max(all.lists_longest, light.lists_longest);
  all.certified_blockers = light.certified_blockers;
  all.leaves_listed += light.leaves_listed, all.leaves_tested += light.leaves_tested;
  all.clusters_lit += light.clusters_lit, all.clusters_by_sample += light.clusters_by_sample;
  all.everywhere_blockers += light.everywhere_blockers;
  all.bytes = std::max(all.bytes, light.bytes);
}

/// The engine with what it kept of the light and of the scene.
void solve_exact_kept(const Call& call, const Light& light, KeptLight& kept, ShadowStats& stats) {
  const ShadowScene::Impl& scene = call.scene;
  Workspace::Impl& w = call.workspace;
  stats.receivers = w.lit.array.size(), stats.triangles = scene.mesh.triangles.size();
  Stopwatch watch;
  if (!kept.prepared) prepare_exact_light(light, kept.samples, kept.exact);
  kept.prepared = true;
  if (kept.scene != scene.identity || kept.scene_version != scene.version) kept.exact.unfit();
  kept.scene = scene.identity, kept.scene_version = scene.version;
  stats.build_ms = watch.lap();
  const std::size_t words = (kept.samples.count + 63) / 64;
  w.exact.reserve(w.receivers.size());
  w.masks.words.reserve(w.receivers.size() * words);
  const ExactBlockers blockers{scene.mesh, scene.config.back_face_casters ? &scene.closed : nullptr, &scene.tree};
  solve_exact(blockers, w.lit.array, light, kept.samples, call.config, kept.exact, w.exact, w.masks, stats);
}

/// Masks, or visibility from methods without masks, of the lit receivers.
void solve_lit(const Call& call, const Light& light, KeptLight& kept) {
  Workspace::Impl& w = call.workspace;
  ShadowStats stats;
  if (call.config.method == ShadowMethod::kExact) {
    solve_exact_kept(call, light, kept, stats);
  } else if (yields_masks(call.config)) {
    solve_masks(call.scene.mesh, w.lit.array, light, kept.samples, call.config, w.masks, stats);
  } else {
    solve_visibility(call.scene.mesh, w.lit.array, light, kept.samples, call.config, w.visibility, stats);
  }
  add_stats(stats, w.stats);
}

/// One receiver's results under one light.
struct ReceiverResult {
  std::span<const std::uint64_t> mask;  // empty: blocked in every sample, or no masks
  float visibility = 0.0f;
  vec3 irradiance{0.0f};
};

void write_mask(std::span<const std::uint64_t> mask, std::uint32_t samples, std::span<std::uint64_t> to) {
  const std::size_t used = (samples + 63) / 64;
  for (std::size_t w = 0; w < to.size(); ++w) {
    if (w >= used) {
      to[w] = 0;
    } else if (!mask.empty()) {
      to[w] = mask[w];
    } else {
      to[w] = w + 1 < used || samples % 64 == 0 ? ~std::uint64_t{0} : (std::uint64_t{1} << (samples % 64)) - 1;
    }
  }
}

/// Results of light `index` into the caller's memory.
void write_light(const Call& call, std::size_t index, KeptLight& kept) {
  const Workspace::Impl& w = call.workspace;
  const ShadowOutput& out = call.output;
  const std::size_t count = w.receivers.size(), first = index * count;
  const bool has_masks = yields_masks(call.config), integral = wants_irradiance(out);
  IrradianceSum sum;
  if (integral) {
    sum = make_irradiance_sum(call.lights[index], kept.samples, call.scene.mesh.frame,
                              emission_weights(call.lights[index], kept));
  }
  parallel_ranges(count, 1024, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) {
      ReceiverResult r;
      const std::uint32_t place = w.lit.place[i];
      if (place != kNone && has_masks) {
        r.mask = w.masks.mask(place);
        r.visibility = w.masks.visibility(place);
        if (integral)
          r.irradiance =
              irradiance(sum, w.receivers.position[i], w.receivers.normal[i], w.lit.array.set[place], r.mask);
      } else if (place != kNone) {
        r.visibility = w.visibility[place];
      }
      if (!out.masks.empty())
        write_mask(r.mask, kept.samples.count, out.masks.subspan((first + i) * call.words, call.words));
      if (!out.visibility.empty()) out.visibility[first + i] = r.visibility;
      if (!out.irradiance.empty()) out.irradiance[first + i] = r.irradiance;
      if (!out.total_irradiance.empty()) out.total_irradiance[i] += r.irradiance;
    }
  });
}

void run(const Call& call) {
  Workspace::Impl& w = call.workspace;
  check_output(call, w.receivers.size(), w.receivers.has_normals);
  check_lights(call);
  std::fill(call.output.total_irradiance.begin(), call.output.total_irradiance.end(), vec3(0.0f));
  const double lights = static_cast<double>(call.lights.size());
  for (std::size_t i = 0; i < call.lights.size(); ++i) {
    current_run()->set_part(static_cast<double>(i) / lights, static_cast<double>(i + 1) / lights);
    KeptLight& kept = keep_light(call, i);
    select_lit(w.receivers, kept.samples, call.config.seed, w.lit);
    solve_lit(call, call.lights[i], kept);
    write_light(call, i, kept);
  }
}

}  // namespace

ShadowSolver::ShadowSolver(const ShadowConfig& config) : config_(config) {
  check_light(Light(), config);
  if (config.method == ShadowMethod::kRaytrace) usage("method 'raytrace' is not part of the library");
}

std::uint32_t ShadowSolver::sample_count(const Light& light) const { return samples_of(light, config_); }

std::size_t ShadowSolver::mask_words(std::span<const Light> lights) const {
  std::size_t words = 0;
  for (const Light& light : lights) words = std::max<std::size_t>(words, (sample_count(light) + 63) / 64);
  return words;
}

namespace {

/// The whole call; `read` fills the workspace's receivers.
template <class Read>
void run_solve(const ShadowScene& scene, const ShadowConfig& config, std::span<const Light> lights,
               Workspace& workspace, const ShadowOutput& output, std::size_t words, std::uint32_t frame,
               const Execution& execution, const Read& read) {
  const Occupied occupied(workspace.impl());
  require_committed(scene.impl());
  workspace.impl().stats = {};
  const auto work = [&] {
    read(scene.impl(), workspace.impl().receivers);
    run({scene.impl(), config, lights, workspace.impl(), output, words, frame});
  };
  if (execution.progress || !config.progress) {
    run_call(execution, work);
  } else {
    Execution watched = execution;
    watched.progress = config.progress;
    run_call(watched, work);
  }
}

}  // namespace

void ShadowSolver::solve(const ShadowScene& scene, const ReceiverView& receivers, std::span<const Light> lights,
                         Workspace& workspace, const ShadowOutput& output, const Execution& execution) const {
  const std::uint32_t frame = receivers.frame != kNone ? receivers.frame : config_.frame;
  run_solve(scene, config_, lights, workspace, output, mask_words(lights), frame, execution,
            [&](const ShadowScene::Impl& from, CallReceivers& to) { read_receivers(from, receivers, to); });
}

void ShadowSolver::solve(const ShadowScene& scene, const GBuffer& gbuffer, std::span<const Light> lights,
                         Workspace& workspace, const ShadowOutput& output, const Execution& execution) const {
  run_solve(scene, config_, lights, workspace, output, mask_words(lights), config_.frame, execution,
            [&](const ShadowScene::Impl& from, CallReceivers& to) { read_receivers(from, gbuffer, to); });
}

}  // namespace halfshade
