// The Python module: scenes, lights, solvers and G-buffers on NumPy arrays. What the calls mean is in the C++ headers
// and, as Python sees it, in halfshade/__init__.pyi.
#include <pybind11/stl.h>

#include <optional>

#include "halfshade/names.h"
#include "shadows/python/arrays.h"
#include "shadows/python/interrupts.h"

namespace halfshade::python {
namespace {

using namespace py::literals;

struct PyScene {
  explicit PyScene(const SceneConfig& config) : value(config) {}
  ShadowScene value;
  UseCount uses{"scene"};
};

struct PyGBuffer {
  GBuffer value;
};

struct PyWorkspace {
  explicit PyWorkspace(std::uint32_t kept_lights) : value(WorkspaceConfig{.kept_lights = kept_lights}) {}
  Workspace value;
  UseCount uses{"workspace"};
};

// ---- errors

/// Error classes by code. They live as long as the process: errors may be raised while the interpreter ends.
PyObject* error_classes[5] = {};

void bind_errors(py::module_& m) {
  const auto make = [&m](const char* name, const char* doc, const py::object& bases) {
    const std::string full = std::string("halfshade.") + name;
    auto type = py::reinterpret_steal<py::object>(PyErr_NewExceptionWithDoc(full.c_str(), doc, bases.ptr(), nullptr));
    if (!type) throw py::error_already_set();
    m.attr(name) = type;
    return type;
  };
  const auto builtin = [](PyObject* type) { return py::reinterpret_borrow<py::object>(type); };
  const py::object base = make("Error", "Anything that halfshade refuses.", builtin(PyExc_RuntimeError));
  const py::tuple base_and_value_error = py::make_tuple(base, builtin(PyExc_ValueError));
  const auto set = [&](ErrorCode code, const char* name, const char* doc, const py::object& bases) {
    error_classes[static_cast<int>(code)] = make(name, doc, bases).release().ptr();
  };
  set(ErrorCode::kUsage, "UsageError", "A call that makes no sense.", base_and_value_error);
  set(ErrorCode::kBadInput, "BadInputError", "An array whose content is wrong.", base_and_value_error);
  set(ErrorCode::kLimit, "LimitError", "The work would exceed a stated limit.", base);
  set(ErrorCode::kOutput, "OutputError", "A result could not be written.", base);
  set(ErrorCode::kCancelled, "CancelledError", "The progress function returned something false.", base);
  py::register_exception_translator([](std::exception_ptr thrown) {
    try {
      if (thrown) std::rethrow_exception(thrown);
    } catch (const Error& e) {
      PyErr_SetString(error_classes[static_cast<int>(e.code())], e.what());
    }
  });
}

// ---- lights

Light flat_light(LightShape shape, bool two_sided, const py::object& emission) {
  Light light;
  light.shape = shape;
  light.two_sided = two_sided;
  light.emission = to_color(emission, "emission");
  return light;
}

std::vector<dvec3> points_of(const py::object& values) {
  const Held<PointView> held = to_points(values, "points");
  std::vector<dvec3> points(held.view.count);
  const py::array_t<double, py::array::c_style | py::array::forcecast> packed(held.owner);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double* xyz = packed.data() + 3 * i;
    points[i] = {xyz[0], xyz[1], xyz[2]};
  }
  return points;
}

void bind_lights(py::module_& m) {
  const py::tuple white = py::make_tuple(1.0, 1.0, 1.0);
  py::class_<Light>(m, "Light",
                    "World space; u and v are full edge vectors; flat lights face u x v or `normal`, unless two_sided.")
      .def_static(
          "point",
          [](const py::object& center, const py::object& emission) {
            Light light = flat_light(LightShape::kPoint, false, emission);
            light.center = to_point(center, "center");
            return light;
          },
          "center"_a, py::kw_only(), "emission"_a = white)
      .def_static(
          "rectangle",
          [](const py::object& center, const py::object& u, const py::object& v, bool two_sided,
             const py::object& emission, const py::object& image) {
            Light light = flat_light(LightShape::kRectangle, two_sided, emission);
            light.center = to_point(center, "center");
            light.u = to_point(u, "u");
            light.v = to_point(v, "v");
            light.emission_image = to_emission_image(image);
            return light;
          },
          "center"_a, "u"_a, "v"_a, py::kw_only(), "two_sided"_a = false, "emission"_a = white,
          "emission_image"_a = py::none())
      .def_static(
          "disk",
          [](const py::object& center, const py::object& normal, double radius, bool two_sided,
             const py::object& emission) {
            Light light = flat_light(LightShape::kDisk, two_sided, emission);
            light.center = to_point(center, "center");
            light.normal = to_point(normal, "normal");
            light.radius = radius;
            return light;
          },
          "center"_a, "normal"_a, "radius"_a, py::kw_only(), "two_sided"_a = false, "emission"_a = white)
      .def_static(
          "sphere",
          [](const py::object& center, double radius, const py::object& emission) {
            Light light = flat_light(LightShape::kSphere, false, emission);
            light.center = to_point(center, "center");
            light.radius = radius;
            return light;
          },
          "center"_a, "radius"_a, py::kw_only(), "emission"_a = white)
      .def_static(
          "ellipsoid",
          [](const py::object& center, const std::array<py::object, 3>& axes, const py::object& emission) {
            Light light = flat_light(LightShape::kEllipsoid, false, emission);
            light.center = to_point(center, "center");
            for (std::size_t k = 0; k < 3; ++k) light.axes[k] = to_point(axes[k], "axes");
            return light;
          },
          "center"_a, "axes"_a, py::kw_only(), "emission"_a = white)
      .def_static(
          "polygon",
          [](const py::object& points, bool two_sided, const py::object& emission) {
            Light light = flat_light(LightShape::kPolygon, two_sided, emission);
            light.points = points_of(points);
            return light;
          },
          "points"_a, py::kw_only(), "two_sided"_a = false, "emission"_a = white)
      .def_static(
          "sun",
          [](const py::object& direction, const py::object& low, const py::object& high, double angular_diameter_deg,
             const py::object& emission) {
            Light light = flat_light(LightShape::kSun, false, emission);
            light.normal = to_point(direction, "direction");
            light.angular_diameter_deg = angular_diameter_deg;
            return place_sun(light, to_point(low, "low"), to_point(high, "high"));
          },
          "direction"_a, "low"_a, "high"_a, py::kw_only(), "angular_diameter_deg"_a = Light().angular_diameter_deg,
          "emission"_a = white)
      .def_static(
          "samples",
          [](const py::object& points, const py::object& emission) {
            Light light = flat_light(LightShape::kSamples, false, emission);
            light.points = points_of(points);
            return light;
          },
          "points"_a, py::kw_only(), "emission"_a = white);
}

// ---- scenes

py::dict dict_of(const SceneStats& s) {
  return py::dict("commits"_a = s.commits, "frame_changes"_a = s.frame_changes, "meshes_rounded"_a = s.meshes_rounded,
                  "certificates_made"_a = s.certificates_made, "tree_builds"_a = s.tree_builds,
                  "tree_cost"_a = s.tree_cost, "commit_ms"_a = s.commit_ms, "tree_ms"_a = s.tree_ms,
                  "meshes"_a = s.meshes, "triangles"_a = s.triangles, "vertices"_a = s.vertices,
                  "certified_triangles"_a = s.certified_triangles, "bytes"_a = s.bytes);
}

std::uint32_t add_mesh(PyScene& scene, const py::object& positions, const py::object& triangles,
                       const py::object& transform, const py::object& uvs, std::optional<std::uint32_t> alpha_map,
                       float alpha_cutoff, const py::object& albedo) {
  const Held<PointView> points = to_points(positions, "positions");
  const Held<TriangleView> corners = to_triangles(triangles, "triangles");
  const Held<UvView> texture = to_uvs(uvs, "uvs");
  MeshView view;
  view.positions = points.view;
  view.triangles = corners.view;
  view.transform = to_transform(transform);
  view.uvs = texture.view;
  view.alpha_map = alpha_map.value_or(kNone);
  view.alpha_cutoff = alpha_cutoff;
  view.albedo = to_color(albedo, "albedo");
  const UseCount::Writing writing(scene.uses);
  std::uint32_t mesh = kNone;
  without_lock([&] { mesh = scene.value.add_mesh(view); });
  return mesh;
}

PyGBuffer rasterized(PyScene& scene, std::uint32_t width, std::uint32_t height, const py::object& eye,
                     const py::object& target, const py::object& up, double fov_y_deg, const py::object& progress,
                     bool serial) {
  const Camera camera{to_point(eye, "eye"), to_point(target, "target"), to_point(up, "up"), fov_y_deg};
  RasterConfig config;
  config.width = width;
  config.height = height;
  const Execution execution = execution_of(progress, serial);
  PyGBuffer gbuffer;
  const UseCount::Reading reading(scene.uses);
  without_lock([&] { rasterize(scene.value, camera, config, gbuffer.value, execution); });
  return gbuffer;
}

/// Any number of points, [..., 3].
py::array_t<double> to_world(PyScene& scene, const py::object& values) {
  const auto points = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(values);
  if (!points) {
    PyErr_Clear();
    throw Error(ErrorCode::kUsage, "points: not an array of numbers");
  }
  if (points.ndim() == 0 || points.shape(points.ndim() - 1) != 3) {
    throw Error(ErrorCode::kUsage, "points: the last dimension is not 3");
  }
  py::array_t<double> world(std::vector<py::ssize_t>(points.shape(), points.shape() + points.ndim()));
  const double* from = points.data();
  double* to = world.mutable_data();
  const UseCount::Reading reading(scene.uses);
  for (py::ssize_t i = 0; i < points.size(); i += 3) {
    const dvec3 p = scene.value.to_world({from[i], from[i + 1], from[i + 2]});
    to[i] = p.x, to[i + 1] = p.y, to[i + 2] = p.z;
  }
  return world;
}

py::array_t<double> reach_of(const PyScene& scene) {
  const std::array<dvec3, 2> box = scene.value.reach();
  return py::array_t<double>(std::vector<py::ssize_t>{2, 3}, &box[0].x);
}

void bind_scenes(py::module_& m) {
  using Writing = UseCount::Writing;
  using Reading = UseCount::Reading;
  py::class_<PyScene>(
      m, "Scene",
      "Meshes in world space. Changes are done together by commit(). A change while another thread solves raises.")
      .def(py::init([](double rebuild_cost, bool back_face_casters) {
             return std::make_unique<PyScene>(SceneConfig{rebuild_cost, back_face_casters});
           }),
           py::kw_only(), "rebuild_cost"_a = SceneConfig().rebuild_cost,
           "back_face_casters"_a = SceneConfig().back_face_casters)
      .def(
          "add_alpha_map",
          [](PyScene& scene, const py::object& alpha) {
            const Held<AlphaView> held = to_alpha(alpha, "alpha");
            const Writing writing(scene.uses);
            return scene.value.add_alpha_map(held.view);
          },
          "alpha"_a)
      .def("add_mesh", &add_mesh, "positions"_a, "triangles"_a = py::none(), py::kw_only(), "transform"_a = py::none(),
           "uvs"_a = py::none(), "alpha_map"_a = py::none(), "alpha_cutoff"_a = 0.5f,
           "albedo"_a = py::make_tuple(0.8, 0.8, 0.8))
      .def(
          "remove_mesh",
          [](PyScene& scene, std::uint32_t mesh) {
            const Writing writing(scene.uses);
            scene.value.remove_mesh(mesh);
          },
          "mesh"_a)
      .def(
          "set_positions",
          [](PyScene& scene, std::uint32_t mesh, const py::object& positions) {
            const Held<PointView> held = to_points(positions, "positions");
            const Writing writing(scene.uses);
            without_lock([&] { scene.value.set_positions(mesh, held.view); });
          },
          "mesh"_a, "positions"_a)
      .def(
          "set_transform",
          [](PyScene& scene, std::uint32_t mesh, const py::object& transform) {
            const Transform known = to_transform(transform);
            const Writing writing(scene.uses);
            scene.value.set_transform(mesh, known);
          },
          "mesh"_a, "transform"_a)
      .def(
          "extend",
          [](PyScene& scene, const Light& light) {
            const Writing writing(scene.uses);
            scene.value.extend(light);
          },
          "light"_a)
      .def(
          "extend",
          [](PyScene& scene, const py::object& points) {
            const Held<PointView> held = to_points(points, "points");
            const Writing writing(scene.uses);
            scene.value.extend(held.view);
          },
          "points"_a)
      .def(
          "commit",
          [](PyScene& scene, const py::object& progress, bool serial) {
            const Execution execution = execution_of(progress, serial);
            const Writing writing(scene.uses);
            without_lock([&] { scene.value.commit(execution); });
          },
          py::kw_only(), "progress"_a = py::none(), "serial"_a = false)
      .def("rasterize", &rasterized, "width"_a, "height"_a, py::kw_only(), "eye"_a,
           "target"_a = py::make_tuple(0.0, 0.0, 0.0), "up"_a = py::make_tuple(0.0, 1.0, 0.0), "fov_y_deg"_a = 45.0,
           "progress"_a = py::none(), "serial"_a = false)
      .def("to_world", &to_world, "points"_a,
           "Points in the local frame of the last commit, [..., 3], as GBuffer.position has them, to world space.")
      .def(
          "triangle_of",
          [](PyScene& scene, std::uint32_t number) {
            const Reading reading(scene.uses);
            const MeshTriangle found = scene.value.triangle_of(number);
            return py::make_tuple(found.mesh, found.triangle);
          },
          "number"_a)
      .def_property_readonly("committed",
                             [](PyScene& scene) {
                               const Reading reading(scene.uses);
                               return scene.value.committed();
                             })
      .def_property_readonly("reach",
                             [](PyScene& scene) {
                               const Reading reading(scene.uses);
                               return reach_of(scene);
                             })
      .def_property_readonly("stats", [](PyScene& scene) {
        const Reading reading(scene.uses);
        return dict_of(scene.value.stats());
      });
}

// ---- G-buffers

/// A property that shows [height][width] entries of the G-buffer where they are.
template <class Value, class Entry>
auto image(std::vector<Entry> GBuffer::*member) {
  return [member](const py::object& self) {
    const GBuffer& g = self.cast<const PyGBuffer&>().value;
    std::vector<py::ssize_t> shape{static_cast<py::ssize_t>(g.height), static_cast<py::ssize_t>(g.width)};
    if (sizeof(Entry) != sizeof(Value)) shape.push_back(sizeof(Entry) / sizeof(Value));
    return array_of(reinterpret_cast<const Value*>((g.*member).data()), shape, self);
  };
}

void bind_gbuffers(py::module_& m) {
  py::class_<PyGBuffer>(
      m, "GBuffer", "What a camera sees, [height, width], row 0 = top. The arrays are read-only views of its memory.")
      .def_property_readonly("width", [](const PyGBuffer& g) { return g.value.width; })
      .def_property_readonly("height", [](const PyGBuffer& g) { return g.value.height; })
      .def_property_readonly("triangle", image<std::uint32_t>(&GBuffer::triangle))
      .def_property_readonly("position", image<double>(&GBuffer::position))
      .def_property_readonly("geometric_normal", image<float>(&GBuffer::geometric_normal))
      .def_property_readonly("shading_normal", image<float>(&GBuffer::shading_normal))
      .def_property_readonly("albedo", image<float>(&GBuffer::albedo))
      .def_property_readonly("depth", image<float>(&GBuffer::depth));
}

// ---- solvers

py::dict dict_of(const SolveStats& s) {
  py::dict dict("build_ms"_a = s.build_ms, "index_ms"_a = s.index_ms, "cull_ms"_a = s.cull_ms, "test_ms"_a = s.test_ms,
                "receivers"_a = s.receivers, "triangles"_a = s.triangles, "pairs_tested"_a = s.pairs_tested,
                "sample_tests"_a = s.sample_tests, "exact_fallbacks"_a = s.exact_fallbacks, "bytes"_a = s.bytes,
                "lights_kept"_a = s.lights_kept, "lights_made"_a = s.lights_made);
  for (const auto& [name, value] : s.details) dict[py::str(name)] = value;
  return dict;
}

ShadowSolver make_solver(const std::string& method, std::uint32_t light_sample_count, const std::string& pattern,
                         std::uint32_t sample_sets, std::uint32_t seed, std::uint32_t frame, bool interleave,
                         bool rotate_sets, const py::dict& options) {
  ShadowConfig config;
  config.method = shadow_method_from_name(method);
  config.light_sample_count = light_sample_count;
  config.pattern = sample_pattern_from_name(pattern);
  config.sample_sets = sample_sets;
  config.seed = seed;
  config.frame = frame;
  config.interleave = interleave;
  config.rotate_sets = rotate_sets;
  for (const auto& [name, value] : options) {
    std::string text = py::str(value);
    if (py::isinstance<py::bool_>(value)) text = value.cast<bool>() ? "on" : "off";
    set_method_option(config, std::string(py::str(name)) + "=" + text);
  }
  return ShadowSolver(config);
}

/// What solve() was asked to work on: explicit points or a G-buffer.
struct Receivers {
  ReceiverView view;
  const GBuffer* gbuffer = nullptr;
  std::vector<py::ssize_t> shape;  // (n,) or (height, width)
  std::vector<py::object> owners;
};

/// `values`: points, or a G-buffer, which brings all that is in the keywords.
Receivers to_receivers(const py::object& values, const py::object& normals, const py::object& meshes,
                       const py::object& triangles, std::optional<double> lift, std::uint32_t first,
                       std::optional<std::uint32_t> frame) {
  Receivers receivers;
  if (py::isinstance<PyGBuffer>(values)) {
    if (!normals.is_none() || !meshes.is_none() || !triangles.is_none() || lift.has_value() || frame.has_value() ||
        first != 0) {
      throw Error(ErrorCode::kUsage,
                  "normals, meshes, triangles, lift, first and frame go with points, not with a G-buffer");
    }
    receivers.gbuffer = &values.cast<const PyGBuffer&>().value;
    receivers.shape = {receivers.gbuffer->height, receivers.gbuffer->width};
    return receivers;
  }
  const auto keep = [&receivers](const auto& held) {
    receivers.owners.push_back(held.owner);
    return held.view;
  };
  receivers.view.positions = keep(to_points(values, "receivers"));
  receivers.view.normals = keep(to_points(normals, "normals"));
  receivers.view.meshes = keep(to_indices(meshes, "meshes"));
  receivers.view.triangles = keep(to_indices(triangles, "triangles"));
  receivers.view.lift = lift.value_or(kDefaultLift);
  receivers.view.first = first;
  receivers.view.frame = frame.value_or(kNone);
  receivers.shape = {static_cast<py::ssize_t>(receivers.view.positions.count)};
  return receivers;
}

/// One light or a sequence of them.
std::vector<Light> to_lights(const py::object& values, bool& single) {
  single = py::isinstance<Light>(values);
  if (single) return {values.cast<const Light&>()};
  std::vector<Light> lights;
  for (const py::handle value : values) {
    if (!py::isinstance<Light>(value)) throw py::type_error("lights: expected a Light or a sequence of them");
    lights.push_back(value.cast<const Light&>());
  }
  return lights;
}

/// The four results as a dictionary of arrays; [light] comes first unless the light was single.
py::dict solve(const ShadowSolver& solver, PyScene& scene, const py::object& receiver_values,
               const py::object& light_values, PyWorkspace& workspace, const py::object& want_masks,
               const py::object& want_visibility, const py::object& want_irradiance,
               const py::object& want_total_irradiance, const py::object& normals, const py::object& meshes,
               const py::object& triangles, std::optional<double> lift, std::uint32_t first,
               std::optional<std::uint32_t> frame, const py::object& progress, bool serial) {
  bool single = false;
  const std::vector<Light> lights = to_lights(light_values, single);
  const Receivers receivers = to_receivers(receiver_values, normals, meshes, triangles, lift, first, frame);

  std::vector<py::ssize_t> shape = receivers.shape;
  const auto with = [](std::vector<py::ssize_t> base, py::ssize_t last) {
    base.push_back(last);
    return base;
  };
  const std::vector<py::ssize_t> rgb_shape = with(shape, 3);
  if (!single) shape.insert(shape.begin(), static_cast<py::ssize_t>(lights.size()));
  const auto words = static_cast<py::ssize_t>(solver.mask_words(lights));
  const auto masks = mask_result(want_masks, with(shape, words));
  const auto visibility = float_result(want_visibility, shape, "visibility");
  const auto irradiance = float_result(want_irradiance, with(shape, 3), "irradiance");
  const auto total = float_result(want_total_irradiance, rgb_shape, "total_irradiance");

  const auto colors = [](std::span<float> values) {
    return std::span(reinterpret_cast<vec3*>(values.data()), values.size() / 3);
  };
  const ShadowOutput output{masks.memory, visibility.memory, colors(irradiance.memory), colors(total.memory)};
  const Execution execution = execution_of(progress, serial);
  const UseCount::Reading reading(scene.uses);
  const UseCount::Writing writing(workspace.uses);
  without_lock([&] {
    if (receivers.gbuffer != nullptr) {
      solver.solve(scene.value, *receivers.gbuffer, lights, workspace.value, output, execution);
    } else {
      solver.solve(scene.value, receivers.view, lights, workspace.value, output, execution);
    }
  });
  return py::dict("masks"_a = masks.array, "visibility"_a = visibility.array, "irradiance"_a = irradiance.array,
                  "total_irradiance"_a = total.array);
}

void bind_solvers(py::module_& m) {
  const ShadowConfig defaults;
  py::class_<PyWorkspace>(m, "Workspace",
                          "Scratch memory, and what can be kept from call to call, of one call at a time.")
      .def(py::init<std::uint32_t>(), "kept_lights"_a = WorkspaceConfig().kept_lights)
      .def("clear",
           [](PyWorkspace& workspace) {
             const UseCount::Writing writing(workspace.uses);
             workspace.value.clear();
           })
      .def_property_readonly("bytes",
                             [](PyWorkspace& workspace) {
                               const UseCount::Reading reading(workspace.uses);
                               return workspace.value.bytes();
                             })
      .def_property_readonly("stats", [](PyWorkspace& workspace) {
        const UseCount::Reading reading(workspace.uses);
        return dict_of(workspace.value.stats());
      });
  py::class_<ShadowSolver>(m, "BaseSolver")
      .def(py::init(&make_solver), py::kw_only(), "method"_a = name_of(defaults.method),
           "light_sample_count"_a = defaults.light_sample_count, "pattern"_a = name_of(defaults.pattern),
           "sample_sets"_a = defaults.sample_sets, "seed"_a = defaults.seed, "frame"_a = defaults.frame,
           "interleave"_a = defaults.interleave, "rotate_sets"_a = defaults.rotate_sets, "options"_a = py::dict())
      .def("sample_count", &ShadowSolver::sample_count, "light"_a)
      .def(
          "mask_words",
          [](const ShadowSolver& solver, const py::object& lights) {
            bool single = false;
            return solver.mask_words(to_lights(lights, single));
          },
          "lights"_a)
      .def("solve_into", &solve);
}

}  // namespace
}  // namespace halfshade::python

PYBIND11_MODULE(_halfshade, m) {
  using namespace halfshade::python;
  m.attr("__version__") = HALFSHADE_VERSION_TEXT;
  m.attr("NONE") = halfshade::kNone;
  bind_errors(m);
  bind_lights(m);
  bind_scenes(m);
  bind_gbuffers(m);
  bind_solvers(m);
}
