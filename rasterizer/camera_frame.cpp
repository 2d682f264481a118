#include "rasterizer/camera_frame.h"

#include <algorithm>

#include "halfshade/error.h"
#include "rasterizer/core/unit_circle.h"

namespace halfshade {
namespace {

// Up and view direction closer than this (sine of the angle) leave the picture's rotation to rounding errors.
constexpr double kMinSineOfUp = 1e-9;

// Unit vector, or zero for a zero vector. Scaling by the largest component first keeps the squares in range.
dvec3 unit_or_zero(const dvec3& v) {
  const double largest = std::max({std::fabs(v.x), std::fabs(v.y), std::fabs(v.z)});
  if (!(largest > 0.0)) return dvec3(0.0);
  const dvec3 scaled = v / largest;
  return scaled / std::sqrt(glm::dot(scaled, scaled));
}

[[noreturn]] void fail(const std::string& message) { throw Error(ErrorCode::kUsage, "camera: " + message); }

}  // namespace

CameraFrame make_camera_frame(const Camera& camera, const LocalFrame& frame, std::uint32_t width,
                              std::uint32_t height) {
  CameraFrame result;
  result.eye = frame.to_local(camera.eye);
  const dvec3 view = frame.to_local(camera.target) - result.eye;
  if (!is_finite(result.eye) || !is_finite(view) || !is_finite(camera.up)) fail("eye, target and up must be finite");
  result.forward = unit_or_zero(view);
  if (result.forward == dvec3(0.0)) fail("eye and target coincide");
  const dvec3 side = glm::cross(result.forward, unit_or_zero(camera.up));
  if (!(glm::dot(side, side) > kMinSineOfUp * kMinSineOfUp)) fail("up is zero or parallel to the view direction");
  result.right = unit_or_zero(side);
  result.up = glm::cross(result.right, result.forward);

  const double fov = camera.fov_y_deg;
  if (!(fov > 0.0 && fov < 180.0)) fail("fov_y_deg is " + std::to_string(fov) + ", allowed: between 0 and 180");
  const dvec2 half_angle = unit_circle(fov / 720.0);  // (cos, sin)
  result.center_x_px = width * 0.5;
  result.center_y_px = height * 0.5;
  result.focal_px = result.center_y_px * half_angle.x / half_angle.y;
  if (!std::isfinite(result.focal_px) || !(result.focal_px > 0.0)) fail("fov_y_deg is too close to 0 or 180");
  return result;
}

}  // namespace halfshade
