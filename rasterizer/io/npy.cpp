#include "rasterizer/io/npy.h"

#include <bit>
#include <charconv>
#include <cstring>
#include <limits>

#include <fmt/format.h>

#include "halfshade/error.h"
#include "rasterizer/io/atomic_file.h"
#include "rasterizer/io/input_file.h"

static_assert(std::endian::native == std::endian::little, "array bytes are written as they lie in memory");

namespace halfshade {
namespace {

constexpr std::string_view kMagic = "\x93NUMPY";

/// 0 for an unknown dtype.
std::size_t item_bytes(std::string_view dtype) {
  if (dtype == "f8") return 8;
  if (dtype == "f4" || dtype == "u4" || dtype == "i4") return 4;
  return dtype == "u1" ? 1 : 0;
}

std::string make_header(std::string_view dtype, std::span<const std::size_t> shape) {
  std::string sizes;
  for (const std::size_t size : shape) sizes += fmt::format("{}, ", size);
  if (shape.size() > 1) sizes.resize(sizes.size() - 2);
  if (shape.size() == 1) sizes.resize(sizes.size() - 1);  // "(3,)"
  std::string header = fmt::format("{{'descr': '{}{}', 'fortran_order': False, 'shape': ({}), }}",
                                   dtype == "u1" ? '|' : '<', dtype, sizes);
  while ((kMagic.size() + 4 + header.size() + 1) % 64 != 0) header += ' ';  // data aligned to 64 bytes
  return header + '\n';
}

// Reads the one form of Python dictionary that the format allows.
class HeaderParser {
 public:
  HeaderParser(std::string_view text, NpyArray& array) : rest_(text), array_(array) {}

  bool run() {
    if (!accept("{")) return false;
    bool has_descr = false, has_order = false, has_shape = false;
    while (!accept("}")) {
      std::string_view key;
      if (!read_string(key) || !accept(":")) return false;
      if (key == "descr" && !has_descr)
        has_descr = read_descr();
      else if (key == "fortran_order" && !has_order)
        has_order = accept("False");
      else if (key == "shape" && !has_shape)
        has_shape = read_shape();
      else
        return false;
      if (!accept(",") && !rest_.starts_with('}')) return false;
    }
    skip_blanks();
    return has_descr && has_order && has_shape && rest_.empty();
  }

 private:
  void skip_blanks() {
    while (!rest_.empty() && (rest_.front() == ' ' || rest_.front() == '\n')) rest_.remove_prefix(1);
  }

  bool accept(std::string_view token) {
    skip_blanks();
    if (!rest_.starts_with(token)) return false;
    rest_.remove_prefix(token.size());
    skip_blanks();
    return true;
  }

  bool read_string(std::string_view& text) {
    if (!accept("'")) return false;
    const std::size_t end = rest_.find('\'');
    if (end == std::string_view::npos) return false;
    text = rest_.substr(0, end);
    rest_.remove_prefix(end);
    return accept("'");
  }

  bool read_descr() {
    std::string_view descr;
    if (!read_string(descr) || descr.size() < 2) return false;
    array_.dtype = descr.substr(1);
    return item_bytes(array_.dtype) != 0 && (descr[0] == '<' || (descr[0] == '|' && array_.dtype == "u1"));
  }

  bool read_shape() {
    if (!accept("(")) return false;
    while (!accept(")")) {
      std::size_t size = 0;
      const auto [end, fault] = std::from_chars(rest_.data(), rest_.data() + rest_.size(), size);
      if (fault != std::errc{}) return false;
      rest_.remove_prefix(static_cast<std::size_t>(end - rest_.data()));
      array_.shape.push_back(size);
      if (!accept(",") && !rest_.starts_with(')')) return false;
    }
    return true;
  }

  std::string_view rest_;
  NpyArray& array_;
};

/// False when the product does not fit.
bool count_bytes(const NpyArray& array, std::size_t& bytes) {
  bytes = item_bytes(array.dtype);
  for (const std::size_t size : array.shape) {
    if (__builtin_mul_overflow(bytes, size, &bytes)) return false;
  }
  return true;
}

}  // namespace

void write_npy(const std::filesystem::path& path, std::string_view dtype, std::span<const std::size_t> shape,
               const void* data) {
  std::size_t bytes = item_bytes(dtype);
  if (bytes == 0) throw Error(ErrorCode::kUsage, fmt::format("dtype '{}', allowed f8, f4, u4, i4, u1", dtype));
  for (const std::size_t size : shape) bytes *= size;
  const std::string header = make_header(dtype, shape);
  const auto length = static_cast<std::uint16_t>(header.size());
  const char version_and_length[4] = {1, 0, static_cast<char>(length & 0xff), static_cast<char>(length >> 8)};
  AtomicFile file(path);
  file.write(kMagic.data(), kMagic.size());
  file.write(version_and_length, sizeof version_and_length);
  file.write(header.data(), header.size());
  file.write(data, bytes);
  file.commit();
}

void NpyArray::require_dtype(std::string_view wanted) const {
  if (dtype != wanted) throw Error(ErrorCode::kBadInput, fmt::format("array of '{}', allowed '{}'", dtype, wanted));
}

NpyArray read_npy(const std::filesystem::path& path, std::uint64_t max_bytes) {
  const auto fail = [&](const std::string& what) -> Error {
    return Error(ErrorCode::kBadInput, fmt::format("{}: {}", path.string(), what));
  };
  const std::string file = read_regular_file(path, max_bytes);
  if (file.size() < 10 || !file.starts_with(kMagic)) throw fail("is not an NPY file");
  if (file[6] != 1 || file[7] != 0)
    throw fail(fmt::format("NPY version {}.{}, allowed 1.0", int{file[6]}, int{file[7]}));
  const std::size_t length = static_cast<unsigned char>(file[8]) | std::size_t{static_cast<unsigned char>(file[9])}
                                                                       << 8;
  if (file.size() < 10 + length) throw fail("NPY header is truncated");
  NpyArray array;
  const std::string_view header = std::string_view(file).substr(10, length);
  if (!HeaderParser(header, array).run()) {
    throw fail("NPY header " + in_quotes(header) + " is not a C-order array of <f8, <f4, <u4, <i4 or |u1");
  }
  std::size_t bytes = 0;
  if (!count_bytes(array, bytes) || file.size() - 10 - length != bytes) {
    throw fail(fmt::format("{} bytes of data, but the header says {}", file.size() - 10 - length,
                           bytes == 0 ? "otherwise" : std::to_string(bytes)));
  }
  array.data.resize(bytes);
  if (bytes != 0) std::memcpy(array.data.data(), file.data() + 10 + length, bytes);
  return array;
}

}  // namespace halfshade
