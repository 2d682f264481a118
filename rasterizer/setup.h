// Triangle set-up: clip, snap to 1/256 pixel, edge functions with the top-left rule, and the plane of 1/w.
//
// Snapped coordinates are integers, so edge functions are exact: two triangles that share an edge see the same line
// and every pixel centre falls on one side of it (Pineda 1988; Olano and Greer 1997 for homogeneous coordinates).
#pragma once

#include "rasterizer/clip.h"
#include "rasterizer/core/mesh.h"
#include "rasterizer/coverage_kernel.h"

namespace halfshade {

/// 1/w = x * px + (y * py + constant), kept within the range of the triangle's corners: set-up snaps the outline, so a
/// pixel centre may lie just outside the true triangle, where a steep plane runs away.
struct DepthPlane {
  double x = 0.0, y = 0.0, constant = 0.0;
  double min = 0.0, max = 0.0;

  double row_term(double y_px) const { return y * y_px + constant; }
  /// The order of operations is fixed: any change would make the depth test depend on who evaluates it.
  double at(double x_px, double row) const {
    const double value = x * x_px + row;
    return value < min ? min : (value > max ? max : value);
  }
};

/// A triangle, or a piece of a clipped one, ready to be drawn. Positive area: its inside is E >= 0.
struct ScreenTriangle {
  std::array<std::int32_t, 3> x_fx8{}, y_fx8{};  // 256 units per pixel, origin at the picture's top left corner
  DepthPlane depth;
  std::uint32_t triangle = 0;       // the mesh's number
  std::uint32_t alpha_map = kNone;  // index into Scene::alpha_maps
};

/// Snaps three points with w > 0. False when they are outside the guard band (or not finite) or enclose no area.
bool snap_triangle(const PixelPoint& a, const PixelPoint& b, const PixelPoint& c, ScreenTriangle& out);

/// The pixels of `window` whose centres lie in the snapped triangle's bounding box; width() or height() 0 if none.
PixelWindow covered_box(const ScreenTriangle& triangle, const PixelWindow& window);

/// Edge functions relative to a tile of at most 64 x 64 pixels; false when the triangle covers nothing there.
bool make_tile_triangle(const ScreenTriangle& triangle, const PixelWindow& tile, TileTriangle& out);

/// False when the triangle has no area or its plane goes through the eye: it is seen as a line and covers nothing.
bool make_depth_plane(const std::array<vec3, 3>& corners, const CameraFrame& camera, DepthPlane& out);

struct SetupCounts {
  std::uint64_t clipped = 0;   // triangles crossed by a plane of the clip volume
  std::uint64_t survived = 0;  // triangles with at least one piece in the window
};

/// Appends the pieces of triangles begin .. end that may cover pixels of `window`, in triangle order.
/// `points` are the mesh's positions projected by `camera`.
void set_up_triangles(const LatticeMesh& mesh, const CameraFrame& camera, std::span<const PixelPoint> points,
                      const PixelWindow& window, std::size_t begin, std::size_t end,
                      std::vector<ScreenTriangle>& pieces, SetupCounts& counts);

}  // namespace halfshade
