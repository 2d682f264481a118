#include "rasterizer/io/texture.h"

#include <fmt/format.h>

#include "halfshade/error.h"
#include "rasterizer/io/image_decode.h"
#include "rasterizer/io/srgb.h"

namespace halfshade {
namespace {

// Channel numbers of red, green and blue: by name, or a single grey one for all.
std::array<std::size_t, 3> color_channels(const DecodedImage& image) {
  const int r = image.find_channel("R"), g = image.find_channel("G"), b = image.find_channel("B");
  if (r < 0 || g < 0 || b < 0) return {0, 0, 0};
  return {static_cast<std::size_t>(r), static_cast<std::size_t>(g), static_cast<std::size_t>(b)};
}

// 8-bit code value of a channel. 16-bit codes round to the nearest; EXR colours get the sRGB curve that ColorMap
// expects.
std::uint8_t code_of(const DecodedImage& image, std::size_t pixel, std::size_t channel, bool is_color) {
  const float value = image.value(pixel, channel);
  return static_cast<std::uint8_t>(is_color && image.is_linear ? encode_srgb(value, 8) : encode_linear(value, 8));
}

std::array<std::uint8_t, 3> color_of(const DecodedImage& image, std::size_t pixel,
                                     const std::array<std::size_t, 3>& channels) {
  return {code_of(image, pixel, channels[0], true), code_of(image, pixel, channels[1], true),
          code_of(image, pixel, channels[2], true)};
}

ColorMap make_color_map(const DecodedImage& image, const std::string& name) {
  ColorMap map{name, image.width, image.height, {}};
  const auto channels = color_channels(image);
  const std::size_t count = std::size_t{image.width} * image.height;
  map.rgb.reserve(count * 3);
  for (std::size_t pixel = 0; pixel < count; ++pixel) {
    for (const std::uint8_t code : color_of(image, pixel, channels)) map.rgb.push_back(code);
  }
  return map;
}

AlphaMap make_alpha_map(const DecodedImage& image, const std::string& name) {
  AlphaMap map{name, image.width, image.height, {}};
  const int alpha = image.find_channel("A");
  const auto channels = color_channels(image);
  const std::size_t count = std::size_t{image.width} * image.height;
  map.alpha.reserve(count);
  for (std::size_t pixel = 0; pixel < count; ++pixel) {
    if (alpha >= 0) {
      map.alpha.push_back(code_of(image, pixel, static_cast<std::size_t>(alpha), false));
      continue;
    }
    // Rec. 709 luma in 1/256: a grey picture comes out unchanged.
    const auto [r, g, b] = color_of(image, pixel, channels);
    map.alpha.push_back(static_cast<std::uint8_t>((54u * r + 183u * g + 19u * b + 128u) >> 8));
  }
  return map;
}

}  // namespace

std::uint32_t TextureSet::request(const std::filesystem::path& file, TextureKind kind) {
  const auto [entry, is_new] = numbers_.try_emplace(file, static_cast<std::uint32_t>(files_.size()));
  if (is_new) files_.emplace_back().path = file;
  File& found = files_[entry->second];
  (kind == TextureKind::kColor ? found.wants_color : found.wants_alpha) = true;
  return entry->second;
}

void TextureSet::load(Scene& scene, std::uint64_t max_bytes) {
  std::uint64_t total = 0;
  for (File& file : files_) {
    const DecodedImage image = decode_image(file.path, {.max_bytes = max_bytes});
    const std::uint64_t bytes_per_pixel = (file.wants_color ? 3 : 0) + (file.wants_alpha ? 1 : 0);
    total += bytes_per_pixel * image.width * image.height;
    if (total > max_bytes) {
      throw Error(ErrorCode::kLimit, fmt::format("{}: all textures up to here need {} bytes, allowed at most {}",
                                                 file.path.string(), total, max_bytes));
    }
    const std::string name = file.path.filename().string();
    if (file.wants_color) {
      file.color_map = static_cast<std::uint32_t>(scene.color_maps.size());
      scene.color_maps.push_back(make_color_map(image, name));
    }
    if (file.wants_alpha) {
      file.alpha_map = static_cast<std::uint32_t>(scene.alpha_maps.size());
      scene.alpha_maps.push_back(make_alpha_map(image, name));
    }
  }
}

}  // namespace halfshade
