// NumPy's .npy arrays: version 1.0, little-endian, C order.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace halfshade {

/// `dtype` is "f8", "f4", "u4", "i4" or "u1"; `data` holds the product of `shape` items. Atomic.
/// Throws Error{kUsage} for another dtype, Error{kOutput}.
void write_npy(const std::filesystem::path& path, std::string_view dtype, std::span<const std::size_t> shape,
               const void* data);

struct NpyArray {
  std::string dtype;  // as in write_npy
  std::vector<std::size_t> shape;
  std::vector<std::byte> data;

  /// The items, row-major. Throws Error{kBadInput} when T is not the dtype's type.
  template <class T>
  std::span<const T> as() const {
    require_dtype(dtype_of(T{}));
    return {reinterpret_cast<const T*>(data.data()), data.size() / sizeof(T)};
  }

 private:
  static constexpr std::string_view dtype_of(double) { return "f8"; }
  static constexpr std::string_view dtype_of(float) { return "f4"; }
  static constexpr std::string_view dtype_of(std::uint32_t) { return "u4"; }
  static constexpr std::string_view dtype_of(std::int32_t) { return "i4"; }
  static constexpr std::string_view dtype_of(std::uint8_t) { return "u1"; }
  void require_dtype(std::string_view wanted) const;
};

/// Throws Error{kBadInput} unless the file is exactly one complete array of a known dtype in C order.
NpyArray read_npy(const std::filesystem::path& path, std::uint64_t max_bytes = std::uint64_t{64} << 30);

}  // namespace halfshade
