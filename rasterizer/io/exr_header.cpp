#include "rasterizer/io/exr_header.h"

#include <algorithm>
#include <array>
#include <utility>

namespace halfshade {
namespace {

/// The file from some place on. What is asked for beyond the end is not there, and `whole` says so from then on.
class Rest {
 public:
  explicit Rest(std::string_view bytes) : bytes_(bytes) {}

  bool whole() const { return whole_; }
  bool empty() const { return bytes_.empty(); }

  std::string_view take(std::size_t count) {
    if (count > bytes_.size()) {
      whole_ = false, bytes_ = {};
      return {};
    }
    const std::string_view taken = bytes_.substr(0, count);
    bytes_.remove_prefix(count);
    return taken;
  }

  std::uint32_t little_endian() {
    std::uint32_t value = 0;
    const std::string_view four = take(4);
    for (std::size_t k = four.size(); k-- > 0;) value = value << 8 | static_cast<unsigned char>(four[k]);
    return value;
  }

  /// A name and its zero, at most 255 characters as in OpenEXR.
  std::string_view name() {
    const std::size_t length = bytes_.substr(0, 256).find('\0');
    const std::string_view text = take(length == std::string_view::npos ? bytes_.size() + 1 : length + 1);
    return text.substr(0, text.empty() ? 0 : text.size() - 1);
  }

 private:
  std::string_view bytes_;
  bool whole_ = true;
};

constexpr std::array<std::pair<std::string_view, std::size_t>, 24> kSizes = {{
    {"box2f", 16},
    {"box2i", 16},
    {"chromaticities", 32},
    {"compression", 1},
    {"deepImageState", 1},
    {"double", 8},
    {"envmap", 1},
    {"float", 4},
    {"int", 4},
    {"keycode", 28},
    {"lineOrder", 1},
    {"m33d", 72},
    {"m33f", 36},
    {"m44d", 128},
    {"m44f", 64},
    {"rational", 8},
    {"tiledesc", 9},
    {"timecode", 8},
    {"v2d", 16},
    {"v2f", 8},
    {"v2i", 8},
    {"v3d", 24},
    {"v3f", 12},
    {"v3i", 12},
}};

/// Of one part: what its buffers are made from.
struct Part {
  std::uint64_t width = 0, pixel_bytes = 0, rows_at_once = 1;
  std::uint64_t tile_pixels = 0;

  /// Of the largest buffer. Pixels beyond any that exist are not counted on, so that the product fits.
  std::uint64_t buffer_bytes() const {
    constexpr std::uint64_t kMostPixels = std::uint64_t{1} << 34;
    return std::min(std::max(width * rows_at_once, tile_pixels), kMostPixels) * pixel_bytes;
  }
};

bool is_channel_list(Rest value, Part& part) {
  part.pixel_bytes = 0;
  while (value.whole() && !value.name().empty()) {
    constexpr std::uint32_t kHalf = 1;
    part.pixel_bytes += value.little_endian() == kHalf ? 2 : 4;
    value.take(12);
  }
  return value.whole() && value.empty();
}

bool is_string_list(Rest value) {
  while (value.whole() && !value.empty()) value.take(value.little_endian());
  return value.whole();
}

bool is_preview(Rest value, std::size_t size) {
  const std::uint64_t width = value.little_endian(), height = value.little_endian();
  return value.whole() && width < 65536 && height < 65536 && 8 + 4 * width * height == size;
}

bool has_credible_size(std::string_view type, std::string_view value, Part& part) {
  for (const auto& [known, size] : kSizes) {
    if (type == known) return value.size() == size;
  }
  if (type == "chlist") return is_channel_list(Rest(value), part);
  if (type == "stringvector") return is_string_list(Rest(value));
  if (type == "preview") return is_preview(Rest(value), value.size());
  return true;  // as long as it says
}

/// Rows that the compressor takes together (OpenEXR's file layout, "chunk"); values that it does not know yet count as
/// the largest.
std::uint64_t rows_of_compression(std::uint8_t compression) {
  constexpr std::array<std::uint16_t, 10> kRows = {1, 1, 1, 16, 32, 16, 32, 32, 32, 256};
  return compression < kRows.size() ? kRows[compression] : 256;
}

/// `value` has the size of its type.
void note(std::string_view name, std::string_view type, std::string_view value, Part& part) {
  Rest rest(value);
  if (name == "dataWindow" && type == "box2i") {
    const auto left = static_cast<std::int32_t>(rest.little_endian());
    rest.take(4);
    const auto right = static_cast<std::int32_t>(rest.little_endian());
    part.width = right < left ? 0 : static_cast<std::uint64_t>(std::int64_t{right} - left + 1);
  } else if (type == "compression") {
    part.rows_at_once = rows_of_compression(static_cast<std::uint8_t>(value[0]));
  } else if (type == "tiledesc") {
    const std::uint64_t width = rest.little_endian();
    part.tile_pixels = width * rest.little_endian();
  }
}

}  // namespace

std::optional<std::uint64_t> exr_buffer_bytes(std::string_view bytes) {
  constexpr std::uint32_t kManyParts = 0x1000;
  std::uint64_t largest = 0;
  Rest rest(bytes);
  rest.take(4);
  const bool many = (rest.little_endian() & kManyParts) != 0;
  for (bool first = true; rest.whole(); first = false) {
    std::string_view name = rest.name();
    if (name.empty() && many && !first) break;  // the end of the headers
    Part part;
    while (rest.whole() && !name.empty()) {
      const std::string_view type = rest.name(), value = rest.take(rest.little_endian());
      if (!has_credible_size(type, value, part)) return std::nullopt;
      if (rest.whole()) note(name, type, value, part);
      name = rest.name();
    }
    largest = std::max(largest, part.buffer_bytes());
    if (!many) break;
  }
  if (!rest.whole()) return std::nullopt;
  return largest;
}

}  // namespace halfshade
