// Sets of light samples, one after the other, each a good sample of the light and their union a better one.
//
// Rectangles get rows (sample_rows.h), so that the fast kernel serves them. A single set of rows at equal heights is
// off by half a row for a blocker's edge along the rows, however many columns it has; so the first four sets are tilted
// by one row over their length, along u and along v, upwards and downwards: no two samples share a height or a column.
// What such a set misses are edges of exactly its own slope; the others have other slopes. From the fifth set on, rows
// lie level but at a height of their own within their stripe, which goes through van der Corput's sequence from set to
// set, so that no direction stays weak for good. Other shapes get scrambled (0,2)-sequences, one per set.
#pragma once

#include "shadows/light_samples.h"

namespace halfshade {

/// Does the light get rows?
bool has_row_sets(const Light& light);

/// The first sets of rows are tilted, each in its own way; sets from here on can be made and asked together.
inline constexpr std::uint32_t kTiltedSets = 4;

/// Sets `first` .. `first + count - 1` with `side` x `side` samples (side 32 or 64), as the sets of the result. `count`
/// is 1 for tilted rows. `st` of rows numbers the rows and is good for find_sample_rows only.
LightSamples make_sets(const Light& light, const ShadowConfig& config, const LocalFrame& frame, std::uint32_t side,
                       std::uint32_t first, std::uint32_t count = 1);

}  // namespace halfshade
