// All threading goes through here: TBB loops in the arena of the calling thread, with the floating-point environment
// that the project's bit-exact results need (round to nearest, denormals kept) set for every piece of work.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <tbb/parallel_scan.h>
#include <tbb/parallel_sort.h>
#include <tbb/task_arena.h>

#if defined(__SSE2__)
#include <xmmintrin.h>
#endif

namespace halfshade {

/// Saves the caller's floating-point control word, sets the default one, restores the caller's on leaving.
class FpEnvironment {
 public:
#if defined(__SSE2__)
  FpEnvironment() : saved_(_mm_getcsr()) { _mm_setcsr(0x1f80u); }
  ~FpEnvironment() { _mm_setcsr(saved_); }

 private:
  unsigned saved_;
#else
  FpEnvironment() {}
  ~FpEnvironment() {}
#endif
  FpEnvironment(const FpEnvironment&) = delete;
  FpEnvironment& operator=(const FpEnvironment&) = delete;
};

/// body(begin, end) over pieces of [0, count) of at least `grain` items (except the last).
template <class Body>
void parallel_ranges(std::size_t count, std::size_t grain, const Body& body) {
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, grain),
                    [&](const tbb::blocked_range<std::size_t>& range) {
                      const FpEnvironment environment;
                      body(range.begin(), range.end());
                    });
}

/// body(i) for every i in [0, count), each its own task: for pieces of work that are large and uneven.
template <class Body>
void parallel_tasks(std::size_t count, const Body& body) {
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, count, 1),
      [&](const tbb::blocked_range<std::size_t>& range) {
        const FpEnvironment environment;
        for (std::size_t i = range.begin(); i != range.end(); ++i) body(i);
      },
      tbb::simple_partitioner());
}

/// Sorts by a strict order that has no ties (equal results for any number of threads).
template <class T, class Before>
void parallel_sort(std::vector<T>& values, const Before& before) {
  tbb::parallel_sort(values.begin(), values.end(), before);
}

/// Both at once, for recursion.
template <class First, class Second>
void parallel_pair(const First& first, const Second& second) {
  const auto guarded = [](const auto& body) {
    return [&body] {
      const FpEnvironment environment;
      body();
    };
  };
  tbb::parallel_invoke(guarded(first), guarded(second));
}

/// offsets[i] = sum of counts[0..i), offsets[count] = total. `offsets` gets counts.size() + 1 entries.
void exclusive_scan(const std::vector<std::uint32_t>& counts, std::vector<std::uint32_t>& offsets);

}  // namespace halfshade
