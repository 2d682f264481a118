// How long do exact masks take against tracing the same shadow rays with Embree: same receivers, same light samples,
// one process, interleaved? README.md says what each number means.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <filesystem>
#include <memory>

#include "bench_case.h"
#include "examples/halfshade/scene_source.h"
#include "harness.h"
#include "rasterizer/core/stopwatch.h"
#include "rasterizer/io/atomic_file.h"
#include "shadows/exact_engine.h"
#include "shadows/raytrace/embree_rays.h"
#include "shadows/solver.h"

namespace halfshade::bench {
namespace {

using nlohmann::ordered_json;

struct Options {
  std::vector<std::string> scenes, methods = {"exact", "afsm"};
  std::vector<double> light_scales;
  std::string size = "512x512", pattern = "rows", shared_scenes, json, modes = "best";
  std::uint32_t light_samples = 256, sets = 1, seed = 0;
  int threads = 0, repeat = 5;
  double verify_percent = 1.0, verify_seconds = 10.0;
};

struct MethodResult {
  std::string name;
  ShadowConfig config;
  VisibilityMasks masks;
  ShadowStats stats;
  OracleCheck check;
  Timing timing;
  std::unique_ptr<KeptExact> kept = std::make_unique<KeptExact>();  // what a static scene keeps, as Embree its tree
  double build_ms = 0.0;                                            // what that took; the times leave it out
};

struct RivalResult {
  EmbreeMode mode;
  VisibilityMasks masks;
  double build_ms = 0.0, quick_ms = 0.0;
  std::uint64_t wrong_bits = 0;
  Timing timing;
};

struct Row {
  double percent = 0.0, ratio = 0.0, ratio_robust = 0.0, ratio_with_build = 0.0;
  std::string method;
};

void solve(const Case& c, MethodResult& method) {
  solve_masks(c.mesh, c.receivers, c.light, c.samples, method.config, method.masks, method.stats, method.kept.get());
}

ShadowConfig config_of(const Options& o) {
  ShadowConfig config;
  config.light_sample_count = o.light_samples;
  config.pattern = sample_pattern_from_name(o.pattern);
  config.sample_sets = o.sets;
  config.seed = o.seed;
  return config;
}

std::vector<MethodResult> solve_all(const Case& c, const Options& o) {
  std::vector<MethodResult> methods;
  for (const std::string& name : o.methods) {
    MethodResult& m = methods.emplace_back();
    m.name = name;
    m.config = config_of(o);
    m.config.method = shadow_method_from_name(name);
    solve(c, m);
    if (m.config.method == ShadowMethod::kExact) m.build_ms = m.stats.build_ms;
    m.check = check_with_oracle(c, m.masks, o.verify_percent, o.verify_seconds);
  }
  return methods;
}

void trace(const Case& c, const EmbreeRays& embree, RivalResult& rival) {
  rival.masks.reset(c.receivers.size(), c.samples.count);
  embree.trace(rival.mode, c.order, rival.masks);
}

/// Every 16th run of 16 receivers.
std::vector<std::uint32_t> every_16th(const std::vector<std::uint32_t>& order) {
  std::vector<std::uint32_t> some;
  for (std::size_t i = 0; i < order.size(); ++i) {
    if (i / 16 % 16 == 8) some.push_back(order[i]);
  }
  return some;
}

/// One quick round over all modes; the best three go on, and the best robust one if none of them is.
std::vector<RivalResult> choose_rivals(const Case& c, EmbreeRays& embree, const Options& o) {
  std::vector<RivalResult> rivals;
  const std::vector<std::uint32_t> some = every_16th(c.order);
  VisibilityMasks masks;
  for (const EmbreeMode& mode : embree_modes(c.samples.count)) {
    RivalResult& rival = rivals.emplace_back();
    rival.mode = mode;
    rival.build_ms = embree.build_ms(mode);
    masks.reset(c.receivers.size(), c.samples.count);
    Stopwatch watch;
    embree.trace(mode, some, masks);
    rival.quick_ms = watch.lap();
  }
  if (o.modes == "all") return rivals;
  std::stable_sort(rivals.begin(), rivals.end(), [](const auto& a, const auto& b) { return a.quick_ms < b.quick_ms; });
  const auto robust = std::find_if(rivals.begin(), rivals.end(), [](const auto& r) { return r.mode.robust; });
  if (robust != rivals.end() && robust - rivals.begin() > 3) std::rotate(rivals.begin() + 3, robust, robust + 1);
  const bool one_is_robust = robust != rivals.end() && robust - rivals.begin() < 3;
  rivals.resize(std::min<std::size_t>(rivals.size(), one_is_robust ? 3 : 4));
  return rivals;
}

void measure(const Case& c, const EmbreeRays& embree, std::vector<MethodResult>& methods,
             std::vector<RivalResult>& rivals, int repeat) {
  std::vector<std::function<void()>> contenders;
  for (MethodResult& m : methods) contenders.push_back([&] { solve(c, m); });
  for (RivalResult& r : rivals) contenders.push_back([&] { trace(c, embree, r); });
  const std::vector<Timing> timings = measure_interleaved(contenders, repeat);
  for (std::size_t i = 0; i < methods.size(); ++i) methods[i].timing = timings[i];
  for (std::size_t i = 0; i < rivals.size(); ++i) rivals[i].timing = timings[methods.size() + i];
}

const RivalResult* best_of(const std::vector<RivalResult>& rivals, bool robust_only, bool with_build) {
  const RivalResult* best = nullptr;
  const auto cost = [with_build](const RivalResult& r) { return r.timing.median() + (with_build ? r.build_ms : 0.0); };
  for (const RivalResult& r : rivals) {
    if (robust_only && !r.mode.robust) continue;
    if (best == nullptr || cost(r) < cost(*best)) best = &r;
  }
  return best;
}

ordered_json case_json(const Case& c, const std::vector<MethodResult>& methods,
                       const std::vector<RivalResult>& rivals) {
  ordered_json json = {{"scene", c.scene},
                       {"scene_hash", scene_hash(*c.mesh.scene)},
                       {"triangles", c.mesh.triangles.size()},
                       {"light", c.light_name},
                       {"light_percent", c.light_percent},
                       {"light_samples", c.samples.count},
                       {"receivers", c.receivers.size()}};
  for (const MethodResult& m : methods) {
    ordered_json entry = {{"name", m.name}, {"build_ms", m.build_ms}, {"mask_hash", m.masks.hash()}};
    entry["shadow"] = timing_json(m.timing);
    entry["stages_of_last_run"] = {
        {"index_ms", m.stats.index_ms}, {"cull_ms", m.stats.cull_ms}, {"test_ms", m.stats.test_ms}};
    entry["oracle"] = {{"receivers", m.check.receivers}, {"wrong_bits", m.check.wrong_bits}};
    json["methods"].push_back(entry);
  }
  json["embree"] = ordered_json::array();
  for (const RivalResult& r : rivals) {
    ordered_json entry = {
        {"mode", r.mode.name()}, {"build_ms", r.build_ms}, {"quick_ms", r.quick_ms}, {"wrong_bits", r.wrong_bits}};
    entry["trace"] = timing_json(r.timing);
    json["embree"].push_back(entry);
  }
  return json;
}

void print_header() {
  fmt::print("{:<22} {:>6} {:>8} {:>6}  {:>9} {:<17} {:>9} {:<17} {:<32} {:>6} {:>7} {:>7} {:>7}  {:>12} {}\n", "scene",
             "light%", "receiv.", "method", "shadow_ms", "(min..max)", "embree_ms", "(min..max)", "embree mode",
             "ratio", "robust", "build", "+build", "wrong embree", "wrong ours");
}

std::string spread(const Timing& t) { return fmt::format("({:.0f}..{:.0f})", t.min(), t.max()); }

/// Everything after the scene: masks first, times afterwards.
std::vector<Row> run_case(const Case& c, const Options& o, int threads, ordered_json& cases) {
  std::vector<MethodResult> methods = solve_all(c, o);
  EmbreeRays embree(c.mesh, c.receivers, c.samples, threads);
  std::vector<RivalResult> rivals = choose_rivals(c, embree, o);
  for (RivalResult& r : rivals) {
    trace(c, embree, r);
    r.wrong_bits = count_differences(r.masks, methods.front().masks);
  }
  measure(c, embree, methods, rivals, o.repeat);
  const RivalResult *best = best_of(rivals, false, false), *robust = best_of(rivals, true, false),
                    *total = best_of(rivals, false, true);
  std::vector<Row> rows;
  for (const MethodResult& m : methods) {
    const double own = m.timing.median();
    const auto name = std::filesystem::path(c.scene).filename().string();
    fmt::print("{:<22} {:>6.1f} {:>8} {:>6}  {:>9.1f} {:<17}", name, c.light_percent, c.receivers.size(), m.name, own,
               spread(m.timing));
    if (best != nullptr) {
      rows.push_back({c.light_percent, best->timing.median() / own, robust->timing.median() / own,
                      (total->timing.median() + total->build_ms) / (own + m.build_ms), m.name});
      fmt::print(" {:>9.1f} {:<17} {:<32} {:>6.2f} {:>7.2f} {:>7.0f} {:>7.2f}  {:>12}", best->timing.median(),
                 spread(best->timing), best->mode.name(), rows.back().ratio, rows.back().ratio_robust, best->build_ms,
                 rows.back().ratio_with_build, best->wrong_bits);
    }
    fmt::print(" {} in {} receivers{}\n", m.check.wrong_bits, m.check.receivers,
               count_differences(m.masks, methods.front().masks) > 0 ? "  DIFFERS FROM THE FIRST METHOD" : "");
  }
  std::fflush(stdout);
  cases.push_back(case_json(c, methods, rivals));
  return rows;
}

void run_scene(const std::string& name, const Options& o, int threads, std::vector<Row>& rows, ordered_json& cases) {
  const SceneSource source = load_scene(name, "", ObjLoadOptions());
  const std::vector<double> scales = o.light_scales.empty() ? std::vector<double>{0.0} : o.light_scales;
  for (std::size_t i = 0; i < source.view.lights.size(); ++i) {
    for (const double percent : scales) {
      View view = source.view;
      const double diagonal = light_diagonal(view.lights[i]);
      if (percent > 0.0 && diagonal == 0.0) {
        fmt::print(stderr, "halfshade_bench: {}: light '{}' has no size to scale\n", name, view.lights[i].name);
        continue;
      }
      if (percent > 0.0) scale_light(view.lights[i], percent * 0.01 * box_diagonal(source.scene) / diagonal);
      const Case c = make_case(name, source.scene, view, i, o.size, config_of(o));
      if (c.receivers.size() == 0) {
        fmt::print(stderr, "halfshade_bench: {}: no receiver faces light '{}'\n", name, c.light_name);
        continue;
      }
      const std::vector<Row> more = run_case(c, o, threads, cases);
      rows.insert(rows.end(), more.begin(), more.end());
    }
  }
}

void print_means(const Options& o, const std::vector<Row>& rows) {
  for (const std::string& method : o.methods) {
    const std::vector<double> scales = o.light_scales.empty() ? std::vector<double>{0.0} : o.light_scales;
    for (const double percent : scales) {
      std::vector<double> plain, robust, with_build;
      for (const Row& row : rows) {
        if (row.method != method || (percent > 0.0 && std::fabs(row.percent - percent) > 1e-6 * percent)) continue;
        plain.push_back(row.ratio), robust.push_back(row.ratio_robust), with_build.push_back(row.ratio_with_build);
      }
      if (plain.empty()) continue;
      fmt::print("geometric mean of {} ratios, {}, light {}: {:.2f} (robust {:.2f}, with build {:.2f})\n", plain.size(),
                 method, percent > 0.0 ? fmt::format("{:g} %", percent) : "of the view", geometric_mean(plain),
                 geometric_mean(robust), geometric_mean(with_build));
    }
  }
}

std::vector<std::string> default_scenes(const Options& o) {
  std::vector<std::string> scenes = {"builtin:demo",       "builtin:columns", "builtin:bars",     "builtin:fence",
                                     "builtin:fence_mesh", "builtin:grass",   "builtin:hairball", "builtin:room",
                                     "builtin:torus_knot", "builtin:field"};
  if (!o.shared_scenes.empty()) {
    std::vector<std::string> found;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(o.shared_scenes)) {
      if (entry.path().extension() == ".obj") found.push_back(entry.path().string());
    }
    std::sort(found.begin(), found.end());
    scenes.insert(scenes.end(), found.begin(), found.end());
  }
  return scenes;
}

void run(Options o, int threads) {
  if (o.scenes.empty()) o.scenes = default_scenes(o);
  ordered_json json = {{"schema", "halfshade.bench/1"}, {"question", "exact masks against Embree's shadow rays"}};
  json["machine"] = run_conditions(threads);
  json["parameters"] = {{"size", o.size},       {"light_samples", o.light_samples},
                        {"pattern", o.pattern}, {"sets", o.sets},
                        {"seed", o.seed},       {"repeat", o.repeat},
                        {"modes", o.modes}};
  json["cases"] = ordered_json::array();
  fmt::print("{}, {} threads, {}, {}, sources {}\n", json["machine"]["cpu"].get<std::string>(), threads,
             json["machine"]["simd_target"].get<std::string>(), json["machine"]["compiler"].get<std::string>(),
             json["machine"]["commit"].get<std::string>());
  fmt::print("{} pixels, {} light samples ({}), median of {}\n", o.size, o.light_samples, o.pattern, o.repeat);
  if (!embree_available()) fmt::print("Embree 3 was not found when this was built: no rival\n");
  print_header();
  std::vector<Row> rows;
  for (const std::string& scene : o.scenes) run_scene(scene, o, threads, rows, json["cases"]);
  print_means(o, rows);
  if (!o.json.empty()) write_file_atomically(o.json, json.dump(2) + "\n");
}

}  // namespace
}  // namespace halfshade::bench

int main(int argc, char** argv) {
  using halfshade::bench::Options;
  CLI::App app("Exact shadow masks against Embree's occlusion rays: same receivers, same samples, one process.",
               "halfshade_bench");
  Options o;
  app.add_option("scenes", o.scenes, "OBJ files or builtin:NAME[:SIZE] (default: a selection of built-in ones)");
  app.add_option("--shared-scenes", o.shared_scenes, "With the default scenes, also all .obj files in this directory")
      ->check(CLI::ExistingDirectory);
  app.add_option("--methods", o.methods, "Shadow methods, separated by commas")->delimiter(',')->capture_default_str();
  app.add_option("--size", o.size, "Picture in pixels, WIDTHxHEIGHT")->capture_default_str();
  app.add_option("--light-samples", o.light_samples, "Samples per light, 1..4096")->capture_default_str();
  app.add_option("--pattern", o.pattern, "Sample pattern, as of halfshade render")->capture_default_str();
  app.add_option("--sets", o.sets, "Different sample sets, chosen per pixel, 1..256")->capture_default_str();
  app.add_option("--seed", o.seed, "Seed of patterns and sets")->capture_default_str();
  app.add_option("--light-scale", o.light_scales,
                 "Light diagonals in percent of the scene box's (default: the view's light)")
      ->delimiter(',')
      ->check(CLI::PositiveNumber);
  app.add_option("--threads", o.threads, "Threads (0 = all cores)")->check(CLI::Range(0, 1024))->capture_default_str();
  app.add_option("--repeat", o.repeat, "Interleaved repetitions")->check(CLI::Range(1, 1000))->capture_default_str();
  app.add_option("--modes", o.modes, "Embree modes to measure in full: the best three of a quick round, or all")
      ->check(CLI::IsMember({"best", "all"}))
      ->capture_default_str();
  app.add_option("--verify", o.verify_percent, "Percentage of receivers to check with the oracle")
      ->check(CLI::Range(0.0, 100.0))
      ->capture_default_str();
  app.add_option("--verify-seconds", o.verify_seconds, "Time limit of that check, per scene and method")
      ->capture_default_str();
  app.add_option("--json", o.json, "Write all samples to this file");
  CLI11_PARSE(app, argc, argv);
  return halfshade::bench::run_on_threads("halfshade_bench", o.threads,
                                          [&](int count) { halfshade::bench::run(o, count); });
}
