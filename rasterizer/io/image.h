// Pictures written and read back: EXR for values, PNG for looking at. Equal input gives equal bytes.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace halfshade {

struct ImageChannel {
  enum class Type { kHalf, kFloat, kUint32 };
  std::string name;         // "R", "N.X", "id.I"
  Type type = Type::kHalf;  // in the file
  const void* data;         // [height][width] of float (kHalf, kFloat) or std::uint32_t (kUint32), row 0 = top
};

/// Text stored with the picture, for example {"method", "exact"}.
using ImageAttributes = std::vector<std::pair<std::string, std::string>>;

/// Finite values beyond the range of half are clamped to it. Atomic. Throws Error{kOutput}.
void write_exr(const std::filesystem::path& path, std::uint32_t width, std::uint32_t height,
               std::span<const ImageChannel> channels, const ImageAttributes& attributes);

/// `values_linear` is [height][width][channels], channels 1 or 3, bits 8 or 16. With `srgb` the sRGB curve is applied,
/// else 0..1 is stored as it is. Rounds to nearest; NaN and negative values give 0. Atomic.
/// Throws Error{kUsage} for other counts, Error{kOutput}.
void write_png(const std::filesystem::path& path, std::uint32_t width, std::uint32_t height, std::uint32_t channels,
               std::span<const float> values_linear, bool srgb, int bits, const ImageAttributes& attributes);

struct FloatImage {
  std::uint32_t width = 0, height = 0;
  std::vector<std::string> channel_names;
  std::vector<float> values;   // [height][width][channel]
  ImageAttributes attributes;  // text only
};

/// PNG and JPEG values as 0..1 without removing the sRGB curve, EXR values as stored (uint32 rounded to float).
/// Throws Error{kBadInput} or Error{kLimit}.
FloatImage read_image(const std::filesystem::path& path);

/// One uint32 channel of an EXR, exactly: [height][width]. Throws as read_image.
std::vector<std::uint32_t> read_uint32_channel(const std::filesystem::path& path, const std::string& name);

}  // namespace halfshade
