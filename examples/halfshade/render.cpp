// halfshade render: scene -> rasterizer -> receivers -> shadow method -> picture, top to bottom.
#include <fmt/format.h>
#include <tbb/task_arena.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <thread>

#include "dump.h"
#include "picture.h"
#include "progress.h"
#include "rasterizer/core/hash.h"
#include "rasterizer/core/parallel.h"
#include "rasterizer/core/stopwatch.h"
#include "rasterizer/io/atomic_file.h"
#include "rasterizer/rasterizer.h"
#include "rasterizer/shading.h"
#include "scene_source.h"
#include "shadows/oracle.h"
#include "shadows/solver.h"
#include "stats_json.h"
#include "verbs.h"

namespace halfshade {
namespace {

using nlohmann::ordered_json;

struct RenderOptions {
  std::string scene = "builtin:demo", view_file, size = "512x512", crop, method = "afsm", pattern = "rows";
  std::string output, json, dump, simd;
  std::uint32_t spp = 1, light_samples = 256, sets = 1, seed = 0, grid = 0;
  int threads = 0;
  double verify_percent = 0.0;
  bool quiet = false;
  ObjLoadOptions load;
  std::string command_line;
};

/// Results of one light.
struct LightResult {
  ReceiverArray receivers;
  LightSamples samples;
  VisibilityMasks masks;
  ShadowStats stats;
  double samples_ms = 0.0, shadow_ms = 0.0;
  std::vector<float> visibility;  // [G-buffer entry]
  std::uint64_t lit = 0, umbra = 0, penumbra = 0;
  std::uint64_t verified = 0, verified_bits = 0, wrong_bits = 0;
};

struct Render {
  RenderOptions options;
  SceneSource source;
  RasterConfig raster;
  std::uint32_t subsamples = 1;
  LatticeMesh mesh;
  GBuffer gbuffer;
  RasterStats raster_stats;
  std::vector<LightResult> lights;
  double load_ms = 0.0, frame_ms = 0.0, rasterize_ms = 0.0, resolve_ms = 0.0, write_ms = 0.0;
};

[[noreturn]] void usage_error(const std::string& message) { throw Error(ErrorCode::kUsage, message); }

void parse_size(const RenderOptions& options, Render& render) {
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
  render.subsamples = k;
  render.raster.width = width * k;
  render.raster.height = height * k;
  PixelWindow crop{0, width, 0, height};
  if (!options.crop.empty()) {
    if (std::sscanf(options.crop.c_str(), "%5u,%5u,%5u,%5u%n", &crop.x0, &crop.x1, &crop.y0, &crop.y1, &used) != 4 ||
        options.crop[used] != '\0' || crop.x0 >= crop.x1 || crop.y0 >= crop.y1 || crop.x1 > width || crop.y1 > height) {
      usage_error(fmt::format("--crop '{}' is not x0,x1,y0,y1 with x0 < x1 <= {} and y0 < y1 <= {}", options.crop,
                              width, height));
    }
  }
  render.raster.window = {crop.x0 * k, crop.x1 * k, crop.y0 * k, crop.y1 * k};
}

/// Masks and G-buffer of the worst case, before anything is allocated.
void check_memory(const Render& render) {
  const double samples = double(render.raster.window.width()) * render.raster.window.height();
  const double bytes = samples * (130.0 + 2.0 * 8.0 * std::ceil(render.options.light_samples / 64.0) +
                                  40.0 * static_cast<double>(render.source.view.lights.size()));
  const double physical = double(sysconf(_SC_PHYS_PAGES)) * double(sysconf(_SC_PAGE_SIZE));
  if (bytes > physical) {
    throw Error(ErrorCode::kLimit, fmt::format("up to {:.1f} GB would be needed, this machine has {:.1f} GB; render "
                                               "with --crop, a smaller --size or fewer --light-samples",
                                               bytes * 1e-9, physical * 1e-9));
  }
}

void make_mesh(Render& render) {
  Stopwatch watch;
  std::vector<dvec3> reach;
  for (const Light& light : render.source.view.lights) {
    const std::vector<dvec3> extent = light_extent(light);
    reach.insert(reach.end(), extent.begin(), extent.end());
  }
  render.mesh = make_lattice_mesh(render.source.scene, make_local_frame(render.source.scene.positions, reach));
  render.frame_ms = watch.lap();
  rasterize(render.mesh, render.source.view.camera, render.raster, render.gbuffer, &render.raster_stats);
  render.rasterize_ms = watch.lap();
}

ShadowConfig shadow_config(const RenderOptions& options) {
  ShadowConfig config;
  config.method = shadow_method_from_name(options.method);
  config.pattern = sample_pattern_from_name(options.pattern);
  config.light_sample_count = options.light_samples;
  config.sample_sets = options.sets;
  config.seed = options.seed;
  config.grid_resolution = options.grid;
  return config;
}

/// Visibility per G-buffer entry; entries that are no receivers face away from the light: 0.
void spread_visibility(const GBuffer& gbuffer, LightResult& result) {
  result.visibility.assign(gbuffer.size(), 0.0f);
  for (std::size_t i = 0; i < result.receivers.size(); ++i) {
    const std::uint32_t blocked = result.masks.blocked_count(i);
    ++(blocked == 0 ? result.lit : (blocked == result.masks.sample_count ? result.umbra : result.penumbra));
    result.visibility[result.receivers.sample[i]] = result.masks.visibility(i);
  }
}

/// Re-runs a share of the receivers, chosen by hash, through the oracle.
void verify(const Render& render, LightResult& result) {
  const auto share = static_cast<std::uint32_t>(std::min(render.options.verify_percent, 100.0) * 0.01 * 4294967295.0);
  std::vector<std::size_t> chosen;
  for (std::size_t i = 0; i < result.receivers.size(); ++i) {
    if (hash32(static_cast<std::uint32_t>(i), 0x5eed) <= share) chosen.push_back(i);
  }
  std::vector<std::uint64_t> wrong(chosen.size(), 0);
  parallel_ranges(chosen.size(), 4, [&](std::size_t begin, std::size_t end) {
    std::vector<std::uint64_t> truth(result.masks.words_per_receiver);
    for (std::size_t k = begin; k != end; ++k) {
      std::fill(truth.begin(), truth.end(), 0);
      oracle_mask(render.mesh, result.receivers, chosen[k], result.samples, truth);
      const auto mask = result.masks.mask(chosen[k]);
      for (std::size_t w = 0; w < truth.size(); ++w)
        wrong[k] += static_cast<std::uint64_t>(std::popcount(truth[w] ^ mask[w]));
    }
  });
  result.verified = chosen.size();
  result.verified_bits = chosen.size() * result.masks.sample_count;
  for (const std::uint64_t w : wrong) result.wrong_bits += w;
}

void solve_light(Render& render, const Light& light) {
  const RenderOptions& options = render.options;
  ShadowConfig config = shadow_config(options);
  LightResult& result = render.lights.emplace_back();
  Stopwatch watch;
  result.samples = make_light_samples(light, config, render.mesh.frame);
  result.receivers = make_receivers(render.gbuffer, result.samples, config.seed);
  result.samples_ms = watch.lap();
  {
    Progress progress("shadows of " + light.name, options.quiet);
    config.progress = [&progress](double done) { return progress(done); };
    solve_masks(render.mesh, result.receivers, light, result.samples, config, result.masks, result.stats);
  }
  result.shadow_ms = watch.lap();
  spread_visibility(render.gbuffer, result);
  if (options.verify_percent > 0.0) verify(render, result);
}

ImageAttributes attributes(const Render& render) {
  const RenderOptions& o = render.options;
  std::string hashes;
  for (const LightResult& light : render.lights) hashes += (hashes.empty() ? "" : ",") + light.masks.hash();
  return {{"halfshade.version", HALFSHADE_VERSION},
          {"halfshade.command", o.command_line},
          {"halfshade.method", o.method},
          {"halfshade.light_samples", std::to_string(o.light_samples)},
          {"halfshade.seed", std::to_string(o.seed)},
          {"halfshade.scene_hash", scene_hash(render.source.scene)},
          {"halfshade.mask_hash", hashes}};
}

void write_picture_file(Render& render) {
  Stopwatch watch;
  std::vector<std::vector<float>> visibility;
  for (const LightResult& light : render.lights) visibility.push_back(light.visibility);
  const std::vector<vec3> color = shade(render.gbuffer, render.mesh.frame, render.source.view, visibility);
  const Picture picture =
      resolve(render.gbuffer, render.subsamples, render.mesh.frame, render.source.view, color, visibility);
  render.resolve_ms = watch.lap();
  write_picture(render.options.output, picture, attributes(render));
  render.write_ms = watch.lap();
}

ordered_json parameters(const RenderOptions& o) {
  return {{"name", o.method}, {"light_samples", o.light_samples}, {"pattern", o.pattern}, {"sets", o.sets},
          {"seed", o.seed},   {"grid_resolution", o.grid},        {"exact", true}};
}

ordered_json light_json(const Render& render, std::size_t index) {
  const LightResult& light = render.lights[index];
  ordered_json json = {{"name", render.source.view.lights[index].name},
                       {"samples", light.samples.count},
                       {"samples_ms", light.samples_ms},
                       {"build_ms", 0.0},  // nothing is kept from frame to frame
                       {"shadow_ms", light.shadow_ms},
                       {"stages", stats_json(light.stats)},
                       {"receivers_lit", light.lit},
                       {"receivers_penumbra", light.penumbra},
                       {"receivers_umbra", light.umbra},
                       {"mask_bytes", light.masks.words.size() * 8},
                       {"mask_hash", light.masks.hash()}};
  if (light.verified > 0)
    json["verify"] = {{"receivers", light.verified}, {"bits", light.verified_bits}, {"wrong_bits", light.wrong_bits}};
  return json;
}

ordered_json run_json(const Render& render) {
  const RenderOptions& o = render.options;
  const Scene& scene = render.source.scene;
  ordered_json json = {{"schema", "halfshade.stats/1"}, {"version", HALFSHADE_VERSION}, {"command", o.command_line}};
  json["machine"] = machine_json();
  json["machine"]["threads"] = tbb::this_task_arena::max_concurrency();
  json["scene"] = {{"name", o.scene}, {"triangles", scene.triangles.size()}, {"hash", scene_hash(scene)}};
  json["method"] = parameters(o);
  json["size"] = {render.raster.width / render.subsamples, render.raster.height / render.subsamples};
  json["spp"] = o.spp;
  json["milliseconds"] = {{"load", render.load_ms},
                          {"frame", render.frame_ms},
                          {"rasterize", render.rasterize_ms},
                          {"resolve", render.resolve_ms},
                          {"write", render.write_ms}};
  json["rasterizer"] = {{"triangles_clipped", render.raster_stats.triangles_clipped},
                        {"triangles_binned", render.raster_stats.triangles_binned},
                        {"tile_entries", render.raster_stats.tile_entries},
                        {"samples_covered", render.raster_stats.samples_covered}};
  json["lights"] = ordered_json::array();
  for (std::size_t i = 0; i < render.lights.size(); ++i) json["lights"].push_back(light_json(render, i));
  json["peak_rss_bytes"] = peak_rss_bytes();
  return json;
}

/// Pixel of each receiver in the whole picture, y * width + x.
std::vector<std::uint32_t> receiver_pixels(const Render& render, const ReceiverArray& receivers) {
  const PixelWindow& window = render.gbuffer.window;
  const std::uint32_t k = render.subsamples, width = render.raster.width / k;
  std::vector<std::uint32_t> pixels;
  for (const std::uint32_t entry : receivers.sample) {
    const std::uint32_t x = (window.x0 + entry % window.width()) / k, y = (window.y0 + entry / window.width()) / k;
    pixels.push_back(y * width + x);
  }
  return pixels;
}

void write_dumps(const Render& render) {
  for (std::size_t i = 0; i < render.lights.size(); ++i) {
    const LightResult& light = render.lights[i];
    std::filesystem::path directory = render.options.dump;
    if (render.lights.size() > 1) directory /= render.source.view.lights[i].name;
    ordered_json about = {{"schema", "halfshade.dump/1"},
                          {"command", render.options.command_line},
                          {"light", render.source.view.lights[i].name},
                          {"width", render.raster.width / render.subsamples},
                          {"height", render.raster.height / render.subsamples},
                          {"spp", render.options.spp},
                          {"method", parameters(render.options)}};
    write_dump(directory, render.mesh, light.receivers, receiver_pixels(render, light.receivers), light.samples,
               light.masks, about);
  }
}

void print_summary(const Render& render) {
  std::FILE* out = render.options.json == "-" ? stderr : stdout;
  fmt::print(out, "scene      {}  {} triangles, {} lights\n", render.options.scene,
             render.source.scene.triangles.size(), render.lights.size());
  fmt::print(out, "picture    {}x{}, {} spp; load {:.0f} ms, rasterize {:.1f} ms\n",
             render.raster.width / render.subsamples, render.raster.height / render.subsamples, render.options.spp,
             render.load_ms, render.rasterize_ms);
  for (std::size_t i = 0; i < render.lights.size(); ++i) {
    const LightResult& l = render.lights[i];
    const ShadowStats& s = l.stats;
    fmt::print(out, "light {:4} {} samples, {} receivers: {} lit, {} penumbra, {} umbra\n",
               render.source.view.lights[i].name, l.samples.count, l.receivers.size(), l.lit, l.penumbra, l.umbra);
    fmt::print(out, "shadows    {} {:.1f} ms (index {:.1f}, cull {:.1f}, test {:.1f})\n", render.options.method,
               l.shadow_ms, s.index_ms, s.cull_ms, s.test_ms);
    fmt::print(out, "exactness  {} of {} sample tests went to the exact predicate\n", s.exact_fallbacks,
               s.sample_tests);
    if (l.verified > 0) {
      fmt::print(out, "verify     {} receivers, {} bits, {} wrong\n", l.verified, l.verified_bits, l.wrong_bits);
    }
    fmt::print(out, "mask hash  {}\n", l.masks.hash());
  }
  if (!render.options.output.empty()) fmt::print(out, "written    {}\n", render.options.output);
}

void print_warnings(const Render& render) {
  for (const std::string& warning : render.source.report.warnings)
    fmt::print(stderr, "halfshade: warning: {}\n", warning);
  if (render.source.view_was_made_up)
    fmt::print(stderr, "halfshade: no view file: camera and light were fitted to the scene\n");
  std::uint64_t translucent = 0;
  for (const std::uint32_t m : render.source.scene.triangle_materials)
    translucent += render.source.scene.materials[m].opacity < 1.0f;
  if (translucent > 0) {
    fmt::print(stderr, "halfshade: {} triangles have d < 1; {} treats them as opaque\n", translucent,
               render.options.method);
  }
}

int run(RenderOptions options) {
  Render render;
  render.options = std::move(options);
  const RenderOptions& o = render.options;
  if (!o.output.empty()) check_picture_path(o.output);
  if (!(o.verify_percent >= 0.0 && o.verify_percent <= 100.0))
    usage_error(fmt::format("--verify {} is not in 0..100", o.verify_percent));
  if (!o.simd.empty()) force_simd_target(o.simd);
  shadow_config(o);  // names are checked before the scene is loaded
  parse_size(o, render);
  Stopwatch watch;
  render.source = load_scene(o.scene, o.view_file, o.load);
  render.load_ms = watch.lap();
  print_warnings(render);
  if (render.source.view.lights.empty()) throw Error(ErrorCode::kBadInput, "the view has no light");
  check_memory(render);
  make_mesh(render);
  for (const Light& light : render.source.view.lights) solve_light(render, light);
  if (!o.output.empty()) write_picture_file(render);
  if (!o.dump.empty()) write_dumps(render);
  print_summary(render);
  if (!o.json.empty()) {
    const std::string text = run_json(render).dump(2) + "\n";
    o.json == "-" ? void(std::fputs(text.c_str(), stdout)) : write_file_atomically(o.json, text);
  }
  for (const LightResult& light : render.lights) {
    if (light.wrong_bits > 0) return kDifferent;
  }
  return kOk;
}

}  // namespace

void add_render(CLI::App& app, const std::string& command_line, int& exit_code) {
  CLI::App* verb = app.add_subcommand("render", "Render a scene with exact soft shadows");
  auto o = std::make_shared<RenderOptions>();
  verb->add_option("scene", o->scene, "OBJ file or builtin:NAME[:SIZE] (see 'halfshade info')")->capture_default_str();
  verb->add_option("--view", o->view_file, "View file (default: NAME.view.json beside NAME.obj)");
  verb->add_option("--size", o->size, "Picture in pixels, WIDTHxHEIGHT")->capture_default_str();
  verb->add_option("--spp", o->spp, "Samples per pixel on a regular grid: 1, 4, 9, 16 ...")->capture_default_str();
  verb->add_option("--crop", o->crop, "Render only pixels x0 <= x < x1, y0 <= y < y1: x0,x1,y0,y1");
  verb->add_option("--method", o->method, "Shadow method: afsm, oracle")->capture_default_str();
  verb->add_option("--light-samples", o->light_samples, "Samples per light, 1..4096")->capture_default_str();
  verb->add_option("--pattern", o->pattern, "Sample pattern: rows, uniform, stratified")->capture_default_str();
  verb->add_option("--sets", o->sets, "Different sample sets, chosen per pixel, 1..256")->capture_default_str();
  verb->add_option("--seed", o->seed, "Seed of patterns and sets")->capture_default_str();
  verb->add_option("--grid", o->grid, "afsm: cells per axis of the light view, 16..2048 (0 = automatic)")
      ->capture_default_str();
  verb->add_option("--threads", o->threads, "Threads (0 = all cores)")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  verb->add_option("--simd", o->simd, "Use only this instruction set (AVX3, AVX2, SSE4, ...)");
  verb->add_option("-o,--output", o->output, "Picture to write: .png or .exr");
  verb->add_option("--json", o->json, "Statistics as JSON to this file, or - for standard output");
  verb->add_option("--dump", o->dump, "Write receivers, samples, triangles and masks into this directory");
  verb->add_option("--verify", o->verify_percent, "Check this percentage of the receivers with the oracle")
      ->capture_default_str();
  verb->add_flag("--lenient", o->load.lenient, "Skip wrong faces of the OBJ and count them");
  verb->add_flag("--strict", o->load.strict, "Missing textures and materials are errors");
  verb->add_flag("--allow-path", o->load.allow_any_path, "Textures and materials may lie outside the OBJ's directory");
  verb->add_flag("-q,--quiet", o->quiet, "No progress");
  verb->callback([o, &exit_code, command_line] {
    o->command_line = command_line;
    const int threads = o->threads > 0 ? o->threads : static_cast<int>(std::thread::hardware_concurrency());
    tbb::task_arena arena(threads);
    arena.execute([&] { exit_code = run(*o); });
  });
}

}  // namespace halfshade
