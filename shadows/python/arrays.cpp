#include "shadows/python/arrays.h"

#include <string>

namespace halfshade::python {
namespace {

[[noreturn]] void usage(const std::string& what) { throw Error(ErrorCode::kUsage, what); }

std::string shape_of(const py::array& array) { return py::str(array.attr("shape")); }

py::array as_array(const py::object& values, const char* name) {
  py::array array = py::array::ensure(values);
  if (!array) {
    PyErr_Clear();
    usage(std::string(name) + ": not an array");
  }
  return array;
}

/// As an array of T: the same array where it is one already.
template <class T>
py::array converted(const py::array& array, const char* name) {
  py::array result = py::array_t<T, py::array::c_style | py::array::forcecast>::ensure(array);
  if (!result) {
    PyErr_Clear();
    usage(std::string(name) + ": cannot be converted to " + std::string(py::str(py::dtype::of<T>())));
  }
  return result;
}

/// Rows of `columns` packed elements, one after the other in memory with room for each?
bool has_packed_rows(const py::array& array, py::ssize_t columns) {
  const py::ssize_t item = array.itemsize();
  return (columns == 1 || array.strides(1) == item) && (array.shape(0) <= 1 || array.strides(0) >= columns * item);
}

std::size_t row_stride(const py::array& array) {
  return array.shape(0) <= 1 ? 0 : static_cast<std::size_t>(array.strides(0));
}

void check_columns(const py::array& array, py::ssize_t columns, const char* name) {
  if (array.ndim() == 2 && array.shape(1) == columns) return;
  usage(std::string(name) + ": shape " + shape_of(array) + ", expected (n, " + std::to_string(columns) + ")");
}

/// As 32-bit numbers without sign.
py::array as_indices(py::array array, const char* name) {
  if (py::isinstance<py::array_t<std::uint32_t>>(array) || py::isinstance<py::array_t<std::int32_t>>(array)) {
    return array;
  }
  const char kind = array.dtype().kind();
  if (array.size() > 0 && kind != 'i' && kind != 'u') usage(std::string(name) + ": not integers");
  if (array.size() > 0) {
    const py::object low = array.attr("min")(), high = array.attr("max")();
    if (low < py::int_(0) || high > py::int_(0xffffffffu)) {
      usage(std::string(name) + ": a number is below 0 or above 2^32 - 1");
    }
  }
  return converted<std::uint32_t>(array, name);
}

template <class T>
T element(const py::array& array, py::ssize_t i) {
  return static_cast<const T*>(array.data())[i];
}

}  // namespace

Held<PointView> to_points(const py::object& values, const char* name) {
  if (values.is_none()) return {};
  py::array array = as_array(values, name);
  check_columns(array, 3, name);
  const bool is_float = py::isinstance<py::array_t<float>>(array);
  if ((!is_float && !py::isinstance<py::array_t<double>>(array)) || !has_packed_rows(array, 3)) {
    array = is_float ? converted<float>(array, name) : converted<double>(array, name);
  }
  const std::size_t count = static_cast<std::size_t>(array.shape(0)), stride = row_stride(array);
  if (is_float) return {{static_cast<const float*>(array.data()), count, stride}, array};
  return {{static_cast<const double*>(array.data()), count, stride}, array};
}

dvec3 to_point(const py::object& values, const char* name) {
  const py::array array = converted<double>(as_array(values, name), name);
  if (array.ndim() != 1 || array.shape(0) != 3) usage(std::string(name) + ": expected three numbers");
  return {element<double>(array, 0), element<double>(array, 1), element<double>(array, 2)};
}

vec3 to_color(const py::object& values, const char* name) { return vec3(to_point(values, name)); }

Held<IndexView> to_indices(const py::object& values, const char* name) {
  if (values.is_none()) return {};
  py::array array = as_indices(as_array(values, name), name);
  if (array.ndim() != 1) usage(std::string(name) + ": shape " + shape_of(array) + ", expected (n,)");
  if (!has_packed_rows(array, 1)) array = converted<std::uint32_t>(array, name);
  return {
      {static_cast<const std::uint32_t*>(array.data()), static_cast<std::size_t>(array.shape(0)), row_stride(array)},
      array};
}

Held<TriangleView> to_triangles(const py::object& values, const char* name) {
  if (values.is_none()) return {};
  py::array array = as_indices(as_array(values, name), name);
  check_columns(array, 3, name);
  if (!has_packed_rows(array, 3)) array = converted<std::uint32_t>(array, name);
  return {
      {static_cast<const std::uint32_t*>(array.data()), static_cast<std::size_t>(array.shape(0)), row_stride(array)},
      array};
}

Held<UvView> to_uvs(const py::object& values, const char* name) {
  if (values.is_none()) return {};
  py::array array = as_array(values, name);
  check_columns(array, 2, name);
  if (!py::isinstance<py::array_t<float>>(array) || !has_packed_rows(array, 2)) array = converted<float>(array, name);
  return {{static_cast<const float*>(array.data()), static_cast<std::size_t>(array.shape(0)), row_stride(array)},
          array};
}

Held<AlphaView> to_alpha(const py::object& values, const char* name) {
  py::array array = as_array(values, name);
  if (array.ndim() != 2 || !py::isinstance<py::array_t<std::uint8_t>>(array)) {
    usage(std::string(name) + ": expected (height, width) of uint8");
  }
  if (array.shape(0) > 65536 || array.shape(1) > 65536) usage(std::string(name) + ": wider or higher than 65536");
  if (array.strides(0) <= 0 || array.strides(1) <= 0) array = converted<std::uint8_t>(array, name);
  return {{static_cast<const std::uint8_t*>(array.data()), static_cast<std::uint32_t>(array.shape(1)),
           static_cast<std::uint32_t>(array.shape(0)), static_cast<std::size_t>(array.strides(0)),
           static_cast<std::size_t>(array.strides(1))},
          array};
}

Transform to_transform(const py::object& values) {
  Transform transform;
  if (values.is_none()) return transform;
  const py::array array = converted<double>(as_array(values, "transform"), "transform");
  if (array.ndim() != 2 || array.shape(1) != 4 || (array.shape(0) != 3 && array.shape(0) != 4)) {
    usage("transform: shape " + shape_of(array) + ", expected (3, 4) or (4, 4)");
  }
  for (py::ssize_t i = 0; i < array.size(); ++i) {
    const double value = element<double>(array, i);
    if (i < 12) {
      transform.row[static_cast<std::size_t>(i / 4)][static_cast<std::size_t>(i % 4)] = value;
    } else if (value != (i == 15 ? 1.0 : 0.0)) {
      usage("transform: the last row is not 0 0 0 1");
    }
  }
  return transform;
}

EmissionImage to_emission_image(const py::object& values) {
  EmissionImage image;
  if (values.is_none()) return image;
  const py::array array = converted<float>(as_array(values, "emission_image"), "emission_image");
  if (array.ndim() != 3 || array.shape(2) != 3 || array.size() == 0) {
    usage("emission_image: shape " + shape_of(array) + ", expected (height, width, 3)");
  }
  if (array.shape(0) > 65536 || array.shape(1) > 65536) usage("emission_image: wider or higher than 65536");
  image.height = static_cast<std::uint32_t>(array.shape(0));
  image.width = static_cast<std::uint32_t>(array.shape(1));
  const auto* rgb = static_cast<const float*>(array.data());
  for (py::ssize_t i = 0; i < array.size(); i += 3) image.rgb.emplace_back(rgb[i], rgb[i + 1], rgb[i + 2]);
  return image;
}

namespace {

template <class Value>
Result<Value> result_over(const py::array& array) {
  return {array, {static_cast<Value*>(const_cast<void*>(array.data())), array.nbytes() / sizeof(Value)}};
}

template <class Value>
Result<Value> result_of(const py::object& wanted, const std::vector<py::ssize_t>& shape, const char* name) {
  if (wanted.is_none() || wanted.ptr() == Py_False) return {};
  if (wanted.ptr() == Py_True) return result_over<Value>(py::array_t<Value>(shape));
  if (!py::isinstance<py::array>(wanted)) usage(std::string(name) + ": expected True, False or an array");
  const auto array = py::reinterpret_borrow<py::array>(wanted);
  bool same_shape = array.ndim() == static_cast<py::ssize_t>(shape.size());
  for (std::size_t k = 0; same_shape && k < shape.size(); ++k) {
    same_shape = array.shape(static_cast<py::ssize_t>(k)) == shape[k];
  }
  if (!same_shape) {
    std::string expected;
    for (const py::ssize_t length : shape) expected += (expected.empty() ? "" : ", ") + std::to_string(length);
    usage(std::string(name) + ": shape " + shape_of(array) + ", expected (" + expected + ")");
  }
  if (!py::isinstance<py::array_t<Value>>(array)) {
    usage(std::string(name) + ": elements are " + std::string(py::str(array.dtype())) + ", expected " +
          std::string(py::str(py::dtype::of<Value>())));
  }
  if (!array.writeable()) usage(std::string(name) + ": read-only");
  const bool aligned = reinterpret_cast<std::uintptr_t>(array.data()) % alignof(Value) == 0;
  if ((array.flags() & py::array::c_style) == 0 || !aligned)
    usage(std::string(name) + ": not C-contiguous and aligned");
  return result_over<Value>(array);
}

}  // namespace

Result<std::uint64_t> mask_result(const py::object& wanted, const std::vector<py::ssize_t>& shape) {
  if (!py::isinstance<py::array_t<std::uint8_t>>(wanted)) return result_of<std::uint64_t>(wanted, shape, "masks");
  std::vector<py::ssize_t> bytes = shape;
  bytes.back() *= 8;
  const Result<std::uint8_t> result = result_of<std::uint8_t>(wanted, bytes, "masks");
  if (reinterpret_cast<std::uintptr_t>(result.memory.data()) % alignof(std::uint64_t) != 0) {
    usage("masks: not aligned to 8 bytes");
  }
  return {result.array, {reinterpret_cast<std::uint64_t*>(result.memory.data()), result.memory.size() / 8}};
}

Result<float> float_result(const py::object& wanted, const std::vector<py::ssize_t>& shape, const char* name) {
  return result_of<float>(wanted, shape, name);
}

}  // namespace halfshade::python
