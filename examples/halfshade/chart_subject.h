// One light of one scene, and how far each method's answer is from the exact one and from the converged one.
#pragma once

#include <functional>
#include <map>
#include <nlohmann/json.hpp>

#include "chart_points.h"

namespace halfshade {

/// Visibility of the light for each pixel; 0 where no receiver is.
using VisibilityImage = std::vector<float>;

class ChartSubject {
 public:
  /// `pipeline` and `light` must outlive it. `on_set` hears of each set of the reference before it is solved.
  ChartSubject(const Pipeline& pipeline, const Light& light, const ChartOptions& options,
               std::function<void(std::uint32_t)> on_set);

  /// Hash of scene, camera, size and light: of the receivers and of two sets of light samples.
  const std::string& inputs_hash() const { return inputs_hash_; }
  /// {"scene", "light", ..., "reference", "exact_checked"}; makes the reference if nobody has asked for it yet.
  nlohmann::ordered_json describe();
  const VisibilityImage& reference();
  std::uint32_t reference_sets() const;

  /// What came out of one run. `reason` is why nothing did: the time limit, or the method refused.
  struct Run {
    double ms = 0.0, build_ms = 0.0;  // `ms` without `build_ms`
    std::uint64_t bytes = 0;
    std::string reason;
    VisibilityMasks masks;  // empty for methods without them
    std::vector<float> visibility;
  };
  /// Throws Error{kCancelled} once a signal has arrived.
  Run run(const ShadowConfig& config);
  /// The point as in docs/files.md, without times; `image` receives its visibility.
  nlohmann::ordered_json measure(const ShadowConfig& config, const Run& run, VisibilityImage& image);

 private:
  /// Light samples of one number, who asks for them, and the exact answer once it is needed.
  struct Question {
    LightSamples samples;
    ReceiverArray receivers;
    VisibilityMasks exact;
  };
  Question& question(const ShadowConfig& config);
  const VisibilityMasks& exact_answer(Question& question, const ShadowConfig& config);
  void check_with_oracle(const Question& question);
  void make_reference();
  nlohmann::ordered_json against_exact(const ShadowConfig& config, const Run& run);
  nlohmann::ordered_json against_reference(const VisibilityImage& image, std::uint32_t sample_count);

  const Pipeline& pipeline_;
  const Light& light_;
  const ChartOptions& options_;
  KeptExact kept_;  // for truth and reference; what is timed builds its own
  std::function<void(std::uint32_t)> on_set_;
  std::string inputs_hash_;
  std::map<std::uint32_t, Question> questions_;  // by number of light samples
  VisibilityImage reference_;
  std::vector<std::uint32_t> compared_;  // pixels that are receivers of every set of the reference
  std::uint32_t reference_samples_ = 0;
  double reference_error_ = 0.0;  // its own: half the RMSE between its two halves
  std::uint64_t checked_bits_ = 0, checked_wrong_ = 0;
};

}  // namespace halfshade
