#include "rasterizer/clip.h"

#include <algorithm>

namespace halfshade {
namespace {

constexpr unsigned kPlanes = 5;

// Signed distance to plane `plane`, times w for the guard band; inside is >= 0. Linear in p, also where w <= 0.
double distance(const PixelPoint& p, const ClipVolume& volume, unsigned plane) {
  switch (plane) {
    case 0:
      return p.z - kNearPlane;
    case 1:
      return p.x - volume.x_min_px * p.z;
    case 2:
      return volume.x_max_px * p.z - p.x;
    case 3:
      return p.y - volume.y_min_px * p.z;
    default:
      return volume.y_max_px * p.z - p.y;
  }
}

// Bit k is set when p lies outside plane k (or is not a number).
unsigned outcode(const PixelPoint& p, const ClipVolume& volume) {
  unsigned code = 0;
  for (unsigned plane = 0; plane != kPlanes; ++plane) code |= distance(p, volume, plane) >= 0.0 ? 0u : 1u << plane;
  return code;
}

// Where the segment crosses the plane. Always computed from the inside end, so that both triangles of an edge agree.
PixelPoint crossing(const PixelPoint& inside, double d_inside, const PixelPoint& outside, double d_outside) {
  return inside + (outside - inside) * (d_inside / (d_inside - d_outside));
}

ClippedPolygon clip_by_plane(const ClippedPolygon& in, const ClipVolume& volume, unsigned plane) {
  ClippedPolygon out;
  for (std::uint32_t i = 0; i != in.count; ++i) {
    const PixelPoint& a = in.points[i];
    const PixelPoint& b = in.points[i + 1 == in.count ? 0 : i + 1];
    const double da = distance(a, volume, plane), db = distance(b, volume, plane);
    const bool a_inside = da >= 0.0, b_inside = db >= 0.0;
    if (out.count + 2 > out.points.size()) break;  // not reached by a convex polygon, which gains one point per plane
    if (a_inside) out.points[out.count++] = a;
    if (a_inside != b_inside) out.points[out.count++] = a_inside ? crossing(a, da, b, db) : crossing(b, db, a, da);
  }
  return out;
}

}  // namespace

ClipVolume make_clip_volume(const CameraFrame& camera) {
  return {camera.center_x_px - kGuardBandPx, camera.center_x_px + kGuardBandPx, camera.center_y_px - kGuardBandPx,
          camera.center_y_px + kGuardBandPx};
}

ClippedPolygon clip_triangle(const std::array<PixelPoint, 3>& triangle, const ClipVolume& volume) {
  const std::array<unsigned, 3> codes = {outcode(triangle[0], volume), outcode(triangle[1], volume),
                                         outcode(triangle[2], volume)};
  ClippedPolygon polygon;
  if ((codes[0] & codes[1] & codes[2]) != 0) return polygon;
  polygon.count = 3;
  std::copy(triangle.begin(), triangle.end(), polygon.points.begin());
  if ((codes[0] | codes[1] | codes[2]) == 0) return polygon;
  // The near plane comes first: behind the eye the guard band's planes say nothing about pixels.
  for (unsigned plane = 0; plane != kPlanes && polygon.count >= 3; ++plane) {
    polygon = clip_by_plane(polygon, volume, plane);
  }
  if (polygon.count < 3) polygon.count = 0;
  polygon.clipped = true;
  return polygon;
}

}  // namespace halfshade
