#include "rasterizer/shading.h"

#include <algorithm>
#include <cmath>

#include "rasterizer/core/parallel.h"

namespace halfshade {
namespace {

/// Centre of a light that stands for all of it in the cosine.
dvec3 light_center(const Light& light) {
  if (light.shape != LightShape::kSamples) return light.center;
  dvec3 sum(0.0);
  for (const dvec3& p : light.points) sum += p;
  return sum / static_cast<double>(light.points.size());
}

vec3 unit(const dvec3& v) {
  const double length = std::sqrt(glm::dot(v, v));
  return length > 0.0 ? vec3(v / length) : vec3(0.0f);
}

}  // namespace

std::vector<vec3> shade(const GBuffer& gbuffer, const LocalFrame& frame, const View& view,
                        std::span<const std::vector<float>> visibility, const Ambient& ambient) {
  std::vector<dvec3> centers;
  for (const Light& light : view.lights) centers.push_back(frame.to_local(light_center(light)));
  const vec3 up = unit(view.camera.up);
  std::vector<vec3> color(gbuffer.size(), kBackground);
  parallel_ranges(gbuffer.size(), 16384, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) {
      if (gbuffer.triangle[i] == kNone) continue;
      const vec3 normal = gbuffer.shading_normal[i];
      const float sky = 0.5f + 0.5f * glm::dot(normal, up);
      vec3 light = ambient.ground + (ambient.sky - ambient.ground) * sky;
      for (std::size_t k = 0; k < centers.size(); ++k) {
        const float cosine = std::max(0.0f, glm::dot(normal, unit(centers[k] - gbuffer.position[i])));
        light += view.lights[k].emission * (cosine * visibility[k][i]);
      }
      color[i] = gbuffer.albedo[i] * light;
    }
  });
  return color;
}

}  // namespace halfshade
