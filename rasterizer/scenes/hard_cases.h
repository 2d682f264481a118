// The smallest scenes that break shadow methods: a few triangles before one light. Shared by the stability tests, which
// demand that exact methods hold, and by the failure atlas, which shows how the others break.
//
// Frame of all but the accumulation cases: y up, light [-1,1] x {4} x [-1,1] facing down, receivers on y = 0.
#pragma once

#include "halfshade/light.h"
#include "halfshade/scene.h"

namespace halfshade::cases {

using Triangle = std::array<dvec3, 3>;
using Triangles = std::vector<Triangle>;

/// Indexed, without shared corners, one opaque material.
Scene scene_of(const Triangles& triangles);
Triangles joined(Triangles a, const Triangles& b);
Triangles quad(const dvec3& a, const dvec3& b, const dvec3& c, const dvec3& d);
/// Closed box, wound outward.
Triangles box(const dvec3& low, const dvec3& high);

/// [-1,1] x {4} x [-1,1], facing down.
Light frame_light();
/// y = 2, x <= slant * z: V(x) = (1 + x) / 2 on y = 0 without slant.
Triangles half_plane(double slant = 0.0);
/// [-1,1] x {y} x [-1,1], wound to face down.
Triangles plate(double y);
/// y = 2, |x| <= width / 2, along all of z.
Triangles wire(double width);
/// Stands upright in x = 0, which holds the light's centre: its two sides see different halves of the light (B1).
Triangles both_sides_lit();
/// Passes through the light itself (C1).
Triangles piercing_light();
/// A corner lies above the light's plane; shadows reach x = 20 and beyond (A5).
Triangles through_light_plane();
/// Two quads, y = 2 and y = 2.5, that hide the same half of the light from the origin (B8).
Triangles double_cover();
/// Bars of a period of 1/64 along x, half of it opaque, at y = 3.5 (B6).
Scene bars();
/// Tiny triangles within 0.01 below the light (D3).
Triangles swarm_at_light(std::uint32_t seed, int count);
/// Of size 0.7 within [-4, 3.5]^3, corners on multiples of 1/1024: moved by large powers of two or ten they stay exact.
Triangles scattered(std::uint32_t seed, int count);
/// y = 2, |x|, |z| <= reach: columns of quads 1/16 wide, cut every 1/16 along z; every other column is shifted by half
/// of that, so that its corners lie in the middle of its neighbours' edges. Segments from receivers on odd multiples of
/// 1/16 to a 16 x 16 grid over the light pass through corners and edges.
Triangles t_junctions(double reach);

/// Disk of radius 0.5 at the origin, facing +z: the light of the accumulation cases, receivers on z = 4 (E1 to E6).
Light accumulation_light();
/// Across the axis at depth z.
Triangles card(double z, double x0, double x1, double y = 64.0);
/// A card at z = 1 that hides one three times as large at z = 3 from the light's centre (E1).
Triangles hidden_card();
/// A card at z = 1 that hides the left half of the light and one at z = 3 that hides the right half (E2).
Triangles overlapping_cards(double y = 64.0);

/// Sphere of radius 1 about the origin with its poles on the y axis, white; normals of the true sphere (A10).
Scene smooth_sphere(std::uint32_t segments, std::uint32_t rings);
/// A small two-sided light 85 degrees away from +z, so that the terminator passes through the middle of a picture
/// taken from there.
Light grazing_light(double size = 0.2);

}  // namespace halfshade::cases
