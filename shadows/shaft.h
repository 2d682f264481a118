// The hull of two boxes, for culling: what lies between receivers and a light (Haines and Wallace 1991).
#pragma once

#include <algorithm>

#include "halfshade/types.h"

namespace halfshade {

struct Box {
  vec3 low{1e30f}, high{-1e30f};  // empty
  bool is_empty() const { return low.x > high.x; }
  void add(const vec3& p) { low = glm::min(low, p), high = glm::max(high, p); }
};

/// Conservative: a plane rejects a box only if all of it lies beyond both ends of the shaft. Coordinates below 4.
class Shaft {
 public:
  Shaft(const Box& a, const Box& b) {
    around_ = {glm::min(a.low, b.low), glm::max(a.high, b.high)};
    for (int first = 0; first < 3; ++first) {
      for (int corner = 0; corner < 4; ++corner) add_planes(a, b, first, (first + 1) % 3, corner);
    }
  }

  bool may_meet(const Box& box) const {
    for (int axis = 0; axis < 3; ++axis) {
      if (box.low[axis] > around_.high[axis] || box.high[axis] < around_.low[axis]) return false;
    }
    for (int i = 0; i < count_; ++i) {
      const Plane& p = planes_[i];
      if (-reach({-p.nx, -p.ny}, box, p.x, p.y) > p.limit) return false;
    }
    return true;
  }

 private:
  /// Along two axes of space: everything in the shaft has nx x + ny y <= limit.
  struct Plane {
    int x = 0, y = 1;
    double nx = 0.0, ny = 0.0, limit = 0.0;
  };

  /// Largest value of n . p in the box.
  static double reach(const dvec2& n, const Box& box, int x, int y) {
    return n.x * double{n.x > 0.0 ? box.high[x] : box.low[x]} + n.y * double{n.y > 0.0 ? box.high[y] : box.low[y]};
  }

  /// The planes through the same corner of both boxes, seen along the third axis; only those that touch the shaft say
  /// more than the box around it.
  void add_planes(const Box& a, const Box& b, int x, int y, int corner) {
    const auto corner_of = [&](const Box& box) {
      return dvec2(corner & 1 ? box.high[x] : box.low[x], corner & 2 ? box.high[y] : box.low[y]);
    };
    const dvec2 p = corner_of(a), along = corner_of(b) - p;
    for (const double sign : {1.0, -1.0}) {
      const dvec2 n = sign * dvec2(-along.y, along.x);
      const double limit = std::max(reach(n, a, x, y), reach(n, b, x, y));
      if (limit <= glm::dot(n, p) + 1e-9) planes_[count_++] = {x, y, n.x, n.y, limit + 1e-9};
    }
  }

  Box around_;
  std::array<Plane, 24> planes_;
  int count_ = 0;
};

}  // namespace halfshade
