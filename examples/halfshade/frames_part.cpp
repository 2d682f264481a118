#include "frames_part.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>

#include "accumulation_state.h"
#include "frame_series.h"
#include "halfshade/error.h"
#include "input_hashes.h"
#include "progress.h"
#include "rasterizer/core/stopwatch.h"
#include "rasterizer/io/atomic_file.h"
#include "render_part.h"

namespace halfshade {
namespace {

using nlohmann::ordered_json;

constexpr const char* kCounts = "counts.state";

std::string counts_hash(const VisibilityAccumulator& counts) {
  std::string bytes;
  for (const std::span<const std::uint32_t> values : {counts.visible(), counts.total()})
    bytes.append(reinterpret_cast<const char*>(values.data()), values.size_bytes());
  return hash_of(bytes);
}

/// Of a part of a series of `frames`, without ranges and counts.
Part describe_series(const Pipeline& pipeline, const RenderOptions& options) {
  Part part = describe_part(pipeline, options, PartSplit::kFrames);
  part.jitter_camera = options.jitter_camera;
  for (std::size_t l = 0; l < part.lights.size(); ++l) {
    part.lights[l].file = kCounts;
    part.lights[l].whole = {0, options.frames};
    part.lights[l].samples_hash = frame_samples_hash(pipeline, options, pipeline.source.view.lights[l]);
  }
  return part;
}

/// Nothing added yet.
AccumulationState empty_state(const Pipeline& pipeline, const Part& part) {
  AccumulationState state;
  std::string text = fmt::format("{} {} {}", part.scene_hash, part.view_hash, fmt::join(part.arguments, " "));
  for (const PartLight& light : part.lights) text += " " + light.samples_hash;
  state.options_hash = hash_of(text);
  state.lights = empty_counts(pipeline);
  if (part.jitter_camera) state.color = empty_colors(pipeline);
  return state;
}

void add_frames(Pipeline& pipeline, const RenderOptions& options, const PartRange& range, Part& part,
                AccumulationState& state) {
  const std::vector<Light>& lights = pipeline.source.view.lights;
  FrameSource source(pipeline, options, part.jitter_camera);
  Progress progress("frames", options.quiet);
  for (std::uint64_t frame = range.begin; frame < range.end; ++frame) {
    ShadowConfig config = shadow_config(options);
    config.frame = static_cast<std::uint32_t>(frame);
    config.progress = [&](double done) {
      return progress((static_cast<double>(frame - range.begin) + done) / static_cast<double>(range.size()));
    };
    source.draw_frame(config.frame);
    std::vector<std::vector<float>> visibility;
    for (std::size_t l = 0; l < lights.size(); ++l) {
      Stopwatch watch;
      source.add(lights[l], config, state.lights[l]);
      part.lights[l].shadow_ms += watch.lap();
      if (part.jitter_camera) visibility.push_back(source.visibility());
    }
    if (part.jitter_camera) add_color(pipeline, visibility, state.color);
    state.frames.emplace_back();
  }
}

void add_part(const Part& part, const AccumulationState& empty, AccumulationState& sum) {
  AccumulationState state = empty;
  const std::filesystem::path file = part.directory / kCounts;
  read_state(file, state);
  for (std::size_t l = 0; l < part.lights.size(); ++l) {
    const PartLight& light = part.lights[l];
    const std::string hash = counts_hash(state.lights[l]);
    if (state.frames.size() != light.range.size() || hash != light.content_hash) {
      throw Error(
          ErrorCode::kBadInput,
          fmt::format("{}: counts of {} frames with hash {} for light '{}', the manifest says {} and {}", file.string(),
                      state.frames.size(), hash, light.name, light.range.size(), light.content_hash));
    }
    sum.lights[l].merge(state.lights[l]);
  }
  sum.color.merge(state.color);
}

ordered_json merge_json(const RenderOptions& o, const std::vector<Part>& parts, const AccumulationState& sum) {
  ordered_json json = {{"schema", "halfshade.merge/1"},  {"version", HALFSHADE_VERSION},
                       {"command", o.command_line},      {"split", "frames"},
                       {"parts", parts.size()},          {"frames", o.frames},
                       {"lights", ordered_json::array()}};
  for (std::size_t l = 0; l < sum.lights.size(); ++l)
    json["lights"].push_back({{"name", parts[0].lights[l].name}, {"counts_hash", counts_hash(sum.lights[l])}});
  return json;
}

}  // namespace

int render_frames_part(const RenderOptions& options, PartNumber number) {
  if (options.frames < 1 || options.frames > kMostFrames)
    usage_error(fmt::format("--frames {} is not in 1..{}", options.frames, kMostFrames));
  if (number.count > options.frames)
    usage_error(fmt::format("--part {}: there are only {} frames", options.part, options.frames));
  const PartRange range = share_of({0, options.frames}, number);
  Pipeline pipeline;
  open_pipeline(options, 40.0, pipeline);
  warn_of_panes(pipeline);
  Part part = describe_series(pipeline, options);
  part.directory = options.output;
  begin_part(part.directory);
  AccumulationState state = empty_state(pipeline, part);
  add_frames(pipeline, options, range, part, state);
  write_state(part.directory / kCounts, state);
  for (std::size_t l = 0; l < part.lights.size(); ++l) {
    PartLight& light = part.lights[l];
    light.range = range;
    light.content_hash = counts_hash(state.lights[l]);
    light.samples = options.light_samples;
    fmt::print("light {:4} frames {}..{} of {}, {:.1f} ms; counts hash {}\n", light.name, range.begin, range.end,
               options.frames, light.shadow_ms, light.content_hash);
  }
  write_manifest(part);
  fmt::print("written    {}\n", options.output);
  return kOk;
}

int merge_frames(const RenderOptions& given, const std::vector<Part>& parts) {
  RenderOptions options = given;
  options.jitter_camera = parts[0].jitter_camera;
  options.frames = static_cast<std::uint32_t>(parts[0].lights[0].whole.end);
  if (!options.dump.empty() || options.verify_percent > 0.0)
    usage_error("--dump and --verify: counts of frames have no masks");
  Pipeline pipeline;
  open_pipeline(options, 40.0, pipeline);
  Part like = describe_series(pipeline, options);
  like.directory = "this scene";
  require_same_render(parts[0], like);
  const AccumulationState empty = empty_state(pipeline, like);
  AccumulationState sum = empty;
  for (const Part& part : parts) add_part(part, empty, sum);
  if (!options.output.empty()) {
    FrameSource(pipeline, options, options.jitter_camera).draw_frame(options.frames - 1);
    write_picture(options.output, mean_picture(pipeline, sum.lights, sum.color),
                  frame_attributes(pipeline, options, options.frames));
  }
  std::FILE* out = options.json == "-" ? stderr : stdout;
  fmt::print(out, "frames     {} from {} parts\n", options.frames, parts.size());
  for (std::size_t l = 0; l < sum.lights.size(); ++l)
    fmt::print(out, "light {:4} counts hash {}\n", parts[0].lights[l].name, counts_hash(sum.lights[l]));
  if (!options.output.empty()) fmt::print(out, "written    {}\n", options.output);
  if (options.json.empty()) return kOk;
  const std::string text = merge_json(options, parts, sum).dump(2) + "\n";
  options.json == "-" ? void(std::fputs(text.c_str(), stdout)) : write_file_atomically(options.json, text);
  return kOk;
}

}  // namespace halfshade
