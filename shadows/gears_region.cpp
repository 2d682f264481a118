#include "shadows/gears_region.h"

#include <algorithm>
#include <cmath>

namespace halfshade {
namespace {

/// Outward pad of every bound, relative to 1 + |bound|: double rounding of the projections stays below 1e-11, since
/// corners lie beyond clip_z (influence_region.cpp has the same).
constexpr double kPad = 1e-9;

/// Shorter edges of a hull, relative to 1 + |coordinate|, have no certain direction: errors of 1e-15 in their ends turn
/// them so far that the pad no longer makes up for it.
constexpr double kShortestEdge = 1e-5;

dvec2 pad_of(const dvec2& x) { return kPad * (1.0 + glm::abs(x)); }

/// Largest value of the edge's function in the box.
double highest(const dvec3& edge, const dvec2& low, const dvec2& high) {
  return edge.x * (edge.x > 0.0 ? high.x : low.x) + edge.y * (edge.y > 0.0 ? high.y : low.y) + edge.z;
}

}  // namespace

GearsProjector::GearsProjector(const GearsGrid& grid) : grid_(grid) {
  const LightView& view = grid.view;
  light_low_ = dvec3(HUGE_VAL), light_high_ = dvec3(-HUGE_VAL);
  for (const dvec3& l : view.light_points) {
    light_low_ = glm::min(light_low_, l), light_high_ = glm::max(light_high_, l);
  }
  if (view.ball.radius > 0.0) light_high_ = view.ball.reach() * (1.0 + kPad), light_low_ = -light_high_;
  if (view.flat) light_low_.z = -view.light_depth, light_high_.z = view.light_depth;
}

/// The corner's own image and the rectangle around the images of the rays through it that end on the far plane.
void GearsProjector::add_corner(const dvec3& v, GearsBlocker& blocker) const {
  const dvec2 own = grid_.camera.image(v);
  blocker.corner_low = glm::min(blocker.corner_low, own), blocker.corner_high = glm::max(blocker.corner_high, own);
  blocker.low = glm::min(blocker.low, own), blocker.high = glm::max(blocker.high, own);
  const double far_z = grid_.view.far_z;
  if (v.z >= far_z) return;  // beyond every receiver: only its own image bounds the part in front
  // F = v + k (v - l), k = (far - v.z) / (v.z - l.z): linear in l.x, l.y and in k.
  const dvec2 eye(grid_.camera.eye), from_high = dvec2(v) - dvec2(light_high_), from_low = dvec2(v) - dvec2(light_low_);
  const double to_image = 1.0 / (far_z - grid_.camera.eye.z);
  const double least = (far_z - v.z) / (v.z - light_low_.z), most = (far_z - v.z) / (v.z - light_high_.z);
  const dvec2 at = dvec2(v) - eye;
  blocker.low = glm::min(blocker.low, (at + glm::min(least * from_high, most * from_high)) * to_image);
  blocker.high = glm::max(blocker.high, (at + glm::max(least * from_low, most * from_low)) * to_image);
}

void GearsProjector::find_hull(const ProjectedBlocker& polygon, GearsBlocker& blocker) const {
  const double far_z = grid_.view.far_z, to_image = 1.0 / (far_z - grid_.camera.eye.z);
  double pad = 0.0;
  blocker.points.clear();
  for (int i = 0; i < polygon.count; ++i) {
    if (polygon.corner[i].z < far_z) pad = std::max(pad, add_far_images(grid_.view, polygon.corner[i], blocker.points));
  }
  for (dvec2& p : blocker.points) p = (p * far_z - dvec2(grid_.camera.eye)) * to_image;
  for (int i = 0; i < polygon.count; ++i) blocker.points.push_back(grid_.camera.image(polygon.corner[i]));
  convex_hull(blocker.points, blocker.hull);
  dvec2 reach(0.0);
  for (const dvec2& p : blocker.hull) reach = glm::max(reach, glm::abs(p));
  const dvec2 outward = pad + pad_of(dvec2(std::max(reach.x, reach.y)));
  for (std::size_t i = 0; i < blocker.hull.size(); ++i) {
    const dvec2 &p = blocker.hull[i], &q = blocker.hull[(i + 1) % blocker.hull.size()];
    const dvec2 normal(p.y - q.y, q.x - p.x);
    // Between images that should coincide, rounding chooses the direction. Leaving an edge out only widens the hull.
    if (glm::length(normal) < kShortestEdge * (1.0 + std::max(reach.x, reach.y))) continue;
    const double slack = glm::dot(glm::abs(normal), outward);
    blocker.edges.emplace_back(normal.x, normal.y, slack - glm::dot(normal, p));
  }
}

void GearsProjector::project(const std::array<dvec3, 3>& corners, bool with_hull, GearsBlocker& blocker) const {
  const ProjectedBlocker polygon = clip_blocker(grid_.view, corners);
  blocker.kind = polygon.kind;
  blocker.edges.clear();
  if (polygon.kind != InfluenceRegion::Kind::kRows) return;
  blocker.low = blocker.corner_low = dvec2(HUGE_VAL), blocker.high = blocker.corner_high = dvec2(-HUGE_VAL);
  blocker.depth = HUGE_VAL;
  for (int i = 0; i < polygon.count; ++i) {
    add_corner(polygon.corner[i], blocker);
    blocker.depth = std::min(blocker.depth, polygon.corner[i].z);
  }
  blocker.corner_low -= pad_of(blocker.corner_low), blocker.corner_high += pad_of(blocker.corner_high);
  blocker.low -= pad_of(blocker.low), blocker.high += pad_of(blocker.high);
  blocker.depth -= kPad * blocker.depth;
  blocker.far_nearness = 1.0 / (grid_.view.far_z - grid_.camera.eye.z);
  const double range = 1.0 / (blocker.depth - grid_.camera.eye.z) - blocker.far_nearness;
  blocker.per_nearness = range > 0.0 ? 1.0 / range : 0.0;
  if (with_hull) find_hull(polygon, blocker);
}

bool GearsProjector::in_frustum(const GearsBlocker& blocker, const dvec3& p) const {
  const double far_z = grid_.view.far_z;
  if (p.z < blocker.depth) return false;
  // Bottom: the box on the far plane. Top: the box of the corners' images on the plane of the nearest corner. Between
  // them the sides run straight.
  const double share = far_z > blocker.depth ? std::min(1.0, (p.z - blocker.depth) / (far_z - blocker.depth)) : 1.0;
  const double top = blocker.depth - grid_.camera.eye.z, bottom = far_z - grid_.camera.eye.z;
  const dvec2 at = dvec2(p) - dvec2(grid_.camera.eye);
  const dvec2 low = glm::mix(blocker.corner_low * top, blocker.low * bottom, share);
  const dvec2 high = glm::mix(blocker.corner_high * top, blocker.high * bottom, share);
  const dvec2 below = low - pad_of(low) - at, above = at - high - pad_of(high);
  return below.x <= 0.0 && below.y <= 0.0 && above.x <= 0.0 && above.y <= 0.0;
}

bool meets(const GearsBlocker& blocker, const GearsNode& node) {
  if (node.depth < blocker.depth) return false;
  const auto [low, high] = box_at(blocker, node.nearness);
  if (node.low.x > high.x || node.high.x < low.x || node.low.y > high.y || node.high.y < low.y) return false;
  if (blocker.boxed) {
    for (int k = 0; k < 3; ++k) {
      if (node.box_low[k] > blocker.box_high[k] || node.box_high[k] < blocker.box_low[k]) return false;
    }
  }
  for (const dvec3& edge : blocker.edges) {
    if (highest(edge, node.low, node.high) < 0.0) return false;
  }
  return true;
}

bool covers(const GearsBlocker& blocker, const GearsNode& node) {
  const auto [low, high] = box_at(blocker, node.nearness);
  if (node.low.x < low.x || node.high.x > high.x || node.low.y < low.y || node.high.y > high.y) return false;
  for (const dvec3& edge : blocker.edges) {
    if (-highest(-edge, node.low, node.high) < 0.0) return false;
  }
  return true;
}

bool in_hull(std::span<const dvec3> edges, const dvec2& image) {
  return std::all_of(edges.begin(), edges.end(), [&](const dvec3& edge) { return highest(edge, image, image) >= 0.0; });
}

}  // namespace halfshade
