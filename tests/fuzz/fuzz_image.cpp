// Pictures as texture, opacity and emission. At most 16 MiB of pixels, so that a run stays in little memory; the reader
// itself takes the limit as an argument.
#include <cmath>

#include "fuzz/fuzz_target.h"
#include "rasterizer/io/emission_file.h"
#include "rasterizer/io/image_decode.h"
#include "rasterizer/io/texture.h"

namespace halfshade::fuzz {
namespace {

constexpr DecodeLimits kLimits{.max_side = 32768, .max_bytes = std::uint64_t{1} << 24};
constexpr std::uint64_t kMostPixels = 1 << 16;  // whose values are looked at

void check_values(const DecodedImage& image) {
  require(image.width >= 1 && image.height >= 1 && !image.channels.empty(), "a picture has pixels");
  const std::size_t count = std::size_t{image.width} * image.height;
  const std::size_t step = 1 + count / kMostPixels;
  for (std::size_t pixel = 0; pixel < count; pixel += step) {
    for (std::size_t c = 0; c < image.channels.size(); ++c) {
      const float value = image.value(pixel, c);
      const auto format = image.channels[c].format;
      if (format == DecodedImage::Format::kUint8 || format == DecodedImage::Format::kUint16) {
        require(value >= 0.0f && value <= 1.0f, "codes are 0..1");
      }
      if (format == DecodedImage::Format::kUint32) image.uint32_value(pixel, c);
    }
  }
  for (const auto& channel : image.channels) require(image.find_channel(channel.name) >= 0, "channels are found");
}

void check_texture(const std::filesystem::path& file) {
  TextureSet textures;
  const auto request = textures.request(file, TextureKind::kColor);
  textures.request(file, TextureKind::kAlpha);
  Scene scene;
  textures.load(scene, kLimits.max_bytes);
  const ColorMap& color = scene.color_maps[textures.color_map(request)];
  const AlphaMap& alpha = scene.alpha_maps[textures.alpha_map(request)];
  const std::size_t count = std::size_t{color.width} * color.height;
  require(color.rgb.size() == count * 3 && alpha.alpha.size() == count, "a texture has its texels");
}

}  // namespace

void fuzz_image(Bytes input) {
  const auto file = write_file("input.picture", as_text(input));
  DecodedImage image;
  const Refusal refusal = refusal_of([&] { image = decode_image(file, kLimits); });
  if (refusal.refused) {
    require(refusal.message.find("input.picture") != std::string::npos, "messages name the file");
    return;
  }
  check_values(image);
  if (std::uint64_t{image.width} * image.height > kMostPixels) return;  // slow, and nothing new
  refusal_of([&] { check_texture(file); });
  refusal_of([&] {
    for (const vec3& c : load_emission_image(file).rgb) {
      for (int k = 0; k < 3; ++k) require(std::isfinite(c[k]) && c[k] >= 0.0f, "emission is finite and not negative");
    }
  });
}

}  // namespace halfshade::fuzz
