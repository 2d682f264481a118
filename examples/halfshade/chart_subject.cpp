#include "chart_subject.h"

#include <bit>
#include <cmath>

#include "halfshade/error.h"
#include "input_hashes.h"
#include "progress.h"
#include "rasterizer/core/hash.h"
#include "rasterizer/core/parallel.h"
#include "rasterizer/core/stopwatch.h"
#include "rasterizer/io/flip.h"
#include "shadows/opaque_mesh.h"
#include "shadows/oracle.h"
#include "shadows/solver.h"

namespace halfshade {
namespace {

using nlohmann::ordered_json;

constexpr std::uint32_t kReferenceFrame = 1u << 24;  // the reference's sets are none that a point uses
constexpr std::uint32_t kReferenceSetSize = 1024;
constexpr std::size_t kMostChecked = 64;      // receivers per number of samples that the oracle looks at
constexpr double kCheckMilliseconds = 200.0;  // or as many as fit into this

template <class T>
void append(std::string& bytes, const std::vector<T>& values) {
  bytes.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
}

/// Sums over differences of visibility.
struct Differences {
  double squares = 0.0, sum = 0.0, worst = 0.0;
  std::uint64_t count = 0, large = 0;
  void add(double d, double threshold) {
    squares += d * d, sum += d, worst = std::max(worst, std::fabs(d));
    large += std::fabs(d) > threshold, ++count;
  }
  double rmse() const { return count == 0 ? 0.0 : std::sqrt(squares / static_cast<double>(count)); }
  double mean() const { return count == 0 ? 0.0 : sum / static_cast<double>(count); }
  double share_large() const { return count == 0 ? 0.0 : static_cast<double>(large) / static_cast<double>(count); }
};

VisibilityImage spread(const ReceiverArray& receivers, const std::vector<float>& visibility, std::size_t pixels) {
  VisibilityImage image(pixels, 0.0f);
  for (std::size_t i = 0; i < receivers.size(); ++i) image[receivers.sample[i]] = visibility[i];
  return image;
}

}  // namespace

ChartSubject::ChartSubject(const Pipeline& pipeline, const Light& light, const ChartOptions& options,
                           std::function<void(std::uint32_t)> on_set)
    : pipeline_(pipeline), light_(light), options_(options), on_set_(std::move(on_set)) {
  ShadowConfig config = shadow_config(options);
  config.light_sample_count = options.base_samples;
  const Question& asked = question(config);
  std::string bytes = scene_hash(pipeline.source.scene);
  append(bytes, asked.receivers.position);
  append(bytes, asked.receivers.sample);
  append(bytes, asked.samples.points);
  config.frame = 1;
  append(bytes, make_light_samples(light, config, pipeline.mesh.frame).points);
  inputs_hash_ = hash_of(bytes);
}

ChartSubject::Question& ChartSubject::question(const ShadowConfig& config) {
  const auto [place, is_new] = questions_.try_emplace(config.light_sample_count);
  Question& q = place->second;
  if (is_new) {
    q.samples = make_light_samples(light_, config, pipeline_.mesh.frame);
    q.receivers = make_receivers(pipeline_.gbuffer, q.samples, config.seed);
  }
  return q;
}

const VisibilityMasks& ChartSubject::exact_answer(Question& question, const ShadowConfig& asked) {
  if (question.exact.words.empty() && question.receivers.size() > 0) {
    ShadowConfig config = shadow_config(options_);
    config.method = ShadowMethod::kExact;
    config.light_sample_count = asked.light_sample_count;
    config.progress = [](double) { return stop_signal() == 0; };
    ShadowStats stats;
    solve_masks(pipeline_.mesh, question.receivers, light_, question.samples, config, question.exact, stats, &kept_);
    check_with_oracle(question);
  }
  return question.exact;
}

/// The exact answer is what others are measured by, so a few receivers of it go through brute force.
void ChartSubject::check_with_oracle(const Question& q) {
  const OpaqueMesh opaque(pipeline_.mesh);
  const std::size_t parts = std::min(kMostChecked, q.receivers.size());
  std::vector<std::uint64_t> truth(q.exact.words_per_receiver);
  Stopwatch watch;
  double spent = 0.0;
  for (std::size_t k = 0; k < parts && spent < kCheckMilliseconds; ++k, spent += watch.lap()) {
    const std::size_t receiver = hash32(static_cast<std::uint32_t>(k), q.samples.count) % q.receivers.size();
    std::fill(truth.begin(), truth.end(), 0);
    oracle_mask(opaque.get(), q.receivers, receiver, q.samples, truth);
    const auto mask = q.exact.mask(receiver);
    for (std::size_t w = 0; w < truth.size(); ++w)
      checked_wrong_ += static_cast<std::uint64_t>(std::popcount(truth[w] ^ mask[w]));
    checked_bits_ += q.samples.count;
  }
}

const VisibilityImage& ChartSubject::reference() {
  if (reference_.empty()) make_reference();
  return reference_;
}

std::uint32_t ChartSubject::reference_sets() const {
  return (options_.reference_samples + kReferenceSetSize - 1) / kReferenceSetSize;
}

/// The mean of many sets, kept as two halves whose difference tells how far it may be trusted. Only pixels that are
/// receivers of every set are compared: where the tangent plane cuts off all but a sliver of the light, a set that
/// misses the sliver says 0 and one that meets it counts the samples below the plane as well, so that V there is no
/// mean of anything.
void ChartSubject::make_reference() {
  ShadowConfig config = shadow_config(options_);
  config.method = ShadowMethod::kExact;
  config.pattern = SamplePattern::kStratified;  // independent sets: no error that all of them share
  config.light_sample_count = std::min(options_.reference_samples, kReferenceSetSize);
  config.sample_sets = 1;
  config.progress = [](double) { return stop_signal() == 0; };
  const std::uint32_t sets = reference_sets();
  const std::size_t pixels = pipeline_.gbuffer.size();
  std::array<std::vector<double>, 2> halves = {std::vector<double>(pixels, 0.0), std::vector<double>(pixels, 0.0)};
  std::array<std::uint32_t, 2> sets_of_half = {0, 0};
  std::vector<std::uint32_t> seen(pixels, 0);  // sets that the pixel is a receiver of
  VisibilityMasks masks;
  ShadowStats stats;
  for (std::uint32_t set = 0; set < sets; ++set) {
    on_set_(set);
    config.frame = kReferenceFrame + set;
    const LightSamples samples = make_light_samples(light_, config, pipeline_.mesh.frame);
    const ReceiverArray receivers = make_receivers(pipeline_.gbuffer, samples, config.seed);
    solve_masks(pipeline_.mesh, receivers, light_, samples, config, masks, stats, &kept_);
    ++sets_of_half[set % 2];
    reference_samples_ += samples.count;
    for (std::size_t i = 0; i < receivers.size(); ++i) {
      halves[set % 2][receivers.sample[i]] += masks.visibility(i);
      ++seen[receivers.sample[i]];
    }
  }
  Differences between;
  reference_.assign(pixels, 0.0f);
  for (std::uint32_t i = 0; i < pixels; ++i) {
    reference_[i] = static_cast<float>((halves[0][i] + halves[1][i]) / sets);
    if (seen[i] < sets) continue;
    compared_.push_back(i);
    if (sets > 1) between.add(halves[0][i] / sets_of_half[0] - halves[1][i] / sets_of_half[1], 0.0);
  }
  reference_error_ = 0.5 * between.rmse();
}

ChartSubject::Run ChartSubject::run(const ShadowConfig& asked) {
  const Question& q = question(asked);
  ShadowConfig config = asked;
  Stopwatch since_start;
  double spent_ms = 0.0;
  config.progress = [&](double) {
    spent_ms += since_start.lap();
    return stop_signal() == 0 && spent_ms < 1000.0 * options_.time_limit;
  };
  Run run;
  ShadowStats stats;
  Stopwatch watch;
  try {
    solve_light_by_method(pipeline_.mesh, q.receivers, light_, q.samples, config, run.masks, run.visibility, stats);
  } catch (const Error& e) {
    if (stop_signal() != 0) throw;
    run.reason = e.code() == ErrorCode::kCancelled ? "stopped at the time limit" : e.what();
  }
  run.ms = watch.lap() - stats.build_ms;
  run.build_ms = stats.build_ms;
  run.bytes = stats.bytes;
  return run;
}

ordered_json ChartSubject::against_exact(const ShadowConfig& config, const Run& run) {
  Question& q = question(config);
  const VisibilityMasks& exact = exact_answer(q, config);
  Differences differences;
  std::uint64_t wrong_bits = 0, wrong_receivers = 0;
  for (std::size_t i = 0; i < q.receivers.size(); ++i) {
    differences.add(double{run.visibility[i]} - exact.visibility(i), 0.0);
    if (run.masks.words.empty()) continue;
    std::uint64_t here = 0;
    for (std::size_t w = 0; w < exact.words_per_receiver; ++w)
      here += static_cast<std::uint64_t>(std::popcount(exact.mask(i)[w] ^ run.masks.mask(i)[w]));
    wrong_bits += here, wrong_receivers += here > 0;
  }
  ordered_json json;
  if (yields_masks(config)) {
    json = {{"wrong_bits", wrong_bits},
            {"bits", q.receivers.size() * q.samples.count},
            {"wrong_receivers", wrong_receivers}};
  }
  json["rmse"] = differences.rmse();
  json["max"] = differences.worst;
  json["mean"] = differences.mean();
  return json;
}

ordered_json ChartSubject::against_reference(const VisibilityImage& image, std::uint32_t sample_count) {
  const VisibilityImage& truth = reference();
  Differences differences;
  VisibilityImage seen = truth;  // pixels that are not compared do not differ
  for (const std::uint32_t i : compared_) {
    differences.add(double{image[i]} - truth[i], 1.0 / sample_count);
    seen[i] = image[i];
  }
  const GBuffer& g = pipeline_.gbuffer;
  return {{"rmse", differences.rmse()},
          {"max", differences.worst},
          {"mean", differences.mean()},
          {"share_over_one_sample", differences.share_large()},
          {"flip", mean_flip_of_grey(seen, truth, g.width, g.height)}};
}

ordered_json ChartSubject::measure(const ShadowConfig& config, const Run& run, VisibilityImage& image) {
  const Question& q = question(config);
  image = spread(q.receivers, run.visibility, pipeline_.gbuffer.size());
  ordered_json json = {{"receivers", q.receivers.size()},
                       {"build_ms", run.build_ms},
                       {"bytes", run.bytes},
                       {"against_exact", against_exact(config, run)},
                       {"against_reference", against_reference(image, q.samples.count)}};
  const std::string assumptions = method_assumptions(config, light_);
  if (!assumptions.empty()) json["assumes"] = assumptions;
  return json;
}

ordered_json ChartSubject::describe() {
  reference();
  return {{"scene", options_.scene},
          {"light", light_.name},
          {"inputs", inputs_hash_},
          {"triangles", pipeline_.source.scene.triangles.size()},
          {"width", pipeline_.gbuffer.width},
          {"height", pipeline_.gbuffer.height},
          {"receivers", compared_.size()},
          {"reference", {{"samples", reference_samples_}, {"own_rmse", reference_error_}}},
          {"exact_checked", {{"bits", checked_bits_}, {"wrong_bits", checked_wrong_}}}};
}

}  // namespace halfshade
