// S34: coarse spheres with smooth normals under grazing light, where interpolated normals light facets that face away.
#include <doctest/doctest.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>

#include "rasterizer/bent_normals.h"
#include "rasterizer/rasterizer.h"
#include "rasterizer/shading.h"
#include "shadows/solver.h"
#include "support/lit_scene.h"

using namespace halfshade;
using namespace halfshade::test;
using halfshade::cases::grazing_light;

namespace {

constexpr std::uint32_t kSide = 1536;

struct Lit {
  Scene scene;
  LatticeMesh mesh;
  GBuffer gbuffer;
  std::vector<float> plain, bent, visibility;  // [pixel]
};

void light_sphere(std::uint32_t segments, std::uint32_t rings, const Light& light, Lit& lit) {
  lit.scene = cases::smooth_sphere(segments, rings);
  lit.mesh = make_lattice_mesh(lit.scene, make_local_frame(lit.scene.positions, light_extent(light)));
  Camera camera;
  camera.eye = {0.0, 0.4, 6.0};
  camera.fov_y_deg = 20.0;
  rasterize(lit.mesh, camera, {kSide, kSide, {}}, lit.gbuffer);
  lit.bent = BentNormals(lit.mesh).cosines(lit.gbuffer, camera, light);
  lit.plain.assign(lit.gbuffer.size(), 0.0f);
  lit.visibility = lit.plain;
  const std::vector<vec3> response = light_response(lit.gbuffer, lit.mesh.frame, light);
  for (std::size_t i = 0; i < response.size(); ++i) lit.plain[i] = response[i].x;
  const ShadowConfig config = frame_config(64);
  const LightSamples samples = make_light_samples(light, config, lit.mesh.frame);
  const ReceiverArray receivers = make_receivers(lit.gbuffer, samples, 0);
  VisibilityMasks masks;
  ShadowStats stats;
  solve_masks(lit.mesh, receivers, light, samples, config, masks, stats);
  for (std::size_t i = 0; i < receivers.size(); ++i) lit.visibility[receivers.sample[i]] = masks.visibility(i);
}

/// Is the light's centre behind the side of the facet that this pixel shows?
bool faces_away_from(const Lit& lit, std::size_t pixel, const Light& light) {
  const auto corners = lit.mesh.corners(lit.gbuffer.triangle[pixel]);
  const dvec3 a(corners[0]), normal = glm::cross(dvec3(corners[1]) - a, dvec3(corners[2]) - a);
  const double side = glm::dot(normal, dvec3(lit.gbuffer.geometric_normal[pixel])) < 0.0 ? -1.0 : 1.0;
  return side * glm::dot(normal, lit.mesh.frame.to_local(light.center) - a) <= 0.0;
}

bool share_an_edge(const Lit& lit, std::uint32_t a, std::uint32_t b) {
  int shared = 0;
  for (const std::uint32_t v : lit.mesh.triangles[a]) {
    const auto& other = lit.mesh.triangles[b];
    shared += std::find(other.begin(), other.end(), v) != other.end();
  }
  return shared == 2;
}

/// Largest difference, in 255ths, between pixels side by side that show two facets with a common edge; facets seen at
/// more than 75 degrees are left out, where a pixel spans too much of the surface. Cosine times visibility or alone.
double largest_step(const Lit& lit, const std::vector<float>& cosine, bool shadowed) {
  const auto value = [&](std::size_t i) { return cosine[i] * (shadowed ? lit.visibility[i] : 1.0f); };
  const auto usable = [&](std::size_t i) {
    return lit.gbuffer.triangle[i] != kNone && lit.gbuffer.geometric_normal[i].z > 0.26f;
  };
  double largest = 0.0;
  for (std::size_t i = 0; i + kSide < lit.gbuffer.size(); ++i) {
    for (const std::size_t j : {i + 1, i + kSide}) {
      const std::uint32_t a = lit.gbuffer.triangle[i], b = lit.gbuffer.triangle[j];
      if (a == b || !usable(i) || !usable(j) || !share_an_edge(lit, a, b)) continue;
      largest = std::max(largest, std::fabs(static_cast<double>(value(i)) - value(j)) * 255.0);
    }
  }
  return largest;
}

}  // namespace

TEST_CASE("S34 terminator: bent normals leave facets that face away exactly black, and no step between facets") {
  const Light light = grazing_light();
  for (const auto& [segments, rings] : {std::pair{8u, 4u}, {16u, 8u}, {32u, 16u}, {64u, 32u}}) {
    CAPTURE(segments);
    Lit lit;
    light_sphere(segments, rings, light, lit);
    std::size_t away = 0, lit_by_bent = 0, lit_by_plain = 0, brighter = 0;
    for (std::size_t i = 0; i < lit.gbuffer.size(); ++i) {
      if (lit.gbuffer.triangle[i] == kNone) continue;
      brighter += lit.bent[i] > lit.plain[i] + 1e-6f;
      if (!faces_away_from(lit, i, light)) continue;
      ++away;
      lit_by_bent += lit.bent[i] != 0.0f;
      lit_by_plain += lit.plain[i] > 0.0f;
    }
    CHECK(away > 100000);
    CHECK(lit_by_bent == 0);
    CHECK(lit_by_plain > 0);  // the fault that bending repairs
    const double shadowed = largest_step(lit, lit.bent, true), alone = largest_step(lit, lit.bent, false);
    CHECK(alone <= 2.0);
    CHECK(shadowed <= 2.0);
    MESSAGE(segments << "x" << rings << ": largest step in 255ths: plain with shadows "
                     << largest_step(lit, lit.plain, true) << ", bent with shadows " << shadowed << ", bent alone "
                     << alone << "; brighter than plain: " << brighter);
  }
}

TEST_CASE("S34 terminator: facets without smooth neighbours keep their cosine") {
  Scene scene = scene_of(box({-1, -1, -1}, {1, 1, 1}));
  const Light light = grazing_light();
  const LatticeMesh mesh = make_lattice_mesh(scene, make_local_frame(scene.positions, light_extent(light)));
  Camera camera;
  camera.eye = {3.0, 2.0, 5.0};
  GBuffer gbuffer;
  rasterize(mesh, camera, {64, 64, {}}, gbuffer);
  const std::vector<float> bent = BentNormals(mesh).cosines(gbuffer, camera, light);
  scene.materials[0].diffuse = vec3(1.0f);
  const std::vector<vec3> plain = light_response(gbuffer, mesh.frame, light);
  for (std::size_t i = 0; i < bent.size(); ++i) {
    if (gbuffer.triangle[i] == kNone) continue;
    CHECK(bent[i] == doctest::Approx(plain[i].x / gbuffer.albedo[i].x).epsilon(1e-5));
  }
}

TEST_CASE("S34 terminator: 1, 2 and 7 threads give the same bits") {
  const auto run = [](int threads) {
    Lit lit;
    tbb::task_arena(threads).execute([&] { light_sphere(16, 8, grazing_light(), lit); });
    return lit.bent;
  };
  const std::vector<float> one = run(1);
  CHECK(run(2) == one);
  CHECK(run(7) == one);
}
