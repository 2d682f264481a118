// Arrays that stay in the caller's memory, with any distance between their elements. Views are read during a call and
// not kept after it.
#pragma once

#include "halfshade/types.h"

namespace halfshade {

/// Points or vectors: x, y, z in float or double, `stride_bytes` from one to the next (0 = packed; any alignment).
struct PointView {
  const void* data = nullptr;
  std::size_t count = 0;
  std::size_t stride_bytes = 0;
  bool is_double = false;

  PointView() = default;
  PointView(const float* first, std::size_t n, std::size_t stride = 0) : data(first), count(n), stride_bytes(stride) {}
  PointView(const double* first, std::size_t n, std::size_t stride = 0)
      : data(first), count(n), stride_bytes(stride), is_double(true) {}
  PointView(std::span<const vec3> points) : data(points.data()), count(points.size()) {}
  PointView(std::span<const dvec3> points) : data(points.data()), count(points.size()), is_double(true) {}
  PointView(const std::vector<vec3>& points) : PointView(std::span(points)) {}
  PointView(const std::vector<dvec3>& points) : PointView(std::span(points)) {}

  bool empty() const { return count == 0; }
};

/// 32-bit numbers, `stride_bytes` from one to the next (0 = packed).
struct IndexView {
  const std::uint32_t* data = nullptr;
  std::size_t count = 0;
  std::size_t stride_bytes = 0;

  IndexView() = default;
  IndexView(const std::uint32_t* first, std::size_t n, std::size_t stride = 0)
      : data(first), count(n), stride_bytes(stride) {}
  IndexView(std::span<const std::uint32_t> values) : data(values.data()), count(values.size()) {}
  IndexView(const std::vector<std::uint32_t>& values) : IndexView(std::span(values)) {}

  bool empty() const { return count == 0; }
};

/// Triangles as triples of vertex numbers, `stride_bytes` from one triangle to the next (0 = packed).
struct TriangleView {
  const std::uint32_t* data = nullptr;
  std::size_t count = 0;  // triangles
  std::size_t stride_bytes = 0;

  TriangleView() = default;
  TriangleView(const std::uint32_t* first, std::size_t n, std::size_t stride = 0)
      : data(first), count(n), stride_bytes(stride) {}
  TriangleView(std::span<const std::array<std::uint32_t, 3>> triangles)
      : data(triangles.empty() ? nullptr : triangles[0].data()), count(triangles.size()) {}
  TriangleView(const std::vector<std::array<std::uint32_t, 3>>& triangles) : TriangleView(std::span(triangles)) {}

  bool empty() const { return count == 0; }
};

/// Texture coordinates, one (u, v) per vertex, `stride_bytes` from one to the next (0 = packed).
struct UvView {
  const float* data = nullptr;
  std::size_t count = 0;
  std::size_t stride_bytes = 0;

  UvView() = default;
  UvView(const float* first, std::size_t n, std::size_t stride = 0) : data(first), count(n), stride_bytes(stride) {}
  UvView(std::span<const vec2> uvs) : data(uvs.empty() ? nullptr : &uvs[0].x), count(uvs.size()) {}
  UvView(const std::vector<vec2>& uvs) : UvView(std::span(uvs)) {}

  bool empty() const { return count == 0; }
};

/// 8-bit opacities of a texture; row 0 is the top of the picture (v = 1); repeats outside 0..1. One channel of a
/// picture with several: `data` points to its first byte, `texel_bytes` leads to the next texel (0 = 1), `row_bytes` to
/// the next row (0 = width * texel_bytes).
struct AlphaView {
  const std::uint8_t* data = nullptr;
  std::uint32_t width = 0, height = 0;
  std::size_t row_bytes = 0, texel_bytes = 0;
};

/// Affine map of a mesh into the world: p -> (row[0] . (p, 1), row[1] . (p, 1), row[2] . (p, 1)), evaluated in double
/// in that order of terms. Any finite values: mirrored and flattened meshes are fine.
struct Transform {
  std::array<std::array<double, 4>, 3> row{{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};

  bool operator==(const Transform&) const = default;
};

}  // namespace halfshade
