// Interleaved timing of contenders in one process, and the comparison of their masks.
#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "halfshade/shadows.h"

namespace halfshade::bench {

/// Wall times of one contender in milliseconds, in the order they were measured.
struct Timing {
  std::vector<double> ms;
  double median() const;
  double min() const;
  double max() const;
};

/// Runs each contender once per round, `rounds` times, so that whatever slows the machine meets all of them alike.
std::vector<Timing> measure_interleaved(const std::vector<std::function<void()>>& contenders, int rounds);

/// Bits that differ.
std::uint64_t count_differences(const VisibilityMasks& a, const VisibilityMasks& b);

double geometric_mean(const std::vector<double>& values);

/// Runs work(threads) on so many threads of TBB, 0 for all there are. Returns the program's exit code: 1 where it
/// throws, which goes to standard error.
int run_on_threads(const char* program, int threads, const std::function<void(int)>& work);

/// Machine, compiler, flags, version of the sources.
nlohmann::ordered_json run_conditions(int threads);

/// {"median_ms", "min_ms", "max_ms", "samples_ms"}
nlohmann::ordered_json timing_json(const Timing& timing);

}  // namespace halfshade::bench
