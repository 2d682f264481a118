// All threading goes through here: loops that run in the TBB arena of the calling thread, on that thread alone, or in
// the host's own loop, as the current call says (run.h). Every piece of work gets the floating-point environment that
// bit-exact results need, and is a place where the call can be stopped.
//
// The loops are functions, not templates, so that TBB's headers are compiled in parallel.cpp alone: they take longer
// than most of our sources, and a piece of work is much longer than the call of a function.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "rasterizer/core/fp_environment.h"
#include "rasterizer/core/function_ref.h"
#include "rasterizer/core/reuse.h"
#include "rasterizer/core/run.h"

namespace halfshade {

/// About how many threads work for the current call.
std::size_t concurrency();

/// body(i) for every i in [0, count), each its own task: for pieces of work that are large and uneven.
void parallel_tasks(std::size_t count, FunctionRef<void(std::size_t)> body);

/// body(begin, end) over pieces of [0, count) of at least `grain` items (except the last).
void parallel_ranges(std::size_t count, std::size_t grain, FunctionRef<void(std::size_t, std::size_t)> body);

/// Both at once, for recursion.
void parallel_pair(FunctionRef<void()> first, FunctionRef<void()> second);

/// Sorts by a strict order that has no ties (equal results for any number of threads). `scratch` is resized to match.
template <class T, class Before>
void parallel_sort(std::vector<T>& values, std::vector<T>& scratch, const Before& before) {
  constexpr std::size_t kRun = 8192;  // sorted by one thread
  const std::size_t count = values.size();
  const auto at = [](std::vector<T>& v, std::size_t i) { return v.begin() + static_cast<std::ptrdiff_t>(i); };
  parallel_tasks((count + kRun - 1) / kRun, [&](std::size_t r) {
    std::sort(at(values, r * kRun), at(values, std::min(count, (r + 1) * kRun)), before);
  });
  if (count > kRun) resize_checked(scratch, count);
  for (std::size_t width = kRun; width < count; width *= 2) {
    // Each task writes one part of the merged runs; binary search finds where its ends lie in the two halves.
    parallel_tasks((count + kRun - 1) / kRun, [&](std::size_t part) {
      const std::size_t first = part * kRun / (2 * width) * (2 * width);
      const auto left = at(values, first), middle = at(values, std::min(count, first + width)),
                 right = at(values, std::min(count, first + 2 * width));
      // How many of the first `wanted` of both halves come from the left one.
      const auto from_left = [&](std::size_t wanted) {
        const auto lefts = static_cast<std::size_t>(middle - left), rights = static_cast<std::size_t>(right - middle);
        std::size_t low = wanted > rights ? wanted - rights : 0, high = std::min(wanted, lefts);
        while (low < high) {
          const std::size_t mine = (low + high) / 2;
          before(left[static_cast<std::ptrdiff_t>(mine)], middle[static_cast<std::ptrdiff_t>(wanted - mine - 1)])
              ? low = mine + 1
              : high = mine;
        }
        return static_cast<std::ptrdiff_t>(low);
      };
      const std::size_t begin = part * kRun - first, end = std::min(count, (part + 1) * kRun) - first;
      const std::ptrdiff_t a = from_left(begin), b = from_left(end);
      std::merge(left + a, left + b, middle + (static_cast<std::ptrdiff_t>(begin) - a),
                 middle + (static_cast<std::ptrdiff_t>(end) - b), at(scratch, first + begin), before);
    });
    std::swap(values, scratch);
  }
}

template <class T, class Before>
void parallel_sort(std::vector<T>& values, const Before& before) {
  std::vector<T> scratch;
  parallel_sort(values, scratch, before);
}

/// offsets[i] = sum of counts[0..i), offsets[count] = total. `offsets` gets counts.size() + 1 entries.
void exclusive_scan(const std::vector<std::uint32_t>& counts, std::vector<std::uint32_t>& offsets);

/// One call of the library: body() in the executor that `execution` asks for, watched by its progress callback.
/// In TBB, threads that wait within the call take up no other work of the arena, so that neither the host's own loops
/// can end up inside of it nor the callback be late.
void run_call(const Execution& execution, FunctionRef<void()> body);

}  // namespace halfshade
