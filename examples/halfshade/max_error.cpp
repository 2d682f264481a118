#include "max_error.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>

#include "pipeline.h"
#include "rasterizer/core/hash.h"
#include "shadows/set_sequence.h"
#include "shadows/solver.h"

namespace halfshade {
namespace {

using nlohmann::ordered_json;

constexpr std::uint32_t kReferenceFrame = 1u << 23, kReferenceSets = 16;

bool read_number(std::string_view text, double& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size();
}

}  // namespace

double parse_max_error(const std::string& text) {
  const std::string_view all = text;
  const std::size_t slash = all.find('/');
  double value = 0.0, divisor = 1.0;
  bool good = false;
  if (slash != std::string_view::npos) {
    good = read_number(all.substr(0, slash), value) && read_number(all.substr(slash + 1), divisor) && divisor > 0.0;
  } else if (all.ends_with('%')) {
    good = read_number(all.substr(0, all.size() - 1), value);
    divisor = 100.0;
  } else {
    good = read_number(all, value);
  }
  if (!good || !(value / divisor >= kSmallestMaxError && value / divisor <= kLargestMaxError)) {
    usage_error(fmt::format(
        "--max-error '{}' is not an error of visibility in 1/4096..1/4, such as 1/256, 0.004 or 0.4%", text));
  }
  return value / divisor;
}

void check_max_error_options(const PipelineOptions& o) {
  const PipelineOptions defaults;
  if (o.method != defaults.method || o.pattern != defaults.pattern || o.light_samples != defaults.light_samples ||
      o.sets != defaults.sets || o.interleave || o.rotate) {
    usage_error("--max-error chooses method, pattern, sets and number of samples itself");
  }
}

std::string max_error_obstacle(const Pipeline& pipeline) {
  if (!pipeline.panes.empty()) return "the scene has translucent triangles";
  for (const Light& light : pipeline.source.view.lights) {
    if (!light.emission_image.empty()) return "light '" + light.name + "' has an emission image";
  }
  return {};
}

ReceiverArray receivers_of_whole_light(const GBuffer& gbuffer, const Light& light, const ShadowConfig& asked,
                                       const LocalFrame& frame) {
  ShadowConfig config = asked;
  config.interleave = false, config.sample_sets = 1;
  return make_receivers(gbuffer, make_sets(light, config, frame, {}, {}), config.seed);
}

namespace {

/// Sums over sets of the share that a receiver sees, and of its square.
struct ReferenceSums {
  double sum = 0.0, squares = 0.0;
  std::uint32_t sets = 0;
  double mean() const { return sum / sets; }
  double standard_error() const {
    return std::sqrt(std::max(0.0, squares / sets - mean() * mean()) / std::max(1.0, sets - 1.0));
  }
};

/// 16 more sets for each receiver of `which`.
void add_reference_sets(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                        ShadowConfig config, std::span<const std::uint32_t> which, std::vector<ReferenceSums>& sums) {
  constexpr std::size_t kPerCall = 32768;
  for (std::size_t first = 0; first < which.size(); first += kPerCall) {
    const auto part_of = which.subspan(first, std::min(kPerCall, which.size() - first));
    config.frame = kReferenceFrame + sums[part_of[0]].sets;
    const LightSamples samples = make_light_samples(light, config, mesh.frame);
    ReceiverArray part;
    for (const std::uint32_t i : part_of) {
      for (std::uint32_t set = 0; set < samples.sets; ++set) {
        part.push_back(receivers.position[i], receivers.normal[i], receivers.triangle[i], receivers.sample[i],
                       static_cast<std::uint8_t>(set));
      }
    }
    VisibilityMasks masks;
    ShadowStats stats;
    solve_masks(mesh, part, light, samples, config, masks, stats);
    for (std::size_t k = 0; k < part.size(); ++k) {
      ReferenceSums& s = sums[part_of[k / samples.sets]];
      const double v = masks.visibility(k);
      s.sum += v, s.squares += v * v, ++s.sets;
    }
  }
}

}  // namespace

std::vector<double> converged_visibility(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                                         const ShadowConfig& asked, double goal, std::span<const std::uint32_t> which) {
  ShadowConfig config = asked;
  config.method = ShadowMethod::kExact;
  config.pattern = SamplePattern::kLowDiscrepancy;
  config.light_sample_count = kConvergedSamples / kReferenceSets;
  config.sample_sets = kReferenceSets, config.interleave = false, config.rotate_sets = false;
  std::vector<ReferenceSums> sums(receivers.size());
  std::vector<std::uint32_t> open(which.begin(), which.end());
  for (const std::uint32_t sets : {16u, 64u, 256u}) {
    while (!open.empty() && sums[open[0]].sets < sets) add_reference_sets(mesh, receivers, light, config, open, sums);
    std::erase_if(open, [&](std::uint32_t i) { return 4.0 * sums[i].standard_error() <= 0.5 * goal; });
  }
  std::vector<double> result;
  for (const std::uint32_t i : which) result.push_back(sums[i].mean());
  return result;
}

MaxErrorCheck check_max_error_run(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                                  const ShadowConfig& config, const AdaptiveVisibility& result, double percent) {
  const auto share = static_cast<std::uint32_t>(std::min(percent, 100.0) * 0.01 * 4294967295.0);
  std::vector<std::uint32_t> which;
  for (std::uint32_t i = 0; i < receivers.size(); ++i) {
    if (hash32(i, 0x5eed) <= share) which.push_back(i);
  }
  const std::vector<double> truth = converged_visibility(mesh, receivers, light, config, result.max_error, which);
  MaxErrorCheck check;
  check.receivers = which.size();
  for (std::size_t k = 0; k < which.size(); ++k) {
    const std::uint32_t i = which[k];
    const double error = std::fabs(double{result.visibility[i]} - truth[k]);
    check.rmse += error * error / static_cast<double>(which.size());
    check.largest = std::max(check.largest, error);
    check.violations += error > result.max_error;
    check.above_bound += error > double{result.bound[i]} + 1.0 / 1024.0;
    if (result.evidence[i] != ErrorEvidence::kProof) continue;
    ++check.proofs, check.wrong_proofs += error > 1e-6;
  }
  check.rmse = std::sqrt(check.rmse);
  return check;
}

ordered_json max_error_json(const AdaptiveVisibility& r) {
  ordered_json levels = ordered_json::array();
  for (const ErrorLevel& level : r.levels) {
    levels.push_back({{"samples_per_receiver", level.samples_per_receiver},
                      {"receivers", level.receivers},
                      {"proved", level.proved},
                      {"settled", level.settled},
                      {"samples", level.samples},
                      {"ms", level.ms},
                      {"largest_bound_left", level.largest_bound}});
  }
  return {{"goal", r.max_error},      {"bound_kept", r.bound_kept},       {"pattern", r.pattern},
          {"set_size", r.set_size},   {"proved_lit", r.proved_lit},       {"proved_umbra", r.proved_umbra},
          {"exhausted", r.exhausted}, {"samples_asked", r.samples_asked}, {"levels", levels}};
}

ordered_json max_error_check_json(const MaxErrorCheck& c) {
  return {{"receivers", c.receivers},
          {"reference_samples", kConvergedSamples},
          {"violations", c.violations},
          {"above_own_bound", c.above_bound},
          {"proofs", c.proofs},
          {"wrong_proofs", c.wrong_proofs},
          {"visibility_rms_error", c.rmse},
          {"visibility_largest_error", c.largest}};
}

void print_max_error(std::FILE* out, const AdaptiveVisibility& r) {
  const double receivers = std::max<double>(1.0, static_cast<double>(r.visibility.size()));
  fmt::print(out,
             "error      goal {:.6f}; bound kept {:.6f} (estimate), {} lit and {} umbra by proof; {:.0f} samples per "
             "receiver on average ({})\n",
             r.max_error, r.bound_kept, r.proved_lit, r.proved_umbra, static_cast<double>(r.samples_asked) / receivers,
             r.pattern);
  for (const ErrorLevel& level : r.levels) {
    fmt::print(out, "  {:5} samples: {} receivers, {} proved, {} settled, {:.1f} ms, largest bound left {:.5f}\n",
               level.samples_per_receiver, level.receivers, level.proved, level.settled, level.ms, level.largest_bound);
  }
  if (r.exhausted > 0) fmt::print(out, "           {} receivers stay above the goal\n", r.exhausted);
}

}  // namespace halfshade
