// halfshade accumulate: temporal jitter. Every frame asks with the next set of light samples; the mean converges to the
// visibility of the whole light (Sintorn, Eisemann, Assarsson 2008, section 4.2 and figure 7).
#include <fmt/format.h>

#include <cmath>
#include <cstdio>

#include "accumulation_state.h"
#include "frame_series.h"
#include "halfshade/error.h"
#include "input_hashes.h"
#include "progress.h"
#include "rasterizer/core/parallel.h"
#include "rasterizer/core/stopwatch.h"
#include "rasterizer/io/atomic_file.h"
#include "shadows/solver.h"
#include "stats_json.h"

namespace halfshade {
namespace {

using nlohmann::ordered_json;

constexpr std::uint32_t kReferenceFrame = 1u << 24;  // the reference's sets: far from those of any frame
constexpr std::uint32_t kReferenceSetSize = 256;
constexpr std::uint32_t kMostReferenceSamples = 1u << 22;
constexpr std::size_t kFewestFitted = 4;
constexpr double kTrust = 3.0;  // errors below this many of the reference's own tell little

struct AccumulateOptions : PipelineOptions {
  std::string output, json;
  std::uint32_t frames = 16, reference_samples = 16384;
  double until_error = 0.0;
  bool jitter_camera = false, resume = false;
};

/// "frame_%04d.png": the text around the one conversion.
struct OutputPattern {
  std::string before, after;
  int digits = 0;
  std::string name(std::size_t frame) const { return fmt::format("{}{:0{}}{}", before, frame, digits, after); }
};

OutputPattern parse_pattern(const std::string& text) {
  OutputPattern pattern;
  const std::size_t percent = text.find('%');
  int used = 0;
  char conversion = 0;
  const char* rest = percent == std::string::npos ? "" : text.c_str() + percent + 1;
  const bool padded = std::sscanf(rest, "0%1d%c%n", &pattern.digits, &conversion, &used) == 2;
  const bool plain = !padded && std::sscanf(rest, "%c%n", &conversion, &used) == 1;
  if (!(padded || plain) || conversion != 'd' || text.find('%', percent + 1) != std::string::npos) {
    usage_error(fmt::format("--output '{}' must hold one %d or %0Nd (N = 1..9) for the frame's number", text));
  }
  pattern.before = text.substr(0, percent);
  pattern.after = rest + used;
  check_picture_path(text);
  return pattern;
}

/// The converged answer.
struct Reference {
  std::vector<VisibilityAccumulator> lights;
  std::vector<std::vector<std::uint32_t>> receivers;  // [light] entries that are receivers in any of its sets
  std::uint32_t samples = 0;                          // 0: there is none
  double ms = 0.0;
  double error = NAN;  // its own, from the difference of its halves; NaN when it is one set
};

struct Accumulation : Pipeline {
  AccumulateOptions options;
  OutputPattern pattern;
  std::filesystem::path state_file;
  AccumulationState state;
  Reference reference;
  double slope = NAN;
  std::size_t frames_fitted = 0;
};

VisibilityError error_between(const std::vector<VisibilityAccumulator>& a, const std::vector<VisibilityAccumulator>& b,
                              const std::vector<std::vector<std::uint32_t>>& receivers) {
  VisibilityError error;
  for (std::size_t l = 0; l < a.size(); ++l) error.merge(visibility_error(a[l], b[l], receivers[l]));
  return error;
}

std::vector<std::uint32_t> marked(const std::vector<std::uint8_t>& flags) {
  std::vector<std::uint32_t> entries;
  for (std::uint32_t i = 0; i < flags.size(); ++i) {
    if (flags[i] != 0) entries.push_back(i);
  }
  return entries;
}

/// Many sets, kept as two halves whose difference tells how far they may be trusted.
void make_reference(Accumulation& run) {
  const std::uint32_t per_set = std::min(run.options.reference_samples, kReferenceSetSize);
  const std::uint32_t sets = (run.options.reference_samples + per_set - 1) / per_set;
  const std::vector<Light>& lights = run.source.view.lights;
  Stopwatch watch;
  Progress progress("reference", run.options.quiet);
  FrameSource source(run, run.options, run.options.jitter_camera);
  ShadowConfig config = shadow_config(run.options);
  config.light_sample_count = per_set;
  config.sample_sets = 1;
  config.interleave = false;
  config.pattern = SamplePattern::kRows;  // of all patterns, its sets converge fastest
  config.progress = [&](double done) { return progress((config.frame - kReferenceFrame + done) / sets); };
  std::array<std::vector<VisibilityAccumulator>, 2> halves = {empty_counts(run), empty_counts(run)};
  std::vector<std::vector<std::uint8_t>> seen(lights.size(), std::vector<std::uint8_t>(run.gbuffer.size(), 0));
  for (std::uint32_t set = 0; set < sets; ++set) {
    config.frame = kReferenceFrame + set;
    source.draw_frame(config.frame);
    for (std::size_t l = 0; l < lights.size(); ++l) {
      source.add(lights[l], config, halves[set < sets / 2 ? 0 : 1][l]);
      for (const std::uint32_t entry : source.receivers()) seen[l][entry] = 1;
    }
  }
  Reference& reference = run.reference;
  for (const std::vector<std::uint8_t>& flags : seen) reference.receivers.push_back(marked(flags));
  if (sets > 1) reference.error = 0.5 * error_between(halves[0], halves[1], reference.receivers).rmse;
  for (std::size_t l = 0; l < lights.size(); ++l) halves[0][l].merge(halves[1][l]);
  reference.lights = std::move(halves[0]);
  reference.samples = per_set * sets;
  reference.ms = watch.lap();
}

/// Everything that decides the accumulated numbers, as text.
std::string options_text(const Accumulation& run) {
  const AccumulateOptions& o = run.options;
  std::string text =
      fmt::format("scene {} view {} size {} crop '{}' spp {} jitter_camera {} shading {} reference {} {}",
                  scene_hash(run.source.scene), view_hash(run.source.view), o.size, o.crop, o.spp, o.jitter_camera,
                  o.shading, o.reference_samples, method_json(o).dump());
  for (const Light& light : run.source.view.lights) text += " light " + frame_samples_hash(run, o, light);
  return text;
}

/// The picture first: a state on the disk says that its frame's picture is there, too.
void write_frame(const Accumulation& run) {
  const std::size_t frame = run.state.frames.size() - 1;
  write_picture(run.pattern.name(frame), mean_picture(run, run.state.lights, run.state.color),
                frame_attributes(run, run.options, frame + 1));
  write_state(run.state_file, run.state);
}

std::FILE* text_output(const Accumulation& run) { return run.options.json == "-" ? stderr : stdout; }

void run_frame(Accumulation& run) {
  const std::vector<Light>& lights = run.source.view.lights;
  Stopwatch watch;
  FrameSource source(run, run.options, run.options.jitter_camera);
  ShadowConfig config = shadow_config(run.options);
  config.frame = static_cast<std::uint32_t>(run.state.frames.size());
  config.progress = [](double) { return stop_signal() == 0; };
  const bool has_reference = run.reference.samples > 0;
  const std::vector<VisibilityAccumulator> before =
      has_reference ? std::vector<VisibilityAccumulator>() : run.state.lights;
  std::vector<std::vector<std::uint32_t>> receivers;
  std::vector<std::vector<float>> visibility;
  source.draw_frame(config.frame);
  for (std::size_t l = 0; l < lights.size(); ++l) {
    source.add(lights[l], config, run.state.lights[l]);
    if (!has_reference) receivers.push_back(source.receivers());
    if (run.state.color.size() > 0) visibility.push_back(source.visibility());
  }
  if (run.state.color.size() > 0) add_color(run, visibility, run.state.color);
  FrameRecord& record = run.state.frames.emplace_back();
  record.ms = watch.lap();
  record.error = has_reference ? error_between(run.state.lights, run.reference.lights, run.reference.receivers)
                               : error_between(run.state.lights, before, receivers);
  fmt::print(text_output(run), "frame {:5}  {:8.1f} ms  {} RMSE {:.6f}  max |dV| {:.6f}\n", config.frame, record.ms,
             has_reference ? "error" : "change", record.error.rmse, record.error.worst);
  std::fflush(text_output(run));
  if (!run.options.output.empty()) write_frame(run);
}

bool finished(const Accumulation& run) {
  const std::vector<FrameRecord>& frames = run.state.frames;
  if (frames.size() >= run.options.frames) return true;
  return run.options.until_error > 0.0 && !frames.empty() && frames.back().error.rmse < run.options.until_error;
}

/// Over the first frames, up to the last whose error is well above the reference's own. Leaving out small errors before
/// that one would flatten the slope.
void fit_slope(Accumulation& run) {
  if (run.reference.samples == 0) return;
  const double least = std::isnan(run.reference.error) ? 0.0 : kTrust * run.reference.error;
  std::vector<double> frames, errors;
  for (std::size_t i = 0; i < run.state.frames.size(); ++i) {
    frames.push_back(static_cast<double>(i + 1));
    errors.push_back(run.state.frames[i].error.rmse);
    if (errors.back() > least) run.frames_fitted = i + 1;
  }
  frames.resize(run.frames_fitted);
  errors.resize(run.frames_fitted);
  if (run.frames_fitted >= kFewestFitted) run.slope = convergence_exponent(frames, errors);
}

void print_summary(const Accumulation& run) {
  std::FILE* out = text_output(run);
  if (!std::isnan(run.slope)) {
    fmt::print(out, "slope {:.2f} (random would be -0.5), fitted to the first {} frames\n", run.slope,
               run.frames_fitted);
  } else if (run.reference.samples > 0) {
    fmt::print(out, "no slope: after frame {} errors are no larger than {:g} times the reference's own\n",
               run.frames_fitted, kTrust);
  }
  if (!run.options.output.empty() && !run.state.frames.empty()) {
    fmt::print(out, "written    {}\n", run.pattern.name(run.state.frames.size() - 1));
  }
}

ordered_json number_or_null(double value) { return std::isfinite(value) ? ordered_json(value) : ordered_json(); }

ordered_json run_json(const Accumulation& run) {
  const AccumulateOptions& o = run.options;
  ordered_json json = {
      {"schema", "halfshade.accumulate/1"}, {"version", HALFSHADE_VERSION}, {"command", o.command_line}};
  json["machine"] = machine_json();
  json["machine"]["threads"] = concurrency();
  json["scene"] = {
      {"name", o.scene}, {"triangles", run.source.scene.triangles.size()}, {"hash", scene_hash(run.source.scene)}};
  json["method"] = method_json(o);
  json["size"] = {run.raster.width / run.subsamples, run.raster.height / run.subsamples};
  json["spp"] = o.spp;
  json["jitter_camera"] = o.jitter_camera;
  json["reference"] = {
      {"samples", run.reference.samples}, {"ms", run.reference.ms}, {"own_rmse", number_or_null(run.reference.error)}};
  json["error_is"] = run.reference.samples > 0 ? "difference from the reference" : "change from the frame before";
  json["frames"] = ordered_json::array();
  for (std::size_t i = 0; i < run.state.frames.size(); ++i) {
    const FrameRecord& frame = run.state.frames[i];
    json["frames"].push_back({{"frame", i},
                              {"ms", frame.ms < 0.0 ? ordered_json() : ordered_json(frame.ms)},
                              {"rmse", frame.error.rmse},
                              {"max", frame.error.worst}});
  }
  json["slope"] = number_or_null(run.slope);
  json["frames_fitted"] = run.frames_fitted;
  json["peak_rss_bytes"] = peak_rss_bytes();
  return json;
}

void check_options(const AccumulateOptions& o) {
  if (o.frames < 1 || o.frames > kMostFrames)
    usage_error(fmt::format("--frames {} is not in 1..{}", o.frames, kMostFrames));
  if (o.reference_samples > kMostReferenceSamples)
    usage_error(fmt::format("--reference-samples {} is not in 0..{}", o.reference_samples, kMostReferenceSamples));
  if (!(o.until_error >= 0.0 && o.until_error <= 1.0))
    usage_error(fmt::format("--until-error {} is not in 0..1", o.until_error));
  if (o.until_error > 0.0 && o.reference_samples == 0)
    usage_error("--until-error needs a reference: --reference-samples must not be 0");
  if (o.resume && o.output.empty()) usage_error("--resume needs the --output pattern of the run to go on with");
}

void prepare_state(Accumulation& run) {
  const AccumulateOptions& o = run.options;
  run.state.options_hash = hash_of(options_text(run));
  run.state.lights = empty_counts(run);
  if (o.jitter_camera && !o.output.empty()) run.state.color = empty_colors(run);
  run.state_file = o.output + ".state";
  if (!o.resume || !std::filesystem::exists(run.state_file)) return;
  read_state(run.state_file, run.state);
  fmt::print(stderr, "halfshade: going on after {} frames\n", run.state.frames.size());
}

void accumulate(const AccumulateOptions& options) {
  Accumulation run;
  run.options = options;
  check_options(options);
  if (!options.output.empty()) run.pattern = parse_pattern(options.output);
  open_pipeline(options, 40.0, run);
  warn_of_panes(run);
  prepare_state(run);
  if (options.reference_samples > 0) make_reference(run);
  while (!finished(run)) run_frame(run);
  fit_slope(run);
  print_summary(run);
  if (options.json.empty()) return;
  const std::string text = run_json(run).dump(2) + "\n";
  options.json == "-" ? void(std::fputs(text.c_str(), stdout)) : write_file_atomically(options.json, text);
}

}  // namespace

void add_accumulate(CLI::App& app, const std::string& command_line) {
  CLI::App* verb = app.add_subcommand("accumulate", "Average frames with different light samples until they converge");
  auto o = std::make_shared<AccumulateOptions>();
  add_pipeline_options(*verb, *o);
  verb->add_option("--frames", o->frames, "Frames, 1..65536")->capture_default_str();
  verb->add_option("-o,--output", o->output,
                   "Pictures to write, with one %d or %0Nd for the frame's number: frame_%04d.png (or .exr)");
  verb->add_flag("--jitter-camera", o->jitter_camera, "Move the camera by a fraction of a pixel in every frame");
  verb->add_option("--until-error", o->until_error, "Stop once the RMSE of the visibility is below this (0 = never)")
      ->capture_default_str();
  verb->add_flag("--resume", o->resume, "Go on where a run with the same options was stopped, from OUTPUT.state");
  verb->add_option("--reference-samples", o->reference_samples,
                   "Samples of the converged answer that errors are measured against; 0 = print changes instead")
      ->capture_default_str();
  verb->add_option("--json", o->json, "Errors and times as JSON to this file, or - for standard output");
  verb->callback([o, command_line] {
    o->command_line = command_line;
    run_in_arena(o->threads, [&] { accumulate(*o); });
  });
}

}  // namespace halfshade
