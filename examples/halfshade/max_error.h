// What `--max-error` asks for and what it gives back: text, JSON, and the check against a converged reference.
#pragma once

#include <nlohmann/json.hpp>

#include "shadows/error_levels.h"

namespace halfshade {

struct Pipeline;
struct PipelineOptions;

/// "1/256", "0.004" or "0.4%". Throws Error{kUsage} for anything else and for goals out of range.
double parse_max_error(const std::string& text);

/// Throws Error{kUsage} where options choose what an error of visibility chooses itself.
void check_max_error_options(const PipelineOptions& options);

/// Why --max-error refuses this scene and its lights, or nothing.
std::string max_error_obstacle(const Pipeline& pipeline);

/// Receivers of one light for solve_to_error.
ReceiverArray receivers_of_whole_light(const GBuffer& gbuffer, const Light& light, const ShadowConfig& config,
                                       const LocalFrame& frame);

/// Visibility of receivers `which` from sets of 1,024 low-discrepancy samples by method exact, sets that no run uses:
/// 16 of them, and 64 or 256 where four times their standard error is above half of `goal`.
inline constexpr std::uint32_t kConvergedSamples = 16384;
std::vector<double> converged_visibility(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                                         const ShadowConfig& config, double goal, std::span<const std::uint32_t> which);

/// A share of the receivers against the reference.
struct MaxErrorCheck {
  std::uint64_t receivers = 0;
  std::uint64_t violations = 0;    // |V - reference| > max_error
  std::uint64_t above_bound = 0;   // |V - reference| > the receiver's own bound + 1/1024 for the reference's error
  std::uint64_t proofs = 0;        // of the receivers, those decided by certificate
  std::uint64_t wrong_proofs = 0;  // of these, where any sample of the reference disagrees
  double rmse = 0.0, largest = 0.0;
};
MaxErrorCheck check_max_error_run(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                                  const ShadowConfig& config, const AdaptiveVisibility& result, double percent);

nlohmann::ordered_json max_error_json(const AdaptiveVisibility& result);
nlohmann::ordered_json max_error_check_json(const MaxErrorCheck& check);
void print_max_error(std::FILE* out, const AdaptiveVisibility& result);

}  // namespace halfshade
