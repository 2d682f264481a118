#include "shadows/irregular_zbuffer.h"

#include <algorithm>
#include <atomic>

#include "rasterizer/core/parallel.h"

namespace halfshade {

void build_irregular_zbuffer(std::span<const std::uint32_t> cell_of_receiver, std::uint32_t cell_count,
                             IrregularZBuffer& zbuffer) {
  constexpr std::size_t kGrain = 8192;
  // The value that a counter had before its increment is the receiver's place in the list (section 3.1).
  std::vector<std::uint32_t> lengths(cell_count, 0), place(cell_of_receiver.size());
  parallel_ranges(cell_of_receiver.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) {
      if (cell_of_receiver[i] == kNone) continue;
      place[i] = std::atomic_ref(lengths[cell_of_receiver[i]]).fetch_add(1, std::memory_order_relaxed);
    }
  });
  exclusive_scan(lengths, zbuffer.offsets);
  zbuffer.entries.resize(zbuffer.offsets.back());
  parallel_ranges(cell_of_receiver.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) {
      if (cell_of_receiver[i] == kNone) continue;
      zbuffer.entries[zbuffer.offsets[cell_of_receiver[i]] + place[i]] = static_cast<std::uint32_t>(i);
    }
  });
  parallel_ranges(cell_count, kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t c = begin; c != end; ++c) {
      std::sort(zbuffer.entries.begin() + zbuffer.offsets[c], zbuffer.entries.begin() + zbuffer.offsets[c + 1]);
    }
  });
}

}  // namespace halfshade
