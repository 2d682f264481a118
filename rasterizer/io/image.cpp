#include "rasterizer/io/image.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/half.h>
#include <OpenImageIO/imageio.h>
#include <fmt/format.h>

#include "halfshade/error.h"
#include "rasterizer/core/parallel.h"
#include "rasterizer/io/atomic_file.h"
#include "rasterizer/io/image_decode.h"
#include "rasterizer/io/srgb.h"

namespace halfshade {
namespace {

using Type = ImageChannel::Type;

// Encoded in memory, then written by our own code: the writers of OpenImageIO do not report every failed write.
void write_encoded(const std::filesystem::path& path, const char* format, OIIO::ImageSpec& spec,
                   const ImageAttributes& attributes, const void* pixels) {
  const auto fail = [&](const std::string& reason) {
    throw Error(ErrorCode::kOutput, fmt::format("{}: cannot encode as {}: {}", path.string(), format, reason));
  };
  for (const auto& [name, text] : attributes) spec.attribute(name, text);
  OIIO::Filesystem::IOVecOutput memory;
  const auto output = OIIO::ImageOutput::create(format);
  if (!output) fail("OpenImageIO was built without this writer");
  if (!output->set_ioproxy(&memory)) fail("the writer cannot write to memory");
  if (!output->open(path.filename().string(), spec)) fail(output->geterror());
  if (!output->write_image(OIIO::TypeDesc::UNKNOWN, pixels)) fail(output->geterror());
  if (!output->close()) fail(output->geterror());
  write_file_atomically(path, {reinterpret_cast<const char*>(memory.buffer().data()), memory.buffer().size()});
}

void require(bool condition, const std::filesystem::path& path, const std::string& what) {
  if (!condition) throw Error(ErrorCode::kUsage, fmt::format("{}: {}", path.string(), what));
}

OIIO::TypeDesc type_in_file(Type type) {
  return type == Type::kHalf ? OIIO::TypeHalf : type == Type::kFloat ? OIIO::TypeFloat : OIIO::TypeUInt32;
}

half to_half(float x) {
  constexpr float kLargestHalf = 65504.0f;
  return half(std::isfinite(x) ? std::clamp(x, -kLargestHalf, kLargestHalf) : x);
}

// Copies one channel into the interleaved pixels, `offset` bytes into each.
void interleave(const ImageChannel& channel, std::size_t count, std::size_t offset, std::size_t pixel_bytes,
                unsigned char* pixels) {
  const char* const source = static_cast<const char*>(channel.data);
  parallel_ranges(count, 16384, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) {
      unsigned char* const target = pixels + i * pixel_bytes + offset;
      if (channel.type == Type::kHalf) {
        float value = 0.0f;
        std::memcpy(&value, source + i * sizeof value, sizeof value);
        const half rounded = to_half(value);
        std::memcpy(target, &rounded, sizeof rounded);
      } else {
        std::memcpy(target, source + i * 4, 4);
      }
    }
  });
}

template <class Code>
std::vector<Code> encode_values(std::span<const float> values, bool srgb) {
  constexpr int kBits = 8 * sizeof(Code);
  std::vector<Code> codes(values.size());
  parallel_ranges(values.size(), 16384, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) {
      codes[i] = static_cast<Code>(srgb ? encode_srgb(values[i], kBits) : encode_linear(values[i], kBits));
    }
  });
  return codes;
}

DecodedImage decode_result(const std::filesystem::path& path) {
  return decode_image(path, {.max_bytes = std::uint64_t{16} << 30});
}

}  // namespace

void write_exr(const std::filesystem::path& path, std::uint32_t width, std::uint32_t height,
               std::span<const ImageChannel> channels, const ImageAttributes& attributes) {
  require(!channels.empty() && width > 0 && height > 0, path, "an EXR needs pixels and channels");
  OIIO::ImageSpec spec(static_cast<int>(width), static_cast<int>(height), static_cast<int>(channels.size()));
  spec.channelnames.clear();
  std::vector<std::size_t> offsets;
  std::size_t pixel_bytes = 0;
  for (const ImageChannel& channel : channels) {
    spec.channelnames.push_back(channel.name);
    spec.channelformats.push_back(type_in_file(channel.type));
    offsets.push_back(pixel_bytes);
    pixel_bytes += spec.channelformats.back().size();
  }
  spec.attribute("compression", "zip");
  spec.attribute("DateTime", "");  // otherwise the writer stores the current time
  const std::size_t count = std::size_t{width} * height;
  std::vector<unsigned char> pixels(count * pixel_bytes);
  for (std::size_t c = 0; c < channels.size(); ++c)
    interleave(channels[c], count, offsets[c], pixel_bytes, pixels.data());
  write_encoded(path, "openexr", spec, attributes, pixels.data());
}

void write_png(const std::filesystem::path& path, std::uint32_t width, std::uint32_t height, std::uint32_t channels,
               std::span<const float> values_linear, bool srgb, int bits, const ImageAttributes& attributes) {
  require(channels == 1 || channels == 3, path, fmt::format("{} channels, allowed 1 or 3", channels));
  require(bits == 8 || bits == 16, path, fmt::format("{} bits, allowed 8 or 16", bits));
  const std::size_t expected = std::size_t{width} * height * channels;
  require(expected != 0 && values_linear.size() == expected, path,
          fmt::format("{} values for {} x {} x {}", values_linear.size(), width, height, channels));
  OIIO::ImageSpec spec(static_cast<int>(width), static_cast<int>(height), static_cast<int>(channels),
                       bits == 8 ? OIIO::TypeUInt8 : OIIO::TypeUInt16);
  if (srgb) spec.attribute("oiio:ColorSpace", "sRGB");
  if (bits == 8) {
    write_encoded(path, "png", spec, attributes, encode_values<std::uint8_t>(values_linear, srgb).data());
  } else {
    write_encoded(path, "png", spec, attributes, encode_values<std::uint16_t>(values_linear, srgb).data());
  }
}

FloatImage read_image(const std::filesystem::path& path) {
  DecodedImage decoded = decode_result(path);
  FloatImage image;
  image.width = decoded.width;
  image.height = decoded.height;
  image.attributes = std::move(decoded.attributes);
  for (const DecodedImage::Channel& channel : decoded.channels) image.channel_names.push_back(channel.name);
  const std::size_t count = std::size_t{decoded.width} * decoded.height, channels = decoded.channels.size();
  image.values.reserve(count * channels);
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t c = 0; c < channels; ++c) image.values.push_back(decoded.value(i, c));
  }
  return image;
}

std::vector<std::uint32_t> read_uint32_channel(const std::filesystem::path& path, const std::string& name) {
  const DecodedImage decoded = decode_result(path);
  const int channel = decoded.find_channel(name);
  const bool fits =
      channel >= 0 && decoded.channels[static_cast<std::size_t>(channel)].format == DecodedImage::Format::kUint32;
  if (!fits) throw Error(ErrorCode::kBadInput, fmt::format("{}: no uint32 channel '{}'", path.string(), name));
  std::vector<std::uint32_t> values(std::size_t{decoded.width} * decoded.height);
  for (std::size_t i = 0; i < values.size(); ++i)
    values[i] = decoded.uint32_value(i, static_cast<std::size_t>(channel));
  return values;
}

}  // namespace halfshade
