// NPY arrays: read, written, read again.
#include "fuzz/fuzz_target.h"
#include "rasterizer/io/npy.h"

namespace halfshade::fuzz {
namespace {

template <class T>
void check_items(const NpyArray& array, const char* dtype) {
  const Refusal refusal = refusal_of([&] {
    std::size_t count = 1;
    for (const std::size_t size : array.shape) count *= size;
    require(array.as<T>().size() == count, "as many items as the shape says");
  });
  require(refusal.refused == (array.dtype != dtype), "items are handed out as what they are");
}

}  // namespace

void fuzz_npy(Bytes input) {
  const auto file = write_file("input.npy", as_text(input));
  NpyArray array;
  const Refusal refusal = refusal_of([&] { array = read_npy(file, 1 << 20); });
  if (refusal.refused) {
    require(refusal.message.find("input.npy: ") != std::string::npos, "messages name the file");
    return;
  }
  check_items<double>(array, "f8");
  check_items<float>(array, "f4");
  check_items<std::uint32_t>(array, "u4");
  check_items<std::int32_t>(array, "i4");
  check_items<std::uint8_t>(array, "u1");
  const auto copy = directory() / "again.npy";
  write_npy(copy, array.dtype, array.shape, array.data.data());
  const NpyArray again = read_npy(copy, 1 << 20);
  require(again.dtype == array.dtype && again.shape == array.shape && again.data == array.data, "every bit comes back");
}

}  // namespace halfshade::fuzz
