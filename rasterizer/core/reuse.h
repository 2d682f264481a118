// Memory of values that are made again and again.
#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include "rasterizer/core/run.h"

namespace halfshade {

/// The vector's memory, with nothing in it.
template <class T>
std::vector<T> emptied(std::vector<T>& values) {
  values.clear();
  return std::move(values);
}

/// Values that take 1 MiB: fresh memory of this size is there within a millisecond.
template <class T>
constexpr std::size_t kMebibyteOf = std::max<std::size_t>(1, (1u << 20) / sizeof(T));

/// values.resize(count), for contents that are about to be overwritten: what was there may be lost. The call can be
/// stopped meanwhile.
template <class T>
void resize_checked(std::vector<T>& values, std::size_t count) {
  if (count > values.capacity()) values.clear();
  values.reserve(count);
  while (values.size() < count) {
    check_run();
    values.resize(std::min(count, values.size() + kMebibyteOf<T>));
  }
  values.resize(count);
}

/// to = from. The call can be stopped meanwhile.
template <class From, class T>
void copy_checked(const From& from, std::vector<T>& to) {
  to.clear();
  to.reserve(from.size());
  checked_ranges(from.size(), kMebibyteOf<T>, [&](std::size_t begin, std::size_t end) {
    to.insert(to.end(), from.begin() + static_cast<std::ptrdiff_t>(begin),
              from.begin() + static_cast<std::ptrdiff_t>(end));
  });
}

}  // namespace halfshade
