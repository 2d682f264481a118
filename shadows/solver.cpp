#include "shadows/solver.h"

#include "rasterizer/core/parallel.h"
#include "rasterizer/core/stopwatch.h"
#include "shadows/alias_free_shadow_map.h"
#include "shadows/exact_engine.h"
#include "shadows/oracle.h"

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

void check_finite(std::span<const Receiver> receivers) {
  for (std::size_t i = 0; i < receivers.size(); ++i) {
    if (!is_finite(receivers[i].position_world)) {
      throw Error(ErrorCode::kBadInput, "receiver " + std::to_string(i) + ": the position is not finite");
    }
  }
}

}  // namespace

std::span<const MethodTraits> shadow_methods() { return kMethods; }
const MethodTraits& traits_of(ShadowMethod method) { return kMethods[static_cast<std::size_t>(method)]; }
ShadowMethod shadow_method_from_name(const std::string& name) { return entry_of(kMethods, name, "method").method; }
SamplePattern sample_pattern_from_name(const std::string& name) { return entry_of(kPatterns, name, "pattern").value; }
const char* name_of(ShadowMethod method) { return traits_of(method).name; }
const char* name_of(SamplePattern pattern) { return kPatterns[static_cast<std::size_t>(pattern)].name; }

void report_progress(const ShadowConfig& config, double done) {
  if (config.progress && !config.progress(done)) throw Error(ErrorCode::kCancelled, "cancelled");
}

void solve_masks(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                 const LightSamples& samples, const ShadowConfig& config, VisibilityMasks& masks, ShadowStats& stats) {
  const FpEnvironment environment;
  stats = {};
  stats.receivers = receivers.size();
  stats.triangles = mesh.triangles.size();
  switch (config.method) {
    case ShadowMethod::kAliasFreeShadowMap:
      solve_alias_free_shadow_map(mesh, receivers, light, samples, config, masks, stats);
      break;
    case ShadowMethod::kExact:
      solve_exact(mesh, receivers, light, samples, config, masks, stats);
      break;
    case ShadowMethod::kOracle: {
      Stopwatch watch;
      solve_oracle(mesh, receivers, samples, config, masks);
      stats.test_ms = watch.lap();
      break;
    }
    default:
      throw Error(ErrorCode::kUsage, std::string("method '") + name_of(config.method) + "' yields no masks");
  }
}

void solve_visibility(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                      const LightSamples& samples, const ShadowConfig& config, std::vector<float>& visibility,
                      ShadowStats& stats) {
  VisibilityMasks masks;
  solve_masks(mesh, receivers, light, samples, config, masks, stats);
  visibility.resize(receivers.size());
  for (std::size_t i = 0; i < receivers.size(); ++i) visibility[i] = masks.visibility(i);
}

namespace {

/// Explicit receivers, on the lattice; `unlit` are those behind a one-sided light.
struct Request {
  LatticeMesh mesh;
  LightSamples samples;
  ReceiverArray receivers;
  std::vector<std::uint32_t> unlit;
};

Request make_request(const Scene& scene, std::span<const Receiver> receivers, const Light& light,
                     const ShadowConfig& config) {
  check_finite(receivers);
  std::vector<dvec3> reach = light_extent(light);
  for (const Receiver& r : receivers) reach.push_back(r.position_world);
  Request q;
  q.mesh = make_lattice_mesh(scene, make_local_frame(scene.positions, reach));
  q.samples = make_light_samples(light, config, q.mesh.frame);
  for (std::uint32_t i = 0; i < receivers.size(); ++i) {
    const vec3 position = q.mesh.frame.to_lattice(receivers[i].position_world);
    if (q.samples.one_sided && glm::dot(dvec3(position) - q.samples.center, q.samples.axis_n) <= 0.0) {
      q.unlit.push_back(i);
    } else {
      const std::uint32_t set =
          q.samples.interleaved ? i % kInterleavedSets : receiver_set(i, config.seed, q.samples.sets);
      q.receivers.push_back(position, vec3(0.0f), receivers[i].triangle, i, static_cast<std::uint8_t>(set));
    }
  }
  return q;
}

}  // namespace

void solve_shadows(const Scene& scene, std::span<const Receiver> receivers, const Light& light,
                   const ShadowConfig& config, VisibilityMasks& masks, ShadowStats* stats) {
  const FpEnvironment environment;
  const Request q = make_request(scene, receivers, light, config);
  ShadowStats own;
  VisibilityMasks solved;
  solve_masks(q.mesh, q.receivers, light, q.samples, config, solved, stats != nullptr ? *stats : own);
  masks.reset(receivers.size(), q.samples.count);
  for (std::size_t i = 0; i < q.receivers.size(); ++i) {
    std::copy_n(solved.mask(i).begin(), masks.words_per_receiver,
                masks.words.begin() + q.receivers.sample[i] * masks.words_per_receiver);
  }
  for (const std::uint32_t i : q.unlit) {
    for (std::uint32_t s = 0; s < q.samples.count; ++s) {
      masks.words[i * masks.words_per_receiver + s / 64] |= std::uint64_t{1} << (s % 64);
    }
  }
}

void solve_visibility(const Scene& scene, std::span<const Receiver> receivers, const Light& light,
                      const ShadowConfig& config, std::vector<float>& visibility, ShadowStats* stats) {
  const FpEnvironment environment;
  const Request q = make_request(scene, receivers, light, config);
  ShadowStats own;
  std::vector<float> solved;
  solve_visibility(q.mesh, q.receivers, light, q.samples, config, solved, stats != nullptr ? *stats : own);
  visibility.assign(receivers.size(), 0.0f);
  for (std::size_t i = 0; i < solved.size(); ++i) visibility[q.receivers.sample[i]] = solved[i];
}

}  // namespace halfshade
