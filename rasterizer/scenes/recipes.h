// The makers behind make_builtin_scene, one per scene. Each fills an empty scene and its view; `size` is within the
// range that the table in builtin.cpp states.
#pragma once

#include "rasterizer/scenes/builtin.h"

namespace halfshade {

void make_demo(std::uint32_t size, BuiltinScene& out);     // demo.cpp
void make_columns(std::uint32_t size, BuiltinScene& out);  // architecture.cpp
void make_bars(std::uint32_t size, BuiltinScene& out);
void make_room(std::uint32_t size, BuiltinScene& out);
void make_fence(std::uint32_t size, BuiltinScene& out);  // fence.cpp
void make_fence_mesh(std::uint32_t size, BuiltinScene& out);
void make_torus_knot(std::uint32_t size, BuiltinScene& out);  // solids.cpp
void make_sphere(std::uint32_t size, BuiltinScene& out);
void make_field(std::uint32_t size, BuiltinScene& out);
void make_grass(std::uint32_t size, BuiltinScene& out);  // strands.cpp
void make_hairball(std::uint32_t size, BuiltinScene& out);
void make_glass(std::uint32_t size, BuiltinScene& out);  // glass.cpp

/// `grass` in pieces: everything but the blades, then blades [first, first + count) of `size`, appended to `scene`,
/// five triangles each.
inline constexpr std::uint32_t kBladeTriangles = 5;
void make_lawn(BuiltinScene& out);
void add_blades(std::uint32_t first, std::uint32_t count, std::uint32_t size, Scene& scene);

/// `size`, or the scene's default for 0. Throws Error{kUsage} as make_builtin_scene.
std::uint32_t checked_builtin_size(std::string_view name, std::uint32_t size);

/// One-sided rectangle that faces `target`.
Light rectangle_light(const dvec3& center, const dvec3& target, double width, double height);

Camera look(const dvec3& eye, const dvec3& target, double fov_y_deg = 45.0);

}  // namespace halfshade
