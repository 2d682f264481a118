// Arrays that stay in the caller's memory, with any distance between their elements. Views are read during a call and
// not kept after it.
#pragma once

#include "halfshade/types.h"

namespace halfshade {

/// Points or vectors: x, y, z in float or double, `stride_bytes` from one to the next (0 = packed; any alignment).
struct PointView {
  const void* data = nullptr;    // the first x
  std::size_t count = 0;         // points
  std::size_t stride_bytes = 0;  // from one x to the next; 0 = packed
  bool is_double = false;        // coordinates are double, not float

  /// No elements.
  PointView() = default;
  /// `n` elements from `first` on, `stride` bytes apart.
  PointView(const float* first, std::size_t n, std::size_t stride = 0) : data(first), count(n), stride_bytes(stride) {}
  /// `n` elements from `first` on, `stride` bytes apart.
  PointView(const double* first, std::size_t n, std::size_t stride = 0)
      : data(first), count(n), stride_bytes(stride), is_double(true) {}
  /// All elements of an array.
  PointView(std::span<const vec3> points) : data(points.data()), count(points.size()) {}
  /// All elements of an array.
  PointView(std::span<const dvec3> points) : data(points.data()), count(points.size()), is_double(true) {}
  /// All elements of an array.
  PointView(const std::vector<vec3>& points) : PointView(std::span(points)) {}
  /// All elements of an array.
  PointView(const std::vector<dvec3>& points) : PointView(std::span(points)) {}

  bool empty() const { return count == 0; }  // has it no elements?
};

/// 32-bit numbers, `stride_bytes` from one to the next (0 = packed).
struct IndexView {
  const std::uint32_t* data = nullptr;  // the first number
  std::size_t count = 0;                // numbers
  std::size_t stride_bytes = 0;         // from one to the next; 0 = packed

  /// No elements.
  IndexView() = default;
  /// `n` elements from `first` on, `stride` bytes apart.
  IndexView(const std::uint32_t* first, std::size_t n, std::size_t stride = 0)
      : data(first), count(n), stride_bytes(stride) {}
  /// All elements of an array.
  IndexView(std::span<const std::uint32_t> values) : data(values.data()), count(values.size()) {}
  /// All elements of an array.
  IndexView(const std::vector<std::uint32_t>& values) : IndexView(std::span(values)) {}

  bool empty() const { return count == 0; }  // has it no elements?
};

/// Triangles as triples of vertex numbers, `stride_bytes` from one triangle to the next (0 = packed).
struct TriangleView {
  const std::uint32_t* data = nullptr;  // the first triangle's first vertex
  std::size_t count = 0;                // triangles
  std::size_t stride_bytes = 0;         // from one triangle to the next; 0 = packed

  /// No elements.
  TriangleView() = default;
  /// `n` elements from `first` on, `stride` bytes apart.
  TriangleView(const std::uint32_t* first, std::size_t n, std::size_t stride = 0)
      : data(first), count(n), stride_bytes(stride) {}
  /// All elements of an array.
  TriangleView(std::span<const std::array<std::uint32_t, 3>> triangles)
      : data(triangles.empty() ? nullptr : triangles[0].data()), count(triangles.size()) {}
  /// All elements of an array.
  TriangleView(const std::vector<std::array<std::uint32_t, 3>>& triangles) : TriangleView(std::span(triangles)) {}

  bool empty() const { return count == 0; }  // has it no elements?
};

/// Texture coordinates, one (u, v) per vertex, `stride_bytes` from one to the next (0 = packed).
struct UvView {
  const float* data = nullptr;   // the first u
  std::size_t count = 0;         // pairs
  std::size_t stride_bytes = 0;  // from one u to the next; 0 = packed

  /// No elements.
  UvView() = default;
  /// `n` elements from `first` on, `stride` bytes apart.
  UvView(const float* first, std::size_t n, std::size_t stride = 0) : data(first), count(n), stride_bytes(stride) {}
  /// All elements of an array.
  UvView(std::span<const vec2> uvs) : data(uvs.empty() ? nullptr : &uvs[0].x), count(uvs.size()) {}
  /// All elements of an array.
  UvView(const std::vector<vec2>& uvs) : UvView(std::span(uvs)) {}

  bool empty() const { return count == 0; }  // has it no elements?
};

/// 8-bit opacities of a texture; row 0 is the top of the picture (v = 1); repeats outside 0..1. One channel of a
/// picture with several: `data` points to its first byte, `texel_bytes` leads to the next texel (0 = 1), `row_bytes` to
/// the next row (0 = width * texel_bytes).
struct AlphaView {
  const std::uint8_t* data = nullptr;          // the top left texel
  std::uint32_t width = 0, height = 0;         // texels
  std::size_t row_bytes = 0, texel_bytes = 0;  // from one row or texel to the next; 0 = packed
};

/// Affine map of a mesh into the world: p -> (row[0] . (p, 1), row[1] . (p, 1), row[2] . (p, 1)), evaluated in double
/// in that order of terms. Any finite values: mirrored and flattened meshes are fine.
struct Transform {
  /// [row][column]; the identity by default.
  std::array<std::array<double, 4>, 3> row{{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};

  bool operator==(const Transform&) const = default;
};

}  // namespace halfshade
