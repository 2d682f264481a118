#include "mask_file.h"

#include <fmt/format.h>

#include "halfshade/error.h"
#include "rasterizer/io/npy.h"

namespace halfshade {

void write_masks(const std::filesystem::path& path, const VisibilityMasks& masks) {
  // Words are little-endian, so this only drops the padding.
  const std::size_t bytes = (masks.sample_count + 7) / 8;
  std::vector<std::uint8_t> values(masks.receiver_count * bytes);
  for (std::size_t r = 0; r < masks.receiver_count; ++r) {
    for (std::size_t b = 0; b < bytes; ++b) {
      values[r * bytes + b] = static_cast<std::uint8_t>(masks.mask(r)[b / 8] >> (b % 8 * 8));
    }
  }
  write_npy(path, "u1", std::array{masks.receiver_count, bytes}, values.data());
}

void read_masks(const std::filesystem::path& path, std::size_t receivers, std::uint32_t samples,
                VisibilityMasks& masks) {
  const std::size_t bytes = (samples + 7) / 8;
  const NpyArray array = read_npy(path, receivers * bytes + 65536);
  if (array.shape != std::vector{receivers, bytes}) {
    throw Error(ErrorCode::kBadInput, fmt::format("{}: the array's shape is ({}), expected ({}, {})", path.string(),
                                                  fmt::join(array.shape, ", "), receivers, bytes));
  }
  if (array.dtype != "u1")
    throw Error(ErrorCode::kBadInput, fmt::format("{}: array of '{}', allowed 'u1'", path.string(), array.dtype));
  const std::span<const std::uint8_t> values = array.as<std::uint8_t>();
  const auto unused = static_cast<std::uint8_t>(samples % 8 == 0 ? 0 : 0xff << samples % 8);
  masks.reset(receivers, samples);
  for (std::size_t i = 0; i < values.size(); ++i) {
    const std::size_t r = i / bytes, b = i % bytes;
    if (b + 1 == bytes && (values[i] & unused) != 0) {
      throw Error(ErrorCode::kBadInput,
                  fmt::format("{}: the mask of receiver {} has bits behind its {} samples", path.string(), r, samples));
    }
    masks.words[r * masks.words_per_receiver + b / 8] |= std::uint64_t{values[i]} << (b % 8 * 8);
  }
}

}  // namespace halfshade
