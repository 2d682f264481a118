// Memory of values that are made again and again.
#pragma once

#include <utility>
#include <vector>

namespace halfshade {

/// The vector's memory, with nothing in it.
template <class T>
std::vector<T> emptied(std::vector<T>& values) {
  values.clear();
  return std::move(values);
}

}  // namespace halfshade
