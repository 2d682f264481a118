// Pictures from outside, decoded in memory by exactly one reader of OpenImageIO.
//
// What this guards against in OpenImageIO 2.4.7: it tries every reader on an unknown file (several of its faults known
// since are in readers that are not on the list here), believes any size in a header, and returns half-filled pictures
// for truncated files.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace halfshade {

struct DecodeLimits {
  std::uint32_t max_side = 32768;                    // pixels
  std::uint64_t max_bytes = std::uint64_t{1} << 30;  // of the file, and of the decoded pixels
};

/// Pixels as stored in the file, alpha not multiplied into colour; row 0 is the top.
struct DecodedImage {
  enum class Format : std::uint8_t { kUint8, kUint16, kUint32, kHalf, kFloat };
  struct Channel {
    std::string name;
    Format format;
    std::size_t offset;  // bytes from the start of a pixel
  };

  std::uint32_t width = 0, height = 0;
  bool is_linear = false;  // EXR; the others hold sRGB
  std::vector<Channel> channels;
  std::size_t pixel_bytes = 0;
  std::unique_ptr<std::byte[]>
      pixels;  // [height][width] pixels of pixel_bytes; memory that was never written costs nothing
  std::vector<std::pair<std::string, std::string>> attributes;  // text only

  /// 8- and 16-bit values as 0..1, others as stored.
  float value(std::size_t pixel, std::size_t channel) const;
  std::uint32_t uint32_value(std::size_t pixel, std::size_t channel) const;  // of a kUint32 channel
  /// Index of the channel with this name, or -1.
  int find_channel(std::string_view name) const;
};

/// PNG, JPEG or EXR, told apart by their first bytes. Throws Error{kBadInput} for anything else and for truncated or
/// damaged files, Error{kLimit} when the header asks for more than `limits`.
DecodedImage decode_image(const std::filesystem::path& file, const DecodeLimits& limits);

}  // namespace halfshade
