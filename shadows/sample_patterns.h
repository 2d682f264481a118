// Sample patterns in the unit square: pure functions of (pattern, count, set, seed), integer arithmetic and exact
// scaling only, so that equal arguments give equal bits everywhere.
#pragma once

#include <span>

#include "halfshade/shadows.h"

namespace halfshade {

/// Sets first_set, first_set + 1, ... of `count` different points in [0,1)^2, [set][sample]. A set depends on its own
/// number alone.
///   rows, uniform, stratified  samples ordered by rows of increasing t
///   low-discrepancy            nested: the first n points do not depend on `count`. Every first 2^m points have
///   exactly
///                              one in each elementary interval of area 2^-m (Sobol' 1967, scrambled as Owen 1995)
///   poisson-disk               nested. Any two of the first n points, n > 1, lie at least 0.65 sqrt(2 / (sqrt(3) n))
///                              apart on the torus: 65 % of what the best possible arrangement reaches (found by
///                              measuring seeds 0..59 up to n = 4096; the least was 66.6 %). Sets are shifted copies
/// `count` is at most 4096. `reuse` gives its memory.
std::vector<dvec2> unit_square_samples(SamplePattern pattern, std::uint32_t count, std::uint32_t first_set,
                                       std::uint32_t sets, std::uint32_t seed, std::vector<dvec2> reuse = {});

/// Rows of a disk of diameter 1 around (1/2, 1/2), which is what SamplePattern::kRows is for disks in set 0: equally
/// high rows whose numbers of points follow their areas, with one pitch in all rows; each off the middle by its own
/// quarter of that at most. Fills `points`.
void disk_rows(std::span<dvec2> points);
std::uint32_t disk_row_count(std::uint32_t count);

/// 1 for lights that have no pattern (points, explicit samples), else what `config` asks for.
std::uint32_t number_of_sets(const Light& light, const ShadowConfig& config);

}  // namespace halfshade
