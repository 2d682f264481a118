// What the fuzz targets share: their names, a directory for files, a reader for structured inputs, and how they fail.
//
// A target takes any bytes. It must come back, throw nothing, and end the process when what it checks does not hold, so
// that the same function serves libFuzzer (libfuzzer_main.cpp) and the replay of stored inputs (replay_main.cpp).
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <string_view>

#include "halfshade/error.h"

namespace halfshade::fuzz {

using Bytes = std::span<const std::uint8_t>;

void fuzz_obj(Bytes input);    // OBJ text: strict, lenient and streamed reading agree
void fuzz_mtl(Bytes input);    // MTL text
void fuzz_view(Bytes input);   // view JSON: what was read is written and read back in every bit
void fuzz_image(Bytes input);  // PNG, JPEG, EXR as texture, opacity and emission
void fuzz_npy(Bytes input);    // NPY: what was read is written and read back in every bit
void fuzz_solve(Bytes input);  // small scenes: an exact method against the oracle
void fuzz_c_api(Bytes input);  // sequences of C calls

/// Ends the process with a message where `holds` is false.
void require(bool holds, const std::string& what);

/// What a call that may refuse its input did. Anything thrown but an Error with a message and a code that bad input can
/// have ends the process; running out of memory as well.
struct Refusal {
  bool refused = false;
  std::string message;
};
Refusal refusal_of(const std::function<void()>& call);

std::string_view as_text(Bytes input);

/// A directory of this process with a material library "a.mtl" and pictures "a.png", "a.exr"; gone at the end.
const std::filesystem::path& directory();
/// Writes the file in directory().
std::filesystem::path write_file(const std::string& name, std::string_view bytes);

/// Takes values off the front of an input; zeros once it is empty.
class ByteReader {
 public:
  explicit ByteReader(Bytes input) : rest_(input) {}
  bool empty() const { return rest_.empty(); }

  template <class T>
  T take() {
    T value{};
    const std::size_t size = std::min(sizeof value, rest_.size());
    if (size != 0) std::memcpy(&value, rest_.data(), size);
    rest_ = rest_.subspan(size);
    return value;
  }
  std::uint32_t byte() { return take<std::uint8_t>(); }
  std::uint32_t below(std::uint32_t count) { return byte() % count; }  // count <= 256
  bool flag() { return (byte() & 1) != 0; }

 private:
  Bytes rest_;
};

}  // namespace halfshade::fuzz
