// Near-plane and guard-band clipping in homogeneous pixel coordinates (Sutherland and Hodgman 1974; Blinn and Newell
// 1978 for the homogeneous form).
//
// The guard band bounds the integers of set-up; it reaches far outside the picture, so few triangles cross it and the
// edges that clipping adds along it are never seen.
#pragma once

#include "rasterizer/camera_frame.h"

namespace halfshade {

/// Half the side of the guard band in pixels, measured from the picture's centre. A picture has at most 16384 samples
/// per side, so its border lies at least 8192 px inside.
inline constexpr double kGuardBandPx = 16384.0;

/// Nearest distance along the camera's axis that is drawn, in local frame units: 2^-16 of the frame, whose half side
/// is 1. There is no far plane.
inline constexpr double kNearPlane = 0x1p-16;

struct ClipVolume {
  double x_min_px = 0.0, x_max_px = 0.0, y_min_px = 0.0, y_max_px = 0.0;  // guard band
};

ClipVolume make_clip_volume(const CameraFrame& camera);

struct ClippedPolygon {
  std::array<PixelPoint, 10> points;  // three corners, one more per plane, two spare for rounding
  std::uint32_t count = 0;            // 0: nothing left
  bool clipped = false;               // a plane crossed the triangle
};

/// The part of a triangle inside the volume, in the triangle's winding; a triangle wholly inside is returned unchanged.
/// Two triangles that share an edge (the same two points) get the same new points on it.
ClippedPolygon clip_triangle(const std::array<PixelPoint, 3>& triangle, const ClipVolume& volume);

}  // namespace halfshade
