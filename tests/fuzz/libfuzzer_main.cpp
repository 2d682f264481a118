// One target as a libFuzzer program: FUZZ_TARGET is its function.
#include <string>

#include <tbb/global_control.h>

#include "fuzz/fuzz_target.h"
#include "fuzz/png_repair.h"

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);

/// Single-threaded: what an input does must not depend on anything else.
extern "C" int LLVMFuzzerInitialize(int*, char***) {
  static const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
  halfshade::fuzz::directory();
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  halfshade::fuzz::FUZZ_TARGET({data, size});
  return 0;
}

/// A PNG with a wrong checksum gets no further than its first chunk, so mutated ones get right checksums.
extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t max_size,
                                               unsigned seed) {
  const std::size_t length = LLVMFuzzerMutate(data, size, max_size);
  if (seed % 8 != 0) halfshade::fuzz::repair_png({data, length});
  return length;
}
