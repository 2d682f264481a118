// Does a segment cross a triangle, counted so that a closed surface is crossed exactly once where it is crossed?
//
// blocks() (predicate.h) is closed: a segment through an edge meets both triangles at it, through a vertex all of its
// fan. That is right for masks, which OR, and wrong for whatever counts or multiplies: depth complexity,
// transmittance. Here ties on edges are broken by simulation of simplicity (Edelsbrunner and Mücke 1990; stability.md
// b3): the light sample is moved by (e, e^2, e^3) for an infinitesimal e > 0, the same for every triangle, so that the
// moved segment meets no edge or vertex at all and every surface through which it goes exactly once.
#pragma once

#include "rasterizer/core/predicate.h"

namespace halfshade {

/// Sign of det(a-r, b-r, l-r) with l moved as above: -1 or 1; 0 only where r lies on the line through a and b.
/// Antisymmetric in a and b.
int orient3d_moved(const vec3& a, const vec3& b, const vec3& l, const vec3& r);

/// r and l lie strictly on opposite sides of the plane of (a, b, c), and the segment from r to l, moved at l, goes
/// through the triangle. Implies blocks(a, b, c, r, l); equal to it except where the segment meets the outline.
/// Independent of the order of the corners. Not of the direction: ties are broken at l.
///
/// Sides are strict and not moved, so a triangle whose plane holds r or l is not crossed. That stays consistent: the
/// segment can meet such a triangle only at r or l themselves, or lie in its plane, from where the moved one leaves at
/// r. It also keeps r off the lines of the edges, so the sign above is never 0.
bool crosses(const vec3& a, const vec3& b, const vec3& c, const vec3& r, const vec3& l);

}  // namespace halfshade
