#include "shadows/soft_shadow_volume.h"

#include <algorithm>
#include <cmath>

namespace halfshade {
namespace {

/// Coordinates are at most 2 and normals are unit vectors: a rounded dot product is off by less than 1.6e-15.
constexpr double kDotError = 1e-14;
/// Padding of the vertices' box: with the angles demanded below they are off by less than 1e-8.
constexpr double kBoxPad = 0x1p-20;
/// Least sine between planes that meet in an edge of a closed volume, and least cosine between such an edge and the
/// direction in which the back cap lies.
constexpr double kLeastSine = 1e-4, kLeastCosine = 0.05;

/// Points whose convex hull holds the part of the light on one side of a plane: corners and, where the plane cuts the
/// light, the crossings of every pair of corners (a superset of the hull's edges).
class LightPart {
 public:
  template <class Height>
  LightPart(std::span<const dvec3> corners, const dvec3& thickness, const Height& height) {
    std::array<dvec3, 16> point;
    std::array<double, 16> h{};
    std::size_t n = 0;
    for (const dvec3& c : corners) {
      for (const double sign : {-1.0, 1.0}) point[n] = c + thickness * sign, h[n] = height(point[n]), ++n;
    }
    for (std::size_t i = 0; i < n; ++i) {
      if (h[i] < 0.0) continue;
      points_[count_++] = point[i];
      for (std::size_t k = 0; k < n; ++k) {
        if (h[k] < 0.0) points_[count_++] = point[i] + (point[k] - point[i]) * (h[i] / (h[i] - h[k]));
      }
    }
  }
  std::span<const dvec3> points() const { return {points_.data(), count_}; }

 private:
  std::array<dvec3, 16 * 16> points_;
  std::size_t count_ = 0;
};

struct Builder {
  std::array<dvec3, 3> corner;
  dvec3 up{0.0};       // unit normal towards the light's part
  double slack = 0.0;  // how far the rounded plane may lie off the blocker's own
  SoftShadowVolume& volume;

  void keep(std::size_t plane, const dvec3& n) const {
    volume.normal[plane] = n;
    volume.offset[plane] =
        std::min({glm::dot(n, corner[0]), glm::dot(n, corner[1]), glm::dot(n, corner[2])}) - kDotError;
  }

  /// The corner of the light that the outer plane of the edge leans on: the one that is farthest round the edge towards
  /// the triangle's inside, seen along the edge.
  const dvec3* supporting_point(std::size_t edge, std::span<const dvec3> light) const {
    const dvec3 along = corner[(edge + 1) % 3] - corner[edge];
    dvec3 out = glm::cross(along, up);
    if (glm::dot(out, corner[(edge + 2) % 3] - corner[edge]) > 0.0) out = -out;
    const dvec3* best = nullptr;
    double best_x = 0.0, best_y = 0.0;
    for (const dvec3& l : light) {
      const double x = glm::dot(out, l - corner[edge]), y = glm::dot(up, l - corner[edge]);
      if (best == nullptr || x * best_y < best_x * y) best = &l, best_x = x, best_y = y;
    }
    return best;
  }

  /// `outer` is larger than `inner` by more than rounding can matter: a plane that leans on the first passes the
  /// second.
  void add_outer_quad(std::size_t edge, std::span<const dvec3> inner, std::span<const dvec3> outer) const {
    const dvec3* point = supporting_point(edge, outer);
    if (point == nullptr) return;
    const dvec3 cross = glm::cross(corner[(edge + 1) % 3] - corner[edge], *point - corner[edge]);
    const double length = glm::length(cross);
    if (!(length > 1e-20)) return;
    dvec3 n = cross / length;
    if (glm::dot(n, corner[(edge + 2) % 3] - corner[edge]) < 0.0) n = -n;
    const double least = std::min({glm::dot(n, corner[0]), glm::dot(n, corner[1]), glm::dot(n, corner[2])});
    for (const dvec3& l : inner) {
      if (!(glm::dot(n, l) + kDotError <= least)) return;
    }
    keep(1 + edge, n);
  }

  /// Back cap and box, where the planes meet at angles that leave no doubt.
  void close(const LatticeBox& receivers) const {
    std::array<dvec3, 3> ray;
    for (std::size_t k = 0; k < 3; ++k) {
      const dvec3 d = glm::cross(volume.normal[1 + (k + 2) % 3], volume.normal[1 + k]);
      const double length = glm::length(d), down = -glm::dot(d, up);
      if (!(length > kLeastSine && std::fabs(down) > kLeastSine * length)) return;
      ray[k] = d / (down > 0.0 ? length : -length);
    }
    const dvec3 axis = glm::normalize(ray[0] + ray[1] + ray[2]);
    double depth = -HUGE_VAL;
    for (int i = 0; i < 8; ++i) {
      const dvec3 p(i & 1 ? receivers.high.x : receivers.low.x, i & 2 ? receivers.high.y : receivers.low.y,
                    i & 4 ? receivers.high.z : receivers.low.z);
      depth = std::max(depth, glm::dot(axis, p));
    }
    for (std::size_t k = 0; k < 3; ++k) {
      if (!(glm::dot(axis, ray[k]) > kLeastCosine)) return;
      depth = std::max(depth, glm::dot(axis, corner[k]));
    }
    dvec3 low(HUGE_VAL), high(-HUGE_VAL);
    for (std::size_t k = 0; k < 3; ++k) {
      volume.vertex[k] = corner[k];
      volume.vertex[3 + k] = corner[k] + ray[k] * ((depth - glm::dot(axis, corner[k])) / glm::dot(axis, ray[k]));
      low = glm::min(low, glm::min(volume.vertex[k], volume.vertex[3 + k]));
      high = glm::max(high, glm::max(volume.vertex[k], volume.vertex[3 + k]));
    }
    volume.low = low - kBoxPad, volume.high = high + kBoxPad;
    volume.closed = true;
  }
};

}  // namespace

bool make_soft_shadow_volume(const LightHull& hull, const std::array<vec3, 3>& blocker, int light_side,
                             const LatticeBox& receivers, SoftShadowVolume& volume) {
  volume = {};
  volume.offset.fill(-1.0);
  Builder b{{dvec3(blocker[0]), dvec3(blocker[1]), dvec3(blocker[2])}, {}, 0.0, volume};
  const dvec3 e0 = b.corner[1] - b.corner[0], e1 = b.corner[2] - b.corner[0];
  const dvec3 normal = glm::cross(e0, e1);
  const double length = glm::length(normal);
  // A needle's normal is noise: its volume is all of space, once.
  b.slack = 0x1p-48 * glm::length(e0) * glm::length(e1) / length + kDotError;
  if (!(b.slack < 1e-7)) return light_side > 0;
  volume.light_side = light_side;
  b.up = normal * (light_side / length);
  const auto height = [&](const dvec3& p) { return glm::dot(b.up, p - b.corner[0]) + b.slack; };
  const LightPart inner({hull.corner.data(), hull.corner_count}, hull.thickness, height);
  if (inner.points().empty()) return false;
  const LightPart outer({hull.outer.data(), hull.corner_count}, hull.thickness * 2.0, height);
  b.keep(0, -b.up);
  volume.offset[0] -= b.slack;
  for (std::size_t edge = 0; edge < 3; ++edge) b.add_outer_quad(edge, inner.points(), outer.points());
  const bool all =
      std::all_of(volume.normal.begin(), volume.normal.end(), [](const dvec3& n) { return n != dvec3(0.0); });
  if (all) b.close(receivers);
  return true;
}

}  // namespace halfshade
