#include "rasterizer/shading.h"

#include <algorithm>
#include <cmath>

#include "rasterizer/core/parallel.h"

namespace halfshade {
namespace {

vec3 emission_of(const Light& light) {
  if (light.emission_image.empty()) return light.emission;
  dvec3 sum(0.0);
  for (const vec3& color : light.emission_image.rgb) sum += dvec3(color);
  return vec3(sum / static_cast<double>(light.emission_image.rgb.size()));
}

vec3 unit(const dvec3& v) {
  const double length = std::sqrt(glm::dot(v, v));
  return length > 0.0 ? vec3(v / length) : vec3(0.0f);
}

float cosine_towards(const dvec3& center, const GBuffer& gbuffer, std::size_t entry) {
  return std::max(0.0f, glm::dot(gbuffer.shading_normal[entry], unit(center - gbuffer.position[entry])));
}

}  // namespace

dvec3 light_center(const Light& light) {
  if (light.shape != LightShape::kSamples && light.shape != LightShape::kPolygon) return light.center;
  dvec3 sum(0.0);
  for (const dvec3& p : light.points) sum += p;
  return sum / static_cast<double>(light.points.size());
}

std::vector<vec3> light_response(const GBuffer& gbuffer, const LocalFrame& frame, const Light& light,
                                 std::span<const float> cosines) {
  const dvec3 center = frame.to_local(light_center(light));
  std::vector<vec3> response(gbuffer.size(), vec3(0.0f));
  for (std::size_t i = 0; i < gbuffer.size(); ++i) {
    if (gbuffer.triangle[i] == kNone) continue;
    response[i] = gbuffer.albedo[i] * (cosines.empty() ? cosine_towards(center, gbuffer, i) : cosines[i]);
  }
  return response;
}

std::vector<vec3> shade(const GBuffer& gbuffer, const LocalFrame& frame, const View& view,
                        std::span<const std::vector<float>> visibility, const Ambient& ambient,
                        std::span<const std::vector<vec3>> visible_emission,
                        std::span<const std::vector<float>> cosines) {
  std::vector<dvec3> centers;
  std::vector<vec3> emissions;
  for (const Light& light : view.lights) {
    centers.push_back(frame.to_local(light_center(light)));
    emissions.push_back(emission_of(light));
  }
  const vec3 up = unit(view.camera.up);
  std::vector<vec3> color(gbuffer.size(), kBackground);
  parallel_ranges(gbuffer.size(), 16384, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) {
      if (gbuffer.triangle[i] == kNone) continue;
      const vec3 normal = gbuffer.shading_normal[i];
      const float sky = 0.5f + 0.5f * glm::dot(normal, up);
      vec3 light = ambient.ground + (ambient.sky - ambient.ground) * sky;
      for (std::size_t k = 0; k < centers.size(); ++k) {
        const float cosine = k < cosines.size() ? cosines[k][i] : cosine_towards(centers[k], gbuffer, i);
        const bool weighted = k < visible_emission.size() && !visible_emission[k].empty();
        light += weighted ? visible_emission[k][i] * cosine : emissions[k] * (cosine * visibility[k][i]);
      }
      color[i] = gbuffer.albedo[i] * light;
    }
  });
  return color;
}

}  // namespace halfshade
