// The scenes of the stability cases S01 to S22, for those who run all of them: other instruction sets, threads and
// orders of triangles (S29), other programs (S45). Frame: y up, light [-1,1] x {4} x [-1,1] facing down, 16x16
// cell-centre samples, receivers near y = 0, unless a case says otherwise.
#pragma once

#include <string>

#include "rasterizer/core/unit_circle.h"
#include "support/lit_scene.h"

namespace halfshade::test {

struct StabilityCase {
  std::string name;  // "S01 vertex_aim"; several entries may share one
  Scene scene;
  std::vector<Receiver> receivers;
  Light light;
  ShadowConfig config;
};

/// One or a few small entries per case, S01 to S22 in order.
std::vector<StabilityCase> stability_cases();

/// `aims` receivers inside a closed sphere, each with up to 4096 segments through vertices or through points of edges
/// (mid-points, exactly, and random ones in turn), moved by `offset`.
std::vector<StabilityCase> sphere_aims(bool at_edges, int rings, int segments, int aims,
                                       const dvec3& offset = dvec3(0));

inline constexpr double kAimGrid = 0x1p12;  // vertices and receivers of the spheres are multiples of 1 / this

inline dvec3 on_grid(const dvec3& p) { return glm::round(p * kAimGrid) / kAimGrid; }

/// Closed UV sphere of radius 1/4 around the origin with vertices on multiples of 2^-12.
struct Sphere {
  std::vector<dvec3> vertices;
  std::vector<std::array<std::uint32_t, 3>> faces;

  Sphere(int rings, int segments);
  Scene scene() const;
};

/// Not snapped to any grid, `radius` around `center`.
std::vector<Triangle> uv_sphere(const dvec3& center, double radius, int rings, int segments);

Light sample_light(std::vector<dvec3> points);

using cases::bars;
using cases::half_plane;
using cases::plate;
using cases::wire;

/// 129 receivers at x = -1 .. 1, across the edge of half_plane().
std::vector<dvec3> half_plane_receivers();

/// Slivers of that aspect; receivers nearly in their planes, seen at half a degree.
std::vector<Triangle> slivers(Random& random, double aspect);
std::vector<dvec3> grazing_points(Random& random, const std::vector<Triangle>& triangles);

/// half_plane() and such triangles, scaled and then moved; receivers and light with them.
StabilityCase moved_case(const std::vector<Triangle>& triangles, const std::vector<dvec3>& points, const dvec3& offset,
                         double scale);

/// side x side points of y = 0, |x|, |z| <= reach.
std::vector<dvec3> floor_points(int side, double reach);

/// A card at y = 2 with a texture of 4 x 4 texels of growing alpha.
Scene alpha_card(float cutoff, const dvec2& uv_low, const dvec2& uv_high);

/// Over one period of the shadow of bars().
std::vector<dvec3> bar_receivers();

/// Sweep a wire, which covers twice its width on the light as seen from y = 0, over eight distances between samples.
std::vector<dvec3> wire_receivers(int count);

}  // namespace halfshade::test
