#include "shadows/influence_region.h"

#include <algorithm>
#include <cmath>

namespace halfshade {
namespace {

/// Outward pad of every bound, relative to 1 + |slope|: double rounding of the projections stays below 1e-11.
constexpr double kPad = 1e-9;

double padded_low(double slope, double pad) { return slope - pad - kPad * (1.0 + std::fabs(slope)); }
double padded_high(double slope, double pad) { return slope + pad + kPad * (1.0 + std::fabs(slope)); }

/// Part of the triangle with z >= depth (keep_far) or z <= depth.
ProjectedBlocker clip_at_depth(const std::array<dvec3, 3>& t, double depth, bool keep_far) {
  ProjectedBlocker result;
  for (int i = 0; i < 3; ++i) {
    const dvec3 &p = t[i], &q = t[(i + 1) % 3];
    const bool p_in = keep_far ? p.z >= depth : p.z <= depth, q_in = keep_far ? q.z >= depth : q.z <= depth;
    if (p_in) result.corner[result.count++] = p;
    if (p_in != q_in) {
      dvec3 crossing = p + (q - p) * ((depth - p.z) / (q.z - p.z));
      crossing.z = depth;
      result.corner[result.count++] = crossing;
    }
  }
  return result;
}

/// Can the part of the blocker nearer than clip_z meet a segment from the light to a receiver on the grid? Tests its
/// box against the box of all such segments up to that depth.
bool near_part_matters(const LightView& view, const std::array<dvec3, 3>& corners) {
  const double depth = view.clip_z, reach = view.light_depth;
  const ProjectedBlocker near = clip_at_depth(corners, depth, false);
  if (near.count == 0) return false;
  dvec3 low(HUGE_VAL), high(-HUGE_VAL);
  for (int i = 0; i < near.count; ++i) low = glm::min(low, near.corner[i]), high = glm::max(high, near.corner[i]);
  if (high.z < -reach * (1.0 + kPad) - 1e-12) return false;
  dvec3 light_low(HUGE_VAL), light_high(-HUGE_VAL);
  for (const dvec3& l : view.light_points) light_low = glm::min(light_low, l), light_high = glm::max(light_high, l);
  if (view.ball.radius > 0.0) light_high = view.ball.reach() * (1.0 + kPad), light_low = -light_high;
  const double share = std::min(1.0, (depth + reach) / (view.near_z - reach));  // of the way from light to receiver
  for (int k = 0; k < 2; ++k) {
    const double to_low = std::max((view.receiver_low[k] - light_high[k]) * share, view.slope_low[k] * (depth + reach));
    const double to_high =
        std::min((view.receiver_high[k] - light_low[k]) * share, view.slope_high[k] * (depth + reach));
    const double pad = 1e-9 + kPad * (std::fabs(to_low) + std::fabs(to_high));
    if (high[k] < light_low[k] + std::min(0.0, to_low) - pad) return false;
    if (low[k] > light_high[k] + std::max(0.0, to_high) + pad) return false;
  }
  return true;
}

/// Image on the far plane of the ray from light point l through v, as slopes.
dvec2 far_image(const LightView& view, const dvec3& v, const dvec3& l) {
  const double t = (view.far_z - l.z) / (v.z - l.z);
  return (dvec2(l) + t * (dvec2(v) - dvec2(l))) / view.far_z;
}

/// Polygon around the circle that a spherical light shows to v: the silhouette lies in a plane across the line to v.
/// For an ellipsoid this happens in the space where it is a ball; lines through v stay lines on the way there and back.
void add_ball_images(const LightView& view, const dvec3& v, std::vector<dvec2>& points) {
  const dvec3 toward = view.ball.to_ball * v;
  const double radius = view.ball.radius, distance = glm::length(toward);
  const dvec3 w = toward / distance;
  const dvec3 a = glm::normalize(std::fabs(w.x) < 0.6 ? dvec3(0, w.z, -w.y) : dvec3(-w.z, 0, w.x)),
              b = glm::cross(w, a);
  const double ring = radius * std::sqrt(std::max(0.0, 1.0 - radius * radius / (distance * distance)));
  const dvec3 middle = w * (radius * radius / distance);
  for (const dvec2& h : view.ball_ring) {
    points.push_back(far_image(view, v, view.ball.from_ball * (middle + (a * h.x + b * h.y) * ring)));
  }
}

/// A flat light's samples lie within light_depth of its plane, not in it: how far that can move an image.
double thickness_pad(const LightView& view, const dvec3& v) {
  double light = 0.0;
  for (const dvec3& l : view.light_points) light = std::max({light, std::fabs(l.x), std::fabs(l.y)});
  const double beyond = v.z - view.light_depth;
  return 4.0 * view.light_depth * (std::fabs(v.x) + std::fabs(v.y) + light) / (beyond * beyond);
}

/// Corners' own images and the light's bound through them; returns the pad that the bound needs.
double collect_points(const LightView& view, const ProjectedBlocker& polygon, std::vector<dvec2>& points) {
  points.clear();
  double pad = 0.0;
  for (int i = 0; i < polygon.count; ++i) {
    const dvec3& v = polygon.corner[i];
    points.push_back(dvec2(v) / v.z);
    if (v.z >= view.far_z) continue;  // beyond every receiver: only its own image bounds the part in front
    pad = std::max(pad, add_far_images(view, v, points));
  }
  return pad;
}

/// Widens the x range of every row that the edge p-q passes.
void scan_edge(const LightGrid& grid, dvec2 p, dvec2 q, std::uint32_t first_row, std::uint32_t last_row, double pad,
               std::vector<dvec2>& extent) {
  if (p.y > q.y) std::swap(p, q);
  const double y_low = padded_low(p.y, pad), y_high = padded_high(q.y, pad);
  const std::uint32_t from = std::max(first_row, grid.row(y_low)), to = std::min(last_row, grid.row(y_high));
  const double slope = q.y > p.y ? (q.x - p.x) / (q.y - p.y) : 0.0;
  for (std::uint32_t row = from; row <= to; ++row) {
    const double bottom = padded_low(grid.row_border(row), pad), top = padded_high(grid.row_border(row + 1), pad);
    double x0 = p.x, x1 = q.x;
    if (q.y > p.y && bottom > p.y) x0 = std::min(bottom, q.y) == q.y ? q.x : p.x + (bottom - p.y) * slope;
    if (q.y > p.y && top < q.y) x1 = top <= p.y ? p.x : p.x + (top - p.y) * slope;
    dvec2& range = extent[row - first_row];
    range.x = std::min({range.x, x0, x1});
    range.y = std::max({range.y, x0, x1});
  }
}

void scan_convert(const LightView& view, double pad, InfluenceRegion& region) {
  double low = HUGE_VAL, high = -HUGE_VAL;
  for (const dvec2& p : region.hull) low = std::min(low, p.y), high = std::max(high, p.y);
  low = padded_low(low, pad), high = padded_high(high, pad);
  if (high < view.slope_low.y || low > view.slope_high.y) return;
  const LightGrid& grid = view.grid;
  const std::uint32_t first = grid.row(low), last = grid.row(high);
  region.extent.assign(last - first + 1, dvec2(HUGE_VAL, -HUGE_VAL));
  for (std::size_t i = 0; i < region.hull.size(); ++i) {
    scan_edge(grid, region.hull[i], region.hull[(i + 1) % region.hull.size()], first, last, pad, region.extent);
  }
  region.first_row = first;
  region.rows.assign(last - first + 1, RowSpan{});
  for (std::size_t i = 0; i < region.rows.size(); ++i) {
    const double x_low = padded_low(region.extent[i].x, pad), x_high = padded_high(region.extent[i].y, pad);
    if (!(x_low <= x_high) || x_high < view.slope_low.x || x_low > view.slope_high.x) continue;
    region.rows[i] = {grid.column(x_low), grid.column(x_high)};
  }
  region.kind = InfluenceRegion::Kind::kRows;
}

}  // namespace

void convex_hull(std::vector<dvec2>& points, std::vector<dvec2>& hull) {
  std::sort(points.begin(), points.end(),
            [](const dvec2& a, const dvec2& b) { return a.x != b.x ? a.x < b.x : a.y < b.y; });
  // From b: then only the angle there is rounded, in units of 2^-53. Images that a point light shows of one corner are
  // apart by no more than rounding; from a far `a` the turn between two of them would be anything.
  const auto turns_left = [](const dvec2& a, const dvec2& b, const dvec2& c) {
    return (b.x - a.x) * (c.y - b.y) - (b.y - a.y) * (c.x - b.x) > 0.0;
  };
  hull.clear();
  const auto add = [&](const dvec2& p, std::size_t keep) {
    while (hull.size() >= keep + 2 && !turns_left(hull[hull.size() - 2], hull.back(), p)) hull.pop_back();
    hull.push_back(p);
  };
  for (const dvec2& p : points) add(p, 0);
  const std::size_t lower = hull.size() - 1;
  for (std::size_t i = points.size() - 1; i-- > 0;) add(points[i], lower);
  if (hull.size() > 1) hull.pop_back();
}

namespace {

/// The hull between the two directions' extents: a rectangle with a side along `along` (unit).
void box_around(const std::vector<dvec2>& hull, const dvec2& along, std::array<dvec2, 4>& box) {
  const dvec2 across(-along.y, along.x);
  dvec2 low(HUGE_VAL), high(-HUGE_VAL);
  for (const dvec2& p : hull) {
    const dvec2 q(glm::dot(p, along), glm::dot(p, across));
    low = glm::min(low, q), high = glm::max(high, q);
  }
  const dvec2 pad(1e-14 * std::max({std::fabs(low.x), std::fabs(low.y), std::fabs(high.x), std::fabs(high.y)}));
  low -= pad, high += pad;  // rotating rounds
  box = {along * low.x + across * low.y, along * high.x + across * low.y, along * high.x + across * high.y,
         along * low.x + across * high.y};
}

/// Replaces the hull by its box, or by the smallest rectangle around it, which has a side along one of its edges.
void coarsen(InfluenceOutline outline, std::vector<dvec2>& hull) {
  std::array<dvec2, 4> best, box;
  box_around(hull, dvec2(1.0, 0.0), best);
  const auto area = [](const std::array<dvec2, 4>& b) { return glm::length(b[1] - b[0]) * glm::length(b[3] - b[0]); };
  for (std::size_t i = 0; outline == InfluenceOutline::kQuad && i < hull.size(); ++i) {
    const dvec2 edge = hull[(i + 1) % hull.size()] - hull[i];
    const double length = glm::length(edge);
    if (!(length > 0.0)) continue;
    box_around(hull, edge / length, box);
    if (area(box) < area(best)) best = box;
  }
  hull.assign(best.begin(), best.end());
}

}  // namespace

ProjectedBlocker clip_blocker(const LightView& view, const std::array<dvec3, 3>& corners) {
  ProjectedBlocker polygon;
  const double nearest = std::min({corners[0].z, corners[1].z, corners[2].z});
  const double farthest = std::max({corners[0].z, corners[1].z, corners[2].z});
  if (nearest > view.far_z * (1.0 + kPad)) return polygon;
  if (nearest < view.clip_z && near_part_matters(view, corners)) {
    polygon.kind = InfluenceRegion::Kind::kEverywhere;
    return polygon;
  }
  if (farthest < view.clip_z) return polygon;
  polygon = {{}, {corners[0], corners[1], corners[2], dvec3(0.0)}, 3};
  if (nearest < view.clip_z) polygon = clip_at_depth(corners, view.clip_z, true);
  polygon.kind = InfluenceRegion::Kind::kRows;
  return polygon;
}

double add_far_images(const LightView& view, const dvec3& v, std::vector<dvec2>& points) {
  if (view.ball.radius > 0.0) add_ball_images(view, v, points);
  for (const dvec3& l : view.light_points) points.push_back(far_image(view, v, l));
  return view.flat ? thickness_pad(view, v) : 0.0;
}

void find_influence_region(const LightView& view, const std::array<dvec3, 3>& corners, InfluenceRegion& region) {
  const ProjectedBlocker polygon = clip_blocker(view, corners);
  region.kind = polygon.kind;
  if (polygon.kind != InfluenceRegion::Kind::kRows) return;
  region.kind = InfluenceRegion::Kind::kNowhere;
  const double pad = collect_points(view, polygon, region.points);
  convex_hull(region.points, region.hull);
  if (view.outline == InfluenceOutline::kBox || view.outline == InfluenceOutline::kQuad) {
    coarsen(view.outline, region.hull);
  }
  scan_convert(view, pad, region);
}

}  // namespace halfshade
