// Small meshes, random numbers and comparisons for the rasterizer's tests. Meshes use the identity frame: world =
// local.
#pragma once

#include <doctest/doctest.h>

#include <hwy/targets.h>
#include <algorithm>
#include <cmath>
#include <cstring>

#include "rasterizer/coverage_kernel.h"
#include "rasterizer/rasterizer.h"

namespace halfshade::testing {

/// SplitMix64 (Steele, Lea and Flood 2014).
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}
  std::uint64_t bits() {
    std::uint64_t z = state_ += 0x9e3779b97f4a7c15u;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
  }
  double real(double low, double high) { return low + (high - low) * (static_cast<double>(bits() >> 11) * 0x1p-53); }
  std::int64_t integer(std::int64_t low, std::int64_t high) {  // both included
    return low + static_cast<std::int64_t>(bits() % static_cast<std::uint64_t>(high - low + 1));
  }
  dvec3 point(double low, double high) { return {real(low, high), real(low, high), real(low, high)}; }

 private:
  std::uint64_t state_;
};

inline void add_triangle(LatticeMesh& mesh, const dvec3& a, const dvec3& b, const dvec3& c) {
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  for (const dvec3& p : {a, b, c}) mesh.positions.push_back(snap_to_lattice(p));
  mesh.triangles.push_back({first, first + 1, first + 2});
}

/// Two triangles, a b c and a c d.
inline void add_quad(LatticeMesh& mesh, const dvec3& a, const dvec3& b, const dvec3& c, const dvec3& d) {
  add_triangle(mesh, a, b, c);
  add_triangle(mesh, a, c, d);
}

/// Random triangles of about `size` in the unit cube.
inline LatticeMesh random_soup(std::uint64_t seed, std::uint32_t count, double size) {
  LatticeMesh mesh;
  Random random(seed);
  for (std::uint32_t i = 0; i != count; ++i) {
    const dvec3 center = random.point(-0.9, 0.9);
    add_triangle(mesh, center + random.point(-size, size), center + random.point(-size, size),
                 center + random.point(-size, size));
  }
  return mesh;
}

inline Camera looking_along_minus_z(double eye_z = 2.0, double fov_y_deg = 60.0) {
  Camera camera;
  camera.eye = {0.0, 0.0, eye_z};
  camera.target = {0.0, 0.0, eye_z - 1.0};
  camera.fov_y_deg = fov_y_deg;
  return camera;
}

inline GBuffer render(const LatticeMesh& mesh, const Camera& camera, std::uint32_t width, std::uint32_t height,
                      const PixelWindow& window = {}, RasterStats* stats = nullptr) {
  GBuffer gbuffer;
  rasterize(mesh, camera, {width, height, window}, gbuffer, stats);
  return gbuffer;
}

template <class T>
bool same_bits(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0);
}

inline bool same_bits(const GBuffer& a, const GBuffer& b) {
  return same_bits(a.triangle, b.triangle) && same_bits(a.position, b.position) &&
         same_bits(a.geometric_normal, b.geometric_normal) && same_bits(a.shading_normal, b.shading_normal) &&
         same_bits(a.albedo, b.albedo) && same_bits(a.depth, b.depth);
}

/// body() once for every Highway target of this build that the machine can run, checking that it really is the one.
template <class Body>
void for_each_target(const Body& body) {
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    CAPTURE(hwy::TargetName(target));
    CHECK(coverage_kernel_target() == target);
    body();
  }
  hwy::SetSupportedTargetsForTest(0);
}

}  // namespace halfshade::testing
