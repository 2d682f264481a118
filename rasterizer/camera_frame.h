// The camera as the rasterizer uses it: an orthonormal frame in the mesh's local frame and a projection to pixels.
#pragma once

#include "halfshade/light.h"
#include "rasterizer/core/lattice.h"

namespace halfshade {

/// A point in homogeneous pixel coordinates: (column * w, row * w, w) with w = distance along the camera's axis, local
/// frame units. (0, 0) is the picture's top left corner; centres of pixels lie at +0.5.
using PixelPoint = dvec3;

struct CameraFrame {
  dvec3 eye{0.0};                                                          // local frame
  dvec3 right{1.0, 0.0, 0.0}, up{0.0, 1.0, 0.0}, forward{0.0, 0.0, -1.0};  // unit, world = local directions
  double focal_px = 1.0;                                                   // pixels per unit of slope
  double center_x_px = 0.0, center_y_px = 0.0;                             // where `forward` meets the picture

  PixelPoint project(const dvec3& local) const {
    const dvec3 d = local - eye;
    const double w = glm::dot(d, forward);
    return {focal_px * glm::dot(d, right) + center_x_px * w, center_y_px * w - focal_px * glm::dot(d, up), w};
  }
  /// Direction from the eye through (x_px, y_px); its component along `forward` is 1.
  dvec3 ray(double x_px, double y_px) const {
    return forward + right * ((x_px - center_x_px) / focal_px) + up * ((center_y_px - y_px) / focal_px);
  }
};

/// Throws Error{kUsage} when eye, target or up are not finite, eye and target coincide, up is parallel to the view
/// direction, or fov_y_deg is outside (0, 180).
CameraFrame make_camera_frame(const Camera& camera, const LocalFrame& frame, std::uint32_t width, std::uint32_t height);

}  // namespace halfshade
