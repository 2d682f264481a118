// Polygons of OBJ faces into triangles, in double.
#pragma once

#include "halfshade/types.h"

namespace halfshade {

/// Appends size - 2 triangles (corner numbers of `polygon`, in its winding) to `triangles`. Quads are cut along the
/// shorter valid diagonal, larger polygons by ear clipping in the plane of their Newell normal, so that every corner is
/// used and no triangle of a simple planar polygon overlaps another.
/// False when the polygon crosses itself or has no area: then the triangles still sum to its signed area.
bool triangulate(std::span<const dvec3> polygon, std::vector<std::array<std::uint32_t, 3>>& triangles);

}  // namespace halfshade
