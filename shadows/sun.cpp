// The sun as a disk far away: see place_sun (halfshade/light.h).
#include <cmath>

#include "halfshade/error.h"
#include "halfshade/light.h"
#include "rasterizer/core/fp_environment.h"
#include "rasterizer/core/lattice.h"
#include "rasterizer/core/unit_vector.h"

namespace halfshade {

Light place_sun(const Light& light, const dvec3& low, const dvec3& high) {
  if (light.shape != LightShape::kSun) return light;
  const FpEnvironment environment;
  const auto require = [&](bool condition, const std::string& what) {
    if (!condition) throw Error(ErrorCode::kBadInput, "light '" + light.name + "': " + what);
  };
  require(is_finite(light.normal) && light.normal != dvec3(0.0), "the sun's direction is zero or not finite");
  require(light.angular_diameter_deg > 0.0 && light.angular_diameter_deg <= 60.0,
          "angular diameter " + std::to_string(light.angular_diameter_deg) + " is not above 0 and up to 60 degrees");
  const double half_diagonal = glm::length(high - low) * 0.5;
  require(is_finite(low) && std::isfinite(half_diagonal), "the box under the sun is not finite");
  const double distance = kSunDistance * (half_diagonal > 0.0 ? half_diagonal : 1.0);
  constexpr double kRadiansPerDegree = 3.14159265358979323846 / 180.0;
  Light disk = light;
  disk.shape = LightShape::kDisk;
  disk.normal = unit_vector(light.normal);
  disk.center = low + (high - low) * 0.5 - disk.normal * distance;
  disk.radius = distance * std::tan(light.angular_diameter_deg * 0.5 * kRadiansPerDegree);
  return disk;
}

}  // namespace halfshade
