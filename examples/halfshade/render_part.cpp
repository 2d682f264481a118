#include "render_part.h"

#include <fmt/format.h>

#include <algorithm>

#include "frames_part.h"
#include "halfshade/error.h"
#include "input_hashes.h"
#include "mask_file.h"
#include "progress.h"
#include "rasterizer/core/stopwatch.h"
#include "shadows/solver.h"

namespace halfshade {
namespace {

/// Some of the triangles, as a scene of their own. Not to be copied or moved: the mesh refers to the scene.
struct BlockerShare {
  Scene scene;
  LatticeMesh mesh;
};

template <class T>
std::vector<T> share_of_values(const std::vector<T>& values, const PartRange& range) {
  if (values.empty()) return {};
  return {values.begin() + static_cast<std::ptrdiff_t>(range.begin),
          values.begin() + static_cast<std::ptrdiff_t>(range.end)};
}

void take_blockers(const LatticeMesh& whole, const PartRange& range, BlockerShare& share) {
  share.scene.materials = whole.scene->materials;
  share.scene.alpha_maps = whole.scene->alpha_maps;
  share.scene.triangle_materials = share_of_values(whole.scene->triangle_materials, range);
  share.scene.triangle_uvs = share_of_values(whole.scene->triangle_uvs, range);
  share.mesh.scene = &share.scene;
  share.mesh.frame = whole.frame;
  share.mesh.positions = whole.positions;
  share.mesh.triangles = share_of_values(whole.triangles, range);
}

/// Own triangles by their numbers in the share; those outside cannot block anything there.
ReceiverArray receivers_of_share(const ReceiverArray& receivers, const PartRange& range) {
  ReceiverArray result = receivers;
  for (std::uint32_t& own : result.triangle) {
    own = own >= range.begin && own < range.end ? static_cast<std::uint32_t>(own - range.begin) : kNone;
  }
  return result;
}

LightSamples samples_of_share(const LightSamples& samples, const PartRange& range) {
  LightSamples result = samples;
  result.count = static_cast<std::uint32_t>(range.size());
  result.points.clear();
  result.st.clear(), result.st_key = {};
  for (std::uint32_t set = 0; set < samples.sets; ++set) {
    for (std::uint64_t i = range.begin; i < range.end; ++i) {
      const std::size_t at = std::size_t{set} * samples.count + i;
      result.points.push_back(samples.points[at]);
      if (!samples.st.empty()) result.st.push_back(samples.st[at]);
    }
  }
  return result;
}

/// Length of the rows that the samples form, which the exact method likes to have whole; 1 where there are none, or
/// fewer than parts.
std::uint32_t row_length(const LightSamples& samples, std::uint32_t parts) {
  if (samples.st.empty()) return 1;
  std::uint32_t length = 1;
  while (length < samples.count && samples.st[length].y == samples.st[0].y) ++length;
  return samples.count % length == 0 && samples.count / length >= parts ? length : 1;
}

/// The masks of a light that belong to the part; fills ranges and counts.
void solve_share(Render& render, PartSplit split, PartNumber number, const LightResult& asked, const Light& light,
                 PartLight& result, VisibilityMasks& masks) {
  ShadowConfig config = shadow_config(render.options);
  Progress progress("shadows of " + light.name, render.options.quiet);
  config.progress = [&progress](double done) { return progress(done); };
  ShadowStats stats;
  const std::size_t count = asked.receivers.size();
  result.receivers_hash = receivers_hash(render.gbuffer, asked.receivers, 0, count);
  Stopwatch watch;
  if (split == PartSplit::kCrop) {
    solve_masks(render.mesh, asked.receivers, light, asked.samples, config, masks, stats, &render.exact);
  } else if (split == PartSplit::kSamples) {
    result.whole = {0, asked.samples.count};
    result.range = share_of(result.whole, number, row_length(asked.samples, number.count));
    masks.reset(count, static_cast<std::uint32_t>(result.range.size()));
    const LightSamples samples = samples_of_share(asked.samples, result.range);
    if (samples.count > 0)
      solve_masks(render.mesh, asked.receivers, light, samples, config, masks, stats, &render.exact);
  } else {
    result.whole = {0, render.mesh.triangles.size()};
    result.range = share_of(result.whole, number);
    BlockerShare share;
    take_blockers(render.mesh, result.range, share);
    solve_masks(share.mesh, receivers_of_share(asked.receivers, result.range), light, asked.samples, config, masks,
                stats);
  }
  result.shadow_ms = watch.lap();
}

std::string crop_text(const PixelWindow& window, std::uint32_t k, const PartRange& rows) {
  return fmt::format("{},{},{},{}", window.x0 / k, window.x1 / k, rows.begin, rows.end);
}

}  // namespace

void check_partial_options(const RenderOptions& o) {
  if (o.part.empty() && !o.resume) return;
  if (o.stream) usage_error("--stream goes with neither --part nor --resume");
  if (o.max_error) usage_error("--max-error goes with neither --part nor --resume");
  if (!(o.band_seconds >= 0.01 && o.band_seconds <= 3600.0))
    usage_error(fmt::format("--band-seconds {} is not in 0.01..3600", o.band_seconds));
  if (o.output.empty()) usage_error("--part and --resume need an --output");
  const ShadowConfig config = shadow_config(o);
  const bool frames = !o.part.empty() && part_split_from_name(o.split) == PartSplit::kFrames;
  if (frames ? !yields_masks(config) : !promises_exactness(config)) {
    usage_error(
        fmt::format("method '{}' is approximate: what it says of a receiver depends on the others, so its parts "
                    "would not fit together",
                    o.method));
  }
  if (o.part.empty()) return;
  parse_part_number(o.part);
  if (o.resume) usage_error("--part is written whole: --resume is for pictures");
  if (!o.json.empty() || !o.dump.empty() || o.verify_percent > 0.0)
    usage_error("--part: --json, --dump and --verify belong to 'merge'");
}

Part describe_part(const Pipeline& pipeline, const PipelineOptions& options, PartSplit split) {
  Part part;
  part.split = split;
  part.version = HALFSHADE_VERSION;
  part.scene = options.scene;
  part.view = options.view_file;
  part.arguments = options.arguments;
  part.scene_hash = scene_hash(pipeline.source.scene);
  part.view_hash = view_hash(pipeline.source.view);
  for (const Light& light : pipeline.source.view.lights) part.lights.emplace_back().name = light.name;
  return part;
}

PartRange pixel_rows(const Pipeline& pipeline) {
  const PixelWindow& window = pipeline.raster.window;
  return {window.y0 / pipeline.subsamples, window.y1 / pipeline.subsamples};
}

std::pair<std::size_t, std::size_t> receivers_in_rows(const Pipeline& pipeline, const ReceiverArray& receivers,
                                                      const PartRange& rows) {
  const PixelWindow& window = pipeline.raster.window;
  const auto place = [&](std::uint64_t row) {
    const std::uint64_t entry = (row * pipeline.subsamples - window.y0) * window.width();
    return static_cast<std::size_t>(std::lower_bound(receivers.sample.begin(), receivers.sample.end(), entry) -
                                    receivers.sample.begin());
  };
  return {place(rows.begin), place(rows.end)};
}

ReceiverArray slice(const ReceiverArray& receivers, std::size_t begin, std::size_t end) {
  const PartRange range{begin, end};
  ReceiverArray result;
  result.position = share_of_values(receivers.position, range);
  result.normal = share_of_values(receivers.normal, range);
  result.triangle = share_of_values(receivers.triangle, range);
  result.sample = share_of_values(receivers.sample, range);
  result.set = share_of_values(receivers.set, range);
  return result;
}

void write_part_masks(const Part& part, std::size_t number, const VisibilityMasks& masks, PartLight& light) {
  light.file = fmt::format("masks_{}.npy", number);
  light.receivers = masks.receiver_count;
  light.samples = masks.sample_count;
  light.content_hash = masks.hash();
  write_masks(part.directory / light.file, masks);
}

void read_part_masks(const Part& part, const PartLight& light, VisibilityMasks& masks) {
  read_masks(part.directory / light.file, light.receivers, light.samples, masks);
  const std::string hash = masks.hash();
  if (hash == light.content_hash) return;
  throw Error(ErrorCode::kBadInput, fmt::format("{}: the mask hash is {}, the manifest says {}",
                                                (part.directory / light.file).string(), hash, light.content_hash));
}

int render_part(const RenderOptions& options) {
  const PartSplit split = part_split_from_name(options.split);
  const PartNumber number = parse_part_number(options.part);
  if (split == PartSplit::kFrames) return render_frames_part(options, number);
  Render render;
  render.options = options;
  read_size(options, render);
  const PartRange whole_rows = pixel_rows(render);
  PartRange rows = whole_rows;
  if (split == PartSplit::kCrop) {
    if (number.count > whole_rows.size())
      usage_error(fmt::format("--part {}: the picture has only {} rows", options.part, whole_rows.size()));
    rows = share_of(whole_rows, number);
    render.options.crop = crop_text(render.raster.window, render.subsamples, rows);
  }
  open_pipeline(render.options, 0.0, render);
  Part part = describe_part(render, options, split);
  part.directory = options.output;
  begin_part(part.directory);
  for (std::size_t l = 0; l < part.lights.size(); ++l) {
    const Light& light = render.source.view.lights[l];
    const LightResult& asked = add_light(render, light);
    PartLight& result = part.lights[l];
    result.range = rows, result.whole = whole_rows;
    result.samples_hash = samples_hash(std::span(&asked.samples, 1));
    VisibilityMasks masks;
    solve_share(render, split, number, asked, light, result, masks);
    write_part_masks(part, l, masks, result);
  }
  write_manifest(part);
  for (const PartLight& light : part.lights) {
    fmt::print("light {:4} {} {}..{} of {}, {} receivers, {:.1f} ms; mask hash {}\n", light.name, options.split,
               light.range.begin, light.range.end, light.whole.end - light.whole.begin, light.receivers,
               light.shadow_ms, light.content_hash);
  }
  fmt::print("written    {}\n", options.output);
  return kOk;
}

}  // namespace halfshade
