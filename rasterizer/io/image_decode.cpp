#include "rasterizer/io/image_decode.h"

#include <algorithm>
#include <array>
#include <cstring>

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/half.h>
#include <OpenImageIO/imageio.h>
#include <fmt/format.h>

#include "halfshade/error.h"
#include "rasterizer/io/exr_header.h"
#include "rasterizer/io/input_file.h"

namespace halfshade {
namespace {

using Format = DecodedImage::Format;

std::uint32_t big_endian(std::string_view bytes, std::size_t at, std::size_t count) {
  std::uint32_t value = 0;
  for (std::size_t k = 0; k < count; ++k) value = value << 8 | static_cast<unsigned char>(bytes[at + k]);
  return value;
}

constexpr std::string_view kPngMagic = "\x89PNG\r\n\x1a\n", kJpegMagic = "\xff\xd8\xff", kExrMagic = "\x76\x2f\x31\x01";

/// OpenImageIO's name of the reader, or empty.
const char* format_of(std::string_view bytes) {
  if (bytes.starts_with(kPngMagic)) return "png";
  if (bytes.starts_with(kJpegMagic)) return "jpeg";
  if (bytes.starts_with(kExrMagic)) return "openexr";
  return "";
}

// The checksum of PNG chunks (ISO 3309), by the byte.
std::uint32_t crc32(std::string_view bytes) {
  static const std::array<std::uint32_t, 256> table = [] {
    std::array<std::uint32_t, 256> values{};
    for (std::uint32_t i = 0; i < 256; ++i) {
      std::uint32_t c = i;
      for (int k = 0; k < 8; ++k) c = (c >> 1) ^ ((c & 1) != 0 ? 0xedb88320u : 0u);
      values[i] = c;
    }
    return values;
  }();
  std::uint32_t crc = ~0u;
  for (const char c : bytes) crc = (crc >> 8) ^ table[(crc ^ static_cast<unsigned char>(c)) & 0xff];
  return ~crc;
}

// The pixels that the header promises can come out of so many bytes: deflate expands at most 1032 times, so a few bytes
// that claim a gigabyte are known for what they are before memory is set aside.
bool has_credible_png_header(std::string_view bytes) {
  constexpr std::uint64_t kMostExpansion = 1032;
  constexpr std::uint32_t kLargestSide = 0x7fffffff;
  constexpr std::uint32_t kChannelsOfColorType[7] = {1, 0, 3, 1, 2, 0, 4};
  if (bytes.size() < 33 || bytes.substr(12, 4) != "IHDR") return false;
  const std::uint32_t width = big_endian(bytes, 16, 4), height = big_endian(bytes, 20, 4);
  const std::uint32_t depth = big_endian(bytes, 24, 1), color_type = big_endian(bytes, 25, 1);
  if (width == 0 || width > kLargestSide || height == 0 || height > kLargestSide || depth > 16 || color_type > 6) {
    return false;
  }
  const std::uint64_t row_bytes = std::uint64_t{width} * depth * kChannelsOfColorType[color_type] / 8;
  return row_bytes <= bytes.size() * kMostExpansion / height;
}

// All chunks up to IEND are there and undamaged. libpng would find that out too, but prints its complaints.
bool is_whole_png(std::string_view bytes) {
  if (!has_credible_png_header(bytes)) return false;
  for (std::size_t at = kPngMagic.size(); bytes.size() - at >= 12;) {
    const std::uint32_t length = big_endian(bytes, at, 4);
    if (length > bytes.size() - at - 12) return false;
    if (crc32(bytes.substr(at + 4, length + std::size_t{4})) != big_endian(bytes, at + 8 + length, 4)) return false;
    if (bytes.substr(at + 4, 4) == "IEND") return true;
    at += 12 + std::size_t{length};
  }
  return false;
}

// A block of 8 x 8 samples takes at least one bit, so a few bytes that claim a gigabyte are known for what they are:
// libjpeg would fill it with grey. `frame` is a start-of-frame segment behind its length.
bool is_credible_jpeg_frame(std::string_view frame, std::size_t file_bytes) {
  constexpr std::uint64_t kMostExpansion = 1024;  // pixels per byte, twice what the above allows
  if (frame.size() < 5) return false;
  return std::uint64_t{big_endian(frame, 1, 2)} * big_endian(frame, 3, 2) <= file_bytes * kMostExpansion;
}

bool is_frame_marker(std::uint32_t marker) {  // but for the tables that share its range
  return marker >= 0xffc0 && marker <= 0xffcf && marker != 0xffc4 && marker != 0xffc8 && marker != 0xffcc;
}

// Walks the segments to the end-of-image marker: libjpeg fills what is missing with grey and only warns.
bool is_whole_jpeg(std::string_view bytes) {
  std::size_t at = 2;
  while (at + 4 <= bytes.size() || at + 2 == bytes.size()) {
    const std::uint32_t marker = big_endian(bytes, at, 2);
    if (marker == 0xffd9) return true;
    if (marker == 0xffff) {
      ++at;
      continue;
    }  // padding
    if (marker < 0xff01 || at + 4 > bytes.size()) return false;
    if (is_frame_marker(marker) && !is_credible_jpeg_frame(bytes.substr(at + 4), bytes.size())) return false;
    at += 2 + std::size_t{big_endian(bytes, at + 2, 2)};
    if (marker != 0xffda) continue;
    // Entropy-coded data: up to a marker that is neither a stuffed zero nor a restart.
    for (; at + 2 <= bytes.size(); ++at) {
      if (bytes[at] != '\xff') continue;
      const std::uint32_t code = big_endian(bytes, at + 1, 1);
      if (code != 0 && code != 0xff && (code < 0xd0 || code > 0xd7)) break;
    }
  }
  return false;
}

std::size_t bytes_of(Format format) {
  switch (format) {
    case Format::kUint8:
      return 1;
    case Format::kUint16:
    case Format::kHalf:
      return 2;
    case Format::kUint32:
    case Format::kFloat:
      return 4;
  }
  return 0;
}

bool to_format(OIIO::TypeDesc type, Format& format) {
  switch (type.basetype) {
    case OIIO::TypeDesc::UINT8:
      format = Format::kUint8;
      return true;
    case OIIO::TypeDesc::UINT16:
      format = Format::kUint16;
      return true;
    case OIIO::TypeDesc::UINT32:
      format = Format::kUint32;
      return true;
    case OIIO::TypeDesc::HALF:
      format = Format::kHalf;
      return true;
    case OIIO::TypeDesc::FLOAT:
      format = Format::kFloat;
      return true;
    default:
      return false;
  }
}

/// OpenImageIO's reader of memory believes any offset that a file names (its issue 3711): this one gives no bytes from
/// outside. Derived, because the JPEG reader asks it for its buffer.
class MemoryReader : public OIIO::Filesystem::IOMemReader {
 public:
  explicit MemoryReader(std::string_view bytes) : IOMemReader(bytes.data(), bytes.size()) {}

  std::size_t pread(void* to, std::size_t count, std::int64_t offset) override {
    if (offset < 0 || static_cast<std::uint64_t>(offset) >= size()) return 0;
    count = std::min(count, size() - static_cast<std::size_t>(offset));
    std::memcpy(to, buffer().data() + offset, count);
    return count;
  }
  std::size_t read(void* to, std::size_t count) override {
    count = pread(to, count, m_pos);
    m_pos += static_cast<std::int64_t>(count);
    return count;
  }
};

class Decoder {
 public:
  Decoder(const std::filesystem::path& file, const DecodeLimits& limits) : file_(file), limits_(limits) {}

  DecodedImage run() {
    const std::string bytes = read_regular_file(file_, limits_.max_bytes);
    const std::string format = format_of(bytes);
    if (format.empty()) throw error("is not a PNG, JPEG or EXR picture, the only kinds allowed");
    if (format == "png" && !is_whole_png(bytes)) throw error("PNG is truncated or damaged");
    if (format == "jpeg" && !is_whole_jpeg(bytes)) throw error("JPEG is truncated or damaged");
    if (format == "openexr") check_exr_header(bytes);
    MemoryReader memory(bytes);
    const auto input = open(format, memory);
    check_spec(input->spec());
    DecodedImage image = describe(input->spec());
    image.is_linear = format == "openexr";
    image.pixels = std::make_unique_for_overwrite<std::byte[]>(image.pixel_bytes * image.width * image.height);
    if (!input->read_image(0, 0, 0, -1, OIIO::TypeDesc::UNKNOWN, image.pixels.get()) || input->has_error()) {
      throw error("cannot be decoded: " + first_line(input->geterror()));
    }
    return image;
  }

 private:
  Error error(const std::string& what, ErrorCode code = ErrorCode::kBadInput) const {
    return Error(code, fmt::format("{}: {}", file_.string(), what));
  }

  void check_exr_header(std::string_view bytes) const {
    const auto buffer = exr_buffer_bytes(bytes);
    if (!buffer.has_value()) throw error("EXR is truncated or damaged");
    if (*buffer <= limits_.max_bytes) return;
    throw error(fmt::format("rows that are compressed together, or a tile, of {} bytes, allowed at most {}", *buffer,
                            limits_.max_bytes),
                ErrorCode::kLimit);
  }

  static std::string first_line(const std::string& text) { return text.substr(0, text.find('\n')); }

  OIIO::ImageInput::unique_ptr open(const std::string& format, MemoryReader& memory) const {
    auto input = OIIO::ImageInput::create(format);
    if (!input) throw error(fmt::format("OpenImageIO was built without its {} reader", format));
    OIIO::ImageSpec config, spec;
    config.attribute("oiio:UnassociatedAlpha", 1);
    if (!input->set_ioproxy(&memory)) throw error(fmt::format("the {} reader cannot read from memory", format));
    if (!input->open(file_.filename().string(), spec, config))
      throw error("cannot be read: " + first_line(input->geterror()));
    return input;
  }

  void check_spec(const OIIO::ImageSpec& spec) const {
    const auto side_fits = [&](int side) { return side >= 1 && static_cast<std::uint32_t>(side) <= limits_.max_side; };
    if (!side_fits(spec.width) || !side_fits(spec.height)) {
      throw error(fmt::format("{} x {} pixels, allowed 1..{} each", spec.width, spec.height, limits_.max_side),
                  ErrorCode::kLimit);
    }
    if (spec.deep || spec.depth != 1 || spec.nchannels < 1) throw error("is not a flat picture");
    const std::uint64_t bytes = spec.image_bytes(true);
    if (bytes > limits_.max_bytes) {
      throw error(fmt::format("{} bytes of pixels, allowed at most {}", bytes, limits_.max_bytes), ErrorCode::kLimit);
    }
  }

  DecodedImage describe(const OIIO::ImageSpec& spec) const {
    DecodedImage image;
    image.width = static_cast<std::uint32_t>(spec.width);
    image.height = static_cast<std::uint32_t>(spec.height);
    for (int c = 0; c < spec.nchannels; ++c) {
      Format format{};
      if (!to_format(spec.channelformat(c), format)) throw error("has pixels of a type that is not supported");
      image.channels.push_back({spec.channel_name(c), format, image.pixel_bytes});
      image.pixel_bytes += bytes_of(format);
    }
    for (const OIIO::ParamValue& attribute : spec.extra_attribs) {
      if (attribute.type() == OIIO::TypeString)
        image.attributes.emplace_back(attribute.name().string(), attribute.get_string());
    }
    return image;
  }

  const std::filesystem::path& file_;
  const DecodeLimits& limits_;
};

template <class T>
T load(const std::byte* at) {
  T value;
  std::memcpy(&value, at, sizeof value);
  return value;
}

}  // namespace

float DecodedImage::value(std::size_t pixel, std::size_t channel) const {
  const std::byte* const at = pixels.get() + pixel * pixel_bytes + channels[channel].offset;
  switch (channels[channel].format) {
    case Format::kUint8:
      return static_cast<float>(load<std::uint8_t>(at)) / 255.0f;
    case Format::kUint16:
      return static_cast<float>(load<std::uint16_t>(at)) / 65535.0f;
    case Format::kUint32:
      return static_cast<float>(load<std::uint32_t>(at));
    case Format::kHalf:
      return static_cast<float>(load<half>(at));
    case Format::kFloat:
      return load<float>(at);
  }
  return 0.0f;
}

std::uint32_t DecodedImage::uint32_value(std::size_t pixel, std::size_t channel) const {
  return load<std::uint32_t>(pixels.get() + pixel * pixel_bytes + channels[channel].offset);
}

int DecodedImage::find_channel(std::string_view name) const {
  for (std::size_t c = 0; c < channels.size(); ++c) {
    if (channels[c].name == name) return static_cast<int>(c);
  }
  return -1;
}

DecodedImage decode_image(const std::filesystem::path& file, const DecodeLimits& limits) {
  return Decoder(file, limits).run();
}

}  // namespace halfshade
