// halfshade recommend: which setting keeps a given error of visibility on this scene under all its lights, and is the
// cheapest?
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <optional>
#include <span>

#include "max_error.h"
#include "pipeline.h"
#include "progress.h"
#include "rasterizer/core/stopwatch.h"
#include "shadows/solver.h"
#include "stats_json.h"

namespace halfshade {
namespace {

using nlohmann::ordered_json;

struct RecommendOptions : PipelineOptions {
  std::string max_error = "1/256";
  double goal = 0.0;
  std::uint32_t repeat = 3;
  double time_limit = 20.0;  // seconds for all repetitions of one setting
  bool json = false;
};

/// A setting, and what came out of it.
struct Candidate {
  std::string name, arguments;  // for people; for `halfshade render`
  ShadowConfig config;
  bool adaptive = false;
  std::vector<double> shadow_ms, build_ms, cpu_ms;
  std::vector<float> visibility;
  double rmse = 0.0, largest = 0.0, share_above = 0.0;
  std::string reason;  // why there is no result
};

double median(std::vector<double> values) {
  if (values.empty()) return 0.0;
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

void add(std::vector<Candidate>& all, ShadowMethod method, SamplePattern pattern, std::uint32_t samples,
         const RecommendOptions& o) {
  Candidate c;
  c.config = shadow_config(o);
  c.config.method = method, c.config.pattern = pattern, c.config.light_sample_count = samples;
  c.name = fmt::format("{} {} {}", name_of(method), name_of(pattern), samples);
  c.arguments = fmt::format("--method {} --pattern {} --light-samples {}", name_of(method), name_of(pattern), samples);
  all.push_back(std::move(c));
}

/// `obstacle`: why --max-error is not among them.
std::vector<Candidate> candidates(const RecommendOptions& o, const std::string& obstacle) {
  std::vector<Candidate> all;
  Candidate adaptive;
  adaptive.config = shadow_config(o), adaptive.adaptive = true;
  adaptive.name = "max-error " + o.max_error, adaptive.arguments = "--max-error " + o.max_error;
  adaptive.reason = obstacle;
  all.push_back(std::move(adaptive));
  for (const std::uint32_t n : {16u, 64u, 256u, 1024u, 4096u}) {
    add(all, ShadowMethod::kExact, SamplePattern::kRows, n, o);
    add(all, ShadowMethod::kExact, SamplePattern::kLowDiscrepancy, n, o);
  }
  for (const std::uint32_t n : {256u, 1024u}) {
    add(all, ShadowMethod::kAliasFreeShadowMap, SamplePattern::kLowDiscrepancy, n, o);
  }
  add(all, ShadowMethod::kAliasFreeLookupTable, SamplePattern::kLowDiscrepancy, 1024, o);
  add(all, ShadowMethod::kPercentageCloserSoftShadows, SamplePattern::kLowDiscrepancy, 256, o);
  add(all, ShadowMethod::kShadowAccumulation, SamplePattern::kLowDiscrepancy, 256, o);
  return all;
}

/// One light of the scene, its receivers and their converged visibility.
struct Subject {
  const Pipeline* pipeline = nullptr;
  const Light* light = nullptr;
  ReceiverArray receivers;
  std::vector<double> truth;
};

void run_once(const Subject& s, double goal, double time_limit, Candidate& c) {
  ShadowConfig config = c.config;
  Stopwatch watch, since_start;
  const std::clock_t cpu_before = std::clock();
  double spent = 0.0;
  config.progress = [&](double) { return stop_signal() == 0 && (spent += since_start.lap()) < 1000.0 * time_limit; };
  ShadowStats stats;
  try {
    if (c.adaptive) {
      AdaptiveVisibility result;
      solve_to_error(s.pipeline->mesh, s.receivers, *s.light, config, goal, result, stats);
      c.visibility = std::move(result.visibility);
    } else {
      const LightSamples samples = make_light_samples(*s.light, config, s.pipeline->mesh.frame);
      VisibilityMasks masks;
      solve_light_by_method(s.pipeline->mesh, s.receivers, *s.light, samples, config, masks, c.visibility, stats);
    }
  } catch (const Error& e) {
    if (stop_signal() != 0) throw;
    c.reason = e.code() == ErrorCode::kCancelled ? "stopped at the time limit" : e.what();
    return;
  }
  c.shadow_ms.push_back(watch.lap() - stats.build_ms);
  c.build_ms.push_back(stats.build_ms);
  c.cpu_ms.push_back(1e3 * static_cast<double>(std::clock() - cpu_before) / CLOCKS_PER_SEC);
}

void measure_error(const Subject& s, double goal, Candidate& c) {
  if (!c.reason.empty()) return;
  const double n = std::max<double>(1.0, static_cast<double>(s.receivers.size()));
  for (std::size_t i = 0; i < s.receivers.size(); ++i) {
    const double error = std::fabs(double{c.visibility[i]} - s.truth[i]);
    c.rmse += error * error / n, c.largest = std::max(c.largest, error), c.share_above += (error > goal) / n;
  }
  c.rmse = std::sqrt(c.rmse);
}

/// Interleaved, so that what else the machine does meets all alike. A setting that took its time is not repeated.
std::vector<Candidate> measure(const Subject& s, const RecommendOptions& o) {
  std::vector<Candidate> all = candidates(o, max_error_obstacle(*s.pipeline));
  Progress progress("settings under " + s.light->name, o.quiet);
  for (std::uint32_t round = 0; round < o.repeat; ++round) {
    for (std::size_t k = 0; k < all.size(); ++k) {
      Candidate& c = all[k];
      double spent = 0.0;
      for (const double ms : c.shadow_ms) spent += ms * 1e-3;
      if (!c.reason.empty() || spent > o.time_limit / o.repeat) continue;
      run_once(s, o.goal, o.time_limit, c);
      if (!progress((round + static_cast<double>(k + 1) / static_cast<double>(all.size())) / o.repeat)) {
        throw Error(ErrorCode::kCancelled, "cancelled");
      }
    }
  }
  for (Candidate& c : all) measure_error(s, o.goal, c);
  return all;
}

bool keeps_goal(const Candidate& c, double goal) { return c.reason.empty() && c.largest <= goal; }

/// Candidates of one light, in the same order for every light.
struct MeasuredLight {
  std::string name;
  std::size_t receivers = 0;
  std::vector<Candidate> candidates;
};

struct Choice {
  std::size_t candidate = 0;
  double ms = 0.0;  // of all lights together
};

/// `render` takes one setting for all lights: the cheapest of those that keep the goal on every receiver of all of
/// them.
std::optional<Choice> cheapest(std::span<const MeasuredLight> lights, double goal) {
  std::optional<Choice> best;
  for (std::size_t k = 0; k < lights.front().candidates.size(); ++k) {
    double ms = 0.0;
    bool keeps = true;
    for (const MeasuredLight& light : lights) {
      keeps = keeps && keeps_goal(light.candidates[k], goal);
      ms += median(light.candidates[k].shadow_ms);
    }
    if (keeps && (!best || ms < best->ms)) best = Choice{k, ms};
  }
  return best;
}

ordered_json candidates_json(const std::vector<Candidate>& all, double goal) {
  ordered_json points = ordered_json::array();
  for (const Candidate& c : all) {
    ordered_json point = {{"setting", c.arguments}};
    if (c.reason.empty()) {
      point.update({{"shadow_ms", median(c.shadow_ms)},
                    {"build_ms", median(c.build_ms)},
                    {"cpu_ms", median(c.cpu_ms)},
                    {"runs", c.shadow_ms.size()},
                    {"rmse", c.rmse},
                    {"max", c.largest},
                    {"share_above", c.share_above},
                    {"keeps_goal", keeps_goal(c, goal)}});
    } else {
      point["reason"] = c.reason;
    }
    points.push_back(std::move(point));
  }
  return points;
}

void print_candidates(const MeasuredLight& light, double goal) {
  const std::optional<Choice> best = cheapest({&light, 1}, goal);
  fmt::print("  {:32} {:>10} {:>10} {:>9} {:>9} {:>9}\n", "setting", "shadow ms", "build ms", "rmse", "max", "% above");
  for (std::size_t k = 0; k < light.candidates.size(); ++k) {
    const Candidate& c = light.candidates[k];
    if (!c.reason.empty()) {
      fmt::print("  {:32} {}\n", c.name, c.reason);
      continue;
    }
    fmt::print("  {:32} {:10.1f} {:10.1f} {:9.5f} {:9.5f} {:9.3f} {}\n", c.name, median(c.shadow_ms),
               median(c.build_ms), c.rmse, c.largest, 100.0 * c.share_above,
               best && best->candidate == k ? "<- cheapest" : (keeps_goal(c, goal) ? "keeps it" : ""));
  }
}

MeasuredLight measure_light(const Pipeline& pipeline, const Light& light, const RecommendOptions& o) {
  Subject s{&pipeline, &light, {}, {}};
  const ShadowConfig config = shadow_config(o);
  s.receivers = receivers_of_whole_light(pipeline.gbuffer, light, config, pipeline.mesh.frame);
  std::vector<std::uint32_t> all(s.receivers.size());
  for (std::uint32_t i = 0; i < all.size(); ++i) all[i] = i;
  s.truth = converged_visibility(pipeline.mesh, s.receivers, light, config, o.goal, all);
  return {light.name, s.receivers.size(), measure(s, o)};
}

/// What to type, with all options that decided what was measured; null if no setting keeps the goal.
ordered_json recommendation_json(const RecommendOptions& o, std::span<const MeasuredLight> lights) {
  const std::optional<Choice> best = cheapest(lights, o.goal);
  if (!best) return {};
  const std::string& setting = lights.front().candidates[best->candidate].arguments;
  return {{"setting", setting}, {"shadow_ms", best->ms}, {"command", picture_command(o) + " " + setting}};
}

ordered_json report_json(const RecommendOptions& o, std::span<const MeasuredLight> measured,
                         const ordered_json& recommended) {
  ordered_json lights = ordered_json::array();
  for (const MeasuredLight& light : measured) {
    lights.push_back({{"name", light.name},
                      {"receivers", light.receivers},
                      {"reference_samples", kConvergedSamples},
                      {"points", candidates_json(light.candidates, o.goal)}});
  }
  return {{"schema", "halfshade.recommend/1"},
          {"version", HALFSHADE_VERSION},
          {"command", o.command_line},
          {"machine", machine_json()},
          {"scene", o.scene},
          {"size", o.size},
          {"max_error", o.goal},
          {"recommended", recommended},
          {"lights", lights}};
}

int run(RecommendOptions o) {
  o.goal = parse_max_error(o.max_error);
  if (o.repeat < 1 || o.repeat > 100) usage_error(fmt::format("--repeat {} is not in 1..100", o.repeat));
  check_max_error_options(o);
  Pipeline pipeline;
  open_pipeline(o, 0.0, pipeline);
  std::vector<MeasuredLight> lights;
  for (const Light& light : pipeline.source.view.lights) {
    lights.push_back(measure_light(pipeline, light, o));
    if (o.json) continue;
    fmt::print("light {}: {} receivers of a picture of {}, against {} samples; goal {:.6f}\n", light.name,
               lights.back().receivers, o.size, kConvergedSamples, o.goal);
    print_candidates(lights.back(), o.goal);
  }
  const ordered_json recommended = recommendation_json(o, lights);
  if (o.json) {
    std::fputs((report_json(o, lights, recommended).dump(2) + "\n").c_str(), stdout);
  } else {
    fmt::print("recommended: {}\n", recommended.is_null() ? "none of these keeps the goal on every receiver"
                                                          : recommended.at("command").get<std::string>());
  }
  return recommended.is_null() ? kDifferent : kOk;
}

}  // namespace

void add_recommend(CLI::App& app, const std::string& command_line, int& exit_code) {
  CLI::App* verb = app.add_subcommand("recommend", "Name the cheapest setting that keeps an error of visibility");
  auto o = std::make_shared<RecommendOptions>();
  o->size = "128x128";  // measured on few pixels, to be quick
  add_pipeline_options(*verb, *o);
  verb->add_option("--max-error", o->max_error, "Largest error of visibility: 1/256, 0.004 or 0.4%")
      ->capture_default_str();
  verb->add_option("--repeat", o->repeat, "Runs of each setting; medians count")->capture_default_str();
  verb->add_option("--time-limit", o->time_limit, "Seconds for one setting")->capture_default_str();
  verb->add_flag("--json", o->json, "All points as JSON on standard output");
  verb->callback([o, verb, &exit_code, command_line] {
    o->command_line = command_line;
    o->arguments = deciding_arguments(*verb);
    run_in_arena(o->threads, [&] { exit_code = run(*o); });
  });
}

}  // namespace halfshade
