// Wang, Wang, Shi, Popescu 2014, "GEARS": tables 1 to 8 on scenes of the same kind. Frame rates become ratios; the
// solve's time stands for the frame's.
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <optional>

#include "bench/bench_case.h"
#include "bench/harness.h"
#include "examples/halfshade/scene_source.h"
#include "papers.h"
#include "rasterizer/core/stopwatch.h"
#include "shadows/raytrace/embree_rays.h"
#include "shadows/solver.h"

namespace halfshade::bench {
namespace {

/// A scene of the paper with its rows of the tables, and the scene that stands for it here.
struct Subject {
  const char* name;
  const char* scene;                // a built-in scene, or a folder of the shared scenes
  std::array<double, 3> by_size;    // table 1: frames per second at 256x256, 512x512, 1024x1024
  std::array<double, 4> by_mask;    // table 2: 4x4, 8x8, 16x16, 32x32 samples
  std::array<double, 5> by_light;   // table 3: light diagonal 1, 2, 3, 4, 5
  std::array<double, 4> by_grid;    // table 4: grid 32, 64, 128, 256
  std::array<double, 4> lists;      // table 5: triangles per cell, most and average; pixel samples, most and average
  double necessary, refined;        // table 6, percent; after the 3-D refinement
  double box_over_hull;             // section 5.3: samples in the box beyond those in the hull, percent
  double speedup, speedup_dynamic;  // table 7
  double frame_rays, mask_samples;  // table 8: rays of the ray tracer in the time of that many samples
};

constexpr Subject kSubjects[] = {
    {"Cow Matrix",
     "builtin:field",
     {33.5, 24.0, 12.5},
     {27.6, 26.2, 24, 20.1},
     {27.2, 24, 21.4, 19.1, 17.2},
     {12.4, 19.7, 24, 21.1},
     {539, 70, 278, 16},
     11,
     28,
     1.75,
     14,
     18,
     48,
     1024},
    {"Chess",
     "builtin:columns",
     {29.1, 19.7, 10.3},
     {31.1, 23.7, 19.7, 16.2},
     {24.3, 19.7, 15.3, 12.4, 7.8},
     {15.3, 17.2, 19.7, 18.2},
     {1333, 54, 103, 11},
     14,
     39,
     1.13,
     11,
     14,
     50,
     1024},
    {"Church",
     "sponza_dabrovic",
     {32.2, 20.1, 12.0},
     {34.5, 26.3, 20.1, 15.7},
     {31.2, 20.1, 15.9, 10.1, 7.6},
     {15.2, 19.1, 20.1, 18.6},
     {2121, 54, 146, 9},
     11,
     38,
     1.5,
     10,
     12,
     90,
     1024},
    {"Dragon",
     "dragon10k",
     {51.6, 24.3, 13.5},
     {36.9, 32.7, 24.3, 16.6},
     {35.7, 24.3, 18.4, 12.8, 9.3},
     {17.5, 22.1, 24.3, 21.4},
     {2844, 60, 283, 16},
     21,
     42,
     0.31,
     10,
     12,
     72,
     1024},
    {"Bird Nest",
     "builtin:hairball",
     {34.9, 15.7, 4.6},
     {23.4, 18.9, 15.7, 8.9},
     {20.1, 15.7, 9.8, 7.5, 5.2},
     {8.7, 12.2, 15.7, 13.1},
     {501, 25, 243, 16},
     27,
     39,
     2.2,
     31,
     34,
     12,
     256},
    {"Spider",
     "builtin:torus_knot",
     {60.8, 32.7, 14.4},
     {45.8, 40.3, 32.7, 18.6},
     {48.7, 32.7, 24.3, 20, 16.8},
     {23.8, 28.3, 32.7, 29.6},
     {506, 9, 244, 16},
     18,
     28,
     0.96,
     12,
     18,
     18,
     256},
};

ShadowConfig config_for(std::uint32_t samples) {
  ShadowConfig config;
  config.method = ShadowMethod::kGears;
  config.light_sample_count = samples;
  config.pattern = SamplePattern::kUniform;
  return config;
}

/// The paper's algorithm as it is: none of our additions.
ShadowConfig as_published(std::uint32_t samples, std::uint32_t grid) {
  ShadowConfig config = config_for(samples);
  config.gears.grid = grid;
  config.gears.subdivide = config.gears.bounds = config.gears.coarse = config.back_face_casters = false;
  return config;
}

struct Loaded {
  const Subject& subject;
  SceneSource source;
  std::string title;
};

std::optional<Loaded> load(const Subject& subject, const PaperOptions& o) {
  std::string path = subject.scene;
  if (!path.starts_with("builtin:")) {
    if (o.shared_scenes.empty()) return std::nullopt;
    path = (std::filesystem::path(o.shared_scenes) / path / (path + ".obj")).string();
    if (!std::filesystem::exists(path)) return std::nullopt;
  }
  Loaded loaded{subject, load_scene(path, "", {}), ""};
  loaded.title =
      fmt::format("{} ({}, {} triangles)", subject.name, subject.scene, loaded.source.scene.triangles.size());
  return loaded;
}

Case case_of(const Loaded& loaded, const std::string& size, std::uint32_t samples, double light_scale = 1.0) {
  View view = loaded.source.view;
  scale_light(view.lights[0], light_scale);
  return make_case(loaded.subject.scene, loaded.source.scene, view, 0, size, config_for(samples));
}

struct Run {
  const Case* c;
  ShadowConfig config;
};

std::vector<double> medians(const std::vector<Run>& runs, int repeat) {
  std::vector<std::function<void()>> contenders;
  for (const Run& run : runs) {
    contenders.push_back([run] {
      VisibilityMasks masks;
      ShadowStats stats;
      solve_masks(run.c->mesh, run.c->receivers, run.c->light, run.c->samples, run.config, masks, stats);
    });
  }
  std::vector<double> ms;
  for (const Timing& timing : measure_interleaved(contenders, repeat)) ms.push_back(timing.median());
  return ms;
}

/// Speeds relative to number `base`, from times or from frames per second.
template <class Values>
std::string relative(const Values& values, std::size_t base, bool times) {
  std::string text;
  for (const double v : values) text += fmt::format("{:.2f} ", times ? values[base] / v : v / values[base]);
  return text;
}

std::string scaled_size(const std::string& size, double factor) {
  unsigned width = 0, height = 0;
  if (std::sscanf(size.c_str(), "%5ux%5u", &width, &height) != 2) {
    throw Error(ErrorCode::kUsage, "size '" + size + "' is not WIDTHxHEIGHT");
  }
  return fmt::format("{}x{}", std::lround(width * factor), std::lround(height * factor));
}

void table_1(const Loaded& loaded, const PaperOptions& o) {
  std::vector<Case> cases;
  for (const double factor : {0.5, 1.0, 2.0}) cases.push_back(case_of(loaded, scaled_size(o.size, factor), 256));
  std::vector<Run> runs;
  for (const Case& c : cases) runs.push_back({&c, config_for(256)});
  print_claim("T1 speed at half, full, double the picture's side: " + loaded.title,
              relative(loaded.subject.by_size, 1, false), relative(medians(runs, o.repeat), 1, true));
}

void table_2(const Loaded& loaded, const PaperOptions& o) {
  std::vector<Case> cases;
  for (const std::uint32_t side : {4u, 8u, 16u, 32u}) cases.push_back(case_of(loaded, o.size, side * side));
  std::vector<Run> runs;
  for (const Case& c : cases) runs.push_back({&c, config_for(c.samples.count)});
  print_claim("T2 speed at 4x4, 8x8, 16x16, 32x32 samples: " + loaded.title, relative(loaded.subject.by_mask, 2, false),
              relative(medians(runs, o.repeat), 2, true));
}

void table_3(const Loaded& loaded, const PaperOptions& o) {
  std::vector<Case> cases;
  for (const double scale : {0.5, 1.0, 1.5, 2.0, 2.5}) cases.push_back(case_of(loaded, o.size, 256, scale));
  std::vector<Run> runs;
  for (const Case& c : cases) runs.push_back({&c, config_for(256)});
  print_claim("T3 speed at light diagonal 1/2, 1, 3/2, 2, 5/2 of the scene's own: " + loaded.title,
              relative(loaded.subject.by_light, 1, false), relative(medians(runs, o.repeat), 1, true));
}

void table_4(const Loaded& loaded, const PaperOptions& o) {
  const Case c = case_of(loaded, o.size, 256);
  std::vector<Run> runs;
  for (const std::uint32_t grid : {32u, 64u, 128u, 256u}) {
    runs.push_back({&c, config_for(256)});
    runs.back().config.gears.grid = grid;
  }
  for (const std::uint32_t grid : {32u, 64u, 128u, 256u}) runs.push_back({&c, as_published(256, grid)});
  runs.push_back({&c, config_for(256)});  // grid 0
  std::vector<double> ms = medians(runs, o.repeat);
  const double chosen = ms.back();
  const std::vector<double> published(ms.begin() + 4, ms.begin() + 8);
  ms.resize(4);
  print_claim("T4 speed at grid 32, 64, 128, 256: " + loaded.title, relative(loaded.subject.by_grid, 2, false),
              fmt::format("{}(our own choice {:.2f}); as published {}", relative(ms, 2, true), ms[2] / chosen,
                          relative(published, 2, true)));
  print_claim("our additions (bounds, coarse, subdivide, certificates), speed-up at grid 128: " + loaded.title, "-",
              fmt::format("{:.2f}", published[2] / ms[2]));
}

ShadowStats study(const Case& c, ShadowConfig config) {
  config.gears.study = true;
  VisibilityMasks masks;
  ShadowStats stats;
  solve_masks(c.mesh, c.receivers, c.light, c.samples, config, masks, stats);
  return stats;
}

double necessary_percent(const ShadowStats& stats) {
  return 100.0 * stats.detail("gears.assignments_necessary").value() /
         std::max(1.0, stats.detail("gears.assignments").value());
}

void tables_5_and_6(const Loaded& loaded, const PaperOptions& o) {
  const Case c = case_of(loaded, o.size, 256);
  ShadowConfig config = as_published(256, 128);
  const ShadowStats plain = study(c, config), ours = study(c, config_for(256));
  config.gears.refine = true;
  const ShadowStats refined = study(c, config);
  const auto lists = [](const ShadowStats& s) {
    return fmt::format("{:.0f} {:.0f} {:.0f} {:.1f}", s.detail("gears.triangles_per_cell_max").value(),
                       s.detail("gears.triangles_per_cell_average").value(),
                       s.detail("gears.receivers_per_cell_max").value(),
                       s.detail("gears.receivers_per_cell_average").value());
  };
  const Subject& p = loaded.subject;
  print_claim("T5 triangles per cell, most and average; pixel samples, most and average: " + loaded.title,
              fmt::format("{} {} {} {}", p.lists[0], p.lists[1], p.lists[2], p.lists[3]),
              fmt::format("{}; with our additions {}", lists(plain), lists(ours)));
  print_claim("T6 necessary assignments; with the 3-D refinement: " + loaded.title,
              fmt::format("{} %; {} %", p.necessary, p.refined),
              fmt::format("{:.0f} %; {:.0f} %; with our additions {:.0f} %", necessary_percent(plain),
                          necessary_percent(refined), necessary_percent(ours)));
  print_claim("5.3 samples in the box beyond those in the hull: " + loaded.title, fmt::format("{} %", p.box_over_hull),
              fmt::format("{:.2f} %", 100.0 * (plain.detail("gears.samples_in_box").value() /
                                                   std::max(1.0, plain.detail("gears.samples_in_hull").value()) -
                                               1.0)));
}

/// Section 5.3: hull and refinement bring fewer tests but no speed.
void bounds_in_time(const Loaded& loaded, const PaperOptions& o) {
  const Case c = case_of(loaded, o.size, 256);
  std::vector<Run> runs(3, {&c, as_published(256, 128)});
  runs[1].config.gears.region = GearsRegion::kHull;
  runs[2].config.gears.refine = true;
  const std::vector<double> ms = medians(runs, o.repeat);
  print_claim("5.3 speed with the hull, with the 3-D refinement, relative to the box: " + loaded.title,
              "below 1; below 1", fmt::format("{:.2f}; {:.2f}", ms[0] / ms[1], ms[0] / ms[2]));
}

/// Best of Embree's modes for that number of rays, once.
double trace_ms(EmbreeRays& embree, const Case& c, const EmbreeMode& mode) {
  VisibilityMasks masks;
  masks.reset(c.receivers.size(), c.samples.count);
  embree.build_ms(mode);
  Stopwatch watch;
  embree.trace(mode, c.order, masks);
  return watch.lap();
}

void table_7(const Loaded& loaded, const PaperOptions& o) {
  const Case c = case_of(loaded, o.size, 256);
  EmbreeRays embree(c.mesh, c.receivers, c.samples, o.threads);
  const EmbreeMode mode = best_embree_mode(c.samples.count, false);
  const double build = embree.build_ms(mode);
  VisibilityMasks ours, published, exact, traced;
  ShadowStats stats;
  const auto solver = [&](const ShadowConfig& config, VisibilityMasks& masks) {
    return [&, config] { solve_masks(c.mesh, c.receivers, c.light, c.samples, config, masks, stats); };
  };
  ShadowConfig exact_config = config_for(256);
  exact_config.method = ShadowMethod::kExact;
  const std::vector<Timing> timings = measure_interleaved(
      {solver(config_for(256), ours), solver(as_published(256, 128), published), solver(exact_config, exact),
       [&] {
         traced.reset(c.receivers.size(), c.samples.count);
         embree.trace(mode, c.order, traced);
       }},
      o.repeat);
  const double gears = timings[0].median(), rays = timings[3].median();
  print_claim("T7 speed-up over ray tracing, static and dynamic: " + loaded.title,
              fmt::format("{} {}", loaded.subject.speedup, loaded.subject.speedup_dynamic),
              fmt::format("{:.2f} {:.2f} (as published {:.2f})", rays / gears, (rays + build) / gears,
                          rays / timings[1].median()));
  print_claim("5.1 bits that differ from the exact engine's; from ray tracing: " + loaded.title, "3 pixels by 1",
              fmt::format("{}; {}", count_differences(ours, exact) + count_differences(published, exact),
                          count_differences(ours, traced)));
}

/// Rays per receiver that Embree traces in `ms`: doubled until it takes longer, then interpolated.
double rays_in_time(const Loaded& loaded, const PaperOptions& o, double ms) {
  double last_ms = 0.0, last_rays = 0.0;
  for (std::uint32_t side = 2; side <= 64; side *= 2) {
    const Case c = case_of(loaded, o.size, side * side);
    EmbreeRays embree(c.mesh, c.receivers, c.samples, o.threads);
    const EmbreeMode mode = best_embree_mode(c.samples.count, false);
    std::vector<double> times;
    for (int i = 0; i < o.repeat; ++i) times.push_back(trace_ms(embree, c, mode));
    std::sort(times.begin(), times.end());
    const double now = times[times.size() / 2], rays = side * side;
    if (now >= ms) return last_rays + (rays - last_rays) * std::max(0.0, ms - last_ms) / std::max(1e-9, now - last_ms);
    last_ms = now, last_rays = rays;
  }
  return last_rays;
}

void table_8(const Loaded& loaded, const PaperOptions& o) {
  const auto samples = static_cast<std::uint32_t>(loaded.subject.mask_samples);
  const Case c = case_of(loaded, o.size, samples);
  const double ms = medians({{&c, config_for(samples)}}, o.repeat)[0];
  print_claim(fmt::format("T8 rays of the ray tracer in the time of {} samples: {}", samples, loaded.title),
              fmt::format("{}", loaded.subject.frame_rays), fmt::format("{:.0f}", rays_in_time(loaded, o, ms)));
}

}  // namespace

void run_gears(const PaperOptions& options) {
  PaperOptions o = options;
  if (o.quick) o.size = "128x128", o.repeat = 1;
  print_claim("claim", "paper", "ours");
  print_claim("---", "---", "---");
  for (const Subject& subject : kSubjects) {
    const std::optional<Loaded> loaded = load(subject, o);
    if (!loaded) continue;
    table_1(*loaded, o);
    table_2(*loaded, o);
    table_3(*loaded, o);
    table_4(*loaded, o);
    tables_5_and_6(*loaded, o);
    bounds_in_time(*loaded, o);
    if (!embree_available()) continue;
    table_7(*loaded, o);
    table_8(*loaded, o);
  }
}

}  // namespace halfshade::bench
