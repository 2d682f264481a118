#include "pipeline.h"

#include <fmt/format.h>
#include <tbb/task_arena.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <thread>

#include "halfshade/error.h"
#include "options_json.h"
#include "rasterizer/core/stopwatch.h"
#include "shadows/method_options.h"
#include "shadows/opaque_mesh.h"
#include "shadows/raytrace/raytrace.h"
#include "shadows/solver.h"
#include "stats_json.h"

namespace halfshade {
namespace {

void parse_size(const PipelineOptions& options, Pipeline& pipeline) {
  unsigned width = 0, height = 0;
  int used = 0;
  if (std::sscanf(options.size.c_str(), "%5ux%5u%n", &width, &height, &used) != 2 || options.size[used] != '\0') {
    usage_error(fmt::format("--size '{}' is not WIDTHxHEIGHT", options.size));
  }
  const auto k = static_cast<std::uint32_t>(std::lround(std::sqrt(options.spp)));
  if (k * k != options.spp || k < 1 || k > 8)
    usage_error(fmt::format("--spp {} is not 1, 4, 9, 16, ... 64", options.spp));
  if (width < 1 || height < 1 || width * k > 16384 || height * k > 16384) {
    usage_error(
        fmt::format("--size {} with --spp {}: each side times {} must be in 1..16384", options.size, options.spp, k));
  }
  pipeline.subsamples = k;
  pipeline.raster.width = width * k;
  pipeline.raster.height = height * k;
  PixelWindow crop{0, width, 0, height};
  if (!options.crop.empty()) {
    if (std::sscanf(options.crop.c_str(), "%5u,%5u,%5u,%5u%n", &crop.x0, &crop.x1, &crop.y0, &crop.y1, &used) != 4 ||
        options.crop[used] != '\0' || crop.x0 >= crop.x1 || crop.y0 >= crop.y1 || crop.x1 > width || crop.y1 > height) {
      usage_error(fmt::format("--crop '{}' is not x0,x1,y0,y1 with x0 < x1 <= {} and y0 < y1 <= {}", options.crop,
                              width, height));
    }
  }
  pipeline.raster.window = {crop.x0 * k, crop.x1 * k, crop.y0 * k, crop.y1 * k};
}

/// Masks and G-buffer of the worst case, before anything is allocated.
void check_memory(const PipelineOptions& options, double extra_bytes_per_sample, const Pipeline& pipeline) {
  const double samples = double(pipeline.raster.window.width()) * pipeline.raster.window.height();
  const double bytes =
      samples * (130.0 + 2.0 * 8.0 * std::ceil(options.light_samples / 64.0) +
                 (40.0 + extra_bytes_per_sample) * static_cast<double>(pipeline.source.view.lights.size()));
  const double physical = double(sysconf(_SC_PHYS_PAGES)) * double(sysconf(_SC_PAGE_SIZE));
  if (bytes > physical) {
    throw Error(ErrorCode::kLimit, fmt::format("up to {:.1f} GB would be needed, this machine has {:.1f} GB; render "
                                               "with --crop, a smaller --size or fewer --light-samples",
                                               bytes * 1e-9, physical * 1e-9));
  }
}

void make_mesh(Pipeline& pipeline) {
  Stopwatch watch;
  std::vector<dvec3> reach;
  for (const Light& light : pipeline.source.view.lights) {
    const std::vector<dvec3> extent = light_extent(light);
    reach.insert(reach.end(), extent.begin(), extent.end());
  }
  pipeline.mesh = make_lattice_mesh(pipeline.source.scene, make_local_frame(pipeline.source.scene.positions, reach));
  pipeline.panes = find_panes(pipeline.mesh);
  pipeline.frame_ms = watch.lap();
}

void print_warnings(const Pipeline& pipeline) {
  for (const std::string& warning : pipeline.source.report.warnings)
    fmt::print(stderr, "halfshade: warning: {}\n", warning);
  if (pipeline.source.view_was_made_up)
    fmt::print(stderr, "halfshade: no view file: camera and light were fitted to the scene\n");
}

std::string method_names() {
  std::string names;
  for (const MethodTraits& m : shadow_methods()) names += (names.empty() ? "" : ", ") + std::string(m.name);
  return names;
}

std::string option_list() {
  std::string list;
  const ShadowConfig defaults;
  for (const MethodOption& option : method_options())
    list += fmt::format("{}={}: {}\n", option.name, option.get(defaults), option.help);
  return list;
}

}  // namespace

void draw(const PipelineOptions& options, Pipeline& pipeline) {
  const View& view = pipeline.source.view;
  Stopwatch watch;
  rasterize(pipeline.mesh, view.camera, pipeline.raster, pipeline.gbuffer, &pipeline.raster_stats);
  pipeline.rasterize_ms = watch.lap();
  if (options.shading != "bent") return;
  if (!pipeline.bent_normals) pipeline.bent_normals.emplace(pipeline.mesh);
  pipeline.cosines.clear();
  for (const Light& light : view.lights) {
    pipeline.cosines.push_back(pipeline.bent_normals->cosines(pipeline.gbuffer, view.camera, light));
  }
}

void read_size(const PipelineOptions& options, Pipeline& pipeline) { parse_size(options, pipeline); }

void usage_error(const std::string& message) { throw Error(ErrorCode::kUsage, message); }

ShadowConfig shadow_config(const PipelineOptions& options) {
  ShadowConfig config;
  config.method = shadow_method_from_name(options.method);
  config.pattern = sample_pattern_from_name(options.pattern);
  config.light_sample_count = options.light_samples;
  config.sample_sets = options.sets;
  config.interleave = options.interleave;
  config.rotate_sets = options.rotate;
  config.seed = options.seed;
  config.grid_resolution = options.grid;
  config.back_face_casters = !options.all_faces;
  for (const std::string& setting : options.settings) set_method_option(config, setting);
  return config;
}

nlohmann::ordered_json method_json(const PipelineOptions& o) {
  const ShadowConfig config = shadow_config(o);
  return {{"name", o.method},
          {"light_samples", o.light_samples},
          {"pattern", o.pattern},
          {"sets", o.interleave ? kInterleavedSets : o.sets},
          {"interleave", o.interleave},
          {"rotate", o.rotate},
          {"seed", o.seed},
          {"grid_resolution", o.grid},
          {"options", options_json(config)},
          {"exact", promises_exactness(config)}};
}

void solve_light_by_method(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                           const LightSamples& samples, const ShadowConfig& config, VisibilityMasks& masks,
                           std::vector<float>& visibility, ShadowStats& stats, KeptExact* kept) {
  if (!yields_masks(config)) {
    masks = {};
    solve_visibility(mesh, receivers, light, samples, config, visibility, stats);
    return;
  }
  if (config.method == ShadowMethod::kRaytrace) {
    solve_raytrace(OpaqueMesh(mesh).get(), receivers, samples, config, masks, stats);
  } else {
    solve_masks(mesh, receivers, light, samples, config, masks, stats, kept);
  }
  visibility_of(masks, visibility);
}

void run_in_arena(int threads, const std::function<void()>& body) {
  tbb::task_arena arena(threads > 0 ? threads : static_cast<int>(std::thread::hardware_concurrency()));
  arena.execute(body);
}

void open_pipeline(const PipelineOptions& options, double extra_bytes_per_sample, Pipeline& pipeline) {
  if (!options.simd.empty()) force_simd_target(options.simd);
  shadow_config(options);  // names are checked before the scene is loaded
  if (options.shading != "plain" && options.shading != "bent")
    usage_error(fmt::format("shading '{}' is not one of: plain, bent", options.shading));
  parse_size(options, pipeline);
  Stopwatch watch;
  pipeline.source = load_scene(options.scene, options.view_file, options.load);
  pipeline.load_ms = watch.lap();
  print_warnings(pipeline);
  if (pipeline.source.view.lights.empty()) throw Error(ErrorCode::kBadInput, "the view has no light");
  check_memory(options, extra_bytes_per_sample, pipeline);
  make_mesh(pipeline);
  draw(options, pipeline);
}

namespace {

/// Options that change no bit, or that parts name on their own.
bool decides(const std::string& option) {
  constexpr std::string_view kOthers[] = {"scene", "--view", "--threads", "--simd", "--quiet", "--help"};
  return std::find(std::begin(kOthers), std::end(kOthers), option) == std::end(kOthers);
}

}  // namespace

std::vector<std::string> deciding_arguments(const CLI::App& verb) {
  PipelineOptions unused;
  CLI::App known;
  add_pipeline_options(known, unused);
  std::vector<std::string> arguments;
  for (const CLI::Option* option : known.get_options()) {
    const std::string name = option->get_name();
    const CLI::Option* given = verb.get_option_no_throw(name);
    if (!decides(name) || given == nullptr) continue;
    if (given->get_expected_max() == 0 && given->count() > 0) {
      arguments.push_back(name);
      continue;
    }
    for (const std::string& value : given->results()) arguments.insert(arguments.end(), {name, value});
  }
  return arguments;
}

void restore_arguments(const std::vector<std::string>& arguments, PipelineOptions& options) {
  CLI::App parser;
  add_pipeline_options(parser, options);
  const PipelineOptions given = options;
  try {
    parser.parse(std::vector<std::string>(arguments.rbegin(), arguments.rend()));
  } catch (const CLI::ParseError& e) {
    throw Error(ErrorCode::kBadInput, fmt::format("arguments '{}': {}", fmt::join(arguments, " "), e.what()));
  }
  options.scene = given.scene, options.view_file = given.view_file;
}

std::string picture_command(const PipelineOptions& options) {
  std::string command = "halfshade render " + options.scene;
  if (!options.view_file.empty()) command += " --view " + options.view_file;
  for (const std::string& argument : options.arguments) command += " " + argument;
  return command;
}

void add_pipeline_options(CLI::App& verb, PipelineOptions& options) {
  verb.add_option("scene", options.scene, "OBJ file or builtin:NAME[:SIZE] (see 'halfshade info')")
      ->capture_default_str();
  verb.add_option("--view", options.view_file, "View file (default: NAME.view.json beside NAME.obj)");
  verb.add_option("--size", options.size, "Picture in pixels, WIDTHxHEIGHT")->capture_default_str();
  verb.add_option("--spp", options.spp, "Samples per pixel on a regular grid: 1, 4, 9, 16 ...")->capture_default_str();
  verb.add_option("--crop", options.crop, "Render only pixels x0 <= x < x1, y0 <= y < y1: x0,x1,y0,y1");
  verb.add_option("--shading", options.shading,
                  "plain: interpolated normals; bent: also fade out where facets turn away from the light")
      ->capture_default_str();
  verb.add_option("--method", options.method, "Shadow method: " + method_names())->capture_default_str();
  verb.add_option("--set", options.settings, "Option of a method, NAME=VALUE; may be repeated:\n" + option_list())
      ->allow_extra_args(false);
  verb.add_option("--light-samples", options.light_samples, "Samples per light, 1..4096")->capture_default_str();
  verb.add_option("--pattern", options.pattern,
                  "Sample pattern: rows, uniform, stratified, low-discrepancy, poisson-disk")
      ->capture_default_str();
  verb.add_option("--sets", options.sets, "Different sample sets, chosen per pixel, 1..256")->capture_default_str();
  verb.add_flag("--interleave", options.interleave, "16 sets in a fixed 4x4 pattern of pixels instead of --sets");
  verb.add_flag("--rotate", options.rotate, "Disk and sphere lights: sets are rotated copies of a single one");
  verb.add_option("--seed", options.seed, "Seed of patterns and sets")->capture_default_str();
  verb.add_flag("--all-faces", options.all_faces,
                "afsm: front faces of closed meshes cast as well (for measuring: changes no bit)");
  verb.add_option("--grid", options.grid, "afsm: cells per axis of the light view, 16..2048 (0 = automatic)")
      ->capture_default_str();
  verb.add_option("--threads", options.threads, "Threads (0 = all cores)")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  verb.add_option("--simd", options.simd, "Use only this instruction set (AVX3, AVX2, SSE4, ...)");
  verb.add_flag("--lenient", options.load.lenient, "Skip wrong faces of the OBJ and count them");
  verb.add_flag("--strict", options.load.strict, "Missing textures and materials are errors");
  verb.add_flag("--allow-path", options.load.allow_any_path,
                "Textures and materials may lie outside the OBJ's directory");
  verb.add_flag("-q,--quiet", options.quiet, "No progress");
}

}  // namespace halfshade
