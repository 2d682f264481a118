#include "shadows/light_view.h"

#include <algorithm>
#include <cmath>

#include "rasterizer/core/parallel.h"
#include "rasterizer/core/reuse.h"
#include "rasterizer/core/unit_circle.h"

namespace halfshade {
namespace {

/// Receivers nearer to the light's plane than this fraction of the farthest one are not projected.
constexpr double kNearFraction = 1e-3;
/// Blockers are clipped at this fraction of the gap between light and nearest projected receiver.
constexpr double kClipFraction = 1.0 / 16.0;
/// Bounds are widened by this factor against rounding: doubles of order one carry errors near 1e-15.
constexpr double kWiden = 1.0 + 1e-9;

/// Place in the plane of the first two axes, around `center`.
dvec2 in_plane(const vec3& p, const dvec3& center, const std::array<dvec3, 3>& axes) {
  const dvec3 d = dvec3(p) - center;
  return {glm::dot(d, axes[0]), glm::dot(d, axes[1])};
}

/// Convex polygon with edges along eight directions around points in the plane; four if `corners` is 4.
std::vector<dvec2> polygon_around(const LightSamples& samples, const dvec3& center, const std::array<dvec3, 3>& axes,
                                  int corners, std::vector<dvec2> polygon) {
  const double d = 0.7071067811865476;
  const std::array<dvec2, 8> normals = {dvec2(1, 0),  dvec2(d, d),   dvec2(0, 1),  dvec2(-d, d),
                                        dvec2(-1, 0), dvec2(-d, -d), dvec2(0, -1), dvec2(d, -d)};
  const int step = 8 / corners;
  std::array<double, 8> reach{};
  for (const vec3& l : samples.points) {
    const dvec2 p = in_plane(l, center, axes);
    for (int k = 0; k < 8; k += step) reach[k] = std::max(reach[k], glm::dot(p, normals[k]));
  }
  for (int k = 0; k < corners; ++k) {
    const int next = (k + 1) % corners;
    const dvec2 m = normals[k * step], n = normals[next * step];
    const double determinant = m.x * n.y - m.y * n.x, s = reach[k * step] * kWiden, t = reach[next * step] * kWiden;
    polygon.push_back(dvec2(s * n.y - t * m.y, t * m.x - s * n.x) / determinant);
  }
  return polygon;
}

/// The light's outline (around its own origin, which lies inside) scaled so that it holds all samples, relative to
/// `center`, which is `origin` there.
std::vector<dvec2> polygon_scaled_around(const LightSamples& samples, const dvec3& center,
                                         const std::array<dvec3, 3>& axes, const dvec2& origin,
                                         std::vector<dvec2> polygon) {
  const std::vector<dvec2>& outline = samples.outline;
  double scale = 1.0;
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const dvec2 edge = outline[(i + 1) % outline.size()] - outline[i], normal(edge.y, -edge.x);
    const double support = glm::dot(outline[i], normal);
    if (!(support > 0.0)) continue;  // corners that coincide
    for (const vec3& l : samples.points) {
      scale = std::max(scale, glm::dot(in_plane(l, center, axes) + origin, normal) / support);
    }
  }
  for (const dvec2& corner : outline) polygon.push_back(corner * (scale * kWiden) - origin);
  return polygon;
}

/// The ellipsoid's own shape, as large as its samples need; no ball for an ellipsoid that is flat, or nearly so.
BallBound make_ball(const Light& light, const LightSamples& samples, const dvec3& center) {
  BallBound ball;
  if (light.shape == LightShape::kEllipsoid) {
    double size = 0.0;
    for (const dvec3& axis : light.axes) size = std::max(size, glm::length(axis));
    ball.from_ball = glm::dmat3(light.axes[0] / size, light.axes[1] / size, light.axes[2] / size);
    if (!(std::fabs(glm::determinant(ball.from_ball)) > 1e-6)) return {};
    ball.to_ball = glm::inverse(ball.from_ball);
  }
  for (const vec3& l : samples.points) {
    ball.radius = std::max(ball.radius, glm::length(ball.to_ball * (dvec3(l) - center)) * kWiden);
  }
  return ball;
}

LightView make_view(const LightBound& bound, const dvec3& x, const dvec3& y, const dvec3& z) {
  LightView view;
  view.origin = dvec3(bound.center);
  view.x = x, view.y = y, view.z = z;
  return view;
}

std::vector<LightView> make_directions(const LightBound& bound, const LightSamples& samples) {
  const dvec3 u = samples.axis_u, v = samples.axis_v, n = samples.axis_n;
  if (bound.flat) {
    std::vector<LightView> views = {make_view(bound, u, v, n)};
    if (!samples.one_sided) views.push_back(make_view(bound, v, u, -n));
    return views;
  }
  std::vector<LightView> views;
  for (int axis = 0; axis < 3; ++axis) {
    dvec3 x(0.0), y(0.0), z(0.0);
    z[axis] = x[(axis + 1) % 3] = y[(axis + 2) % 3] = 1.0;
    views.push_back(make_view(bound, x, y, z));
    views.push_back(make_view(bound, y, x, -z));
  }
  return views;
}

/// The view that holds a receiver: the side of a flat light it lies on, or the cube face it is seen through.
std::size_t view_of(const std::vector<LightView>& views, const dvec3& p) {
  std::size_t best = 0;
  double depth = -HUGE_VAL;
  for (std::size_t i = 0; i < views.size(); ++i) {
    const double z = glm::dot(p - views[i].origin, views[i].z);
    if (z > depth) depth = z, best = i;
  }
  return best;
}

/// Corners of the bounding polygons of section 4.1, if the outline asks for them.
int ring_corners(InfluenceOutline outline) {
  switch (outline) {
    case InfluenceOutline::kHexagon:
      return 6;
    case InfluenceOutline::kOctagon:
      return 8;
    case InfluenceOutline::kDodecagon:
      return 12;
    default:
      return 0;
  }
}

/// Regular polygon around the circle of that radius.
std::vector<dvec2> ring_around(int corners, double radius) {
  const double reach = radius / unit_circle(0.5 / corners).x;
  std::vector<dvec2> ring;
  for (int k = 0; k < corners; ++k) ring.push_back(unit_circle(double(k) / corners) * (reach * kWiden));
  return ring;
}

void set_flat_light(const LightBound& bound, const LightSamples& samples, int corners, LightView& view) {
  std::vector<dvec2> outline = bound.outline;
  if (corners != 0) {  // around the disk that holds the light
    double radius = 0.0;
    for (const dvec2& p : outline) radius = std::max(radius, glm::length(p));
    outline = ring_around(corners, radius);
  }
  for (const dvec2& p : outline) {
    const dvec3 q = view.to_view(view.origin + samples.axis_u * p.x + samples.axis_v * p.y);
    view.light_points.emplace_back(q.x, q.y, 0.0);
  }
  view.light_depth = glm::length(bound.half_axes[2]);
}

void set_box_light(const LightBound& bound, LightView& view) {
  for (int corner = 0; corner < 8; ++corner) {
    dvec3 p = view.origin;
    for (int k = 0; k < 3; ++k) p += bound.half_axes[k] * ((corner >> k) & 1 ? 1.0 : -1.0);
    view.light_points.push_back(view.to_view(p));
    view.light_depth = std::max(view.light_depth, std::fabs(view.light_points.back().z));
  }
}

void set_light(const LightBound& bound, const LightSamples& samples, InfluenceOutline outline, LightView& view) {
  const int corners = ring_corners(outline);
  view.flat = bound.flat;
  view.outline = outline;
  BallBound ball = bound.ball;
  if (!bound.flat && corners != 0 && !(ball.radius > 0.0)) {  // any other light is taken for a sphere
    for (const vec3& l : samples.points) {
      ball.radius = std::max(ball.radius, glm::length(dvec3(l) - dvec3(bound.center)) * kWiden);
    }
  }
  if (bound.flat) {
    set_flat_light(bound, samples, corners, view);
  } else if (ball.radius > 0.0) {
    const glm::dmat3 from_view(view.x, view.y, view.z);
    view.ball = {ball.radius, glm::transpose(from_view) * ball.from_ball, ball.to_ball * from_view};
    view.ball_ring = ring_around(corners != 0 ? corners : 6, 1.0);
    view.light_depth = 1.2 * view.ball.reach().z;  // a hexagon around the silhouette reaches 1.155 radii
  } else {
    set_box_light(bound, view);
  }
}

/// Depth range, box and slopes of the receivers that `view` holds; near_z splits off those too close to project.
void fit_receivers(const std::vector<dvec3>& points, LightView& view) {
  view.far_z = 0.0;
  for (const dvec3& p : points) view.far_z = std::max(view.far_z, p.z);
  view.near_z = 1.1 * view.light_depth + kNearFraction * view.far_z;
  view.clip_z = view.light_depth + kClipFraction * (view.near_z - view.light_depth);
  view.receiver_low = dvec3(HUGE_VAL), view.slope_low = dvec2(HUGE_VAL);
  view.receiver_high = dvec3(-HUGE_VAL), view.slope_high = dvec2(-HUGE_VAL);
  for (const dvec3& p : points) {
    if (view.too_near(p)) continue;
    view.has_receivers = true;
    view.receiver_low = glm::min(view.receiver_low, p);
    view.receiver_high = glm::max(view.receiver_high, p);
    view.slope_low = glm::min(view.slope_low, dvec2(p) / p.z);
    view.slope_high = glm::max(view.slope_high, dvec2(p) / p.z);
  }
}

/// Undoes part of the fit of section 4.3: depth range and slopes reach over whole meshes. For measuring.
void widen(const LightViewOptions& options, LightView& view) {
  if (options.far_over != nullptr) {
    for (const vec3& p : options.far_over->positions) view.far_z = std::max(view.far_z, view.to_view(dvec3(p)).z);
  }
  if (options.grid_over == nullptr) return;
  for (const vec3& vertex : options.grid_over->positions) {
    const dvec3 p = view.to_view(dvec3(vertex));
    if (view.too_near(p)) continue;
    view.slope_low = glm::min(view.slope_low, dvec2(p) / p.z);
    view.slope_high = glm::max(view.slope_high, dvec2(p) / p.z);
  }
}

void fit_grid(std::uint32_t resolution, LightView& view) {
  LightGrid& grid = view.grid;
  if (!view.has_receivers) return;
  grid.columns = grid.rows = resolution;
  grid.low = {LightGrid::warp(view.slope_low.x), LightGrid::warp(view.slope_low.y)};
  const dvec2 high(LightGrid::warp(view.slope_high.x), LightGrid::warp(view.slope_high.y));
  for (int k = 0; k < 2; ++k) {
    const double extent = high[k] - grid.low[k];
    grid.cells_per_unit[k] = extent > 0.0 ? resolution / extent : 0.0;
  }
}

std::uint32_t choose_resolution(std::size_t receivers) {
  const auto side = static_cast<std::uint32_t>(std::sqrt(static_cast<double>(receivers) / 2.0));
  return std::clamp(side, 16u, 1024u);
}

}  // namespace

dvec3 BallBound::reach() const {
  const glm::dmat3 rows = glm::transpose(from_ball);
  return radius * dvec3(glm::length(rows[0]), glm::length(rows[1]), glm::length(rows[2]));
}

double LightGrid::row_border(std::uint32_t row) const {
  if (cells_per_unit.y == 0.0) return row == 0 ? -HUGE_VAL : HUGE_VAL;
  const double w = low.y + row / cells_per_unit.y;
  return w >= 1.0 ? HUGE_VAL : (w <= -1.0 ? -HUGE_VAL : unwarp(w));
}

LightBound make_light_bound(const Light& light, const LightSamples& samples, LightBound reuse) {
  LightBound bound;
  bound.outline = emptied(reuse.outline);
  bound.flat = samples.flat;
  const std::array<dvec3, 3> axes = {samples.axis_u, samples.axis_v, samples.axis_n};
  dvec3 low(HUGE_VAL), high(-HUGE_VAL);  // in the light's axes, around its centre
  for (const vec3& l : samples.points) {
    const dvec3 d = dvec3(l) - samples.center;
    const dvec3 q(glm::dot(d, axes[0]), glm::dot(d, axes[1]), glm::dot(d, axes[2]));
    low = glm::min(low, q), high = glm::max(high, q);
  }
  const dvec3 middle = (low + high) * 0.5;
  bound.center = snap_to_lattice(samples.center + axes[0] * middle.x + axes[1] * middle.y + axes[2] * middle.z);
  dvec3 reach(0.0);
  for (const vec3& l : samples.points) {
    const dvec3 d = dvec3(l) - dvec3(bound.center);
    const dvec3 q(glm::dot(d, axes[0]), glm::dot(d, axes[1]), glm::dot(d, axes[2]));
    reach = glm::max(reach, glm::abs(q));
  }
  if (light.shape == LightShape::kSphere || light.shape == LightShape::kEllipsoid) {
    bound.ball = make_ball(light, samples, dvec3(bound.center));
  }
  for (int k = 0; k < 3; ++k) bound.half_axes[k] = axes[k] * (reach[k] * kWiden);
  if (bound.flat && light.shape == LightShape::kPolygon) {
    const dvec3 shift = dvec3(bound.center) - samples.center;
    bound.outline =
        polygon_scaled_around(samples, dvec3(bound.center), axes, {glm::dot(shift, axes[0]), glm::dot(shift, axes[1])},
                              std::move(bound.outline));
  } else if (bound.flat) {
    const int corners = light.shape == LightShape::kRectangle ? 4 : 8;
    bound.outline = polygon_around(samples, dvec3(bound.center), axes, corners, std::move(bound.outline));
  }
  return bound;
}

std::vector<LightViewCells> make_light_views(const LightBound& bound, const LightSamples& samples,
                                             const ReceiverArray& receivers, std::uint32_t resolution,
                                             const LightViewOptions& options) {
  const std::vector<LightView> views = make_directions(bound, samples);
  std::vector<std::uint8_t> holder(receivers.size());
  parallel_ranges(receivers.size(), 8192, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) {
      holder[i] = static_cast<std::uint8_t>(view_of(views, dvec3(receivers.position[i])));
    }
  });
  std::vector<LightViewCells> result;
  for (std::size_t k = 0; k < views.size(); ++k) {
    std::vector<dvec3> points;
    for (std::size_t i = 0; i < holder.size(); ++i) {
      if (holder[i] == k) points.push_back(views[k].to_view(dvec3(receivers.position[i])));
    }
    if (points.empty()) continue;
    LightViewCells cells{views[k], std::vector<std::uint32_t>(receivers.size(), kNone)};
    set_light(bound, samples, options.outline, cells.view);
    fit_receivers(points, cells.view);
    widen(options, cells.view);
    fit_grid(resolution != 0 ? resolution : choose_resolution(points.size()), cells.view);
    for (std::size_t i = 0, next = 0; i < holder.size(); ++i) {
      if (holder[i] != k) continue;
      const dvec3& p = points[next++];
      const LightGrid& grid = cells.view.grid;
      cells.cell_of_receiver[i] =
          cells.view.too_near(p) ? cells.near_cell() : grid.row(p.y / p.z) * grid.columns + grid.column(p.x / p.z);
    }
    result.push_back(std::move(cells));
  }
  return result;
}

}  // namespace halfshade
