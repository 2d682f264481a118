// Makes the shapes that the built-in scenes are put together from: boxes, lathed bodies, tubes, cards, knots.
// Solids are closed and wound counter-clockwise seen from outside, with vertices shared inside each solid.
#pragma once

#include <string>

#include "halfshade/scene.h"
#include "rasterizer/scenes/random.h"

namespace halfshade {

/// Object space -> world: p -> origin + p.x x + p.y y + p.z z. Axes may stretch but must stay right-handed.
struct Placement {
  dvec3 origin{0.0};
  dvec3 x{1.0, 0.0, 0.0}, y{0.0, 1.0, 0.0}, z{0.0, 0.0, 1.0};
  dvec3 operator()(const dvec3& p) const { return origin + x * p.x + y * p.y + z * p.z; }
};

/// Turned about the y axis (counter-clockwise seen from above), scaled, then moved to `origin`.
Placement place_at(const dvec3& origin, double turns = 0.0, double scale = 1.0);

/// A unit vector at right angles to unit vector `v`.
dvec3 perpendicular(const dvec3& v);

class MeshBuilder {
 public:
  /// Appends to `scene`, which must outlive the builder.
  explicit MeshBuilder(Scene& scene) : scene_(scene) {}

  /// Adds a material; shapes made from now on have it.
  std::uint32_t material(const std::string& name, const vec3& diffuse);
  void use(std::uint32_t material) { material_ = material; }
  void place(const Placement& placement) { placement_ = placement; }

  std::uint32_t vertex(const dvec3& p);
  void triangle(std::uint32_t a, std::uint32_t b, std::uint32_t c);
  /// Open sheets, counter-clockwise.
  void quad(std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d);
  void quad(const dvec3& a, const dvec3& b, const dvec3& c, const dvec3& d);
  /// A quad whose texture runs from uv_low at `a` to uv_high at `c`, u along a -> b.
  void card(const dvec3& a, const dvec3& b, const dvec3& c, const dvec3& d, const vec2& uv_low, const vec2& uv_high);
  /// Horizontal square of the given half side, facing up.
  void ground(double half_side, double y = 0.0);

  void box(const dvec3& low, const dvec3& high);
  /// Surface of revolution about y. `profile` lists (radius, height) upwards, radius > 0; the ends are closed by a fan
  /// around the points (0, bottom) and (0, top).
  void lathe(std::span<const dvec2> profile, double bottom, double top, std::uint32_t sides);
  void cylinder(double radius, double bottom, double top, std::uint32_t sides);
  void ellipsoid(const dvec3& center, const dvec3& radii, std::uint32_t sides, std::uint32_t bands);
  /// Tube with flat ends along a polyline of at least two points.
  void tube(std::span<const dvec3> path, double radius, std::uint32_t sides);
  /// Tube on a (2,3) torus knot with its axis along z: `major` and `minor` are the torus' radii.
  void torus_knot(double major, double minor, double radius, std::uint32_t rings, std::uint32_t sides);

  std::uint32_t vertex_count() const { return static_cast<std::uint32_t>(scene_.positions.size()); }
  std::uint32_t triangle_count() const { return static_cast<std::uint32_t>(scene_.triangles.size()); }
  /// Moves the vertices from `first_vertex` on vertically until the lowest one lies at height y.
  void settle(std::uint32_t first_vertex, double y);
  /// Gives the triangles from `first_triangle` on shading normals: at each corner the area-weighted mean of the faces
  /// around the vertex that are less than about 40 degrees away from the corner's own face.
  void smooth(std::uint32_t first_triangle);
  /// Pads the optional per-triangle arrays. Call it once, last.
  void finish();

 private:
  /// Joins rings of `sides` vertices, numbered ring by ring from `first`. Sides go counter-clockwise about the
  /// direction from the first ring to the last.
  void join_rings(std::uint32_t first, std::uint32_t rings, std::uint32_t sides, bool loop);
  void close_ring(std::uint32_t first, std::uint32_t sides, const dvec3& pole, bool at_end);
  void tube_ring(const dvec3& center, const dvec3& normal, const dvec3& binormal, double radius, std::uint32_t sides);

  Scene& scene_;
  Placement placement_;
  std::uint32_t material_ = 0;
};

}  // namespace halfshade
