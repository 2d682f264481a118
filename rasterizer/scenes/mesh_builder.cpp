#include "rasterizer/scenes/mesh_builder.h"

#include <algorithm>

#include "rasterizer/core/parallel.h"

namespace halfshade {
namespace {

double fraction(std::uint32_t i, std::uint32_t n) { return static_cast<double>(i) / static_cast<double>(n); }

/// Which triangle corners meet at each vertex, as offsets + list. Only triangles from `first` on.
struct VertexFaces {
  std::vector<std::uint32_t> offsets, faces;
};

VertexFaces vertex_faces(const Scene& scene, std::uint32_t first) {
  std::vector<std::uint32_t> counts(scene.positions.size(), 0);
  for (std::size_t t = first; t < scene.triangles.size(); ++t) {
    for (const std::uint32_t v : scene.triangles[t]) ++counts[v];
  }
  VertexFaces result;
  exclusive_scan(counts, result.offsets);
  result.faces.resize(result.offsets.back());
  std::vector<std::uint32_t> next(result.offsets.begin(), result.offsets.end() - 1);
  for (std::size_t t = first; t < scene.triangles.size(); ++t) {
    for (const std::uint32_t v : scene.triangles[t]) result.faces[next[v]++] = static_cast<std::uint32_t>(t);
  }
  return result;
}

/// Twice the area times the unit normal; zero for a degenerate triangle.
dvec3 area_normal(const Scene& scene, std::uint32_t triangle) {
  const auto& t = scene.triangles[triangle];
  const dvec3& a = scene.positions[t[0]];
  return glm::cross(scene.positions[t[1]] - a, scene.positions[t[2]] - a);
}

dvec3 unit_or_zero(const dvec3& v) {
  const double length2 = glm::dot(v, v);
  return length2 > 0.0 ? v / std::sqrt(length2) : dvec3{0.0};
}

}  // namespace

Placement place_at(const dvec3& origin, double turns, double scale) {
  const dvec2 angle = unit_circle(turns);
  return {origin, dvec3{angle.x, 0.0, -angle.y} * scale, dvec3{0.0, scale, 0.0}, dvec3{angle.y, 0.0, angle.x} * scale};
}

dvec3 perpendicular(const dvec3& v) {
  const dvec3 other = std::fabs(v.y) < 0.8 ? dvec3{0.0, 1.0, 0.0} : dvec3{1.0, 0.0, 0.0};
  return unit_or_zero(glm::cross(other, v));
}

std::uint32_t MeshBuilder::material(const std::string& name, const vec3& diffuse) {
  material_ = static_cast<std::uint32_t>(scene_.materials.size());
  scene_.materials.push_back({.name = name, .diffuse = diffuse});
  return material_;
}

std::uint32_t MeshBuilder::vertex(const dvec3& p) {
  scene_.positions.push_back(placement_(p));
  return vertex_count() - 1;
}

void MeshBuilder::triangle(std::uint32_t a, std::uint32_t b, std::uint32_t c) {
  scene_.triangles.push_back({a, b, c});
  scene_.triangle_materials.push_back(material_);
}

void MeshBuilder::quad(std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) {
  triangle(a, b, c);
  triangle(a, c, d);
}

void MeshBuilder::quad(const dvec3& a, const dvec3& b, const dvec3& c, const dvec3& d) {
  const std::uint32_t first = vertex(a);
  vertex(b);
  vertex(c);
  vertex(d);
  quad(first, first + 1, first + 2, first + 3);
}

void MeshBuilder::card(const dvec3& a, const dvec3& b, const dvec3& c, const dvec3& d, const vec2& uv_low,
                       const vec2& uv_high) {
  quad(a, b, c, d);
  scene_.triangle_uvs.resize(triangle_count() - 2, {vec2{0.0f}, vec2{0.0f}, vec2{0.0f}});
  const vec2 low_right{uv_high.x, uv_low.y}, high_left{uv_low.x, uv_high.y};
  scene_.triangle_uvs.push_back({uv_low, low_right, uv_high});
  scene_.triangle_uvs.push_back({uv_low, uv_high, high_left});
}

void MeshBuilder::ground(double half_side, double y) {
  const double h = half_side;
  quad(dvec3{-h, y, h}, dvec3{h, y, h}, dvec3{h, y, -h}, dvec3{-h, y, -h});
}

void MeshBuilder::box(const dvec3& low, const dvec3& high) {
  const std::uint32_t v = vertex_count();  // corner number: bit 0 = x high, bit 1 = y high, bit 2 = z high
  for (int corner = 0; corner < 8; ++corner) {
    vertex({(corner & 1) ? high.x : low.x, (corner & 2) ? high.y : low.y, (corner & 4) ? high.z : low.z});
  }
  quad(v + 0, v + 4, v + 6, v + 2);  // -x
  quad(v + 1, v + 3, v + 7, v + 5);  // +x
  quad(v + 0, v + 1, v + 5, v + 4);  // -y
  quad(v + 2, v + 6, v + 7, v + 3);  // +y
  quad(v + 0, v + 2, v + 3, v + 1);  // -z
  quad(v + 4, v + 5, v + 7, v + 6);  // +z
}

void MeshBuilder::join_rings(std::uint32_t first, std::uint32_t rings, std::uint32_t sides, bool loop) {
  for (std::uint32_t ring = 0; ring < (loop ? rings : rings - 1); ++ring) {
    const std::uint32_t low = first + ring * sides, high = first + (ring + 1) % rings * sides;
    for (std::uint32_t side = 0; side < sides; ++side) {
      const std::uint32_t next = (side + 1) % sides;
      quad(low + side, low + next, high + next, high + side);
    }
  }
}

void MeshBuilder::close_ring(std::uint32_t first, std::uint32_t sides, const dvec3& pole, bool at_end) {
  const std::uint32_t center = vertex(pole);
  for (std::uint32_t side = 0; side < sides; ++side) {
    const std::uint32_t a = first + side, b = first + (side + 1) % sides;
    if (at_end) {
      triangle(a, b, center);
    } else {
      triangle(b, a, center);
    }
  }
}

void MeshBuilder::lathe(std::span<const dvec2> profile, double bottom, double top, std::uint32_t sides) {
  const std::uint32_t first = vertex_count();
  const auto rings = static_cast<std::uint32_t>(profile.size());
  for (const dvec2& point : profile) {
    for (std::uint32_t side = 0; side < sides; ++side) {
      const dvec2 angle = unit_circle(fraction(side, sides));
      vertex({point.x * angle.y, point.y, point.x * angle.x});
    }
  }
  join_rings(first, rings, sides, false);
  close_ring(first, sides, {0.0, bottom, 0.0}, false);
  close_ring(first + (rings - 1) * sides, sides, {0.0, top, 0.0}, true);
}

void MeshBuilder::cylinder(double radius, double bottom, double top, std::uint32_t sides) {
  const std::array<dvec2, 2> profile{dvec2{radius, bottom}, dvec2{radius, top}};
  lathe(profile, bottom, top, sides);
}

void MeshBuilder::ellipsoid(const dvec3& center, const dvec3& radii, std::uint32_t sides, std::uint32_t bands) {
  std::vector<dvec2> profile;
  for (std::uint32_t band = 1; band < bands; ++band) {
    const dvec2 angle = unit_circle(0.5 * fraction(band, bands));
    profile.push_back({angle.y, -angle.x});
  }
  const Placement outer = placement_;
  placement_ = {outer(center), outer.x * radii.x, outer.y * radii.y, outer.z * radii.z};
  lathe(profile, -1.0, 1.0, sides);
  placement_ = outer;
}

void MeshBuilder::tube_ring(const dvec3& center, const dvec3& normal, const dvec3& binormal, double radius,
                            std::uint32_t sides) {
  for (std::uint32_t side = 0; side < sides; ++side) {
    const dvec2 angle = unit_circle(fraction(side, sides));
    vertex(center + (normal * angle.x + binormal * angle.y) * radius);
  }
}

void MeshBuilder::tube(std::span<const dvec3> path, double radius, std::uint32_t sides) {
  const std::uint32_t first = vertex_count();
  const std::size_t rings = path.size();
  dvec3 normal = perpendicular(unit_or_zero(path[1] - path[0]));
  for (std::size_t i = 0; i < rings; ++i) {
    const dvec3 along = unit_or_zero(path[std::min(i + 1, rings - 1)] - path[i == 0 ? 0 : i - 1]);
    normal = unit_or_zero(normal - along * glm::dot(along, normal));
    tube_ring(path[i], normal, glm::cross(along, normal), radius, sides);
  }
  join_rings(first, static_cast<std::uint32_t>(rings), sides, false);
  close_ring(first, sides, path.front(), false);
  close_ring(first + static_cast<std::uint32_t>(rings - 1) * sides, sides, path.back(), true);
}

void MeshBuilder::torus_knot(double major, double minor, double radius, std::uint32_t rings, std::uint32_t sides) {
  const std::uint32_t first = vertex_count();
  for (std::uint32_t ring = 0; ring < rings; ++ring) {
    const dvec2 around = unit_circle(2.0 * fraction(ring, rings));   // about the axis
    const dvec2 through = unit_circle(3.0 * fraction(ring, rings));  // through the hole
    const double reach = major + minor * through.x;
    // The torus' own normal is at right angles to any curve on it, so it serves as the first axis of the cross section.
    const dvec3 normal{through.x * around.x, through.x * around.y, through.y};
    const dvec3 along{-3.0 * minor * through.y * around.x - 2.0 * reach * around.y,
                      -3.0 * minor * through.y * around.y + 2.0 * reach * around.x, 3.0 * minor * through.x};
    const dvec3 center{reach * around.x, reach * around.y, minor * through.y};
    tube_ring(center, normal, unit_or_zero(glm::cross(along, normal)), radius, sides);
  }
  join_rings(first, rings, sides, true);
}

void MeshBuilder::settle(std::uint32_t first_vertex, double y) {
  if (first_vertex >= vertex_count()) return;
  double lowest = scene_.positions[first_vertex].y;
  for (std::size_t i = first_vertex; i < scene_.positions.size(); ++i) {
    lowest = std::min(lowest, scene_.positions[i].y);
  }
  for (std::size_t i = first_vertex; i < scene_.positions.size(); ++i) scene_.positions[i].y += y - lowest;
}

void MeshBuilder::smooth(std::uint32_t first_triangle) {
  constexpr double kCreaseCosine = 0.77;
  const VertexFaces around = vertex_faces(scene_, first_triangle);
  scene_.triangle_normals.resize(triangle_count(), {vec3{0.0f}, vec3{0.0f}, vec3{0.0f}});
  parallel_ranges(triangle_count() - first_triangle, 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) {
      const auto t = static_cast<std::uint32_t>(first_triangle + i);
      const dvec3 own = unit_or_zero(area_normal(scene_, t));
      for (std::size_t corner = 0; corner < 3; ++corner) {
        const std::uint32_t v = scene_.triangles[t][corner];
        dvec3 sum{0.0};
        for (std::uint32_t k = around.offsets[v]; k != around.offsets[v + 1]; ++k) {
          const dvec3 other = area_normal(scene_, around.faces[k]);
          if (glm::dot(own, other) > kCreaseCosine * std::sqrt(glm::dot(other, other))) sum += other;
        }
        scene_.triangle_normals[t][corner] = vec3{unit_or_zero(sum)};
      }
    }
  });
}

void MeshBuilder::finish() {
  if (!scene_.triangle_uvs.empty()) {
    scene_.triangle_uvs.resize(triangle_count(), {vec2{0.0f}, vec2{0.0f}, vec2{0.0f}});
  }
  if (!scene_.triangle_normals.empty()) {
    scene_.triangle_normals.resize(triangle_count(), {vec3{0.0f}, vec3{0.0f}, vec3{0.0f}});
  }
}

}  // namespace halfshade
