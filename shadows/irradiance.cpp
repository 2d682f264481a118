#include "shadows/irradiance.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace halfshade {
namespace {

constexpr double kPi = 3.14159265358979323846;

/// Area of the emitter in units of the frame, or what stands for it.
double area_of(const Light& light, const LightSamples& samples, double scale) {
  switch (light.shape) {
    case LightShape::kRectangle:
      return glm::length(glm::cross(light.u, light.v)) * scale * scale;
    case LightShape::kDisk:
      return kPi * light.radius * light.radius * scale * scale;
    case LightShape::kSphere:
      return 4.0 * kPi * light.radius * light.radius * scale * scale;
    case LightShape::kEllipsoid:
      return 4.0 * kPi;  // of the unit sphere: the normals carry the rest
    case LightShape::kPolygon: {
      double twice = 0.0;
      const std::size_t n = samples.outline.size();
      for (std::size_t i = 0; i < n; ++i) {
        const dvec2 p = samples.outline[i], q = samples.outline[(i + 1) % n];
        twice += p.x * q.y - p.y * q.x;
      }
      return 0.5 * std::fabs(twice);
    }
    default:
      return scale * scale;  // intensity: distances of the frame squared
  }
}

/// Cosine at the light towards the receiver, times the stretch of an ellipsoid's surface; `to_light` is a unit vector.
double light_factor(const IrradianceSum& sum, const vec3& point, std::size_t index, const dvec3& to_light) {
  switch (sum.shape) {
    case LightShape::kRectangle:
    case LightShape::kDisk:
    case LightShape::kPolygon: {
      const double cosine = -glm::dot(sum.samples->axis_n, to_light);
      return sum.two_sided ? std::fabs(cosine) : std::fmax(cosine, 0.0);
    }
    case LightShape::kSphere: {
      const dvec3 normal = dvec3(point) - sum.center;
      const double length = glm::length(normal);
      return length > 0.0 ? std::fmax(-glm::dot(normal, to_light) / length, 0.0) : 0.0;
    }
    case LightShape::kEllipsoid: {
      const dvec3 p = unit_sphere_point(sum.samples->st[index]);
      const dvec3 normal = sum.cofactor[0] * p.x + sum.cofactor[1] * p.y + sum.cofactor[2] * p.z;
      return std::fmax(-glm::dot(normal, to_light), 0.0);
    }
    default:
      return 1.0;
  }
}

}  // namespace

IrradianceSum make_irradiance_sum(const Light& light, const LightSamples& samples, const LocalFrame& frame,
                                  std::span<const vec3> weights) {
  IrradianceSum sum;
  sum.samples = &samples;
  sum.shape = light.shape;
  sum.two_sided = light.two_sided;
  sum.weights = weights;
  sum.center = samples.center;
  const double area = area_of(light, samples, frame.scale);
  sum.strength = weights.empty() ? dvec3(light.emission) * (area / samples.count) : dvec3(area);
  const auto& [a, b, c] = light.axes;
  const double s = frame.scale * frame.scale, turn = glm::dot(glm::cross(a, b), c) < 0.0 ? -s : s;  // outwards
  sum.cofactor = {glm::cross(b, c) * turn, glm::cross(c, a) * turn, glm::cross(a, b) * turn};
  return sum;
}

vec3 irradiance(const IrradianceSum& sum, const vec3& position, const vec3& normal, std::uint32_t set,
                std::span<const std::uint64_t> mask) {
  const LightSamples& samples = *sum.samples;
  const std::span<const vec3> points = samples.set(set);
  const std::size_t first = std::size_t{set} * samples.count;
  dvec3 total(0.0);
  for (std::size_t word = 0; word * 64 < samples.count; ++word) {
    const std::size_t in_word = std::min<std::size_t>(64, samples.count - word * 64);
    std::uint64_t open = ~mask[word] & (~std::uint64_t{0} >> (64 - in_word));
    for (; open != 0; open &= open - 1) {
      const std::size_t i = word * 64 + static_cast<std::size_t>(std::countr_zero(open));
      const dvec3 way = dvec3(points[i]) - dvec3(position);
      const double squared = glm::dot(way, way), above = glm::dot(dvec3(normal), way);
      if (!(above > 0.0)) continue;
      const dvec3 to_light = way / std::sqrt(squared);
      const double factor =
          glm::dot(dvec3(normal), to_light) * light_factor(sum, points[i], first + i, to_light) / squared;
      total += sum.weights.empty() ? dvec3(factor) : dvec3(sum.weights[first + i]) * factor;
    }
  }
  return vec3(total * sum.strength);
}

}  // namespace halfshade
