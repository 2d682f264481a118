#include "rasterizer/io/emission_file.h"

#include <cmath>

#include <fmt/format.h>

#include "halfshade/error.h"
#include "rasterizer/io/image_decode.h"
#include "rasterizer/io/srgb.h"

namespace halfshade {

EmissionImage load_emission_image(const std::filesystem::path& file) {
  const DecodedImage decoded = decode_image(file, {.max_side = 4096, .max_bytes = std::uint64_t{1} << 28});
  std::array<int, 3> channels = {decoded.find_channel("R"), decoded.find_channel("G"), decoded.find_channel("B")};
  if (channels[0] < 0 || channels[1] < 0 || channels[2] < 0) channels = {0, 0, 0};
  EmissionImage image{"", decoded.width, decoded.height, {}};
  const std::size_t count = std::size_t{image.width} * image.height;
  image.rgb.reserve(count);
  for (std::size_t pixel = 0; pixel < count; ++pixel) {
    vec3 color;
    for (int k = 0; k < 3; ++k) {
      const float value = decoded.value(pixel, static_cast<std::size_t>(channels[k]));
      color[k] = decoded.is_linear ? value : decode_srgb(value);
      if (std::isfinite(color[k]) && color[k] >= 0.0f) continue;
      throw Error(ErrorCode::kBadInput, fmt::format("{}: emission {} in column {}, row {}, allowed finite numbers >= 0",
                                                    file.string(), color[k], pixel % image.width, pixel / image.width));
    }
    image.rgb.push_back(color);
  }
  return image;
}

}  // namespace halfshade
