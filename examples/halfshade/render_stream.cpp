// Three rounds: the first finds the scene's box and the areas of its triangles; the second draws the triangles and
// sorts them into bucket files; the third, once per part of the receivers, casts the shadows of what the files hold.
#include "render_stream.h"

#include <fmt/format.h>

#include <cstdio>

#include "halfshade/emission.h"
#include "picture.h"
#include "progress.h"
#include "rasterizer/core/parallel.h"
#include "rasterizer/core/stopwatch.h"
#include "rasterizer/io/atomic_file.h"
#include "rasterizer/shading.h"
#include "shadows/blocker_stream.h"
#include "shadows/hierarchical_penumbra_casting.h"
#include "shadows/mask_hash.h"
#include "stats_json.h"

namespace halfshade {
namespace {

using nlohmann::ordered_json;

constexpr double kMiB = 1024.0 * 1024.0;
constexpr double kProgramBytes = 160.0 * kMiB;    // code, libraries, thread stacks, the caster's round of blockers
constexpr double kBytesPerPieceTriangle = 400.0;  // scene, lattice mesh, screen triangles and bins of a piece
constexpr double kBytesPerEntry = 76.0 + 80.0;    // G-buffer with depths; colours, picture and what writes it
constexpr double kBytesPerRecord = 68.0;          // the longer kind

/// Bytes of the worst case: every sample of the picture is a receiver, every receiver in penumbra.
struct Forecast {
  double fixed = 0.0;         // all but the part of the receivers that is worked on
  double per_receiver = 0.0;  // of that part
  double receivers = 0.0, disk = 0.0;
  std::size_t parts = 1;

  double total() const { return fixed + receivers * per_receiver / static_cast<double>(parts); }
};

struct StreamRender : Pipeline {
  StreamSource source_stream;
  StreamScan scan;
  Forecast forecast;
  std::vector<std::vector<float>> visibility;       // [light][entry]
  std::vector<std::vector<vec3>> visible_emission;  // [light][entry], for lights with an emission image
  ordered_json lights = ordered_json::array();
  double scan_ms = 0.0, draw_ms = 0.0;
  std::uint64_t bucket_bytes = 0;
};

double texture_bytes(const Scene& scene) {
  double bytes = 0.0;
  for (const ColorMap& map : scene.color_maps) bytes += static_cast<double>(map.rgb.size());
  for (const AlphaMap& map : scene.alpha_maps) bytes += static_cast<double>(map.alpha.size());
  return bytes;
}

Forecast make_forecast(const StreamRenderOptions& o, const StreamRender& render) {
  Forecast f;
  const PixelWindow& window = render.raster.window;
  const double lights = static_cast<double>(render.source.view.lights.size());
  f.receivers = static_cast<double>(window.width()) * window.height();
  f.per_receiver = most_bytes_per_receiver(o.light_samples);
  f.fixed = kProgramBytes + texture_bytes(render.source_stream.stream.piece) +
            f.receivers * (kBytesPerEntry + 33.0 + 16.0 * lights) +
            kBytesPerPieceTriangle * static_cast<double>(std::max<std::uint64_t>(render.scan.largest_piece, 65536));
  f.disk = kBytesPerRecord * static_cast<double>(render.scan.triangles);
  if (o.max_mib == 0) return f;
  const double left = static_cast<double>(o.max_mib) * kMiB - f.fixed;
  const double least = f.per_receiver * std::min(f.receivers, 4096.0);
  if (left < least) {
    throw Error(ErrorCode::kLimit, fmt::format("--max-memory {}: at least {:.0f} MiB would be needed; render with "
                                               "--crop, a smaller --size or fewer --light-samples",
                                               o.max_mib, std::ceil((f.fixed + least) / kMiB)));
  }
  f.parts = parts_for(static_cast<std::size_t>(f.receivers), o.light_samples, static_cast<std::uint64_t>(left));
  return f;
}

void print_forecast(std::FILE* out, const StreamRender& render) {
  const Forecast& f = render.forecast;
  fmt::print(
      out,
      "forecast   at most {:.0f} MiB: {:.0f} whatever the receivers are, {:.0f} for {}; up to {:.0f} MiB on disk\n",
      f.total() / kMiB, f.fixed / kMiB, (f.total() - f.fixed) / kMiB,
      f.parts == 1 ? "all receivers at once" : fmt::format("each of {} parts of them", f.parts), f.disk / kMiB);
}

void scan(const StreamRenderOptions& o, StreamRender& render) {
  Stopwatch watch;
  render.source_stream = open_stream(o.scene, o.view_file, o.load, o.piece);
  render.scan = scan_stream(render.source_stream.stream);
  for (const std::string& warning : render.source_stream.report.warnings)
    fmt::print(stderr, "halfshade: warning: {}\n", warning);
  View& view = render.source.view;
  view = render.source_stream.view;
  if (render.source_stream.needs_view) {
    view = fitted_view(render.scan.low, render.scan.high);
    fmt::print(stderr, "halfshade: no view file: camera and light were fitted to the scene\n");
  }
  place_suns(view, render.scan.low, render.scan.high);
  if (render.scan.translucent > 0) {
    fmt::print(stderr, "halfshade: {} translucent triangles: with --stream they neither block nor tint light\n",
               render.scan.translucent);
  }
  if (view.lights.empty()) throw Error(ErrorCode::kBadInput, "the view has no light");
  render.scan_ms = watch.lap();
}

void drop_geometry(Scene& piece) {
  std::vector<dvec3>().swap(piece.positions);
  decltype(piece.triangles)().swap(piece.triangles);
  decltype(piece.triangle_normals)().swap(piece.triangle_normals);
}

/// The second round.
BlockerFiles draw_and_sort(const StreamRenderOptions& o, const PenumbraCastingOptions& hpc, StreamRender& render) {
  Stopwatch watch;
  std::vector<dvec3> reach;
  for (const Light& light : render.source.view.lights) {
    const std::vector<dvec3> extent = light_extent(light);
    reach.insert(reach.end(), extent.begin(), extent.end());
  }
  const LocalFrame frame = render.scan.frame(reach);
  BlockerFiles files(o.directory, render.scan.buckets(frame, hpc.area_buckets), hpc.area_buckets);
  PiecewisePicture picture = begin_picture(render.raster);
  Progress progress("drawing and sorting", o.quiet);
  SceneStream& stream = render.source_stream.stream;
  std::uint32_t first = 0;
  for (stream.rewind(); stream.next(stream.piece);) {
    const LatticeMesh piece = make_lattice_mesh(stream.piece, frame);
    rasterize_piece(piece, first, render.source.view.camera, render.raster, picture, render.raster_stats);
    files.add(piece, first);
    first += static_cast<std::uint32_t>(piece.triangles.size());
    if (!progress(static_cast<double>(first) / static_cast<double>(render.scan.triangles)))
      throw Error(ErrorCode::kCancelled, "cancelled");
  }
  drop_geometry(stream.piece);
  render.mesh.frame = frame;
  render.gbuffer = std::move(picture.gbuffer);
  render.bucket_bytes = files.bytes();
  render.draw_ms = watch.lap();
  return files;
}

void spread(const StreamRender& render, const Light& light, const LightSamples& samples, const ReceiverArray& receivers,
            std::size_t first, const VisibilityMasks& masks, std::vector<float>& visibility,
            std::vector<vec3>& emission) {
  const std::vector<vec3> weights =
      light.emission_image.empty() ? std::vector<vec3>() : sample_emission(light.emission_image, samples);
  if (!weights.empty() && emission.empty()) emission.assign(render.gbuffer.size(), vec3(0.0f));
  for (std::size_t i = 0; i < masks.receiver_count; ++i) {
    const std::size_t r = first + i;
    visibility[receivers.sample[r]] = masks.visibility(i);
    if (weights.empty()) continue;
    const std::size_t at = std::size_t{receivers.set[r]} * samples.count;
    emission[receivers.sample[r]] = weighted_visibility(masks.mask(i), std::span(weights).subspan(at, samples.count));
  }
}

void solve_light(const StreamRenderOptions& o, const Light& light, BlockerFiles& files, StreamRender& render,
                 std::FILE* out) {
  Stopwatch watch;
  ShadowConfig config = shadow_config(o);
  const LightSamples samples = make_light_samples(light, config, render.mesh.frame);
  const ReceiverArray receivers = make_receivers(render.gbuffer, samples, config.seed);
  std::vector<float>& visibility = render.visibility.emplace_back(render.gbuffer.size(), 0.0f);
  std::vector<vec3>& emission = render.visible_emission.emplace_back();
  MaskHasher hasher(receivers.size(), samples.count);
  ShadowStats stats;
  {
    Progress progress("shadows of " + light.name, o.quiet);
    config.progress = [&progress](double done) { return progress(done); };
    cast_from_files(
        files, render.source_stream.stream.piece, receivers, light, samples, config, render.forecast.parts,
        [&](std::size_t first, const VisibilityMasks& masks) {
          hasher.add(masks);
          spread(render, light, samples, receivers, first, masks, visibility, emission);
        },
        stats);
  }
  const double shadow_ms = watch.lap();
  const std::string hash = hasher.digest();
  fmt::print(out, "light {:4} {} samples, {} receivers; shadows {:.1f} ms\nmask hash  {}\n", light.name, samples.count,
             receivers.size(), shadow_ms, hash);
  if (o.stats) {
    for (const auto& [name, value] : stats.details) fmt::print(out, "  {:<36} {:.6g}\n", name, value);
  }
  render.lights.push_back({{"name", light.name},
                           {"samples", samples.count},
                           {"shadow_ms", shadow_ms},
                           {"stages", stats_json(stats)},
                           {"mask_hash", hash}});
}

ordered_json run_json(const StreamRenderOptions& o, const StreamRender& render) {
  ordered_json json = {{"schema", "halfshade.stats/1"}, {"version", HALFSHADE_VERSION}, {"command", o.command_line}};
  json["machine"] = machine_json();
  json["scene"] = {{"name", o.scene}, {"triangles", render.scan.triangles}, {"streamed", true}};
  json["method"] = method_json(o);
  json["milliseconds"] = {{"scan", render.scan_ms}, {"draw_and_sort", render.draw_ms}};
  json["forecast_bytes"] = render.forecast.total();
  json["receiver_parts"] = render.forecast.parts;
  json["bucket_file_bytes"] = render.bucket_bytes;
  json["lights"] = render.lights;
  json["peak_rss_bytes"] = peak_rss_bytes();
  return json;
}

void check(const StreamRenderOptions& o) {
  if (!o.output.empty()) check_picture_path(o.output);
  if (o.method != "hpc")
    usage_error(fmt::format("--stream: method '{}' needs the whole scene; only hpc does not", o.method));
  if (o.shading != "plain") usage_error("--stream: shading 'bent' needs the whole scene");
  if (o.piece == 0) usage_error("--piece 0 is not in 1..4294967295");
  check_penumbra_casting(shadow_config(o).hpc);
}

}  // namespace

void render_stream(const StreamRenderOptions& o) {
  check(o);
  if (!o.simd.empty()) force_simd_target(o.simd);
  std::FILE* out = o.json == "-" ? stderr : stdout;
  StreamRender render;
  read_size(o, render);
  scan(o, render);
  render.forecast = make_forecast(o, render);
  fmt::print(out, "scene      {}  {} triangles in pieces of at most {}\n", o.scene, render.scan.triangles,
             render.scan.largest_piece);
  print_forecast(out, render);
  std::fflush(out);
  BlockerFiles files = draw_and_sort(o, shadow_config(o).hpc, render);
  for (const Light& light : render.source.view.lights) solve_light(o, light, files, render, out);
  if (!o.output.empty()) {
    const std::vector<vec3> color =
        shade(render.gbuffer, render.mesh.frame, render.source.view, render.visibility, {}, render.visible_emission);
    const Picture picture =
        resolve(render.gbuffer, render.subsamples, render.mesh.frame, render.source.view, color, render.visibility);
    write_picture(o.output, picture,
                  {{"halfshade.version", HALFSHADE_VERSION},
                   {"halfshade.command", o.command_line},
                   {"halfshade.method", o.method},
                   {"halfshade.seed", std::to_string(o.seed)}});
    fmt::print(out, "written    {}\n", o.output);
  }
  fmt::print(out, "memory     {:.0f} MiB at most were resident; scan {:.0f} ms, draw and sort {:.0f} ms\n",
             static_cast<double>(peak_rss_bytes()) / kMiB, render.scan_ms, render.draw_ms);
  if (o.json.empty()) return;
  const std::string text = run_json(o, render).dump(2) + "\n";
  o.json == "-" ? void(std::fputs(text.c_str(), stdout)) : write_file_atomically(o.json, text);
}

}  // namespace halfshade
