#include "rasterizer/setup.h"

#include <algorithm>
#include <utility>

namespace halfshade {
namespace {

// Snapped coordinates stay within the guard band around a centre of at most 8192 px: (8192 + 16384 + 1) * 256 < 2^23.
constexpr double kMaxCoordinateFx8 = 0x1p23;

// Round to the nearest 1/256 pixel; false for anything that is not a number near the guard band.
bool snap(double homogeneous, double w, std::int32_t& out) {
  const double fx8 = homogeneous / w * 256.0;
  if (!(std::fabs(fx8) < kMaxCoordinateFx8)) return false;
  out = static_cast<std::int32_t>(std::floor(fx8 + 0.5));
  return true;
}

bool lexicographic_less(const vec3& a, const vec3& b) {
  if (a.x != b.x) return a.x < b.x;
  if (a.y != b.y) return a.y < b.y;
  return a.z < b.z;
}

// Pixel p has its centre at 256 p + 128: the first one inside [min, max] is ceil((min - 128) / 256), the last one
// floor((max - 128) / 256). The range is cut to begin .. end and may be empty.
void covered_range(const std::array<std::int32_t, 3>& fx8, std::uint32_t begin, std::uint32_t end, std::uint32_t& first,
                   std::uint32_t& past_last) {
  const std::int32_t low = std::min(std::min(fx8[0], fx8[1]), fx8[2]);
  const std::int32_t high = std::max(std::max(fx8[0], fx8[1]), fx8[2]);
  const auto begin_signed = static_cast<std::int32_t>(begin), end_signed = static_cast<std::int32_t>(end);
  const std::int32_t p0 = std::clamp((low + 127) >> 8, begin_signed, end_signed);
  const std::int32_t p1 = std::clamp(((high - 128) >> 8) + 1, p0, end_signed);
  first = static_cast<std::uint32_t>(p0);
  past_last = static_cast<std::uint32_t>(p1);
}

// 1/w of the corners bounds 1/w on the visible part; a corner behind the near plane is replaced by the plane itself.
void set_depth_range(const std::array<vec3, 3>& corners, const CameraFrame& camera, DepthPlane& out) {
  std::array<double, 3> w;
  for (std::size_t i = 0; i != 3; ++i) {
    w[i] = std::max(kNearPlane, glm::dot(dvec3(corners[i]) - camera.eye, camera.forward));
  }
  out.min = 1.0 / std::max({w[0], w[1], w[2]});
  out.max = 1.0 / std::min({w[0], w[1], w[2]});
}

// Splits the polygon into a fan and appends the pieces that may cover pixels of the window.
void append_pieces(const ClippedPolygon& polygon, const PixelWindow& window, ScreenTriangle& piece,
                   std::vector<ScreenTriangle>& pieces) {
  for (std::uint32_t i = 2; i < polygon.count; ++i) {
    if (!snap_triangle(polygon.points[0], polygon.points[i - 1], polygon.points[i], piece)) continue;
    const PixelWindow box = covered_box(piece, window);
    if (box.width() != 0 && box.height() != 0) pieces.push_back(piece);
  }
}

}  // namespace

bool snap_triangle(const PixelPoint& a, const PixelPoint& b, const PixelPoint& c, ScreenTriangle& out) {
  const std::array<const PixelPoint*, 3> points = {&a, &b, &c};
  for (std::size_t i = 0; i != 3; ++i) {
    const PixelPoint& p = *points[i];
    if (!snap(p.x, p.z, out.x_fx8[i]) || !snap(p.y, p.z, out.y_fx8[i])) return false;
  }
  const auto& x = out.x_fx8;
  const auto& y = out.y_fx8;
  // Differences are below 2^24, so the products fit 64 bits easily.
  const std::int64_t area = std::int64_t{x[1] - x[0]} * (y[2] - y[0]) - std::int64_t{x[2] - x[0]} * (y[1] - y[0]);
  if (area < 0) {  // both windings are drawn
    std::swap(out.x_fx8[1], out.x_fx8[2]);
    std::swap(out.y_fx8[1], out.y_fx8[2]);
  }
  return area != 0;
}

PixelWindow covered_box(const ScreenTriangle& triangle, const PixelWindow& window) {
  PixelWindow box;
  covered_range(triangle.x_fx8, window.x0, window.x1, box.x0, box.x1);
  covered_range(triangle.y_fx8, window.y0, window.y1, box.y0, box.y1);
  return box;
}

// An edge function moves by a multiple of 256 from pixel to pixel, so E >= 0 exactly when floor(E / 256) >= 0, and the
// quotient moves by a and b. An edge whose sign does not change in the box is dropped, or the triangle with it;
// for the others |E / 256| <= 63 (|a| + |b|) < 2^30, since |a| + |b| <= 2^24 in the guard band.
bool make_tile_triangle(const ScreenTriangle& triangle, const PixelWindow& tile, TileTriangle& out) {
  const PixelWindow box = covered_box(triangle, tile);
  if (box.width() == 0 || box.height() == 0) return false;
  const std::int64_t x_center = std::int64_t{box.x0} * 256 + 128, y_center = std::int64_t{box.y0} * 256 + 128;
  for (std::size_t k = 0; k != 3; ++k) {
    const std::size_t next = k == 2 ? 0 : k + 1;
    const std::int64_t a = triangle.y_fx8[k] - triangle.y_fx8[next];
    const std::int64_t b = triangle.x_fx8[next] - triangle.x_fx8[k];
    const bool top_left = a > 0 || (a == 0 && b > 0);  // rows grow downwards
    const std::int64_t edge = a * (x_center - triangle.x_fx8[k]) + b * (y_center - triangle.y_fx8[k]);
    const std::int64_t e = (edge - (top_left ? 0 : 1)) >> 8;
    const std::int64_t x_range = a * (box.width() - 1), y_range = b * (box.height() - 1);
    if (e + std::max<std::int64_t>(x_range, 0) + std::max<std::int64_t>(y_range, 0) < 0) return false;
    const bool inside = e + std::min<std::int64_t>(x_range, 0) + std::min<std::int64_t>(y_range, 0) >= 0;
    out.e[k] = inside ? 0 : static_cast<std::int32_t>(e);
    out.a[k] = inside ? 0 : static_cast<std::int32_t>(a);
    out.b[k] = inside ? 0 : static_cast<std::int32_t>(b);
  }
  out.column = static_cast<std::uint8_t>(box.x0 - tile.x0);
  out.row = static_cast<std::uint8_t>(box.y0 - tile.y0);
  out.width = static_cast<std::uint8_t>(box.width());
  out.height = static_cast<std::uint8_t>(box.height());
  return true;
}

// With the plane n.(p - eye) = d, the point at depth w along a ray of unit depth is eye + w ray, so 1/w = n.ray / d.
// Edges are exact differences on the lattice: n is good to the last bits however small the triangle is. Sorting the
// corners gives coincident triangles the same plane, whatever their winding, so that their depths tie.
bool make_depth_plane(const std::array<vec3, 3>& corners, const CameraFrame& camera, DepthPlane& out) {
  std::array<vec3, 3> sorted = corners;
  std::sort(sorted.begin(), sorted.end(), lexicographic_less);
  const dvec3 origin(sorted[0]);
  const dvec3 normal = glm::cross(dvec3(sorted[1]) - origin, dvec3(sorted[2]) - origin);
  const double d = glm::dot(normal, origin - camera.eye);
  out.x = glm::dot(normal, camera.right) / (camera.focal_px * d);
  out.y = -glm::dot(normal, camera.up) / (camera.focal_px * d);
  out.constant = glm::dot(normal, camera.forward) / d - out.x * camera.center_x_px - out.y * camera.center_y_px;
  if (!std::isfinite(out.x) || !std::isfinite(out.y) || !std::isfinite(out.constant)) return false;
  set_depth_range(corners, camera, out);
  return true;
}

void set_up_triangles(const LatticeMesh& mesh, const CameraFrame& camera, std::span<const PixelPoint> points,
                      const PixelWindow& window, std::size_t begin, std::size_t end,
                      std::vector<ScreenTriangle>& pieces, SetupCounts& counts) {
  const ClipVolume volume = make_clip_volume(camera);
  for (std::size_t i = begin; i != end; ++i) {
    const auto& corner = mesh.triangles[i];
    const ClippedPolygon polygon = clip_triangle({points[corner[0]], points[corner[1]], points[corner[2]]}, volume);
    counts.clipped += polygon.clipped;
    const std::size_t first = pieces.size();
    ScreenTriangle piece;
    piece.triangle = static_cast<std::uint32_t>(i);
    append_pieces(polygon, window, piece, pieces);
    if (pieces.size() == first) continue;
    DepthPlane depth;
    if (!make_depth_plane(mesh.corners(piece.triangle), camera, depth)) {
      pieces.resize(first);
      continue;
    }
    for (std::size_t k = first; k != pieces.size(); ++k) {
      pieces[k].depth = depth;
      pieces[k].alpha_map = mesh.alpha_map(piece.triangle);
    }
    ++counts.survived;
  }
}

}  // namespace halfshade
