// Sets of light samples, one after the other, each a good sample of the light and their union a better one.
//
// Rectangles get rows (sample_rows.h), so that the fast kernel serves them. Rows are a lattice, and every lattice is
// weak for some directions of a blocker's edge: those of its shortest vectors, above all that of the rows. So rounds of
// sets take turns, rows along u and along v, and the sets of a round are rows between each other's: a finer lattice
// together, centred on the light as each single one of several is not. (Rows tilted by one row over their length are
// never weak for edges along the axes, but their ends are off centre: for half-planes at other angles they err twice as
// much.) Other shapes get scrambled (0,2)-sequences, one per set.
#pragma once

#include "shadows/light_samples.h"

namespace halfshade {

/// Does the light get rows?
bool has_row_sets(const Light& light);

/// Sets that are asked together, along v in odd rounds; `first` of them came before.
struct SetRound {
  std::uint32_t index = 0, first = 0, count = 1;
};
inline constexpr SetRound kSetRounds[] = {{0, 0, 1}, {1, 1, 1},  {2, 2, 2},  {3, 4, 2},
                                          {4, 6, 4}, {5, 10, 4}, {6, 14, 8}, {7, 22, 8}};

/// Samples of a set: powers of two in 8..64.
struct SetShape {
  std::uint32_t rows = 32, columns = 32;
  std::uint32_t size() const { return rows * columns; }
};

/// The sets of a round. `st` of rows numbers the rows and is good for find_sample_rows only.
LightSamples make_sets(const Light& light, const ShadowConfig& config, const LocalFrame& frame, const SetShape& shape,
                       const SetRound& round);

/// Rows: from row j to row j + 1 of a set the lattice moves on by a fraction of a column; [j] is true where that leads
/// from sample i of row j to sample i + 1 of the next, not to sample i.
std::vector<bool> row_wraps(const SetShape& shape, const SetRound& round, std::uint32_t set);

}  // namespace halfshade
