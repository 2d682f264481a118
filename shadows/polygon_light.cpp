#include "shadows/polygon_light.h"

#include <algorithm>
#include <cmath>

#include "halfshade/error.h"

namespace halfshade {
namespace {

constexpr std::size_t kMostCorners = PolygonLight::kMostCorners;
using Corners = BoundedVector<dvec2, kMostCorners>;
constexpr double kTolerance = 1e-6;  // of the polygon's size: how far it may be from flat and convex

[[noreturn]] void refuse(const Light& light, const std::string& what) {
  throw Error(ErrorCode::kBadInput, "light '" + light.name + "': " + what);
}

dvec3 corner_after(const Light& light, std::size_t i) { return light.points[(i + 1) % light.points.size()]; }

void set_axes(const Light& light, double size, PolygonLight& polygon) {
  dvec3 longest(0.0), normal(0.0);
  for (std::size_t i = 0; i < light.points.size(); ++i) {
    const dvec3 p = (light.points[i] - polygon.center) / size, q = (corner_after(light, i) - polygon.center) / size;
    normal += glm::cross(p, q);                                                 // Newell's normal: twice the area
    if (glm::length(q - p) > 1.000001 * glm::length(longest)) longest = q - p;  // of equal ones the first
  }
  if (!(glm::length(normal) > kTolerance)) refuse(light, "the polygon has no area");
  polygon.axis_n = glm::normalize(normal);
  polygon.axis_u = glm::normalize(longest - polygon.axis_n * glm::dot(longest, polygon.axis_n));
  polygon.axis_v = glm::cross(polygon.axis_n, polygon.axis_u);
}

/// Every corner lies on the inner side of every edge.
void check_convex(const Light& light, double size, const Corners& corners) {
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const dvec2 p = corners[i], edge = corners[(i + 1) % corners.size()] - p;
    const double length = glm::length(edge);
    for (const dvec2& q : corners) {
      if (edge.x * (q.y - p.y) - edge.y * (q.x - p.x) >= -kTolerance * size * length) continue;
      refuse(light, "the polygon is not convex at corner " + std::to_string(i));
    }
  }
}

/// Chord of the polygon at a height: its ends in axis_u.
dvec2 chord(const Corners& corners, double height) {
  double left = HUGE_VAL, right = -HUGE_VAL;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    dvec2 p = corners[i], q = corners[(i + 1) % corners.size()];
    if (p.y > q.y) std::swap(p, q);
    if (height < p.y || height > q.y) continue;
    const double x = q.y > p.y ? p.x + (q.x - p.x) * ((height - p.y) / (q.y - p.y)) : p.x;
    left = std::min({left, x, p.y == q.y ? q.x : x});
    right = std::max({right, x, p.y == q.y ? q.x : x});
  }
  return {left, right};
}

void make_slabs(PolygonLight& polygon) {
  BoundedVector<double, kMostCorners> heights;
  for (const dvec2& corner : polygon.corners) heights.push_back(corner.y);
  std::sort(heights.begin(), heights.end());
  double area = 0.0;
  for (std::size_t i = 0; i + 1 < heights.size(); ++i) {
    if (heights[i] == heights[i + 1]) continue;
    const dvec2 below = chord(polygon.corners, heights[i]), above = chord(polygon.corners, heights[i + 1]);
    PolygonLight::Slab slab{heights[i], heights[i + 1], below.x, below.y, above.x, above.y, area, 0.0};
    slab.area = 0.5 * (slab.high - slab.low) * (below.y - below.x + above.y - above.x);
    area += slab.area;
    polygon.slabs.push_back(slab);
  }
}

}  // namespace

PolygonLight make_polygon_light(const Light& light) {
  const std::size_t count = light.points.size();
  if (count < 3 || count > kMostCorners) {
    refuse(light, std::to_string(count) + " corners, 3.." + std::to_string(kMostCorners) + " are allowed");
  }
  PolygonLight polygon;
  double size = 0.0;
  for (const dvec3& p : light.points) {
    if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z)) refuse(light, "a corner is not finite");
    polygon.center += p / static_cast<double>(count);
  }
  for (const dvec3& p : light.points) size = std::max(size, glm::length(p - polygon.center));
  if (!(size > 0.0 && std::isfinite(size))) refuse(light, "the polygon has no area");
  set_axes(light, size, polygon);
  for (std::size_t i = 0; i < count; ++i) {
    const dvec3 d = light.points[i] - polygon.center;
    if (std::fabs(glm::dot(d, polygon.axis_n)) > kTolerance * size) {
      refuse(light, "corner " + std::to_string(i) + " does not lie in the polygon's plane");
    }
    polygon.corners.push_back({glm::dot(d, polygon.axis_u), glm::dot(d, polygon.axis_v)});
  }
  check_convex(light, size, polygon.corners);
  make_slabs(polygon);
  return polygon;
}

dvec3 PolygonLight::offset(const dvec2& st) const {
  const double wanted = st.y * (slabs.back().area_before + slabs.back().area);
  const Slab* slab =
      std::find_if(slabs.begin(), slabs.end() - 1, [&](const Slab& s) { return wanted <= s.area_before + s.area; });
  // Share f of the slab's height below which the wanted area lies: width at the bottom w0, at the top w1,
  // f (w0 + f (w1 - w0) / 2) = wanted part of the mean width; the stable root of the quadratic.
  const double w0 = slab->right_low - slab->left_low, w1 = slab->right_high - slab->left_high;
  const double part = slab->area > 0.0 ? std::clamp((wanted - slab->area_before) / slab->area, 0.0, 1.0) : 0.0;
  const double goal = part * 0.5 * (w0 + w1);
  const double root = w0 + std::sqrt(std::max(0.0, w0 * w0 + 2.0 * (w1 - w0) * goal));
  const double f = root > 0.0 ? std::min(1.0, 2.0 * goal / root) : 0.0;
  const double left = slab->left_low + f * (slab->left_high - slab->left_low);
  const double right = slab->right_low + f * (slab->right_high - slab->right_low);
  return axis_u * (left + st.x * (right - left)) + axis_v * (slab->low + f * (slab->high - slab->low));
}

}  // namespace halfshade
