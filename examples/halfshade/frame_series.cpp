#include "frame_series.h"

#include <fmt/format.h>

#include "input_hashes.h"
#include "rasterizer/shading.h"
#include "shadows/solver.h"

namespace halfshade {
namespace {

std::vector<std::vector<float>> mean_visibility(std::span<const VisibilityAccumulator> lights) {
  std::vector<std::vector<float>> result;
  for (const VisibilityAccumulator& light : lights) {
    std::vector<float>& values = result.emplace_back(light.size());
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<float>(light.visibility(i));
  }
  return result;
}

Picture shaded(const Pipeline& pipeline, const std::vector<std::vector<float>>& visibility) {
  const View& view = pipeline.source.view;
  const std::vector<vec3> color =
      shade(pipeline.gbuffer, pipeline.mesh.frame, view, visibility, {}, {}, pipeline.cosines);
  return resolve(pipeline.gbuffer, pipeline.subsamples, pipeline.mesh.frame, view, color, visibility);
}

/// Mean over frames and subsamples of a pixel, weighted by how often they showed a surface.
float pixel_visibility(const Pipeline& pipeline, const VisibilityAccumulator& light, std::size_t x, std::size_t y) {
  std::uint64_t visible = 0, total = 0;
  const std::uint32_t k = pipeline.subsamples;
  for (std::uint32_t j = 0; j < k; ++j) {
    const std::size_t first = (y * k + j) * pipeline.gbuffer.window.width() + x * k;
    for (std::size_t entry = first; entry < first + k; ++entry) {
      visible += light.visible()[entry], total += light.total()[entry];
    }
  }
  return total == 0 ? 0.0f : static_cast<float>(static_cast<double>(visible) / static_cast<double>(total));
}

}  // namespace

void FrameSource::draw_frame(std::uint32_t frame) {
  if (!jitter_camera_) return;
  pipeline_.raster.subpixel_offset = subpixel_jitter(frame);
  draw(options_, pipeline_);
}

void FrameSource::add(const Light& light, const ShadowConfig& config, VisibilityAccumulator& sum) {
  const LightSamples samples = make_light_samples(light, config, pipeline_.mesh.frame);
  receivers_ = make_receivers(pipeline_.gbuffer, samples, config.seed);
  solve_masks(pipeline_.mesh, receivers_, light, samples, config, masks_, stats_, &pipeline_.exact);
  sum.add(receivers_.sample, masks_);
  sum.add_hidden(facing_away(), samples.count);
}

std::vector<float> FrameSource::visibility() const {
  std::vector<float> values(pipeline_.gbuffer.size(), 0.0f);
  for (std::size_t i = 0; i < receivers_.size(); ++i) values[receivers_.sample[i]] = masks_.visibility(i);
  return values;
}

/// Entries that show a surface and are no receivers.
std::vector<std::uint32_t> FrameSource::facing_away() const {
  std::vector<std::uint32_t> entries;
  std::size_t next = 0;
  for (std::uint32_t i = 0; i < pipeline_.gbuffer.size(); ++i) {
    const bool receiver = next < receivers_.size() && receivers_.sample[next] == i;
    next += receiver;
    if (!receiver && pipeline_.gbuffer.triangle[i] != kNone) entries.push_back(i);
  }
  return entries;
}

std::vector<VisibilityAccumulator> empty_counts(const Pipeline& pipeline) {
  return std::vector<VisibilityAccumulator>(pipeline.source.view.lights.size(),
                                            VisibilityAccumulator(pipeline.gbuffer.size()));
}

ColorAccumulator empty_colors(const Pipeline& pipeline) {
  return ColorAccumulator(4 * (pipeline.gbuffer.size() / pipeline.subsamples / pipeline.subsamples));
}

void add_color(const Pipeline& pipeline, const std::vector<std::vector<float>>& visibility, ColorAccumulator& color) {
  const Picture picture = shaded(pipeline, visibility);
  std::vector<float> values;
  values.reserve(color.size());
  for (std::size_t i = 0; i < picture.alpha.size(); ++i) {
    values.insert(values.end(), {picture.color[3 * i], picture.color[3 * i + 1], picture.color[3 * i + 2]});
    values.push_back(picture.alpha[i]);
  }
  color.add(values);
}

Picture mean_picture(const Pipeline& pipeline, std::span<const VisibilityAccumulator> lights,
                     const ColorAccumulator& color) {
  Picture picture = shaded(pipeline, mean_visibility(lights));
  if (color.size() == 0) return picture;
  for (std::size_t i = 0; i < picture.alpha.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) picture.color[3 * i + k] = color.mean(4 * i + k);
    picture.alpha[i] = color.mean(4 * i + 3);
    for (std::size_t l = 0; l < lights.size(); ++l) {
      picture.visibility[l][i] = pixel_visibility(pipeline, lights[l], i % picture.width, i / picture.width);
    }
  }
  return picture;
}

std::string frame_samples_hash(const Pipeline& pipeline, const PipelineOptions& options, const Light& light) {
  std::vector<LightSamples> frames;
  for (const std::uint32_t frame : {0u, 1u}) {
    ShadowConfig config = shadow_config(options);
    config.frame = frame;
    frames.push_back(make_light_samples(light, config, pipeline.mesh.frame));
  }
  return samples_hash(frames);
}

ImageAttributes frame_attributes(const Pipeline& pipeline, const PipelineOptions& options, std::size_t frames) {
  return {{"halfshade.version", HALFSHADE_VERSION},
          {"halfshade.method", options.method},
          {"halfshade.light_samples", std::to_string(options.light_samples)},
          {"halfshade.seed", std::to_string(options.seed)},
          {"halfshade.frames", std::to_string(frames)},
          {"halfshade.scene_hash", scene_hash(pipeline.source.scene)}};
}

void warn_of_panes(const Pipeline& pipeline) {
  if (pipeline.panes.empty()) return;
  fmt::print(stderr,
             "halfshade: warning: {} translucent triangles: accumulate averages visibility, which knows the opaque "
             "ones alone; their light is neither dimmed nor coloured\n",
             pipeline.panes.translucent);
}

}  // namespace halfshade
