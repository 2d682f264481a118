#include "shadows/c_convert.h"

#include <algorithm>
#include <sstream>

#include "halfshade/names.h"
#include "shadows/view_access.h"

namespace halfshade {

static_assert(static_cast<int>(LightShape::kPoint) == HALFSHADE_LIGHT_POINT &&
              static_cast<int>(LightShape::kRectangle) == HALFSHADE_LIGHT_RECTANGLE &&
              static_cast<int>(LightShape::kDisk) == HALFSHADE_LIGHT_DISK &&
              static_cast<int>(LightShape::kSphere) == HALFSHADE_LIGHT_SPHERE &&
              static_cast<int>(LightShape::kSamples) == HALFSHADE_LIGHT_SAMPLES &&
              static_cast<int>(LightShape::kEllipsoid) == HALFSHADE_LIGHT_ELLIPSOID &&
              static_cast<int>(LightShape::kPolygon) == HALFSHADE_LIGHT_POLYGON &&
              static_cast<int>(LightShape::kSun) == HALFSHADE_LIGHT_SUN);
static_assert(kNone == HALFSHADE_NONE && kDefaultLift == HALFSHADE_DEFAULT_LIFT);

namespace {

[[noreturn]] void usage(const std::string& what) { throw Error(ErrorCode::kUsage, what); }

dvec3 to_point(const double (&xyz)[3]) { return {xyz[0], xyz[1], xyz[2]}; }
vec3 to_color(const float (&rgb)[3]) { return {rgb[0], rgb[1], rgb[2]}; }

/// `count` elements of `data`, or none when NULL.
template <class Value>
std::span<Value> to_span(Value* data, std::size_t count, const std::string& name) {
  check_array(data, count, 0, sizeof(Value), alignof(Value), name);
  return {data, data == nullptr ? 0 : count};
}

/// An output: none when NULL; `any` of its elements are needed.
template <class Value>
std::span<Value> to_output_span(Value* data, std::size_t count, bool any, const std::string& name) {
  if (any && data != nullptr && count == 0) usage(name + " has 0 elements; NULL stands for not wanted");
  return to_span(data, count, name);
}

/// The same for colours in an array of floats.
std::span<vec3> to_output_colors(float* data, std::size_t count, bool any, const std::string& name) {
  to_output_span(data, count, any, name);
  if (count % 3 != 0) usage(name + " holds " + std::to_string(count) + " floats, which is no multiple of 3");
  return {reinterpret_cast<vec3*>(data), data == nullptr ? 0 : count / 3};
}

void read_emission_image(const halfshade_light& given, const std::string& name, EmissionImage& image) {
  image.width = image.height = 0;
  image.rgb.clear();
  if (given.emission_image == nullptr) return;
  if (given.image_width == 0 || given.image_height == 0) usage(name + ".emission_image has no width or no height");
  const std::uint64_t texels = std::uint64_t{given.image_width} * given.image_height;
  if (texels > kMostInC) throw Error(ErrorCode::kLimit, name + ".emission_image has more than 2^31 - 1 texels");
  check_array(given.emission_image, texels, 0, sizeof(vec3), 1, name + ".emission_image");
  image.width = given.image_width;
  image.height = given.image_height;
  image.rgb.resize(texels);
  std::memcpy(image.rgb.data(), given.emission_image, texels * sizeof(vec3));
}

void read_points(const halfshade_points& points, const std::string& name, std::vector<dvec3>& values) {
  const PointView view = to_view(points, name);
  values.resize(view.count);
  for (std::size_t i = 0; i < view.count; ++i) values[i] = element(view, i);
}

}  // namespace

void check_struct_size(std::size_t struct_size, std::size_t known, const char* name) {
  // The size of a struct is a multiple of its alignment: no other number can have been sizeof.
  const bool possible = struct_size % alignof(std::size_t) == 0;
  if (possible && struct_size >= known && struct_size <= known + kMostUnknownBytes) return;
  usage(std::string(name) + ".struct_size is " + std::to_string(struct_size) + ", expected sizeof, " +
        std::to_string(known));
}

void check_array(const void* data, std::size_t count, std::size_t stride_bytes, std::size_t element_bytes,
                 std::size_t alignment, const std::string& name) {
  const auto limit = [&name](const std::string& what) {
    throw Error(ErrorCode::kLimit, name + what + ", allowed are 2^31 - 1");
  };
  if (count > kMostInC) limit(" has " + std::to_string(count) + " elements");
  if (stride_bytes > kMostInC) limit(": stride of " + std::to_string(stride_bytes) + " bytes");
  if (count == 0) return;
  if (data == nullptr) usage(name + " has " + std::to_string(count) + " elements, but its data is NULL");
  if (stride_bytes != 0 && stride_bytes < element_bytes) {
    usage(name + ": stride of " + std::to_string(stride_bytes) + " bytes, but an element has " +
          std::to_string(element_bytes));
  }
  if (reinterpret_cast<std::uintptr_t>(data) % alignment != 0 || stride_bytes % alignment != 0) {
    usage(name + ": address or stride is no multiple of " + std::to_string(alignment));
  }
}

PointView to_view(const halfshade_points& points, const std::string& name) {
  const int scalar = number_of(points.scalar);
  const bool is_double = scalar == HALFSHADE_FLOAT64;
  if (!is_double && scalar != HALFSHADE_FLOAT32) {
    usage(name + ".scalar is " + std::to_string(scalar) + ", allowed are 0 and 1");
  }
  check_array(points.data, points.count, points.stride_bytes, 3 * (is_double ? sizeof(double) : sizeof(float)), 1,
              name);
  if (is_double) return {static_cast<const double*>(points.data), points.count, points.stride_bytes};
  return {static_cast<const float*>(points.data), points.count, points.stride_bytes};
}

IndexView to_view(const halfshade_indices& indices, const std::string& name) {
  check_array(indices.data, indices.count, indices.stride_bytes, sizeof(std::uint32_t), 1, name);
  return {indices.data, indices.count, indices.stride_bytes};
}

TriangleView to_triangles(const halfshade_indices& triangles, const std::string& name) {
  check_array(triangles.data, triangles.count, triangles.stride_bytes, 3 * sizeof(std::uint32_t), 1, name);
  return {triangles.data, triangles.count, triangles.stride_bytes};
}

UvView to_view(const halfshade_uvs& uvs, const std::string& name) {
  check_array(uvs.data, uvs.count, uvs.stride_bytes, 2 * sizeof(float), 1, name);
  return {uvs.data, uvs.count, uvs.stride_bytes};
}

AlphaView to_view(const halfshade_alpha_desc* given) {
  const halfshade_alpha_desc desc = read_struct(given, "alpha map");
  if (desc.data == nullptr) usage("alpha map: data is NULL");
  if (desc.texel_bytes > kMostInC || desc.row_bytes > kMostInC) {
    throw Error(ErrorCode::kLimit, "alpha map: texels or rows are more than 2^31 - 1 bytes apart");
  }
  const std::size_t texel_bytes = desc.texel_bytes != 0 ? desc.texel_bytes : 1;
  const std::uint64_t width_bytes = std::uint64_t{std::max(desc.width, 1u) - 1} * texel_bytes + 1;
  if (desc.row_bytes != 0 && desc.row_bytes < width_bytes) {
    usage("alpha map: rows are " + std::to_string(desc.row_bytes) + " bytes apart, but one has " +
          std::to_string(width_bytes));
  }
  return {desc.data, desc.width, desc.height, desc.row_bytes, desc.texel_bytes};
}

MeshView to_view(const halfshade_mesh_desc* given) {
  const halfshade_mesh_desc desc = read_struct(given, "mesh");
  MeshView view;
  view.positions = to_view(desc.positions, "mesh.positions");
  view.triangles = to_triangles(desc.triangles, "mesh.triangles");
  view.transform = to_transform(&desc.transform[0][0]);
  view.uvs = to_view(desc.uvs, "mesh.uvs");
  view.alpha_map = desc.alpha_map;
  view.alpha_cutoff = desc.alpha_cutoff;
  view.albedo = to_color(desc.albedo);
  return view;
}

ReceiverView to_view(const halfshade_receivers* given) {
  const halfshade_receivers desc = read_struct(given, "receivers");
  ReceiverView view;
  view.positions = to_view(desc.positions, "receivers.positions");
  view.normals = to_view(desc.normals, "receivers.normals");
  view.meshes = to_view(desc.meshes, "receivers.meshes");
  view.triangles = to_view(desc.triangles, "receivers.triangles");
  view.lift = desc.lift;
  view.first = desc.first;
  view.frame = desc.frame;
  return view;
}

ShadowOutput to_output(const halfshade_output* given, bool any) {
  const halfshade_output desc = read_struct(given, "output");
  return {.masks = to_output_span(desc.masks, desc.mask_count, any, "output.masks"),
          .visibility = to_output_span(desc.visibility, desc.visibility_count, any, "output.visibility"),
          .irradiance = to_output_colors(desc.irradiance, desc.irradiance_count, any, "output.irradiance"),
          .total_irradiance =
              to_output_colors(desc.total_irradiance, desc.total_irradiance_count, any, "output.total_irradiance")};
}

Transform to_transform(const double* rows) {
  if (rows == nullptr) usage("transform is NULL");
  Transform transform;
  for (std::size_t i = 0; i < 12; ++i) transform.row[i / 4][i % 4] = rows[i];
  return transform;
}

void to_light(const halfshade_light* given, const std::string& name, Light& light) {
  const halfshade_light desc = read_struct(given, name.c_str());
  const int shape = number_of(desc.shape);
  if (shape < HALFSHADE_LIGHT_POINT || shape > HALFSHADE_LIGHT_SUN) {
    usage(name + ".shape is " + std::to_string(shape) + ", allowed are 0 to " +
          std::to_string(static_cast<int>(HALFSHADE_LIGHT_SUN)));
  }
  light.shape = static_cast<LightShape>(shape);
  light.center = to_point(desc.center);
  light.u = to_point(desc.u);
  light.v = to_point(desc.v);
  light.normal = to_point(desc.normal);
  light.radius = desc.radius;
  for (std::size_t k = 0; k < 3; ++k) light.axes[k] = to_point(desc.axes[k]);
  read_points(desc.points, name + ".points", light.points);
  light.two_sided = desc.two_sided != 0;
  light.emission = to_color(desc.emission);
  light.angular_diameter_deg = desc.angular_diameter_deg;
  read_emission_image(desc, name, light.emission_image);
}

void to_lights(const halfshade_light* given, std::size_t count, std::vector<Light>& lights) {
  check_array(given, count, 0, sizeof(halfshade_light), alignof(halfshade_light), "lights");
  lights.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    const auto* one = reinterpret_cast<const halfshade_light*>(reinterpret_cast<const unsigned char*>(given) +
                                                               i * given->struct_size);
    // Before it is read: what it says may reach beyond the array.
    if (one->struct_size != given->struct_size) usage("lights differ in struct_size");
    to_light(one, "lights[" + std::to_string(i) + "]", lights[i]);
  }
}

ShadowConfig to_config(const halfshade_solver_desc* given) {
  const halfshade_solver_desc desc = read_struct(given, "solver");
  ShadowConfig config;
  if (desc.method != nullptr) config.method = shadow_method_from_name(desc.method);
  if (desc.pattern != nullptr) config.pattern = sample_pattern_from_name(desc.pattern);
  config.light_sample_count = desc.light_sample_count;
  config.sample_sets = desc.sample_sets;
  config.seed = desc.seed;
  config.frame = desc.frame;
  config.interleave = desc.interleave != 0;
  config.rotate_sets = desc.rotate_sets != 0;
  if (desc.options != nullptr) {
    std::istringstream options(desc.options);
    for (std::string assignment; options >> assignment;) set_method_option(config, assignment);
  }
  return config;
}

}  // namespace halfshade
