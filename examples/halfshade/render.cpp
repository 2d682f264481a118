// halfshade render: scene -> rasterizer -> receivers -> shadow method -> picture, top to bottom.
#include <fmt/format.h>

#include <cstdio>
#include <optional>

#include "dump.h"
#include "halfshade/emission.h"
#include "journal.h"
#include "progress.h"
#include "rasterizer/core/hash.h"
#include "rasterizer/core/parallel.h"
#include "rasterizer/core/stopwatch.h"
#include "rasterizer/io/atomic_file.h"
#include "rasterizer/shading.h"
#include "render_part.h"
#include "shadows/opaque_mesh.h"
#include "shadows/oracle.h"
#include "shadows/solver.h"
#include "shadows/thin_features.h"
#include "shadows/transmittance.h"
#include "shortcuts.h"
#include "stats_json.h"

namespace halfshade {
namespace {

using nlohmann::ordered_json;

/// Visibility per G-buffer entry; entries that are no receivers face away from the light: 0.
void spread_visibility(const GBuffer& gbuffer, LightResult& result) {
  result.visibility.assign(gbuffer.size(), 0.0f);
  for (std::size_t i = 0; i < result.receivers.size(); ++i) {
    const float v = result.receiver_visibility[i];
    ++(v == 1.0f ? result.lit : (v == 0.0f ? result.umbra : result.penumbra));
    result.visibility[result.receivers.sample[i]] = v;
  }
}

/// Sums of the visible samples' weights; entries that are no receivers get none.
void spread_emission(const GBuffer& gbuffer, const EmissionImage& image, LightResult& result) {
  if (image.empty() || result.masks.words.empty()) return;
  const std::vector<vec3> weights = sample_emission(image, result.samples);
  result.visible_emission.assign(gbuffer.size(), vec3(0.0f));
  for (std::size_t i = 0; i < result.receivers.size(); ++i) {
    const std::size_t first = std::size_t{result.receivers.set[i]} * result.samples.count;
    result.visible_emission[result.receivers.sample[i]] =
        weighted_visibility(result.masks.mask(i), std::span(weights).subspan(first, result.samples.count));
  }
}

/// Light through translucent triangles, in place of emission times visibility.
void spread_transmitted(const Render& render, const Light& light, const ShadowConfig& config, LightResult& result) {
  if (render.panes.empty()) return;
  solve_reaching_light(render.panes, result.receivers, light, result.samples, config, result.masks,
                       result.receiver_visibility, result.reaching, result.stats);
  const vec3 emission = light.emission_image.empty() ? light.emission : vec3(1.0f);
  result.visible_emission.assign(render.gbuffer.size(), vec3(0.0f));
  for (std::size_t i = 0; i < result.receivers.size(); ++i) {
    result.visible_emission[result.receivers.sample[i]] = emission * result.reaching[i];
  }
}

/// Re-runs a share of the receivers, chosen by hash, through the oracle: wrong bits, and errors of visibility.
void verify(const Render& render, const Light& light, LightResult& result) {
  const auto share = static_cast<std::uint32_t>(std::min(render.options.verify_percent, 100.0) * 0.01 * 4294967295.0);
  std::vector<std::size_t> chosen;
  for (std::size_t i = 0; i < result.receivers.size(); ++i) {
    if (hash32(static_cast<std::uint32_t>(i), 0x5eed) <= share) chosen.push_back(i);
  }
  std::vector<std::uint64_t> wrong(chosen.size(), 0);
  std::vector<double> error(chosen.size(), 0.0);
  std::vector<std::uint8_t> wrong_light(chosen.size(), 0);
  std::vector<vec3> weights;
  if (!light.emission_image.empty()) weights = sample_emission(light.emission_image, result.samples);
  const OpaqueMesh opaque(render.mesh);
  parallel_ranges(chosen.size(), 4, [&](std::size_t begin, std::size_t end) {
    VisibilityMasks truth;
    for (std::size_t k = begin; k != end; ++k) {
      truth.reset(1, result.samples.count);
      oracle_mask(opaque.get(), result.receivers, chosen[k], result.samples, truth.words);
      if (!result.reaching.empty()) {
        wrong_light[k] =
            result.reaching[chosen[k]] !=
            reference_transmittance(render.panes, result.receivers, chosen[k], result.samples, truth.words, weights);
      }
      error[k] = double{result.receiver_visibility[chosen[k]]} - truth.visibility(0);
      if (result.masks.words.empty()) continue;
      const auto mask = result.masks.mask(chosen[k]);
      for (std::size_t w = 0; w < truth.words.size(); ++w)
        wrong[k] += static_cast<std::uint64_t>(std::popcount(truth.words[w] ^ mask[w]));
    }
  });
  result.verified = chosen.size();
  result.verified_bits = chosen.size() * result.masks.sample_count;
  for (const std::uint64_t w : wrong) result.wrong_bits += w;
  for (const std::uint8_t w : wrong_light) result.wrong_lights += w;
  for (const double e : error) {
    result.rms_error += e * e / static_cast<double>(chosen.size());
    result.mean_error += e / static_cast<double>(chosen.size());
    result.largest_error = std::max(result.largest_error, std::fabs(e));
  }
  result.rms_error = std::sqrt(result.rms_error);
}

/// Says so where at least one probe in a hundred sees features that the light's samples are too far apart for.
void look_for_thin_features(Render& render, const Light& light, ShadowConfig config, LightResult& result) {
  if (!yields_masks(config)) return;
  Stopwatch watch;
  Progress progress("features of " + light.name, true);
  config.progress = [&progress](double done) { return progress(done); };
  result.thin = find_thin_features(render.mesh, result.receivers, result.receiver_visibility, light, config,
                                   render.options.probes, render.exact);
  result.probe_ms = watch.lap();
  if (result.thin.seeing == 0 || result.thin.share() < 0.01) return;
  fmt::print(stderr,
             "halfshade: warning: light '{}': {} of {} probed points see something narrower than the distance between "
             "its {} samples, on {:.1f} % of the light; more --light-samples would resolve it\n",
             light.name, result.thin.seeing, result.thin.probes, result.samples.count,
             100.0 * result.thin.share_of_light);
}

}  // namespace

LightResult& add_light(Render& render, const Light& light) {
  const ShadowConfig config = shadow_config(render.options);
  LightResult& result = render.lights.emplace_back();
  Stopwatch watch;
  result.samples = make_light_samples(light, config, render.mesh.frame);
  result.receivers = make_receivers(render.gbuffer, result.samples, config.seed);
  result.samples_ms = watch.lap();
  return result;
}

void finish_light(Render& render, const Light& light, LightResult& result) {
  ShadowConfig config = shadow_config(render.options);
  config.progress = [](double) { return stop_signal() == 0; };
  Stopwatch watch;
  spread_transmitted(render, light, config, result);
  result.shadow_ms += watch.lap();
  spread_visibility(render.gbuffer, result);
  if (render.panes.empty()) spread_emission(render.gbuffer, light.emission_image, result);
  if (render.options.verify_percent > 0.0) verify(render, light, result);
}

namespace {

/// --max-error: visibility of the whole light instead of that of a number of samples.
void solve_light_to_error(Render& render, const Light& light) {
  const RenderOptions& options = render.options;
  ShadowConfig config = shadow_config(options);
  LightResult& result = render.lights.emplace_back();
  Stopwatch watch;
  result.receivers = receivers_of_whole_light(render.gbuffer, light, config, render.mesh.frame);
  result.samples_ms = watch.lap();
  {
    Progress progress("shadows of " + light.name, options.quiet);
    config.progress = [&progress](double done) { return progress(done); };
    solve_to_error(render.mesh, result.receivers, light, config, options.error_goal, result.adaptive, result.stats);
    config.progress = nullptr;
  }
  result.shadow_ms = watch.lap();
  result.receiver_visibility = result.adaptive.visibility;
  spread_visibility(render.gbuffer, result);
  if (options.verify_percent <= 0.0) return;
  result.check =
      check_max_error_run(render.mesh, result.receivers, light, config, result.adaptive, options.verify_percent);
}

void solve_light(Render& render, const Light& light) {
  if (render.options.error_goal > 0.0) {
    solve_light_to_error(render, light);
    return;
  }
  ShadowConfig config = shadow_config(render.options);
  LightResult& result = add_light(render, light);
  Stopwatch watch;
  {
    Progress progress("shadows of " + light.name, render.options.quiet);
    config.progress = [&progress](double done) { return progress(done); };
    solve_light_by_method(render.mesh, result.receivers, light, result.samples, config, result.masks,
                          result.receiver_visibility, result.stats, &render.exact);
  }
  result.shadow_ms = watch.lap();
  look_for_thin_features(render, light, config, result);
  finish_light(render, light, result);
}

ImageAttributes attributes(const Render& render) {
  const RenderOptions& o = render.options;
  std::string hashes;
  for (const LightResult& light : render.lights) {
    if (!light.masks.words.empty()) hashes += (hashes.empty() ? "" : ",") + light.masks.hash();
  }
  return {{"halfshade.version", HALFSHADE_VERSION},
          {"halfshade.command", picture_command(o)},
          {"halfshade.method", o.method},
          {"halfshade.light_samples", std::to_string(o.light_samples)},
          {"halfshade.seed", std::to_string(o.seed)},
          {"halfshade.scene_hash", scene_hash(render.source.scene)},
          {"halfshade.mask_hash", hashes}};
}

/// The picture of all lights, or of all but the one with number `without`.
Picture make_picture(const Render& render, std::size_t without = kNone) {
  std::vector<std::vector<float>> visibility;
  std::vector<std::vector<vec3>> visible_emission;
  for (std::size_t i = 0; i < render.lights.size(); ++i) {
    visibility.push_back(render.lights[i].visibility);
    visible_emission.push_back(render.lights[i].visible_emission);
    if (i != without) continue;
    visibility[i].assign(render.gbuffer.size(), 0.0f);
    visible_emission[i].clear();
  }
  const std::vector<vec3> color =
      shade(render.gbuffer, render.mesh.frame, render.source.view, visibility, {}, visible_emission, render.cosines);
  return resolve(render.gbuffer, render.subsamples, render.mesh.frame, render.source.view, color, visibility);
}

void write_picture_file(Render& render) {
  Stopwatch watch;
  const Picture picture = make_picture(render);
  render.resolve_ms = watch.lap();
  write_picture(render.options.output, picture, attributes(render));
  render.write_ms = watch.lap();
}

ordered_json light_json(const Render& render, std::size_t index) {
  const LightResult& light = render.lights[index];
  ordered_json json = {{"name", render.source.view.lights[index].name},
                       {"samples", light.samples.count},
                       {"samples_ms", light.samples_ms},
                       {"build_ms", light.stats.build_ms},
                       {"shadow_ms", light.shadow_ms - light.stats.build_ms},
                       {"stages", stats_json(light.stats)},
                       {"receivers_lit", light.lit},
                       {"receivers_penumbra", light.penumbra},
                       {"receivers_umbra", light.umbra},
                       {"mask_bytes", light.masks.words.size() * 8}};
  if (light.thin.probes > 0)
    json["thin_features"] = {{"probes", light.thin.probes},
                             {"probes_seeing", light.thin.seeing},
                             {"share_of_light", light.thin.share_of_light},
                             {"probe_ms", light.probe_ms}};
  const std::string assumptions = method_assumptions(shadow_config(render.options), render.source.view.lights[index]);
  if (!assumptions.empty()) json["assumes"] = assumptions;
  if (!light.masks.words.empty()) json["mask_hash"] = light.masks.hash();
  if (render.options.error_goal > 0.0) json["max_error"] = max_error_json(light.adaptive);
  if (!light.shortcuts.empty()) json["shortcuts"] = shortcuts_json(light.shortcuts);
  if (light.check.receivers > 0) json["verify"] = max_error_check_json(light.check);
  if (light.verified > 0)
    json["verify"] = {{"receivers", light.verified},
                      {"bits", light.verified_bits},
                      {"wrong_bits", light.wrong_bits},
                      {"visibility_rms_error", light.rms_error},
                      {"visibility_mean_error", light.mean_error},
                      {"visibility_largest_error", light.largest_error},
                      {"wrong_transmitted_lights", light.wrong_lights}};
  return json;
}

ordered_json run_json(const Render& render) {
  const RenderOptions& o = render.options;
  const Scene& scene = render.source.scene;
  ordered_json json = {{"schema", "halfshade.stats/1"}, {"version", HALFSHADE_VERSION}, {"command", o.command_line}};
  json["machine"] = machine_json();
  json["machine"]["threads"] = concurrency();
  json["scene"] = {{"name", o.scene}, {"triangles", scene.triangles.size()}, {"hash", scene_hash(scene)}};
  json["method"] = method_json(o);
  json["size"] = {render.raster.width / render.subsamples, render.raster.height / render.subsamples};
  json["spp"] = o.spp;
  json["shading"] = o.shading;
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

DumpLighting dump_lighting(const Render& render, std::size_t light) {
  const PixelWindow& window = render.gbuffer.window;
  const std::uint32_t k = render.subsamples;
  DumpLighting lighting;
  lighting.window = {window.x0 / k, window.x1 / k, window.y0 / k, window.y1 / k};
  const Picture rest = make_picture(render, light);
  for (std::size_t i = 0; i < rest.color.size(); i += 3) {
    lighting.rest.emplace_back(rest.color[i], rest.color[i + 1], rest.color[i + 2]);
  }
  const std::vector<vec3> response =
      light_response(render.gbuffer, render.mesh.frame, render.source.view.lights[light],
                     render.cosines.empty() ? std::span<const float>() : render.cosines[light]);
  for (const std::uint32_t entry : render.lights[light].receivers.sample) {
    lighting.response.push_back(response[entry] / static_cast<float>(k * k));
  }
  return lighting;
}

void write_dumps(const Render& render) {
  for (std::size_t i = 0; i < render.lights.size(); ++i) {
    const LightResult& light = render.lights[i];
    std::filesystem::path directory = render.options.dump;
    if (render.lights.size() > 1) directory /= render.source.view.lights[i].name;
    ordered_json about = {{"schema", "halfshade.dump/1"},
                          {"command", picture_command(render.options)},
                          {"light", render.source.view.lights[i].name},
                          {"width", render.raster.width / render.subsamples},
                          {"height", render.raster.height / render.subsamples},
                          {"spp", render.options.spp},
                          {"method", method_json(render.options)}};
    write_dump(directory, render.mesh, light.receivers, receiver_pixels(render, light.receivers), light.samples,
               light.masks, dump_lighting(render, i), about);
  }
}

/// --stats: every counter and what the method noted about itself.
void print_stats(std::FILE* out, const ShadowStats& stats) {
  const ordered_json json = stats_json(stats);
  for (const auto& [name, value] : json.items()) {
    if (name != "details") fmt::print(out, "  {:<36} {}\n", name, value.dump());
  }
  for (const auto& [name, value] : stats.details) fmt::print(out, "  {:<36} {:.6g}\n", name, value);
}

void print_summary(const Render& render) {
  std::FILE* out = render.options.json == "-" ? stderr : stdout;
  fmt::print(out, "scene      {}  {} triangles, {} lights\n", render.options.scene,
             render.source.scene.triangles.size(), render.lights.size());
  fmt::print(out, "picture    {}x{}, {} spp; load {:.0f} ms, rasterize {:.1f} ms\n",
             render.raster.width / render.subsamples, render.raster.height / render.subsamples, render.options.spp,
             render.load_ms, render.rasterize_ms);
  if (!render.panes.empty()) {
    fmt::print(out, "light      through {} translucent triangles; visibility is that of the others\n",
               render.panes.translucent);
  }
  for (std::size_t i = 0; i < render.lights.size(); ++i) {
    const LightResult& l = render.lights[i];
    const ShadowStats& s = l.stats;
    fmt::print(out, "light {:4} {} samples, {} receivers: {} lit, {} penumbra, {} umbra\n",
               render.source.view.lights[i].name, l.samples.count, l.receivers.size(), l.lit, l.penumbra, l.umbra);
    fmt::print(out, "shadows    {} {:.1f} ms (index {:.1f}, cull {:.1f}, test {:.1f})\n", render.options.method,
               l.shadow_ms - s.build_ms, s.index_ms, s.cull_ms, s.test_ms);
    if (promises_exactness(shadow_config(render.options))) {
      fmt::print(out, "exactness  {} of {} sample tests went to the exact predicate\n", s.exact_fallbacks,
                 s.sample_tests);
    } else {
      fmt::print(out, "exactness  {} is approximate: --verify says how wrong it is here\n", render.options.method);
      fmt::print(out, "assumes    {}\n",
                 method_assumptions(shadow_config(render.options), render.source.view.lights[i]));
    }
    if (l.verified > 0) {
      fmt::print(out,
                 "verify     {} receivers, {} bits, {} wrong; visibility off by {:.5f} (rms), {:.5f} (largest), "
                 "{:+.5f} (mean; + is too light)\n",
                 l.verified, l.verified_bits, l.wrong_bits, l.rms_error, l.largest_error, l.mean_error);
      if (!l.reaching.empty()) {
        fmt::print(out, "           light through translucent triangles wrong at {} receivers\n", l.wrong_lights);
      }
    }
    if (render.options.error_goal > 0.0) print_max_error(out, l.adaptive);
    if (l.check.receivers > 0) {
      fmt::print(out,
                 "verify     {} receivers against {} samples: {} above the goal, {} of {} proofs wrong; off by {:.5f} "
                 "(rms), {:.5f} (largest)\n",
                 l.check.receivers, kConvergedSamples, l.check.violations, l.check.wrong_proofs, l.check.proofs,
                 l.check.rmse, l.check.largest);
    }
    if (!l.masks.words.empty()) fmt::print(out, "mask hash  {}\n", l.masks.hash());
    print_shortcuts(out, l.shortcuts);
    if (!l.shortcuts.empty() && !render.options.measure_shortcuts) {
      fmt::print(out, "           --measure-shortcuts adds what each gains\n");
    }
    if (render.options.stats) print_stats(out, s);
  }
  if (!render.options.output.empty()) fmt::print(out, "written    {}\n", render.options.output);
}

}  // namespace

void check_render_options(const RenderOptions& o) {
  if (!o.output.empty()) check_picture_path(o.output);
  if (!(o.verify_percent >= 0.0 && o.verify_percent <= 100.0))
    usage_error(fmt::format("--verify {} is not in 0..100", o.verify_percent));
  if (!o.dump.empty() && !yields_masks(shadow_config(o)))
    usage_error(fmt::format("--dump: method '{}' yields no masks", o.method));
}

int finish_render(Render& render) {
  const RenderOptions& o = render.options;
  if (!o.output.empty()) write_picture_file(render);
  if (!o.dump.empty()) write_dumps(render);
  print_summary(render);
  if (!o.json.empty()) {
    const std::string text = run_json(render).dump(2) + "\n";
    o.json == "-" ? void(std::fputs(text.c_str(), stdout)) : write_file_atomically(o.json, text);
  }
  const bool must_be_exact = promises_exactness(shadow_config(o));
  for (const LightResult& light : render.lights) {
    if (light.check.violations + light.check.wrong_proofs > 0) return kDifferent;
    if (must_be_exact && light.wrong_bits + light.wrong_lights > 0) return kDifferent;
  }
  return kOk;
}

namespace {

int run(const RenderOptions& options) {
  Render render;
  render.options = options;
  check_render_options(options);
  if (options.max_error) {
    render.options.error_goal = parse_max_error(*options.max_error);
    check_max_error_options(options);
    if (!options.dump.empty()) usage_error("--max-error: --dump needs the same samples for all receivers");
  }
  open_pipeline(options, 0.0, render);
  if (const std::string obstacle = max_error_obstacle(render); options.max_error && !obstacle.empty()) {
    usage_error("--max-error: " + obstacle);
  }
  if (!render.panes.empty() && !yields_masks(shadow_config(options))) {
    fmt::print(stderr,
               "halfshade: warning: {} translucent triangles: {} does not know which light samples it sees; its "
               "visibility times the transmittance of the whole light is approximate\n",
               render.panes.translucent, options.method);
  }
  if (options.resume) {
    const Journal journal(options.output + ".journal");
    solve_in_bands(render, journal);
    const int code = finish_render(render);
    journal.remove();
    return code;
  }
  for (const Light& light : render.source.view.lights) {
    solve_light(render, light);
    LightResult& l = render.lights.back();
    if (!(options.stats || options.measure_shortcuts) || !promises_exactness(shadow_config(options))) continue;
    l.shortcuts =
        list_shortcuts(render.mesh, l.receivers, light, shadow_config(options), l.stats, options.measure_shortcuts);
  }
  return finish_render(render);
}

/// The default method means hpc here.
int run_streamed(const RenderOptions& o) {
  if (o.verify_percent > 0.0 || !o.dump.empty()) usage_error("--stream: --verify and --dump need the whole scene");
  if (o.max_error) usage_error("--stream: --max-error needs the whole scene");
  StreamRenderOptions streamed = o.streamed;
  static_cast<PipelineOptions&>(streamed) = o;
  streamed.output = o.output, streamed.json = o.json, streamed.stats = o.stats;
  if (o.method == PipelineOptions().method) streamed.method = "hpc";
  render_stream(streamed);
  return kOk;
}

}  // namespace

void add_render(CLI::App& app, const std::string& command_line, int& exit_code) {
  CLI::App* verb = app.add_subcommand("render", "Render a scene with exact soft shadows");
  auto o = std::make_shared<RenderOptions>();
  add_pipeline_options(*verb, *o);
  verb->add_option("-o,--output", o->output, "Picture to write: .png or .exr");
  verb->add_option("--json", o->json, "Statistics as JSON to this file, or - for standard output");
  verb->add_option("--dump", o->dump, "Write receivers, samples, triangles and masks into this directory");
  verb->add_option("--verify", o->verify_percent, "Check this percentage of the receivers with the oracle")
      ->capture_default_str();
  verb->add_option("--probes", o->probes,
                   "Receivers that look for features finer than the light's samples, and warn (0 = none)")
      ->check(CLI::Range(0, 65536))
      ->capture_default_str();
  verb->add_flag("--stats", o->stats, "Print every counter of the method, and its shortcuts");
  verb->add_flag("--measure-shortcuts", o->measure_shortcuts,
                 "Exact methods: list the shortcuts with what each gains, from runs with and without it");
  verb->add_option("--max-error", o->max_error,
                   "Largest error of visibility of the whole light, 1/4096..1/4: 1/256, 0.004 or 0.4%; samples are "
                   "spent where it takes them");
  verb->add_flag("--resume", o->resume,
                 "Keep finished bands in OUTPUT.journal and go on from those of a run that was stopped");
  verb->add_option("--band-seconds", o->band_seconds, "--resume: work between two savings, 0.01..3600")
      ->capture_default_str();
  verb->add_option("--part", o->part, "Do only part i of n, i/n, and write it to the directory --output; see 'merge'");
  verb->add_option("--split", o->split, "--part: what is divided: crop, frames, samples or blockers")
      ->capture_default_str();
  verb->add_option("--frames", o->frames, "--split frames: number of frames in all, as of 'accumulate'")
      ->capture_default_str();
  verb->add_flag("--jitter-camera", o->jitter_camera, "--split frames: as of 'accumulate'");
  verb->add_flag("--stream", o->stream, "Never hold the whole scene: method hpc, blockers sorted into files on disk");
  verb->add_option("--stream-dir", o->streamed.directory, "Directory of these files (default: the system's)");
  verb->add_option("--max-memory", o->streamed.max_mib, "--stream: MiB to stay within; receivers are split into parts");
  verb->add_option("--piece", o->streamed.piece, "--stream: triangles of a built-in scene made at once")
      ->capture_default_str();
  verb->callback([o, verb, &exit_code, command_line] {
    o->command_line = command_line;
    o->arguments = deciding_arguments(*verb);
    check_partial_options(*o);
    run_in_arena(o->threads,
                 [&] { exit_code = o->stream ? run_streamed(*o) : (o->part.empty() ? run(*o) : render_part(*o)); });
  });
}

}  // namespace halfshade
