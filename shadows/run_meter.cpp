#include "shadows/run_meter.h"

#include <algorithm>
#include <bit>
#include <cassert>

// Plain code, compiled for every target: where there is an instruction that counts bits, it is used.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "shadows/run_meter.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace halfshade {
namespace HWY_NAMESPACE {

/// What lies one row below the samples of word i.
HWY_INLINE std::uint64_t Below(const RunMeter& meter, const RunMeter::Words& mask, std::size_t i) {
  return meter.two_rows ? mask[i] >> 32 | mask[i + 1] << 32 : mask[i + 1];
}

HWY_INLINE std::uint32_t Count(std::uint64_t bits) { return static_cast<std::uint32_t>(std::popcount(bits)); }

/// Sum of the squares of the lengths of runs; next(z, below z, word) says where the next sample along the run is in z.
template <class Next>
HWY_INLINE std::uint32_t SquaredRuns(const RunMeter& meter, RunMeter::Words starts, const Next& next) {
  std::uint32_t sum = 0, all = 0;  // of runs of at least 1, 2, 3 ... samples: L (L + 1) / 2 for a run of L
  for (bool first = true;; first = false) {
    std::uint32_t count = 0;
    for (std::size_t i = 0; i < meter.words; ++i) count += Count(starts[i]);
    if (first) all = count;
    if (count == 0) return 2 * sum - all;
    sum += count;
    for (std::size_t i = 0; i < meter.words; ++i) {
      starts[i] &= next(starts[i], Below(meter, starts, i) & meter.has_below[i], i);
    }
  }
}

std::uint32_t Roughness(const RunMeter& meter, const RunMeter::Words& mask) {
  RunMeter::Words down{}, right{};  // samples that see something else than the one below them, or on their right
  std::uint32_t differ = 0;
  for (std::size_t i = 0; i < meter.words; ++i) {
    down[i] = (mask[i] ^ Below(meter, mask, i)) & meter.has_below[i];
    right[i] = (mask[i] ^ mask[i] >> 1) & meter.not_last;
    differ += Count(down[i]) + Count(right[i]);
  }
  std::uint32_t alone = 0;  // samples unlike both neighbours of a row, or of a column
  for (std::size_t i = 0; i < meter.words; ++i) {
    alone += Count(right[i] & right[i] >> 1 & meter.not_last) + Count(down[i] & Below(meter, down, i));
  }
  const auto along_row = [&](std::uint64_t z, std::uint64_t, std::size_t) { return z >> 1 & meter.not_last; };
  const auto forwards = [&](std::uint64_t, std::uint64_t z, std::size_t i) {
    return (z & ~meter.wraps[i]) | (z >> 1 & meter.not_last & meter.wraps[i]);
  };
  const auto backwards = [&](std::uint64_t, std::uint64_t z, std::size_t i) {
    return (z & meter.wraps[i]) | ((z & meter.not_last) << 1 & ~meter.wraps[i]);
  };
  return std::max({differ + 4 * alone, SquaredRuns(meter, down, along_row), SquaredRuns(meter, right, forwards),
                   SquaredRuns(meter, right, backwards)});
}

}  // namespace HWY_NAMESPACE
}  // namespace halfshade
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace halfshade {

HWY_EXPORT(Roughness);

RunMeter::RunMeter(const SetShape& shape, const SetRound& round, std::uint32_t set)
    : words(shape.size() / 64),
      samples(shape.size()),
      two_rows(shape.columns == 32),
      not_last(two_rows ? 0x7fffffff7fffffff : 0x7fffffffffffffff) {
  assert(shape.columns == 32 || shape.columns == 64);
  const std::vector<bool> row_wraps_on = row_wraps(shape, round, set);
  for (std::size_t row = 0; row + 1 < shape.rows; ++row) {
    const std::uint64_t bits = two_rows ? std::uint64_t{0xffffffff} << 32 * (row % 2) : ~std::uint64_t{0};
    const std::size_t word = two_rows ? row / 2 : row;
    has_below[word] |= bits;
    if (row_wraps_on[row]) wraps[word] |= bits;
  }
}

SetAnswer RunMeter::read(std::span<const std::uint64_t> blocked) const {
  assert(blocked.size() == words);
  std::uint64_t any = 0, all = ~std::uint64_t{0};
  for (const std::uint64_t word : blocked) any |= word, all &= word;
  if (any == 0 || ~all == 0) return {any == 0 ? samples : 0, 0};
  Words mask{};
  SetAnswer answer{samples, 0};
  for (std::size_t i = 0; i < words; ++i) {
    mask[i] = blocked[i];
    answer.visible -= static_cast<std::uint32_t>(std::popcount(mask[i]));
  }
  answer.roughness = HWY_DYNAMIC_DISPATCH(Roughness)(*this, mask);
  return answer;
}

}  // namespace halfshade
#endif
