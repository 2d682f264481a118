// halfshade chart: time and error of every method and parameter on any scenes. Each point is measured once with its
// errors; then all points of a light are timed again in turn, so that whatever slows the machine meets all alike.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>

#include "chart_file.h"
#include "chart_subject.h"
#include "halfshade/error.h"
#include "input_hashes.h"
#include "options_json.h"
#include "output_files.h"
#include "progress.h"
#include "rasterizer/core/parallel.h"
#include "rasterizer/core/stopwatch.h"
#include "rasterizer/io/image.h"
#include "shadows/solver.h"
#include "stats_json.h"

namespace halfshade {
namespace {

using nlohmann::ordered_json;

constexpr double kSaveEveryMs = 2000.0;  // while only times are added

std::string time_text(double seconds) {
  const auto whole = static_cast<long>(seconds + 0.5);
  return whole < 60 ? fmt::format("{} s", whole) : fmt::format("{} min {:02} s", whole / 60, whole % 60);
}

/// Equal lengths of work per scene, light and step: a run of a point, or a set of the reference.
class ChartProgress {
 public:
  ChartProgress(std::size_t scenes, bool quiet) : progress_("chart", quiet), scenes_(static_cast<double>(scenes)) {}
  void begin_part(double begin, double end) { begin_ = begin, end_ = end; }
  void step(double done_of_part, const std::string& what) {
    seconds_ += watch_.lap() * 1e-3;
    const double done = (begin_ + (end_ - begin_) * done_of_part) / scenes_;
    const double left = seconds_ * (1.0 - done) / std::max(done, 1e-6);
    progress_(done, fmt::format("about {} left, {}", time_text(left), what));
  }

 private:
  Progress progress_;
  Stopwatch watch_;
  double scenes_, begin_ = 0.0, end_ = 1.0, seconds_ = 0.0;
};

std::string program_hash() {
  std::ifstream file("/proc/self/exe", std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(file), {}};
  return bytes.empty() ? "unknown" : hash_of(bytes);
}

/// What every point of a file has in common; another program means other times.
ordered_json settings_json(const ChartOptions& o) {
  return {{"program", program_hash()},    {"size", o.size},
          {"pattern", o.pattern},         {"seed", o.seed},
          {"threads", concurrency()},     {"simd_target", simd_target()},
          {"time_limit_s", o.time_limit}, {"reference_samples", o.reference_samples}};
}

ordered_json head_json(const ChartOptions& o) {
  return {{"version", HALFSHADE_VERSION},
          {"command", o.command_line},
          {"machine", machine_json()},
          {"settings", settings_json(o)}};
}

void add_time(ordered_json& point, double ms) {
  point["times_ms"].push_back(ms);
  std::vector<double> times = point["times_ms"].get<std::vector<double>>();
  std::sort(times.begin(), times.end());
  point["shadow_ms"] = (times[(times.size() - 1) / 2] + times[times.size() / 2]) * 0.5;
  point["shadow_ms_min"] = times.front();
  point["shadow_ms_max"] = times.back();
}

/// One light of one scene.
class LightChart {
 public:
  LightChart(const Pipeline& pipeline, const Light& light, const ChartOptions& options, ChartFile& file,
             ChartProgress& progress)
      : pipeline_(pipeline),
        light_(light),
        options_(options),
        file_(file),
        progress_(progress),
        subject_(pipeline, light, options, [this](std::uint32_t set) { begin_set(set); }),
        series_(chart_series(options)) {
    file.expect_inputs(options.scene, light.name, subject_.inputs_hash());
    const std::string scene = std::filesystem::path(options.scene).stem().string();
    image_directory_ = "images/" + file_name(scene + "-" + light.name + "-" + subject_.inputs_hash().substr(0, 6));
    make_directory(std::filesystem::path(options.output) / image_directory_);
    if (light.shape == LightShape::kPoint) fix_sample_count(series_, 1);
    if (light.shape == LightShape::kSamples) {
      fix_sample_count(series_, static_cast<std::uint32_t>(light.points.size()));
    }
    for (const ChartSeries& series : series_) steps_ += series.points.size() * options.repeat;
  }

  void make() {
    if (needs_reference()) {
      steps_ += subject_.reference_sets();
      subject_.reference();
    }
    if (!file_.has_subject(options_.scene, light_.name)) file_.set_subject(describe());
    for (const ChartSeries& series : series_) make_series(series);
    for (std::uint32_t round = 1; round < options_.repeat; ++round) time_again(round);
    if (changed_) file_.set_subject(describe());
    file_.save();
  }

 private:
  /// A series ends with the first point that took too long, now or in an earlier process.
  void make_series(const ChartSeries& series) {
    std::string reason;  // why the rest of the series is left out
    for (const ChartPoint& point : series.points) {
      begin_run(point);
      ordered_json* known = find(point);
      if (known == nullptr) {
        file_.add_point(reason.empty() ? measure(series, point) : skipped(series, point, reason));
        known = find(point);
        file_.save();
      }
      if (reason.empty()) reason = why_to_end(*known, point);
    }
  }

  void begin_step(const std::string& what) {
    if (stop_signal() != 0) throw Error(ErrorCode::kCancelled, "cancelled");
    progress_.step(static_cast<double>(done_++) / static_cast<double>(steps_),
                   fmt::format("{} {}", options_.scene, what));
  }

  void begin_run(const ChartPoint& point) { begin_step(point.id); }

  void begin_set(std::uint32_t set) {
    begin_step(fmt::format("reference {} of {}", set + 1, subject_.reference_sets()));
  }

  /// Not when all points were measured in an earlier process.
  bool needs_reference() {
    if (!file_.has_subject(options_.scene, light_.name)) return true;
    for (const ChartSeries& series : series_) {
      for (const ChartPoint& point : series.points) {
        if (find(point) == nullptr) return true;
      }
    }
    return false;
  }

  ordered_json* find(const ChartPoint& point) { return file_.find_point(options_.scene, light_.name, point.id); }

  std::string why_to_end(const ordered_json& json, const ChartPoint& point) const {
    const bool ended = json.at("status") == "skipped" ? json.value("over_time", false)
                                                      : json.at("times_ms").at(0) > 1000.0 * options_.time_limit;
    return ended ? fmt::format("{} took more than {:g} s", point.id, options_.time_limit) : std::string();
  }

  ordered_json begin_point(const ChartSeries& series, const ChartPoint& point) const {
    return {{"scene", options_.scene},
            {"light", light_.name},
            {"id", point.id},
            {"method", name_of(point.config.method)},
            {"parameter", series.parameter},
            {"label", point.label},
            {"light_samples", point.config.light_sample_count},
            {"options", options_json(point.config)},
            {"promises_exactness", promises_exactness(point.config)}};
  }

  ordered_json skipped(const ChartSeries& series, const ChartPoint& point, const std::string& reason) const {
    ordered_json json = begin_point(series, point);
    json["status"] = "skipped";
    json["reason"] = reason;
    return json;
  }

  ordered_json measure(const ChartSeries& series, const ChartPoint& point) {
    changed_ = true;
    const ChartSubject::Run run = subject_.run(point.config);
    if (!run.reason.empty()) {
      ordered_json json = skipped(series, point, run.reason);
      json["over_time"] = run.ms > 1000.0 * options_.time_limit;
      return json;
    }
    ordered_json json = begin_point(series, point);
    json["status"] = "measured";
    json["times_ms"] = ordered_json::array();
    add_time(json, run.ms);
    VisibilityImage image;
    json.update(subject_.measure(point.config, run, image));
    json["image"] = write_image(point.id, image);
    return json;
  }

  /// Its path below the output directory.
  std::string write_image(const std::string& id, const VisibilityImage& image) const {
    const std::string name = fmt::format("{}/{}.png", image_directory_, file_name(id));
    const GBuffer& g = pipeline_.gbuffer;
    write_png(std::filesystem::path(options_.output) / name, g.width, g.height, 1, image, false, 8, {});
    return name;
  }

  ordered_json describe() {
    ordered_json json = subject_.describe();
    json["reference"]["image"] = write_image("reference", subject_.reference());
    return json;
  }

  bool has_enough(const ordered_json& point, std::uint32_t runs) const {
    if (point.at("status") != "measured") return true;
    double sum_ms = 0.0;
    for (const ordered_json& ms : point.at("times_ms")) sum_ms += ms.get<double>();
    return point.at("times_ms").size() >= runs || sum_ms > 1000.0 * options_.time_limit;
  }

  /// One run of every point that has fewer than `round` + 1 times; those of an earlier process count.
  void time_again(std::uint32_t round) {
    Stopwatch since_save;
    double unsaved_ms = 0.0;
    for (const ChartSeries& series : series_) {
      for (const ChartPoint& point : series.points) {
        begin_run(point);
        ordered_json& json = *find(point);
        if (has_enough(json, round + 1)) continue;
        const ChartSubject::Run run = subject_.run(point.config);
        if (run.reason.empty()) add_time(json, run.ms);
        if ((unsaved_ms += since_save.lap()) < kSaveEveryMs) continue;
        file_.save();
        unsaved_ms = 0.0;
      }
    }
  }

  const Pipeline& pipeline_;
  const Light& light_;
  const ChartOptions& options_;
  ChartFile& file_;
  ChartProgress& progress_;
  ChartSubject subject_;
  std::vector<ChartSeries> series_;
  std::string image_directory_;       // below the output directory
  std::size_t steps_ = 0, done_ = 0;  // runs of points, and sets of the reference
  bool changed_ = false;              // a point was measured in this process
};

void run(ChartOptions options) {
  complete_options(options);
  if (!(options.time_limit > 0.0)) usage_error(fmt::format("--time-limit {} is not positive", options.time_limit));
  chart_series(options);  // names are checked before anything is loaded
  if (!options.simd.empty()) force_simd_target(options.simd);
  make_directory(options.output);
  ChartFile file(options.output, head_json(options), options.fresh);
  ChartProgress progress(options.scenes.size(), options.quiet);
  for (std::size_t s = 0; s < options.scenes.size(); ++s) {
    options.scene = options.scenes[s];
    options.light_samples = *std::max_element(options.samples.begin(), options.samples.end());
    Pipeline pipeline;
    open_pipeline(options, 0.0, pipeline);
    const std::vector<Light>& lights = pipeline.source.view.lights;
    for (std::size_t l = 0; l < lights.size(); ++l) {
      const double per_light = 1.0 / static_cast<double>(lights.size()), light = static_cast<double>(l);
      progress.begin_part(static_cast<double>(s) + per_light * light, static_cast<double>(s) + per_light * (light + 1));
      LightChart(pipeline, lights[l], options, file, progress).make();
    }
  }
  file.save_table();
  fmt::print("written    {}/chart.json, chart.csv, images/\n", options.output);
}

}  // namespace

void add_chart(CLI::App& app, const std::string& command_line) {
  CLI::App* verb = app.add_subcommand("chart", "Time and error of every method and parameter on any scenes");
  auto o = std::make_shared<ChartOptions>();
  o->size.clear();
  verb->add_option("scenes", o->scenes, "OBJ files or builtin:NAME[:SIZE] (default: all built-in scenes)");
  verb->add_option("--shared-scenes", o->shared_scenes,
                   "With the default scenes, but not with --quick: also all OBJ files below this directory");
  verb->add_option("--methods", o->methods, "Methods, separated by commas (default: all but oracle)")
      ->delimiter(',')
      ->allow_extra_args(false);
  verb->add_option("--samples", o->samples, "Light samples of methods with masks (default: 4,16,64,256,1024,4096)")
      ->delimiter(',')
      ->allow_extra_args(false);
  verb->add_option("--base-samples", o->base_samples, "Light samples where another parameter is swept (default: 256)")
      ->check(CLI::Range(1, 4096));
  verb->add_option("--sweep", o->sweeps,
                   "[METHOD:]OPTION=V1,V2,...: one parameter, the others at their defaults; may be repeated, replaces "
                   "the default sweeps; 'none' for no sweep. Options as for render --set")
      ->allow_extra_args(false);
  verb->add_option("-o,--output", o->output, "Directory for chart.json, chart.csv and images; finished points are kept")
      ->capture_default_str();
  verb->add_option("--size", o->size, "Picture in pixels, WIDTHxHEIGHT (default: 256x256)");
  verb->add_option("--repeat", o->repeat,
                   "Runs of each point, fewer if they take longer than the limit together; their median counts")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  verb->add_option("--time-limit", o->time_limit, "Seconds; a run that takes longer ends its series of parameters")
      ->capture_default_str();
  verb->add_option("--reference-samples", o->reference_samples, "Samples per receiver of the converged reference")
      ->check(CLI::Range(16, 1 << 22))
      ->capture_default_str();
  verb->add_option("--pattern", o->pattern, "Sample pattern")->capture_default_str();
  verb->add_option("--seed", o->seed, "Seed of the pattern")->capture_default_str();
  verb->add_option("--threads", o->threads, "Threads (0 = all cores)")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  verb->add_option("--simd", o->simd, "Use only this instruction set (AVX3, AVX2, SSE4, ...)");
  verb->add_flag("--quick", o->quick, "Three scenes of 128x128 pixels, up to 256 samples, few sweeps");
  verb->add_flag("--fresh", o->fresh, "Forget the points that the directory holds");
  verb->add_flag("-q,--quiet", o->quiet, "No progress");
  verb->callback([o, command_line] {
    o->command_line = command_line;
    run_in_arena(o->threads, [&] { run(*o); });
  });
}

}  // namespace halfshade
