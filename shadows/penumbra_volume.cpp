#include "shadows/penumbra_volume.h"

#include <algorithm>
#include <cmath>

namespace halfshade {
namespace {

/// Coordinates are at most 2 and normals are unit vectors: a rounded dot product is off by less than
/// 4 * 2^-53 * (|n|_1 * 2) < 1.6e-15. Two of them are compared, and the corners of bounds carry about 4e-15 of their
/// own (extents, axes that are orthonormal but for rounding). This is more than twice the sum.
constexpr double kDotError = 2e-14;
/// By how much the outer corners lie outside: enough for planes laid through them to pass the bound's own corners by
/// more than kDotError, unless the plane nearly lies in the light's plane.
constexpr double kOuterShare = 1e-9, kOuterLeast = 1e-12;
/// A flat light's samples lie off its plane by the rounding of their coordinates. Planes that meet the light's plane at
/// a slope of more than 1 / kSlopes clear that, too.
constexpr double kSlopes = 64.0;

struct Axes {
  dvec3 origin, u, v, n;
};

/// Polygons in units of u, v around the axes' origin, `n_center` above it.
LightHull polygon_hull(const Axes& axes, std::span<const dvec2> corners, std::span<const dvec2> outer, double n_center,
                       double n_half) {
  LightHull hull;
  hull.corner_count = hull.edge_count = static_cast<std::uint32_t>(corners.size());
  const dvec3 base = axes.origin + axes.n * n_center;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    hull.corner[i] = base + axes.u * corners[i].x + axes.v * corners[i].y;
    hull.outer[i] = base + axes.u * outer[i].x + axes.v * outer[i].y;
    hull.edge[i] = {static_cast<std::uint8_t>(i), static_cast<std::uint8_t>((i + 1) % corners.size())};
  }
  hull.thickness = axes.n * n_half;
  return hull;
}

dvec3 outer_half(const dvec3& half, double thickness = 0.0) {
  return half * (1.0 + kOuterShare) + (kOuterLeast + kSlopes * thickness);
}

LightHull rectangle_hull(const Axes& axes, const dvec3& low, const dvec3& high) {
  const dvec3 middle = (low + high) * 0.5, half = (high - low) * 0.5;
  const auto rectangle = [&](const dvec3& h) {
    const dvec2 m(middle), d(h);
    return std::array<dvec2, 4>{m - d, m + dvec2(d.x, -d.y), m + d, m + dvec2(-d.x, d.y)};
  };
  return polygon_hull(axes, rectangle(half), rectangle(outer_half(half, half.z)), middle.z, half.z);
}

/// The light's own outline, which lies around the axes' origin.
LightHull outline_hull(const Axes& axes, std::span<const dvec2> outline, double n_center, double n_half) {
  dvec2 middle(0.0);
  for (const dvec2& c : outline) middle += c / static_cast<double>(outline.size());
  std::vector<dvec2> outer;
  for (const dvec2& c : outline) {
    const dvec2 d = c - middle;
    const double out = kOuterLeast + kSlopes * n_half;
    outer.push_back(c + d * (kOuterShare + out / std::max(std::sqrt(glm::dot(d, d)), out)));
  }
  return polygon_hull(axes, outline, outer, n_center, n_half);
}

/// Volumetric lights: convex bounding volumes take the place of polygons (section 3.4).
LightHull box_hull(const Axes& axes, const dvec3& low, const dvec3& high) {
  LightHull hull;
  hull.corner_count = 8;
  hull.edge_count = 0;
  const dvec3 middle = (low + high) * 0.5, half = (high - low) * 0.5;
  for (std::uint8_t i = 0; i < 8; ++i) {
    const dvec3 sign(i & 1 ? 1.0 : -1.0, i & 2 ? 1.0 : -1.0, i & 4 ? 1.0 : -1.0);
    const auto place = [&](const dvec3& p) { return axes.origin + axes.u * p.x + axes.v * p.y + axes.n * p.z; };
    hull.corner[i] = place(middle + sign * half);
    hull.outer[i] = place(middle + sign * outer_half(half));
    for (const int bit : {1, 2, 4}) {
      if ((i & bit) == 0) hull.edge[hull.edge_count++] = {i, static_cast<std::uint8_t>(i | bit)};
    }
  }
  return hull;
}

struct Extent {
  dvec3 low{HUGE_VAL}, high{-HUGE_VAL};
  void add(const Axes& axes, const vec3& p) {
    const dvec3 d = dvec3(p) - axes.origin;
    const dvec3 q(glm::dot(d, axes.u), glm::dot(d, axes.v), glm::dot(d, axes.n));
    low = glm::min(low, q), high = glm::max(high, q);
  }
};

LightHull hull_of(const Axes& axes, const Extent& extent, bool flat) {
  return flat ? rectangle_hull(axes, extent.low, extent.high) : box_hull(axes, extent.low, extent.high);
}

Axes axes_of(const LightSamples& samples, const KernelSamples& kernel) {
  return {dvec3(kernel.center), samples.axis_u, samples.axis_v, samples.axis_n};
}

/// Finds and keeps separating planes of one hull and one blocker.
class PlaneFinder {
 public:
  PlaneFinder(const LightHull& hull, const std::array<vec3, 3>& blocker, PenumbraVolume& volume)
      : hull_(hull), blocker_{dvec3(blocker[0]), dvec3(blocker[1]), dvec3(blocker[2])}, volume_(volume) {
    volume.count = 0;
  }

  /// Keeps the plane with this normal, in either direction, if it separates for certain. Most candidates do not and
  /// fail at the first or second corner, so the normal is made a unit vector only when it is kept.
  void try_normal(const dvec3& n) {
    const double t0 = glm::dot(n, blocker_[0]), t1 = glm::dot(n, blocker_[1]), t2 = glm::dot(n, blocker_[2]);
    const double size = std::fabs(n.x) + std::fabs(n.y) + std::fabs(n.z);
    const double margin = std::fabs(glm::dot(n, hull_.thickness)) + kDotError * size;
    const double low = std::min({t0, t1, t2}), high = std::max({t0, t1, t2});
    const double first = glm::dot(n, hull_.corner[0]);
    const bool below = first + margin <= low;
    if (!below && !(first - margin >= high)) return;
    for (std::uint32_t i = 1; i < hull_.corner_count; ++i) {
      const double x = glm::dot(n, hull_.corner[i]);
      if (below ? !(x + margin <= low) : !(x - margin >= high)) return;
    }
    below ? keep(n, low) : keep(-n, -high);
  }

  void run() {
    const dvec3 e0 = blocker_[1] - blocker_[0], e1 = blocker_[2] - blocker_[1], e2 = blocker_[0] - blocker_[2];
    try_normal(glm::cross(e0, e1));
    const std::array<dvec3, 3> blocker_edges = {e0, e1, e2};
    for (std::size_t k = 0; k < 3; ++k) {
      for (std::uint32_t i = 0; i < hull_.corner_count; ++i) {
        try_normal(glm::cross(blocker_edges[k], hull_.outer[i] - blocker_[k]));
      }
    }
    for (std::uint32_t i = 0; i < hull_.edge_count; ++i) {
      const dvec3 &from = hull_.outer[hull_.edge[i].from], along = hull_.outer[hull_.edge[i].to] - from;
      for (const dvec3& t : blocker_) try_normal(glm::cross(along, t - from));
    }
  }

 private:
  void keep(const dvec3& n, double offset) {
    const double length = std::sqrt(glm::dot(n, n));
    if (!(length > 1e-30) || volume_.count == PenumbraVolume::kMostPlanes) return;
    volume_.normal[volume_.count] = n / length;
    volume_.offset[volume_.count++] = offset / length - kDotError;
  }

  const LightHull& hull_;
  const std::array<dvec3, 3> blocker_;
  PenumbraVolume& volume_;
};

}  // namespace

LightHull make_light_hull(const LightBound& bound, const LightSamples& samples, const KernelSamples& kernel) {
  const Axes axes = axes_of(samples, kernel);
  Extent extent;
  for (const vec3& p : samples.points) extent.add(axes, p);
  if (samples.flat && bound.flat && bound.outline.size() >= 3 && bound.outline.size() <= 8) {
    return outline_hull(axes, bound.outline, 0.5 * (extent.low.z + extent.high.z),
                        0.5 * (extent.high.z - extent.low.z));
  }
  return hull_of(axes, extent, samples.flat);
}

std::vector<LightHull> make_group_hulls(const LightSamples& samples, const KernelSamples& kernel,
                                        std::uint32_t group_size) {
  const Axes axes = axes_of(samples, kernel);
  std::vector<LightHull> hulls;
  for (std::uint32_t first = 0; first < kernel.count; first += group_size) {
    const std::uint32_t count = std::min(group_size, kernel.count - first);
    Extent extent;
    for (std::uint32_t set = 0; set < kernel.sets; ++set) {
      for (const vec3& p : kernel.set_points(set).subspan(first, count)) extent.add(axes, p);
    }
    hulls.push_back(hull_of(axes, extent, samples.flat));
  }
  return hulls;
}

void make_penumbra_volume(const LightHull& hull, const std::array<vec3, 3>& blocker, PenumbraVolume& volume) {
  PlaneFinder(hull, blocker, volume).run();
}

}  // namespace halfshade
