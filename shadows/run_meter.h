// How far off may a share of visible samples be, to judge by which ones are visible?
#pragma once

#include <array>
#include <span>

#include "shadows/set_sequence.h"

namespace halfshade {

/// What a receiver sees of one set.
struct SetAnswer {
  std::uint32_t visible = 0;    // samples
  std::uint32_t roughness = 0;  // variance of `visible` around the true share, in units of 1/12 (see RunMeter)
};

/// Reads masks of a set of rows.
///
/// A sample at the outline of what is hidden stands for a cell that is hidden in part: its error is that of a number in
/// 0..1 rounded to 0 or 1, of variance 1/12. From sample to sample these errors are independent, or better, unless the
/// outline runs along the lattice: then a whole run of samples is rounded alike. The roughness is the sum of the
/// squares of the lengths of such runs, along the rows or along either of the two next directions of the lattice,
/// whichever is largest, and at least the number of neighbours that differ.
class RunMeter {
 public:
  static constexpr std::size_t kMaxWords = 64;
  using Words = std::array<std::uint64_t, kMaxWords + 1>;  // [word of the mask]; one more, empty

  /// For a set of the round; `shape.columns` is 32 or 64.
  RunMeter(const SetShape& shape, const SetRound& round, std::uint32_t set);
  SetAnswer read(std::span<const std::uint64_t> blocked) const;

  std::size_t words;
  std::uint32_t samples;
  bool two_rows;               // in a word
  std::uint64_t not_last;      // samples with a neighbour on the right
  Words has_below{}, wraps{};  // samples with a row below them; of which row_wraps says so
};

}  // namespace halfshade
