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

constexpr Named<ShadowMethod> kMethods[] = {
    {ShadowMethod::kAliasFreeShadowMap, "afsm"}, {ShadowMethod::kExact, "exact"}, {ShadowMethod::kOracle, "oracle"}};
constexpr Named<SamplePattern> kPatterns[] = {{SamplePattern::kRows, "rows"},
                                              {SamplePattern::kUniform, "uniform"},
                                              {SamplePattern::kStratified, "stratified"},
                                              {SamplePattern::kLowDiscrepancy, "low-discrepancy"},
                                              {SamplePattern::kPoissonDisk, "poisson-disk"}};

template <class Value, std::size_t n>
Value value_of(const Named<Value> (&table)[n], const std::string& name, const char* what) {
  std::string known;
  for (const auto& entry : table) {
    if (name == entry.name) return entry.value;
    known += (known.empty() ? "" : ", ") + std::string(entry.name);
  }
  throw Error(ErrorCode::kUsage, std::string(what) + " '" + name + "' is not one of: " + known);
}

template <class Value, std::size_t n>
const char* name_in(const Named<Value> (&table)[n], Value value) {
  for (const auto& entry : table) {
    if (entry.value == value) return entry.name;
  }
  return "?";
}

void check_finite(std::span<const Receiver> receivers) {
  for (std::size_t i = 0; i < receivers.size(); ++i) {
    if (!is_finite(receivers[i].position_world)) {
      throw Error(ErrorCode::kBadInput, "receiver " + std::to_string(i) + ": the position is not finite");
    }
  }
}

}  // namespace

ShadowMethod shadow_method_from_name(const std::string& name) { return value_of(kMethods, name, "method"); }
SamplePattern sample_pattern_from_name(const std::string& name) { return value_of(kPatterns, name, "pattern"); }
const char* name_of(ShadowMethod method) { return name_in(kMethods, method); }
const char* name_of(SamplePattern pattern) { return name_in(kPatterns, pattern); }

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
  }
}

void solve_shadows(const Scene& scene, std::span<const Receiver> receivers, const Light& light,
                   const ShadowConfig& config, VisibilityMasks& masks, ShadowStats* stats) {
  const FpEnvironment environment;
  check_finite(receivers);
  std::vector<dvec3> reach = light_extent(light);
  for (const Receiver& r : receivers) reach.push_back(r.position_world);
  const LocalFrame frame = make_local_frame(scene.positions, reach);
  const LatticeMesh mesh = make_lattice_mesh(scene, frame);
  const LightSamples samples = make_light_samples(light, config, frame);
  ReceiverArray array;
  std::vector<std::uint32_t> unlit;
  for (std::uint32_t i = 0; i < receivers.size(); ++i) {
    const vec3 position = frame.to_lattice(receivers[i].position_world);
    const bool behind = samples.one_sided && glm::dot(dvec3(position) - samples.center, samples.axis_n) <= 0.0;
    if (behind) {
      unlit.push_back(i);
    } else {
      const std::uint32_t set = samples.interleaved ? i % kInterleavedSets : receiver_set(i, config.seed, samples.sets);
      array.push_back(position, vec3(0.0f), receivers[i].triangle, i, static_cast<std::uint8_t>(set));
    }
  }
  ShadowStats own;
  VisibilityMasks solved;
  solve_masks(mesh, array, light, samples, config, solved, stats != nullptr ? *stats : own);
  masks.reset(receivers.size(), samples.count);
  for (std::size_t i = 0; i < array.size(); ++i) {
    std::copy_n(solved.mask(i).begin(), masks.words_per_receiver,
                masks.words.begin() + array.sample[i] * masks.words_per_receiver);
  }
  for (const std::uint32_t i : unlit) {
    for (std::uint32_t s = 0; s < samples.count; ++s) {
      masks.words[i * masks.words_per_receiver + s / 64] |= std::uint64_t{1} << (s % 64);
    }
  }
}

}  // namespace halfshade
