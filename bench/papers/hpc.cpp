// Laine and Aila 2005, "Hierarchical Penumbra Casting": table 2 on scenes of the same kind, and what each optimisation
// of section 3.3 is worth. The ratio is shadow rays' time over ours; trees of the ray tracer are not counted, as the
// paper did not count them, and our sorting and hierarchies are.
#include <fmt/format.h>

#include <filesystem>

#include "bench/bench_case.h"
#include "bench/harness.h"
#include "examples/halfshade/scene_source.h"
#include "papers.h"
#include "shadows/method_options.h"
#include "shadows/raytrace/embree_rays.h"
#include "shadows/solver.h"

namespace halfshade::bench {
namespace {

/// Paper's performance ratios: three resolutions at 256 samples, then 1,024 samples and a light of four times the area
/// at the middle one.
struct Subject {
  const char* name;
  const char* scene;  // a built-in scene of the same kind and size, or a folder of the shared scenes
  std::array<double, 5> ratio;
};

constexpr Subject kSubjects[] = {{"GRIDS, 73 K", "builtin:bars:3040", {9.0, 13.5, 16.7, 26.1, 5.0}},
                                 {"FLOWERS, 903 K", "builtin:grass:180000", {1.4, 3.5, 7.8, 4.2, 2.1}},
                                 {"SPONZA, 1.27 M", "sponza_crytek", {4.5, 8.2, 11.4, 11.6, 2.0}}};

struct Row {
  const char* label;
  std::uint32_t width, height, samples;
  double light_side;  // factor
};

constexpr Row kRows[] = {{"640x480", 640, 480, 256, 1.0},
                         {"1280x960", 1280, 960, 256, 1.0},
                         {"2560x1920", 2560, 1920, 256, 1.0},
                         {"1280x960, 1,024 samples", 1280, 960, 1024, 1.0},
                         {"1280x960, 4x light area", 1280, 960, 256, 2.0}};

ShadowConfig paper_config(std::uint32_t samples) {
  ShadowConfig config;
  config.method = ShadowMethod::kHierarchicalPenumbraCasting;
  config.light_sample_count = samples;
  config.pattern = SamplePattern::kStratified;
  config.sample_sets = 8;
  return config;
}

struct Work {
  Case scene_case;
  ShadowConfig config;
  ShadowStats stats;
  VisibilityMasks masks;

  void solve(const ShadowConfig& with) {
    solve_masks(scene_case.mesh, scene_case.receivers, scene_case.light, scene_case.samples, with, masks, stats);
  }
};

/// The paper's pictures, scaled so that the largest, 2560 wide, is as wide as --size asks.
std::string size_of(const Row& row, const PaperOptions& options) {
  const std::uint32_t width = options.quick ? 320 : static_cast<std::uint32_t>(std::stoul(options.size));
  return fmt::format("{}x{}", row.width * width / 2560, row.height * width / 2560);
}

Work make_work(const Subject& subject, const SceneSource& source, const Row& row, const PaperOptions& options) {
  Work work;
  work.config = paper_config(row.samples);
  View view = source.view;
  scale_light(view.lights[0], row.light_side);
  work.scene_case = make_case(subject.name, source.scene, view, 0, size_of(row, options), work.config);
  return work;
}

/// Rays' time over ours, or nothing without Embree.
std::string measure_ratio(Work& work, const PaperOptions& options) {
  if (!embree_available()) return "no Embree here";
  const Case& c = work.scene_case;
  EmbreeRays rays(c.mesh, c.receivers, c.samples, options.threads);
  const EmbreeMode mode = best_embree_mode(c.samples.count, false);
  rays.build_ms(mode);
  VisibilityMasks traced;
  const std::vector<Timing> times = measure_interleaved({[&] { work.solve(work.config); },
                                                         [&] {
                                                           traced.reset(c.receivers.size(), c.samples.count);
                                                           rays.trace(mode, c.order, traced);
                                                         }},
                                                        options.repeat);
  const OracleCheck check = check_with_oracle(c, work.masks, 1.0, options.quick ? 0.5 : 5.0);
  return fmt::format("{:.2f} | {} in {} receivers | {:.1f} MiB", times[1].median() / times[0].median(),
                     check.wrong_bits, check.receivers,
                     work.stats.detail("hpc.peak_mask_bytes").value_or(0.0) / 1048576.0);
}

void print_row(const Subject& subject, const SceneSource& source, std::size_t row, const PaperOptions& options) {
  Work work = make_work(subject, source, kRows[row], options);
  fmt::print("| {} | {} | {} | {:.1f} | {} |\n", subject.name, kRows[row].label, size_of(kRows[row], options),
             subject.ratio[row], measure_ratio(work, options));
  std::fflush(stdout);
}

/// Time without one optimisation over time with all of them, and the counter it is about.
void print_optimisations(const Subject& subject, const SceneSource& source, const PaperOptions& options) {
  struct Variant {
    const char *what, *setting, *counter;
  };
  constexpr Variant kVariants[] = {{"A, umbra bits", "hpc.umbra-bits=off", "hpc.nodes_visited"},
                                   {"A, rebuilt hierarchies", "hpc.rebuild=1", "hpc.nodes_visited"},
                                   {"B, active plane sets", "hpc.plane-sets=off", "hpc.plane_tests"},
                                   {"C, lazy volumes", "hpc.lazy-volumes=off", "hpc.group_volumes"},
                                   {"D, masks on demand", "hpc.masks-on-demand=off", "hpc.peak_mask_bytes"},
                                   {"blockers sorted by area", "hpc.buckets=0", "hpc.nodes_visited"},
                                   {"surface area alone", "hpc.weigh-split=on", "hpc.nodes_visited"}};
  Work work = make_work(subject, source, kRows[0], options);
  for (const Variant& v : kVariants) {
    ShadowConfig without = work.config;
    set_method_option(without, v.setting);
    double with_count = 0.0, without_count = 0.0;
    const std::vector<Timing> times =
        measure_interleaved({[&] { work.solve(work.config), with_count = work.stats.detail(v.counter).value_or(0.0); },
                             [&] { work.solve(without), without_count = work.stats.detail(v.counter).value_or(0.0); }},
                            options.repeat);
    fmt::print("| {} | {} | {:.2f} | {} x {:.2f} |\n", subject.name, v.what, times[1].median() / times[0].median(),
               v.counter, with_count > 0.0 ? without_count / with_count : 0.0);
    std::fflush(stdout);
  }
}

/// Empty scenes stand for what is not there.
SceneSource load_subject(const Subject& subject, const PaperOptions& options) {
  const std::string name = subject.scene;
  if (name.starts_with("builtin:")) return load_scene(name, "", {});
  const std::filesystem::path file = std::filesystem::path(options.shared_scenes) / name / (name + ".obj");
  if (options.shared_scenes.empty() || !std::filesystem::exists(file)) return {};
  return load_scene(file.string(), "", {});
}

}  // namespace

void run_hpc(const PaperOptions& options) {
  fmt::print(
      "| scene | paper's row | our picture | paper's ratio | our ratio | wrong bits | mask memory "
      "|\n|---|---|---|---|---|---|---|\n");
  std::vector<SceneSource> sources;
  for (const Subject& subject : kSubjects) {
    sources.push_back(load_subject(subject, options));
    if (sources.back().scene.triangles.empty()) continue;
    for (std::size_t row = 0; row < std::size(kRows); ++row) print_row(subject, sources.back(), row, options);
  }
  fmt::print("\n| scene | without | time | counter |\n|---|---|---|---|\n");
  for (std::size_t i = 0; i < sources.size(); ++i) {
    if (!sources[i].scene.triangles.empty()) print_optimisations(kSubjects[i], sources[i], options);
  }
}

}  // namespace halfshade::bench
