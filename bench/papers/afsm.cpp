// Sintorn, Eisemann, Assarsson 2008, "Sample Based Visibility for Soft Shadows using Alias-free Shadow Maps": figures
// 9, 11, 12, 13, the gains of section 4.3, the table of section 4.2 and the outlines of section 4.1. Frame rates become
// ratios; the solve's time stands for the frame's.
#include <fmt/format.h>

#include <filesystem>
#include <optional>

#include "bench/bench_case.h"
#include "bench/harness.h"
#include "examples/halfshade/scene_source.h"
#include "papers.h"
#include "shadows/method_options.h"
#include "shadows/solver.h"

namespace halfshade::bench {
namespace {

ShadowConfig config_for(ShadowMethod method, std::uint32_t samples) {
  ShadowConfig config;
  config.method = method;
  config.light_sample_count = samples;
  return config;
}

/// `options` are "afsm.NAME=VALUE".
ShadowConfig afsm(std::uint32_t samples, const std::vector<std::string>& options = {}) {
  ShadowConfig config = config_for(ShadowMethod::kAliasFreeShadowMap, samples);
  for (const std::string& option : options) set_method_option(config, option);
  return config;
}

/// A scene under its first light, scaled; lives as long as the cases made from it.
struct Subject {
  std::string title;
  SceneSource source;

  Case at(const PaperOptions& o, std::uint32_t samples, double light_scale = 1.0) const {
    View view = source.view;
    scale_light(view.lights[0], light_scale);
    return make_case(title, source.scene, view, 0, o.size, afsm(samples));
  }
};

Subject builtin(const std::string& name) { return {name, load_scene("builtin:" + name, "", {})}; }

std::optional<Subject> shared(const PaperOptions& o, const std::string& name) {
  const std::filesystem::path path = std::filesystem::path(o.shared_scenes) / name / (name + ".obj");
  if (o.shared_scenes.empty() || !std::filesystem::exists(path)) return std::nullopt;
  return Subject{name, load_scene(path.string(), "", {})};
}

struct Result {
  VisibilityMasks masks;
  ShadowStats stats;
  double ms = 0.0;
  double detail(const std::string& name) const { return stats.detail(name).value(); }
};

struct Run {
  const Case* c;
  ShadowConfig config;
};

/// Interleaved; medians.
std::vector<Result> solve_all(const std::vector<Run>& runs, int repeat) {
  std::vector<Result> results(runs.size());
  std::vector<std::function<void()>> contenders;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    contenders.push_back([&, i] {
      const Case& c = *runs[i].c;
      solve_masks(c.mesh, c.receivers, c.light, c.samples, runs[i].config, results[i].masks, results[i].stats);
    });
  }
  const std::vector<Timing> timings = measure_interleaved(contenders, repeat);
  for (std::size_t i = 0; i < runs.size(); ++i) results[i].ms = timings[i].median();
  return results;
}

std::string times_relative_to(const std::vector<Result>& results, std::size_t base) {
  std::string text;
  for (const Result& r : results) text += fmt::format("{:.2f} ", r.ms / results[base].ms);
  return text;
}

/// Figure 13: one shadow map per sample is about ten times as slow; from 128 to 1024 samples the cost doubles.
void samples_rows(const Subject& subject, const PaperOptions& o) {
  std::vector<Case> cases;
  for (const std::uint32_t n : {128u, 256u, 512u, 1024u}) cases.push_back(subject.at(o, n));
  std::vector<Run> runs;
  for (const Case& c : cases) {
    runs.push_back({&c, afsm(c.samples.count)});
    runs.push_back({&c, config_for(ShadowMethod::kShadowMapPerSample, c.samples.count)});
  }
  const std::vector<Result> results = solve_all(runs, o.repeat);
  std::vector<Result> ours;
  std::string ratio, wrong;
  for (std::size_t i = 0; i < results.size(); i += 2) {
    const Result &exact = results[i], &maps = results[i + 1];
    ours.push_back(exact);
    ratio += fmt::format("{:.2f} ", maps.ms / exact.ms);
    wrong += fmt::format("{:.2f} % ", 100.0 * static_cast<double>(count_differences(exact.masks, maps.masks)) /
                                          static_cast<double>(exact.masks.receiver_count * exact.masks.sample_count));
  }
  print_claim("fig. 13: time of one shadow map per sample / ours, 128, 256, 512, 1024 samples: " + subject.title,
              "about 10", fmt::format("{}(bits the maps get wrong: {})", ratio, wrong));
  print_claim("fig. 13: time at 128, 256, 512, 1024 samples: " + subject.title, "1 to about 2",
              times_relative_to(ours, 0));
}

/// Figure 12: linear in the light's radius, 15, 12, 7.1 frames per second at 4, 8, 16.
void radius_row(const Subject& subject, const PaperOptions& o) {
  std::vector<Case> cases;
  for (const double scale : {0.5, 1.0, 2.0}) cases.push_back(subject.at(o, 256, scale));
  std::vector<Run> runs;
  for (const Case& c : cases) runs.push_back({&c, afsm(256)});
  print_claim("fig. 12: time at half, full, double light size: " + subject.title, "1.00 1.25 2.11",
              times_relative_to(solve_all(runs, o.repeat), 0));
}

/// Figure 11: 21, 8, 4 frames per second.
void triangles_row(const PaperOptions& o) {
  std::vector<Subject> subjects;
  for (const char* size : {"1200", "12000", "24000"}) subjects.push_back(builtin(std::string("torus_knot:") + size));
  std::vector<Case> cases;
  for (const Subject& subject : subjects) cases.push_back(subject.at(o, 128));
  std::vector<Run> runs;
  for (const Case& c : cases) runs.push_back({&c, afsm(128)});
  print_claim("fig. 11: time at 1,200, 12,000, 24,000 triangles, 128 samples: torus_knot", "1.00 2.63 5.25",
              times_relative_to(solve_all(runs, o.repeat), 0));
}

/// Figure 9: lists of a 512x512 map; 128, 256, 384, 512 pixels square.
void list_rows(const Subject& subject, const PaperOptions& options) {
  struct Row {
    const char* size;
    const char* paper;
  };
  for (const Row& row :
       {Row{"128x128", "1.3, 13"}, {"256x256", "1.7, 40"}, {"384x384", "2.4, 88"}, {"512x512", "3.3, 161"}}) {
    PaperOptions o = options;
    o.size = row.size;
    const Case c = subject.at(o, 16);
    for (const char* fit : {"on", "off"}) {
      const Result r = solve_all({{&c, afsm(16, {"afsm.grid=512", std::string("afsm.fit=") + fit})}}, 1).front();
      print_claim(
          fmt::format("fig. 9: mean and longest list, 512x512 map, {} picture, fit {}: {}", row.size, fit,
                      subject.title),
          row.paper,
          fmt::format("{:.1f}, {}; {:.0f} % of the lists occupied",
                      static_cast<double>(r.stats.receivers) / static_cast<double>(r.stats.lists_occupied),
                      r.stats.lists_longest, 100.0 * static_cast<double>(r.stats.lists_occupied) / (512.0 * 512.0)));
    }
    if (options.quick) break;
  }
}

/// One option switched off at a time, against all on; then all of section 4.3 off.
void option_rows(const Subject& subject, const PaperOptions& o, double light_scale) {
  struct Row {
    const char* what;
    const char* paper;
    std::vector<std::string> off;
  };
  const std::vector<Row> rows = {
      {"fit of the grid to the receivers", "about 30 % faster", {"afsm.fit=off"}},
      {"far plane at the farthest receiver", "weaker", {"afsm.far-fit=off"}},
      {"cells without receivers beyond the blocker", "important", {"afsm.skip-empty=off"}},
      {"penumbra by silhouette edges", "important", {"afsm.silhouettes=off"}},
      {"cut by the supporting plane", "with the next up to 50 % faster", {"afsm.plane-cut=off"}},
      {"culling against the whole light", "with the last up to 50 % faster", {"afsm.cull-back-facing=off"}},
      {"back faces alone (3.3), and all that needs its certificate", "-", {"afsm.back-faces=off"}},
      {"all of section 4.3",
       "-",
       {"afsm.fit=off", "afsm.far-fit=off", "afsm.skip-empty=off", "afsm.silhouettes=off", "afsm.plane-cut=off",
        "afsm.cull-back-facing=off"}}};
  const Case c = subject.at(o, 256, light_scale);
  std::vector<Run> runs = {{&c, afsm(256)}};
  for (const Row& row : rows) runs.push_back({&c, afsm(256, row.off)});
  const std::vector<Result> results = solve_all(runs, o.repeat);
  const Result& on = results[0];
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Result& off = results[i + 1];
    print_claim(fmt::format("4.3 {}, light x {}: {}", rows[i].what, light_scale, subject.title), rows[i].paper,
                fmt::format("{:+.0f} % time without; pairs x {:.2f}; differing bits {}", 100.0 * (off.ms / on.ms - 1.0),
                            static_cast<double>(off.stats.pairs_tested) / static_cast<double>(on.stats.pairs_tested),
                            count_differences(on.masks, off.masks)));
  }
}

/// Section 4.1: outlines of the influence region.
void region_rows(const Subject& subject, const PaperOptions& o) {
  const Case c = subject.at(o, 256);
  std::vector<Run> runs;
  const std::vector<std::string> outlines = {"hull", "hexagon", "octagon", "dodecagon", "aabb", "quad"};
  for (const std::string& outline : outlines) runs.push_back({&c, afsm(256, {"afsm.region=" + outline})});
  const std::vector<Result> results = solve_all(runs, o.repeat);
  for (std::size_t i = 0; i < runs.size(); ++i) {
    const Result& r = results[i];
    print_claim(
        fmt::format("4.1 region {}: cells, pairs, time relative to hull: {}", outlines[i], subject.title),
        outlines[i] == "hexagon" ? "chosen" : "-",
        fmt::format("{:.2f}, {:.2f}, {:.2f}; differing bits {}",
                    r.detail("afsm.region_cells") / results[0].detail("afsm.region_cells"),
                    static_cast<double>(r.stats.pairs_tested) / static_cast<double>(results[0].stats.pairs_tested),
                    r.ms / results[0].ms, count_differences(r.masks, results[0].masks)));
  }
}

/// Section 4.2: wrong bits and time of the table against the exact plane tests.
void table_rows(const Subject& subject, const PaperOptions& o, LightShape shape) {
  Subject lit = subject;
  Light& light = lit.source.view.lights[0];
  const double radius = 0.5 * light_diagonal(light);
  if (shape == LightShape::kSphere) light.shape = shape, light.radius = radius;
  const Case c = lit.at(o, 128);
  std::vector<Run> runs = {{&c, afsm(128)}};
  const std::vector<int> sizes = {16, 32, 64, 128, 256};
  for (const int size : sizes) {
    runs.push_back({&c, afsm(128, {"afsm.table=" + std::to_string(size)})});
    runs.back().config.method = ShadowMethod::kAliasFreeLookupTable;
  }
  const std::vector<Result> results = solve_all(runs, o.repeat);
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    const Result& r = results[i + 1];
    const std::uint64_t wrong = count_differences(results[0].masks, r.masks);
    const double bits = static_cast<double>(r.masks.receiver_count) * r.masks.sample_count;
    print_claim(
        fmt::format("4.2 table of {} steps, 128 samples, {} light: wrong bits, time without and with building it"
                    " / exact plane tests: {}",
                    sizes[i], shape == LightShape::kSphere ? "spherical" : "flat", subject.title),
        sizes[i] == 128 ? "the size used" : "-",
        fmt::format("{:.4f} %; {:.2f}, {:.2f}; {:.1f} MiB", 100.0 * static_cast<double>(wrong) / bits,
                    (r.ms - r.detail("afsm-lut.table_ms")) / results[0].ms, r.ms / results[0].ms,
                    r.detail("afsm-lut.table_bytes") / (1 << 20)));
  }
}

}  // namespace

void run_afsm(const PaperOptions& options) {
  PaperOptions o = options;
  if (o.quick) o.size = "128x128", o.repeat = 1;
  print_claim("claim", "paper", "ours");
  print_claim("---", "---", "---");
  std::vector<Subject> subjects;
  subjects.push_back(builtin("columns"));
  subjects.push_back(builtin("torus_knot:6000"));
  if (auto sponza = shared(o, "sponza_dabrovic")) subjects.push_back(std::move(*sponza));
  triangles_row(o);
  for (const Subject& subject : subjects) {
    samples_rows(subject, o);
    radius_row(subject, o);
    list_rows(subject, o);
    for (const double scale : {1.0, 0.2}) option_rows(subject, o, scale);
    region_rows(subject, o);
    for (const LightShape shape : {LightShape::kRectangle, LightShape::kSphere}) table_rows(subject, o, shape);
  }
}

}  // namespace halfshade::bench
