#include "rasterizer/attributes.h"

#include <algorithm>
#include <cmath>

#include "rasterizer/core/srgb_table.h"

namespace halfshade {
namespace {

constexpr vec3 kDefaultAlbedo{0.8f};  // of a mesh without a scene

// 0 for not-a-number, too.
double clamp_to_unit(double x) { return x > 0.0 ? (x < 1.0 ? x : 1.0) : 0.0; }

// floor(coordinate) mod size. Coordinates beyond 2^62 have no texel of their own; they (and NaN) get texel 0.
std::uint32_t wrap_texel(double coordinate, std::uint32_t size) {
  const double cell = std::floor(coordinate);
  if (!(std::fabs(cell) < 0x1p62)) return 0;
  const std::int64_t remainder = static_cast<std::int64_t>(cell) % std::int64_t{size};
  return static_cast<std::uint32_t>(remainder < 0 ? remainder + size : remainder);
}

dvec2 interpolate(const std::array<vec2, 3>& uvs, const dvec3& weights) {
  return dvec2(uvs[0]) * weights.x + dvec2(uvs[1]) * weights.y + dvec2(uvs[2]) * weights.z;
}

vec3 linear_texel(const ColorMap& map, std::uint32_t column, std::uint32_t row) {
  const std::uint8_t* rgb = &map.rgb[(std::size_t{row} * map.width + column) * 3];
  return {kLinearFromSrgb[rgb[0]], kLinearFromSrgb[rgb[1]], kLinearFromSrgb[rgb[2]]};
}

// Bilinear in linear light, repeated; texel centres at +0.5.
vec3 sample_color(const ColorMap& map, const dvec2& uv) {
  const double x = uv.x * map.width - 0.5, y = (1.0 - uv.y) * map.height - 0.5;
  const std::uint32_t x0 = wrap_texel(x, map.width), y0 = wrap_texel(y, map.height);
  const std::uint32_t x1 = x0 + 1 == map.width ? 0 : x0 + 1, y1 = y0 + 1 == map.height ? 0 : y0 + 1;
  const auto fx = static_cast<float>(clamp_to_unit(x - std::floor(x)));
  const auto fy = static_cast<float>(clamp_to_unit(y - std::floor(y)));
  const vec3 top = linear_texel(map, x0, y0) * (1.0f - fx) + linear_texel(map, x1, y0) * fx;
  const vec3 bottom = linear_texel(map, x0, y1) * (1.0f - fx) + linear_texel(map, x1, y1) * fx;
  return top * (1.0f - fy) + bottom * fy;
}

// Everything about a triangle that its samples share. Neighbouring samples mostly show the same one.
class TriangleSurface {
 public:
  TriangleSurface(const LatticeMesh& mesh, const CameraFrame& camera, std::uint32_t triangle)
      : camera_(camera), planes_(make_barycentric_planes(mesh.corners(triangle), camera.eye)) {
    const std::array<vec3, 3> corners = mesh.corners(triangle);
    for (std::size_t i = 0; i != 3; ++i) corners_[i] = dvec3(corners[i]);
    const dvec3 normal = glm::cross(corners_[1] - corners_[0], corners_[2] - corners_[0]);
    normal_ = normal / std::sqrt(glm::dot(normal, normal));
    if (glm::dot(normal_, camera.eye - corners_[0]) < 0.0) normal_ = -normal_;
    if (mesh.scene != nullptr) look_up(*mesh.scene, triangle);
  }

  void write(const dvec3& ray, std::size_t entry, GBuffer& gbuffer) const {
    const dvec3 weights = planes_.weights(ray);
    const dvec3 position = corners_[0] * weights.x + corners_[1] * weights.y + corners_[2] * weights.z;
    gbuffer.position[entry] = position;
    gbuffer.geometric_normal[entry] = vec3(normal_);
    gbuffer.shading_normal[entry] = vec3(shading_normal(weights));
    gbuffer.albedo[entry] =
        color_map_ == nullptr ? diffuse_ : diffuse_ * sample_color(*color_map_, interpolate(*uvs_, weights));
    gbuffer.depth[entry] = static_cast<float>(glm::dot(position - camera_.eye, camera_.forward));
  }

 private:
  void look_up(const Scene& scene, std::uint32_t triangle) {
    if (!scene.triangle_normals.empty()) normals_ = &scene.triangle_normals[triangle];
    const Material& material = scene.materials[scene.triangle_materials[triangle]];
    diffuse_ = material.diffuse;
    if (material.color_map == kNone || scene.triangle_uvs.empty()) return;
    color_map_ = &scene.color_maps[material.color_map];
    uvs_ = &scene.triangle_uvs[triangle];
    if (diffuse_ == vec3(0.0f)) diffuse_ = vec3(1.0f);  // exporters write a black Kd beside map_Kd
  }

  // Interpolated, on the same side as the geometric normal; the geometric one where the scene has none.
  dvec3 shading_normal(const dvec3& weights) const {
    if (normals_ == nullptr) return normal_;
    const auto& n = *normals_;
    const dvec3 sum = dvec3(n[0]) * weights.x + dvec3(n[1]) * weights.y + dvec3(n[2]) * weights.z;
    const double length = std::sqrt(glm::dot(sum, sum));
    if (!(length > 1e-6)) return normal_;
    return glm::dot(sum, normal_) < 0.0 ? -sum / length : sum / length;
  }

  const CameraFrame& camera_;
  BarycentricPlanes planes_;
  std::array<dvec3, 3> corners_;  // local frame
  dvec3 normal_{0.0};             // unit, on the camera's side
  vec3 diffuse_ = kDefaultAlbedo;
  const std::array<vec3, 3>* normals_ = nullptr;
  const std::array<vec2, 3>* uvs_ = nullptr;
  const ColorMap* color_map_ = nullptr;
};

void write_background(std::size_t entry, GBuffer& gbuffer) {
  gbuffer.position[entry] = dvec3(0.0);
  gbuffer.geometric_normal[entry] = gbuffer.shading_normal[entry] = gbuffer.albedo[entry] = vec3(0.0f);
  gbuffer.depth[entry] = 0.0f;
}

}  // namespace

dvec3 BarycentricPlanes::weights(const dvec3& ray) const {
  const double scale = 1.0 / glm::dot(determinant, ray);
  const double b = glm::dot(second, ray) * scale, c = glm::dot(third, ray) * scale;
  const dvec3 clamped{clamp_to_unit(1.0 - b - c), clamp_to_unit(b), clamp_to_unit(c)};
  const double sum = clamped.x + clamped.y + clamped.z;
  return sum > 0.0 ? clamped / sum : dvec3(1.0 / 3.0);
}

// Moeller and Trumbore 1997, with the ray taken out: with t = eye - a, e = b - a, f = c - a the determinant is
// ray.(f x e), the weight of b is ray.(f x t) and that of c is ray.(t x e), each over the determinant.
BarycentricPlanes make_barycentric_planes(const std::array<vec3, 3>& corners, const dvec3& eye) {
  const dvec3 a(corners[0]);
  const dvec3 e = dvec3(corners[1]) - a, f = dvec3(corners[2]) - a, t = eye - a;
  return {glm::cross(f, e), glm::cross(f, t), glm::cross(t, e)};
}

bool is_opaque(const AlphaMap& map, double u, double v, float cutoff) {
  const std::uint32_t column = wrap_texel(u * map.width, map.width);
  const std::uint32_t row = map.height - 1 - wrap_texel(v * map.height, map.height);
  return static_cast<float>(map.alpha[std::size_t{row} * map.width + column]) / 255.0f >= cutoff;
}

AlphaTest::AlphaTest(const LatticeMesh& mesh, const CameraFrame& camera, std::uint32_t triangle,
                     std::uint32_t alpha_map)
    : planes_(make_barycentric_planes(mesh.corners(triangle), camera.eye)),
      uvs_(mesh.scene->triangle_uvs[triangle]),
      map_(mesh.scene->alpha_maps[alpha_map]),
      cutoff_(mesh.scene->materials[mesh.scene->triangle_materials[triangle]].alpha_cutoff) {}

bool AlphaTest::passes(const dvec3& ray) const {
  const dvec2 uv = interpolate(uvs_, planes_.weights(ray));
  return is_opaque(map_, uv.x, uv.y, cutoff_);
}

void resolve_row(const LatticeMesh& mesh, const CameraFrame& camera, std::uint32_t x0, std::uint32_t y,
                 std::span<const std::uint32_t> triangles, GBuffer& gbuffer) {
  const PixelWindow& window = gbuffer.window;
  std::size_t entry = std::size_t{y - window.y0} * window.width() + (x0 - window.x0);
  std::size_t i = 0;
  while (i != triangles.size()) {
    const std::uint32_t triangle = triangles[i];
    if (triangle == kNone) {
      gbuffer.triangle[entry] = kNone;
      write_background(entry++, gbuffer);
      ++i;
      continue;
    }
    const TriangleSurface surface(mesh, camera, triangle);
    for (; i != triangles.size() && triangles[i] == triangle; ++i, ++entry) {
      gbuffer.triangle[entry] = triangle;
      surface.write(camera.ray(x0 + static_cast<double>(i) + 0.5, y + 0.5), entry, gbuffer);
    }
  }
}

}  // namespace halfshade
