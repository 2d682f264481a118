// Flat convex polygons as lights: checked corners and an area-preserving map from the unit square.
#pragma once

#include "halfshade/light.h"
#include "rasterizer/core/bounded_vector.h"

namespace halfshade {

struct PolygonLight {
  static constexpr std::size_t kMostCorners = 64;

  dvec3 center{0.0};                                        // mean of the corners, world
  dvec3 axis_u{1, 0, 0}, axis_v{0, 1, 0}, axis_n{0, 0, 1};  // orthonormal; u along the longest edge, n = facing
  BoundedVector<dvec2, kMostCorners> corners;               // around center, in units of axis_u, axis_v

  /// A horizontal slice of the polygon between two corners' heights (in axis_v), with its chords.
  struct Slab {
    double low = 0.0, high = 0.0;                                               // heights
    double left_low = 0.0, right_low = 0.0, left_high = 0.0, right_high = 0.0;  // chord ends in axis_u
    double area_before = 0.0, area = 0.0;                                       // of the slabs below, of this one
  };
  BoundedVector<Slab, kMostCorners> slabs;  // from below

  /// Vector from `center`, world units. Samples of equal t lie on one chord, so rows stay rows; equal areas of the
  /// square go to equal areas of the polygon.
  dvec3 offset(const dvec2& st) const;
};

/// Throws Error{kBadInput} naming the light unless light.points are 3..64 corners of a flat (to 1e-6 of its size),
/// convex polygon with an area.
PolygonLight make_polygon_light(const Light& light);

}  // namespace halfshade
