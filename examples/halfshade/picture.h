// The finished picture: colour, visibility per light and auxiliary values, resolved from samples to pixels.
#pragma once

#include <filesystem>
#include <string>

#include "halfshade/light.h"
#include "rasterizer/core/lattice.h"
#include "rasterizer/gbuffer.h"
#include "rasterizer/io/image.h"

namespace halfshade {

struct Picture {
  std::uint32_t width = 0, height = 0;  // pixels of the rendered window
  std::vector<float> color;             // [height][width][3], linear
  std::vector<float> alpha;             // share of the pixel's samples that show a surface
  std::vector<std::string> light_names;
  std::vector<std::vector<float>> visibility;  // [light][height][width], mean over the samples that show a surface
  std::vector<float> normal, position_world;   // [height][width][3], of the pixel's middle sample
  std::vector<float> depth_world;
  std::vector<std::uint32_t> triangle;
};

/// `subsamples` per axis and pixel; `color` and `visibility` have one value per G-buffer entry.
Picture resolve(const GBuffer& gbuffer, std::uint32_t subsamples, const LocalFrame& frame, const View& view,
                const std::vector<vec3>& color, std::span<const std::vector<float>> visibility);

/// By the file's ending: .png (8 bit sRGB colour) or .exr (all layers). Throws Error.
void write_picture(const std::filesystem::path& path, const Picture& picture, const ImageAttributes& attributes);

/// Throws Error{kUsage} unless the ending is one that write_picture knows; for checking before the work is done.
void check_picture_path(const std::filesystem::path& path);

}  // namespace halfshade
