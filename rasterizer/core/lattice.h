// The local frame and its lattice: where all geometry lives once it has been read.
//
// World coordinates (double) are moved so that the scene's box is centred on the origin, scaled by a power of two to
// max |x| <= 1, rounded to float and snapped to multiples of 2^-38. On that lattice every difference of two
// coordinates is exact in double and orient3d is exact in 128-bit integers (see predicate.h).
#pragma once

#include <cmath>
#include <cstdint>

#include "halfshade/types.h"

namespace halfshade {

inline constexpr int kLatticeBits = 38;
inline constexpr double kLatticeUnit = 0x1p-38;

/// The lattice coordinate as an integer number of units; exact for every snapped value.
inline std::int64_t lattice_units(float x) { return static_cast<std::int64_t>(static_cast<double>(x) * 0x1p38); }

/// Nearest float that is a multiple of the lattice unit. |x| <= 2.
inline float snap_to_lattice(double x) {
  const float rounded = static_cast<float>(x);
  if (std::fabs(rounded) >= 0x1p-14f) return rounded;  // a float this large is a multiple of 2^-38 by itself
  return static_cast<float>(std::nearbyint(x * 0x1p38) * 0x1p-38);
}

inline vec3 snap_to_lattice(const dvec3& p) {
  return {snap_to_lattice(p.x), snap_to_lattice(p.y), snap_to_lattice(p.z)};
}

inline bool is_finite(const dvec3& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

/// World <-> local. Built from the scene's box and the farthest point that must fit (lights, explicit receivers).
/// Subtracting the box minimum first makes the frame independent of where the scene lies: fl(p - min) is the same
/// double for a shifted copy of the scene whenever the shifted coordinates are exact.
struct LocalFrame {
  dvec3 box_min{0.0};
  dvec3 half_extent{0.0};
  double scale = 1.0;  // power of two

  dvec3 center() const { return box_min + half_extent; }
  dvec3 to_local(const dvec3& world) const { return ((world - box_min) - half_extent) * scale; }
  dvec3 to_local_vector(const dvec3& world) const { return world * scale; }
  dvec3 to_world(const dvec3& local) const { return (local / scale + half_extent) + box_min; }
  vec3 to_lattice(const dvec3& world) const { return snap_to_lattice(to_local(world)); }
};

/// Frame for geometry inside [min, max] with `extra` points (lights) that must stay within |x| <= 1.
/// Throws Error{kBadInput} when a coordinate is not finite or the extents overflow.
LocalFrame make_local_frame(std::span<const dvec3> geometry, std::span<const dvec3> extra);

}  // namespace halfshade
