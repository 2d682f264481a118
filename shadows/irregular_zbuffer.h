// Irregular z-buffer: receivers sorted into the cells of a light view (Johnson et al. 2005; Aila and Laine 2004),
// stored as in Sintorn, Eisemann, Assarsson 2008, section 3.1: a length and an offset per cell into one array.
#pragma once

#include "halfshade/types.h"

namespace halfshade {

struct IrregularZBuffer {
  std::vector<std::uint32_t> offsets;  // [cell]; cell c holds entries[offsets[c] .. offsets[c + 1])
  std::vector<std::uint32_t> entries;  // receiver indices, by cell, ascending within a cell
};

/// Builds the lists from the cell of each receiver (kNone = in no list): atomic count, parallel scan, fill, and a sort
/// within each cell that makes the order canonical. Equal result for any number of threads.
void build_irregular_zbuffer(std::span<const std::uint32_t> cell_of_receiver, std::uint32_t cell_count,
                             IrregularZBuffer& zbuffer);

}  // namespace halfshade
