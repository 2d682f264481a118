#include "shadows/solver.h"

#include "rasterizer/core/parallel.h"
#include "rasterizer/core/stopwatch.h"
#include "shadows/alias_free_shadow_map.h"
#include "shadows/exact_engine.h"
#include "shadows/gears.h"
#include "shadows/hierarchical_penumbra_casting.h"
#include "shadows/opaque_mesh.h"
#include "shadows/oracle.h"
#include "shadows/percentage_closer.h"
#include "shadows/receiver_request.h"
#include "shadows/scene_check.h"
#include "shadows/shadow_accumulation.h"
#include "shadows/shadow_map.h"
#include "shadows/shadow_map_per_sample.h"
#include "shadows/soft_textured_shadow_volumes.h"
#include "shadows/transmittance.h"

namespace halfshade {
namespace {

template <class Value>
struct Named {
  Value value;
  const char* name;
};

constexpr MethodTraits kMethods[] = {{ShadowMethod::kExact, "exact", true, true},
                                     {ShadowMethod::kAliasFreeShadowMap, "afsm", true, true},
                                     {ShadowMethod::kAliasFreeLookupTable, "afsm-lut", false, true},
                                     {ShadowMethod::kHierarchicalPenumbraCasting, "hpc", true, true},
                                     {ShadowMethod::kGears, "gears", true, true},
                                     {ShadowMethod::kSoftTexturedShadowVolumes, "stsv", true, true},
                                     {ShadowMethod::kShadowAccumulation, "shadow-accumulation", false, false},
                                     {ShadowMethod::kShadowMap, "shadow-map", false, false},
                                     {ShadowMethod::kPercentageCloserFiltering, "pcf", false, false},
                                     {ShadowMethod::kPercentageCloserSoftShadows, "pcss", false, false},
                                     {ShadowMethod::kShadowMapPerSample, "shadow-maps", false, true},
                                     {ShadowMethod::kRaytrace, "raytrace", false, true},
                                     {ShadowMethod::kOracle, "oracle", true, true}};
constexpr Named<SamplePattern> kPatterns[] = {{SamplePattern::kRows, "rows"},
                                              {SamplePattern::kUniform, "uniform"},
                                              {SamplePattern::kStratified, "stratified"},
                                              {SamplePattern::kLowDiscrepancy, "low-discrepancy"},
                                              {SamplePattern::kPoissonDisk, "poisson-disk"}};

/// The entry of that name; throws Error{kUsage} with all names.
template <class Entry, std::size_t n>
const Entry& entry_of(const Entry (&table)[n], const std::string& name, const char* what) {
  std::string known;
  for (const Entry& entry : table) {
    if (name == entry.name) return entry;
    known += (known.empty() ? "" : ", ") + std::string(entry.name);
  }
  throw Error(ErrorCode::kUsage, std::string(what) + " '" + name + "' is not one of: " + known);
}

}  // namespace

std::span<const MethodTraits> shadow_methods() { return kMethods; }
const MethodTraits& traits_of(ShadowMethod method) { return kMethods[static_cast<std::size_t>(method)]; }
ShadowMethod shadow_method_from_name(const std::string& name) { return entry_of(kMethods, name, "method").method; }
SamplePattern sample_pattern_from_name(const std::string& name) { return entry_of(kPatterns, name, "pattern").value; }

namespace {

/// Averaged opacity: neither bits nor exact.
bool is_filtered(const ShadowConfig& config) {
  return config.method == ShadowMethod::kSoftTexturedShadowVolumes && config.stsv.filter == OpacityFilter::kFiltered;
}

}  // namespace

bool yields_masks(const ShadowConfig& config) { return traits_of(config.method).masks && !is_filtered(config); }
bool promises_exactness(const ShadowConfig& config) { return traits_of(config.method).exact && !is_filtered(config); }

const char* name_of(ShadowMethod method) { return traits_of(method).name; }
const char* name_of(SamplePattern pattern) { return kPatterns[static_cast<std::size_t>(pattern)].name; }

void report_progress(const ShadowConfig& config, double done) {
  if (Run* run = current_run()) {
    run->report(done);
  } else if (config.progress && !config.progress(done)) {
    throw Error(ErrorCode::kCancelled, "cancelled");
  }
}

namespace {

/// body() in the call that is going on, or as a call of its own that config.progress watches.
template <class Body>
void in_call(const ShadowConfig& config, const Body& body) {
  if (current_run() != nullptr) {
    body();
    return;
  }
  Execution execution;
  execution.progress = config.progress;
  run_call(execution, body);
}

void begin_stats(const OpaqueMesh& opaque, const ReceiverArray& receivers, ShadowStats& stats) {
  stats = {};
  stats.receivers = receivers.size();
  stats.triangles = opaque.get().triangles.size();
  if (opaque.translucent() == 0) return;
  stats.details.emplace_back("translucent_triangles", static_cast<double>(opaque.translucent()));
}

void dispatch_masks(const LatticeMesh& scene_mesh, const ReceiverArray& receivers, const Light& light,
                    const LightSamples& samples, const ShadowConfig& config, VisibilityMasks& masks, ShadowStats& stats,
                    KeptExact* kept) {
  const OpaqueMesh opaque(scene_mesh);
  const LatticeMesh& mesh = opaque.get();
  begin_stats(opaque, receivers, stats);
  switch (config.method) {
    case ShadowMethod::kAliasFreeShadowMap:
    case ShadowMethod::kAliasFreeLookupTable:
      solve_alias_free_shadow_map(mesh, receivers, light, samples, config, masks, stats);
      break;
    case ShadowMethod::kExact: {
      KeptExact own;
      solve_exact(mesh, receivers, light, samples, config, kept != nullptr ? *kept : own, masks, stats);
      break;
    }
    case ShadowMethod::kHierarchicalPenumbraCasting:
      solve_hierarchical_penumbra_casting(mesh, receivers, light, samples, config, masks, stats);
      break;
    case ShadowMethod::kGears:
      solve_gears(mesh, receivers, light, samples, config, masks, stats);
      break;
    case ShadowMethod::kSoftTexturedShadowVolumes:
      solve_soft_textured_shadow_volumes(mesh, receivers, light, samples, config, masks, stats);
      break;
    case ShadowMethod::kOracle: {
      Stopwatch watch;
      solve_oracle(mesh, receivers, samples, config, masks);
      stats.test_ms = watch.lap();
      break;
    }
    case ShadowMethod::kShadowMapPerSample:
      solve_shadow_maps(mesh, receivers, samples, config, masks, stats);
      break;
    case ShadowMethod::kRaytrace:
      throw Error(ErrorCode::kUsage,
                  "method 'raytrace' is not part of the core library: solve_raytrace (shadows/raytrace) has it");
    default:
      throw Error(ErrorCode::kUsage, std::string("method '") + name_of(config.method) + "' yields no masks");
  }
}

void solve_without_masks(const LatticeMesh& scene_mesh, const ReceiverArray& receivers, const Light& light,
                         const LightSamples& samples, const ShadowConfig& config, std::vector<float>& visibility,
                         ShadowStats& stats) {
  const OpaqueMesh opaque(scene_mesh);
  const LatticeMesh& mesh = opaque.get();
  begin_stats(opaque, receivers, stats);
  switch (config.method) {
    case ShadowMethod::kSoftTexturedShadowVolumes:
      solve_filtered_shadow_volumes(mesh, receivers, light, samples, config, visibility, stats);
      break;
    case ShadowMethod::kShadowAccumulation:
      solve_shadow_accumulation(mesh, receivers, light, samples, config, visibility, stats);
      break;
    case ShadowMethod::kPercentageCloserFiltering:
      solve_pcf(mesh, receivers, samples, config, visibility, stats);
      break;
    case ShadowMethod::kPercentageCloserSoftShadows:
      solve_pcss(mesh, receivers, light, samples, config, visibility, stats);
      break;
    default:
      solve_shadow_map(mesh, receivers, samples, config, visibility, stats);
  }
}

}  // namespace

void solve_masks(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                 const LightSamples& samples, const ShadowConfig& config, VisibilityMasks& masks, ShadowStats& stats,
                 KeptExact* kept) {
  in_call(config, [&] { dispatch_masks(mesh, receivers, light, samples, config, masks, stats, kept); });
}

std::string method_assumptions(const ShadowConfig& config, const Light& light) {
  switch (config.method) {
    case ShadowMethod::kAliasFreeLookupTable:
      return assumptions_of_lookup_table(config);
    case ShadowMethod::kSoftTexturedShadowVolumes:
      return promises_exactness(config) ? std::string()
                                        : "each light sample is dimmed by the average opacity of its cell's footprint "
                                          "on a perforated triangle; footprints are boxes along the texture's axes";
    case ShadowMethod::kShadowAccumulation:
      return assumptions_of_shadow_accumulation(config, light);
    case ShadowMethod::kShadowMap:
      return assumptions_of_shadow_map(config);
    case ShadowMethod::kPercentageCloserFiltering:
      return assumptions_of_pcf(config);
    case ShadowMethod::kPercentageCloserSoftShadows:
      return assumptions_of_pcss(config, light);
    case ShadowMethod::kShadowMapPerSample:
      return assumptions_of_shadow_maps(config);
    case ShadowMethod::kRaytrace:
      return std::string("float rays of Embree, ") + (config.raytrace.robust ? "robust" : "fast") +
             " mode: hits near edges may go either way, a receiver's own triangle counts";
    default:
      return {};
  }
}

void solve_visibility(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                      const LightSamples& samples, const ShadowConfig& config, std::vector<float>& visibility,
                      ShadowStats& stats) {
  if (!yields_masks(config)) {
    in_call(config, [&] { solve_without_masks(mesh, receivers, light, samples, config, visibility, stats); });
    return;
  }
  VisibilityMasks masks;
  solve_masks(mesh, receivers, light, samples, config, masks, stats);
  visibility_of(masks, visibility);
}

void visibility_of(const VisibilityMasks& masks, std::vector<float>& visibility) {
  visibility.resize(masks.receiver_count);
  for (std::size_t i = 0; i < masks.receiver_count; ++i) visibility[i] = masks.visibility(i);
}

namespace {

/// Explicit receivers, on the lattice; `unlit` are those behind a one-sided light.
struct Request : ReceiverRequest {
  LatticeMesh mesh;
};

Request make_request(const Scene& scene, std::span<const Receiver> receivers, const Light& light,
                     const ShadowConfig& config) {
  check_scene(scene);
  check_own_triangles(receivers, scene.triangles.size());
  const LocalFrame frame = make_local_frame(scene.positions, receiver_reach(receivers, light));
  return {make_receiver_request(frame, receivers, light, config), make_lattice_mesh(scene, frame)};
}

}  // namespace

void solve_shadows(const Scene& scene, std::span<const Receiver> receivers, const Light& light,
                   const ShadowConfig& config, VisibilityMasks& masks, ShadowStats* stats) {
  in_call(config, [&] {
    const Request q = make_request(scene, receivers, light, config);
    ShadowStats own;
    VisibilityMasks solved;
    solve_masks(q.mesh, q.receivers, light, q.samples, config, solved, stats != nullptr ? *stats : own);
    spread_masks(q, solved, receivers.size(), masks);
  });
}

void solve_depth_complexity(const Scene& scene, std::span<const Receiver> receivers, const Light& light,
                            const ShadowConfig& config, DepthComplexity& counts, ShadowStats* stats) {
  in_call(config, [&] {
    const Request q = make_request(scene, receivers, light, config);
    ShadowStats own;
    DepthComplexity solved;
    count_depth_complexity(q.mesh, q.receivers, light, q.samples, config, solved, stats != nullptr ? *stats : own);
    counts = {receivers.size(), q.samples.count, std::vector<std::uint32_t>(receivers.size() * q.samples.count, 1)};
    for (std::size_t i = 0; i < q.receivers.size(); ++i) {
      std::copy_n(solved.counts.begin() + static_cast<std::ptrdiff_t>(i * q.samples.count), q.samples.count,
                  counts.counts.begin() + static_cast<std::ptrdiff_t>(q.receivers.sample[i] * q.samples.count));
    }
  });
}

void solve_visibility(const Scene& scene, std::span<const Receiver> receivers, const Light& light,
                      const ShadowConfig& config, std::vector<float>& visibility, ShadowStats* stats) {
  in_call(config, [&] {
    const Request q = make_request(scene, receivers, light, config);
    ShadowStats own;
    std::vector<float> solved;
    solve_visibility(q.mesh, q.receivers, light, q.samples, config, solved, stats != nullptr ? *stats : own);
    visibility.assign(receivers.size(), 0.0f);
    for (std::size_t i = 0; i < solved.size(); ++i) visibility[q.receivers.sample[i]] = solved[i];
  });
}

void solve_light(const Scene& scene, std::span<const Receiver> receivers, const Light& light,
                 const ShadowConfig& config, std::vector<vec3>& reaching, ShadowStats* stats) {
  in_call(config, [&] {
    const Request q = make_request(scene, receivers, light, config);
    ShadowStats own;
    ShadowStats& noted = stats != nullptr ? *stats : own;
    VisibilityMasks masks;
    std::vector<float> visibility;
    if (yields_masks(config)) {
      solve_masks(q.mesh, q.receivers, light, q.samples, config, masks, noted);
    } else {
      solve_visibility(q.mesh, q.receivers, light, q.samples, config, visibility, noted);
    }
    std::vector<vec3> solved;
    solve_reaching_light(find_panes(q.mesh), q.receivers, light, q.samples, config, masks, visibility, solved, noted);
    reaching.assign(receivers.size(), vec3(0.0f));
    for (std::size_t i = 0; i < solved.size(); ++i) reaching[q.receivers.sample[i]] = solved[i];
  });
}

}  // namespace halfshade
