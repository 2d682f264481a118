// Elements of the caller's arrays, whatever their stride and alignment.
#pragma once

#include <cstring>

#include "halfshade/views.h"

namespace halfshade {

/// `count` values of type T at a byte offset of i strides; copied, since nothing is known about alignment.
template <class T, std::size_t count>
std::array<T, count> read_element(const void* data, std::size_t stride_bytes, std::size_t i) {
  std::array<T, count> value;
  const std::size_t stride = stride_bytes != 0 ? stride_bytes : sizeof value;
  std::memcpy(value.data(), static_cast<const unsigned char*>(data) + i * stride, sizeof value);
  return value;
}

inline dvec3 element(const PointView& view, std::size_t i) {
  if (view.is_double) {
    const auto [x, y, z] = read_element<double, 3>(view.data, view.stride_bytes, i);
    return {x, y, z};
  }
  const auto [x, y, z] = read_element<float, 3>(view.data, view.stride_bytes, i);
  return {x, y, z};
}

inline vec2 element(const UvView& view, std::size_t i) {
  const auto [u, v] = read_element<float, 2>(view.data, view.stride_bytes, i);
  return {u, v};
}

inline std::uint32_t element(const IndexView& view, std::size_t i) {
  return read_element<std::uint32_t, 1>(view.data, view.stride_bytes, i)[0];
}

inline std::array<std::uint32_t, 3> element(const TriangleView& view, std::size_t i) {
  return read_element<std::uint32_t, 3>(view.data, view.stride_bytes, i);
}

/// Rows are summed in the order of their terms, each operation rounded to double.
inline dvec3 apply(const Transform& t, const dvec3& p) {
  const auto along = [&p](const std::array<double, 4>& row) {
    return row[0] * p.x + row[1] * p.y + row[2] * p.z + row[3];
  };
  return {along(t.row[0]), along(t.row[1]), along(t.row[2])};
}

}  // namespace halfshade
