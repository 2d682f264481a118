// A vector with room for N elements in itself: nothing is allocated.
#pragma once

#include <array>
#include <cassert>
#include <cstddef>

namespace halfshade {

template <class T, std::size_t N>
class BoundedVector {
 public:
  void push_back(const T& value) {
    assert(size_ < N);
    values_[size_++] = value;
  }
  std::size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }
  T& operator[](std::size_t i) { return values_[i]; }
  const T& operator[](std::size_t i) const { return values_[i]; }
  T* begin() { return values_.data(); }
  T* end() { return values_.data() + size_; }
  const T* begin() const { return values_.data(); }
  const T* end() const { return values_.data() + size_; }
  const T& back() const { return values_[size_ - 1]; }

 private:
  std::array<T, N> values_;
  std::size_t size_ = 0;
};

}  // namespace halfshade
