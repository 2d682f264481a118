#include "rasterizer/bent_normals.h"

#include <algorithm>
#include <atomic>
#include <cmath>

#include "rasterizer/attributes.h"
#include "rasterizer/core/parallel.h"
#include "rasterizer/shading.h"

namespace halfshade {
namespace {

constexpr double kBlend = 3.0;               // the paper's c
constexpr float kSameNormalCosine = 0.999f;  // corner normals of one smooth surface, within the rounding of files

/// Twice the area long.
dvec3 winding_normal(const LatticeMesh& mesh, std::uint32_t triangle) {
  const std::array<vec3, 3> corners = mesh.corners(triangle);
  const dvec3 a(corners[0]);
  return glm::cross(dvec3(corners[1]) - a, dvec3(corners[2]) - a);
}

/// Signed distance of `center` from the triangle's plane; 0 for a triangle without area.
double height_above(const LatticeMesh& mesh, std::uint32_t triangle, const dvec3& center) {
  const dvec3 normal = winding_normal(mesh, triangle);
  const double length = std::sqrt(glm::dot(normal, normal));
  return length > 0.0 ? glm::dot(normal, center - dvec3(mesh.corners(triangle)[0])) / length : 0.0;
}

/// Shading normal of the corner of `triangle` that is position `vertex`; zero if there is none.
vec3 corner_normal(const LatticeMesh& mesh, std::uint32_t triangle, std::uint32_t vertex) {
  if (mesh.scene == nullptr || mesh.scene->triangle_normals.empty()) return vec3(0.0f);
  const auto& corners = mesh.triangles[triangle];
  const std::size_t k = corners[0] == vertex ? 0 : (corners[1] == vertex ? 1 : 2);
  return mesh.scene->triangle_normals[triangle][k];
}

}  // namespace

// The order of the facets at a position depends on the threads; only their minimum is ever taken.
BentNormals::BentNormals(const LatticeMesh& mesh) : mesh_(mesh) {
  constexpr std::size_t kGrain = 8192;
  std::vector<std::uint32_t> counts(mesh.positions.size(), 0);
  parallel_ranges(mesh.triangles.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t != end; ++t) {
      for (const std::uint32_t v : mesh.triangles[t])
        std::atomic_ref(counts[v]).fetch_add(1, std::memory_order_relaxed);
    }
  });
  exclusive_scan(counts, offsets_);
  faces_.resize(offsets_.back());
  std::vector<std::uint32_t> next(offsets_.begin(), offsets_.end() - 1);
  parallel_ranges(mesh.triangles.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t != end; ++t) {
      for (const std::uint32_t v : mesh.triangles[t]) {
        faces_[std::atomic_ref(next[v]).fetch_add(1, std::memory_order_relaxed)] = static_cast<std::uint32_t>(t);
      }
    }
  });
}

namespace {

/// What the samples that show one side of one triangle share.
struct BentFacet {
  std::uint32_t triangle = kNone;
  bool back = false;
  BarycentricPlanes planes;
  dvec3 heights{0.0};  // of the light's centre above the lowest of the facets at each corner, on the side that is seen
};

}  // namespace

std::vector<float> BentNormals::cosines(const GBuffer& gbuffer, const Camera& camera, const Light& light) const {
  const dvec3 center = mesh_.frame.to_local(light_center(light)), eye = mesh_.frame.to_local(camera.eye);

  // The height of the centre above a facet's plane is the same at all its corners, so that one sign holds for all of a
  // facet that faces away; dividing by the distance at the sample instead of at the corners keeps flat facets exact.
  const auto facet_of = [&](std::uint32_t triangle, bool back) {
    BentFacet facet{triangle, back, make_barycentric_planes(mesh_.corners(triangle), eye)};
    const double side = back ? -1.0 : 1.0;
    for (int k = 0; k < 3; ++k) {
      const std::uint32_t v = mesh_.triangles[triangle][static_cast<std::size_t>(k)];
      const vec3 own = corner_normal(mesh_, triangle, v);
      facet.heights[k] = side * height_above(mesh_, triangle, center);
      for (std::uint32_t i = offsets_[v]; i != offsets_[v + 1]; ++i) {
        if (!(glm::dot(own, corner_normal(mesh_, faces_[i], v)) > kSameNormalCosine)) continue;
        facet.heights[k] = std::min(facet.heights[k], side * height_above(mesh_, faces_[i], center));
      }
    }
    return facet;
  };

  std::vector<float> result(gbuffer.size(), 0.0f);
  parallel_ranges(gbuffer.size(), 4096, [&](std::size_t begin, std::size_t end) {
    BentFacet facet;
    for (std::size_t i = begin; i != end; ++i) {
      const std::uint32_t triangle = gbuffer.triangle[i];
      if (triangle == kNone) continue;
      const bool back = glm::dot(winding_normal(mesh_, triangle), dvec3(gbuffer.geometric_normal[i])) < 0.0;
      if (triangle != facet.triangle || back != facet.back) facet = facet_of(triangle, back);
      const dvec3 towards = center - gbuffer.position[i];
      const double distance = std::sqrt(glm::dot(towards, towards));
      if (!(distance > 0.0)) continue;
      const double smooth = std::max(0.0, glm::dot(dvec3(gbuffer.shading_normal[i]), towards) / distance);
      const double bend = glm::dot(facet.planes.weights(gbuffer.position[i] - eye), facet.heights) / distance;
      const double blend = std::clamp(kBlend * bend, 0.0, 1.0);
      result[i] = static_cast<float>(std::clamp(blend * smooth + (1.0 - blend) * bend, 0.0, 1.0));
    }
  });
  return result;
}

}  // namespace halfshade
