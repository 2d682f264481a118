// Pictures as means of frames that each ask with other light samples: what accumulate, and parts of split `frames`,
// share.
#pragma once

#include "halfshade/accumulation.h"
#include "picture.h"
#include "pipeline.h"

namespace halfshade {

inline constexpr std::uint32_t kMostFrames = 65536;

/// Runs frames through rasterizer and shadows.
class FrameSource {
 public:
  /// Both must outlive it.
  FrameSource(Pipeline& pipeline, const PipelineOptions& options, bool jitter_camera)
      : pipeline_(pipeline), options_(options), jitter_camera_(jitter_camera) {}

  /// The camera of frame `frame`.
  void draw_frame(std::uint32_t frame);

  /// Adds a frame of one light to `sum`; receivers() and visibility() then tell about this frame alone.
  void add(const Light& light, const ShadowConfig& config, VisibilityAccumulator& sum);

  /// G-buffer entries, increasing.
  const std::vector<std::uint32_t>& receivers() const { return receivers_.sample; }
  std::vector<float> visibility() const;

 private:
  std::vector<std::uint32_t> facing_away() const;

  Pipeline& pipeline_;
  const PipelineOptions& options_;
  bool jitter_camera_;
  ReceiverArray receivers_;
  VisibilityMasks masks_;
  ShadowStats stats_;
};

/// One per light, one entry per G-buffer entry.
std::vector<VisibilityAccumulator> empty_counts(const Pipeline& pipeline);

/// For pictures whose camera moves: four values per pixel.
ColorAccumulator empty_colors(const Pipeline& pipeline);

/// Adds the picture of a single frame, of its visibility [light][entry].
void add_color(const Pipeline& pipeline, const std::vector<std::vector<float>>& visibility, ColorAccumulator& color);

/// Mean of all frames. With a moving camera, when `color` has values, layers other than colour, alpha and visibility
/// are those of the frame drawn last.
Picture mean_picture(const Pipeline& pipeline, std::span<const VisibilityAccumulator> lights,
                     const ColorAccumulator& color);

/// What decides the samples of a light in every frame: those of two of them.
std::string frame_samples_hash(const Pipeline& pipeline, const PipelineOptions& options, const Light& light);

ImageAttributes frame_attributes(const Pipeline& pipeline, const PipelineOptions& options, std::size_t frames);

void warn_of_panes(const Pipeline& pipeline);

}  // namespace halfshade
