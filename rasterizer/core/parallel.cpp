#include "rasterizer/core/parallel.h"

namespace halfshade {

void exclusive_scan(const std::vector<std::uint32_t>& counts, std::vector<std::uint32_t>& offsets) {
  offsets.resize(counts.size() + 1);
  offsets[0] = 0;
  tbb::parallel_scan(
      tbb::blocked_range<std::size_t>(0, counts.size(), 4096), std::uint32_t{0},
      [&](const tbb::blocked_range<std::size_t>& range, std::uint32_t sum, bool is_final) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
          sum += counts[i];
          if (is_final) offsets[i + 1] = sum;
        }
        return sum;
      },
      [](std::uint32_t left, std::uint32_t right) { return left + right; });
}

}  // namespace halfshade
