// Checksums of PNG chunks, for inputs that have been tampered with.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

namespace halfshade::fuzz {

inline std::uint32_t png_crc(std::span<const std::uint8_t> bytes) {
  std::uint32_t crc = ~0u;
  for (const std::uint8_t byte : bytes) {
    crc ^= byte;
    for (int k = 0; k < 8; ++k) crc = crc >> 1 ^ ((crc & 1) != 0 ? 0xedb88320u : 0u);
  }
  return ~crc;
}

/// Writes the right checksum behind every whole chunk; leaves anything but a PNG alone.
inline void repair_png(std::span<std::uint8_t> file) {
  if (file.size() < 8 || std::memcmp(file.data(), "\x89PNG\r\n\x1a\n", 8) != 0) return;
  for (std::size_t at = 8; file.size() - at >= 12;) {
    std::size_t length = 0;
    for (std::size_t k = 0; k < 4; ++k) length = length << 8 | file[at + k];
    if (length > file.size() - at - 12) return;
    const std::uint32_t crc = png_crc(file.subspan(at + 4, length + 4));
    for (std::size_t k = 0; k < 4; ++k) file[at + 8 + length + k] = static_cast<std::uint8_t>(crc >> (24 - 8 * k));
    at += 12 + length;
  }
}

}  // namespace halfshade::fuzz
