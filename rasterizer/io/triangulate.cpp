// Ear clipping after Meisters 1975 ("Polygons have ears"). Only reflex or straight corners can lie inside an ear, and
// they are kept in a uniform grid, so that a test looks at few of them.
#include "rasterizer/io/triangulate.h"

#include <algorithm>
#include <cmath>

#include <glm/common.hpp>

namespace halfshade {
namespace {

using Triangles = std::vector<std::array<std::uint32_t, 3>>;

double cross2(const dvec2& a, const dvec2& b, const dvec2& c) {
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

// Twice the vector area, around corner 0 to keep the numbers small (Newell).
dvec3 newell_normal(std::span<const dvec3> polygon) {
  dvec3 normal(0.0);
  for (std::size_t i = 1; i + 1 < polygon.size(); ++i) {
    normal += glm::cross(polygon[i] - polygon[0], polygon[i + 1] - polygon[0]);
  }
  return normal;
}

// Drops the axis along which the polygon is seen largest: the remaining coordinates stay exact. Counter-clockwise.
std::vector<dvec2> project(std::span<const dvec3> polygon, const dvec3& normal) {
  const dvec3 size = glm::abs(normal);
  const int drop = size.x > size.y ? (size.x > size.z ? 0 : 2) : (size.y > size.z ? 1 : 2);
  int first = (drop + 1) % 3, second = (drop + 2) % 3;
  if (normal[drop] < 0.0) std::swap(first, second);
  std::vector<dvec2> points;
  points.reserve(polygon.size());
  for (const dvec3& p : polygon) points.emplace_back(p[first], p[second]);
  return points;
}

class EarClipper {
 public:
  EarClipper(std::span<const dvec2> points, Triangles& triangles)
      : points_(points), triangles_(triangles), left_(points.size()), links_(points.size()), reflex_(points.size()) {
    const auto count = static_cast<std::uint32_t>(points.size());
    for (std::uint32_t i = 0; i < count; ++i) links_[i] = {(i + count - 1) % count, (i + 1) % count};
    for (std::uint32_t i = 0; i < count; ++i) reflex_[i] = !is_convex(i);
    fill_grid();
  }

  bool run() {
    constexpr int kMostForcedCuts = 16;  // a crossing polygon must not cost a full search per corner
    int forced = 0;
    std::uint32_t some = 0;
    while (left_ > 3) {
      if (cut_ears(some)) continue;
      cut(some);
      some = links_[some].next;
      if (++forced == kMostForcedCuts) break;
    }
    for (; left_ >= 3; some = links_[some].next) cut(some);
    return forced == 0;
  }

 private:
  struct Links {
    std::uint32_t previous, next;
  };

  bool is_convex(std::uint32_t i) const {
    return cross2(points_[links_[i].previous], points_[i], points_[links_[i].next]) > 0.0;
  }

  void fill_grid() {
    low_ = high_ = points_[0];
    for (const dvec2& p : points_) low_ = glm::min(low_, p), high_ = glm::max(high_, p);
    const auto count = static_cast<double>(std::count(reflex_.begin(), reflex_.end(), true));
    side_ = std::max(1u, static_cast<std::uint32_t>(std::sqrt(count)));
    cells_.resize(std::size_t{side_} * side_);
    for (std::uint32_t i = 0; i < points_.size(); ++i) {
      if (reflex_[i]) cells_[cell(points_[i].y, 1) * side_ + cell(points_[i].x, 0)].push_back(i);
    }
  }

  std::size_t cell(double x, int axis) const {
    const double width = high_[axis] - low_[axis];
    const double place = width > 0.0 ? (x - low_[axis]) / width * side_ : 0.0;
    return std::min<std::size_t>(static_cast<std::size_t>(place), side_ - 1);
  }

  // Closed test, so that no diagonal runs through a corner; a corner at the same place as one of the ear's does not
  // count (polygons with holes touch themselves where the hole is joined).
  bool hides_ear(std::uint32_t i, const dvec2& a, const dvec2& b, const dvec2& c) const {
    if (!reflex_[i]) return false;
    const dvec2& p = points_[i];
    if (p == a || p == b || p == c) return false;
    return cross2(a, b, p) >= 0.0 && cross2(b, c, p) >= 0.0 && cross2(c, a, p) >= 0.0;
  }

  bool is_ear(std::uint32_t i) const {
    if (!is_convex(i)) return false;
    const dvec2 &a = points_[links_[i].previous], &b = points_[i], &c = points_[links_[i].next];
    const dvec2 low = glm::min(a, glm::min(b, c)), high = glm::max(a, glm::max(b, c));
    for (std::size_t y = cell(low.y, 1); y <= cell(high.y, 1); ++y) {
      for (std::size_t x = cell(low.x, 0); x <= cell(high.x, 0); ++x) {
        for (const std::uint32_t other : cells_[y * side_ + x]) {
          if (hides_ear(other, a, b, c)) return false;
        }
      }
    }
    return true;
  }

  // One round over the corners that are left, following up the neighbours of each cut. False when there was no ear;
  // `some` is then a corner to cut anyway, a convex one if there is any.
  bool cut_ears(std::uint32_t& some) {
    std::vector<std::uint32_t> queue;
    std::uint32_t i = some;
    for (std::size_t k = 0; k < left_; ++k, i = links_[i].next) queue.push_back(i);
    bool found = false;
    for (std::size_t k = 0; k < queue.size() && left_ > 3; ++k) {
      const std::uint32_t candidate = queue[k];
      if (!is_left(candidate) || !is_ear(candidate)) continue;
      const Links neighbours = links_[candidate];
      cut(candidate);
      queue.push_back(neighbours.next);
      queue.push_back(neighbours.previous);
      some = neighbours.next;
      found = true;
    }
    if (!found) {
      for (const std::uint32_t candidate : queue) {
        if (is_convex(candidate)) return some = candidate, false;
      }
    }
    return found;
  }

  bool is_left(std::uint32_t i) const {
    return links_[links_[i].previous].next == i && links_[links_[i].next].previous == i;
  }

  void cut(std::uint32_t i) {
    const auto [previous, next] = links_[i];
    triangles_.push_back({previous, i, next});
    links_[previous].next = next;
    links_[next].previous = previous;
    --left_;
    reflex_[i] = false;
    for (const std::uint32_t neighbour : {previous, next}) {
      if (reflex_[neighbour] && is_convex(neighbour)) reflex_[neighbour] = false;
    }
  }

  std::span<const dvec2> points_;
  Triangles& triangles_;
  std::size_t left_;
  std::vector<Links> links_;
  std::vector<bool> reflex_;  // reflex or straight; never for corners already cut
  dvec2 low_{0.0}, high_{0.0};
  std::uint32_t side_ = 1;
  std::vector<std::vector<std::uint32_t>> cells_;  // [y][x] -> reflex corners
};

bool cut_quad(std::span<const dvec3> q, const dvec3& normal, Triangles& triangles) {
  const auto faces_up = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    return glm::dot(glm::cross(q[b] - q[a], q[c] - q[a]), normal) > 0.0;
  };
  const bool first_valid = faces_up(0, 1, 2) && faces_up(0, 2, 3);
  const bool second_valid = faces_up(0, 1, 3) && faces_up(1, 2, 3);
  const bool second_shorter = glm::dot(q[3] - q[1], q[3] - q[1]) < glm::dot(q[2] - q[0], q[2] - q[0]);
  if (second_valid && (!first_valid || second_shorter)) {
    triangles.insert(triangles.end(), {{0, 1, 3}, {1, 2, 3}});
  } else {
    triangles.insert(triangles.end(), {{0, 1, 2}, {0, 2, 3}});
  }
  return first_valid || second_valid;
}

}  // namespace

bool triangulate(std::span<const dvec3> polygon, Triangles& triangles) {
  if (polygon.size() == 3) {
    triangles.push_back({0, 1, 2});
    return true;
  }
  const dvec3 normal = newell_normal(polygon);
  if (polygon.size() == 4) return cut_quad(polygon, normal, triangles);
  const std::vector<dvec2> points = project(polygon, normal);
  return EarClipper(points, triangles).run();
}

}  // namespace halfshade
