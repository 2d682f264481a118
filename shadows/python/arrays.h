// NumPy arrays as views of the C++ interface, and the other way round. Arrays that a view can describe are read where
// they are; others (lists, integers as coordinates, reversed or transposed arrays) are converted first.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include "halfshade/shadow_solver.h"

namespace halfshade::python {

namespace py = pybind11;

/// A view and what keeps its memory alive.
template <class View>
struct Held {
  View view = {};
  py::object owner = {};
};

/// (n, 3) float32 or float64. None: empty. Throws Error{kUsage} naming the argument, here and below.
Held<PointView> to_points(const py::object& values, const char* name);
/// (3,) numbers.
dvec3 to_point(const py::object& values, const char* name);
vec3 to_color(const py::object& values, const char* name);
/// (n,) uint32 or int32; other integers are converted, none may be below 0 or above 2^32 - 1.
Held<IndexView> to_indices(const py::object& values, const char* name);
/// (n, 3), likewise.
Held<TriangleView> to_triangles(const py::object& values, const char* name);
/// (n, 2) float32.
Held<UvView> to_uvs(const py::object& values, const char* name);
/// (height, width) uint8.
Held<AlphaView> to_alpha(const py::object& values, const char* name);
/// (3, 4), or (4, 4) with last row 0 0 0 1.
Transform to_transform(const py::object& values);
/// (height, width, 3).
EmissionImage to_emission_image(const py::object& values);

/// Where one result goes: the memory of `array`, which has exactly `shape`. `wanted` is None or False: nothing; True: a
/// new array; an array: that one, which must be writable, C-contiguous, of that shape and type. Masks may be given as
/// uint8 with eight times as many elements in the last place.
template <class Value>
struct Result {
  py::object array = py::none();
  std::span<Value> memory = {};
};
Result<std::uint64_t> mask_result(const py::object& wanted, const std::vector<py::ssize_t>& shape);
Result<float> float_result(const py::object& wanted, const std::vector<py::ssize_t>& shape, const char* name);

/// A read-only array over memory of `owner`.
template <class Value>
py::array array_of(const Value* data, std::vector<py::ssize_t> shape, const py::object& owner) {
  py::array array(py::dtype::of<Value>(), std::move(shape), data, owner);
  array.attr("setflags")(py::arg("write") = false);
  return array;
}

}  // namespace halfshade::python
