#include "shadows/closed_components.h"

#include <doctest/doctest.h>

#include "support/lit_scene.h"

using namespace halfshade;
using namespace halfshade::test;

namespace {

ClosedComponents components_of(const Scene& scene) {
  return find_closed_components(make_lattice_mesh(scene, make_local_frame(scene.positions, {})));
}

}  // namespace

TEST_CASE("closed boxes are certified one by one, open and inconsistently wound ones are not") {
  std::vector<Triangle> triangles = joined(box({0, 0, 0}, {1, 1, 1}), box({2, 0, 0}, {3, 1, 1}));
  ClosedComponents closed = components_of(scene_of(triangles));
  CHECK(closed.components == 2);
  REQUIRE(closed.boxes.size() == 2);
  CHECK(closed.of_triangle[0] == 0);
  CHECK(closed.of_triangle[12] == 1);

  std::vector<Triangle> open = triangles;
  open.pop_back();
  closed = components_of(scene_of(open));
  CHECK(closed.boxes.size() == 1);
  CHECK(closed.of_triangle[12] == kNone);

  std::vector<Triangle> flipped = triangles;
  std::swap(flipped[3][0], flipped[3][1]);
  closed = components_of(scene_of(flipped));
  CHECK(closed.of_triangle[0] == kNone);
  CHECK(closed.of_triangle[12] == 0);
}

TEST_CASE("a component with an alpha-tested triangle is not certified") {
  Scene scene = scene_of(box({0, 0, 0}, {1, 1, 1}));
  scene.materials.push_back(scene.materials[0]);
  scene.materials[1].alpha_map = 0;
  scene.alpha_maps.push_back({"holes", 1, 1, {255}});
  scene.triangle_uvs.resize(scene.triangles.size());
  CHECK(components_of(scene).boxes.size() == 1);
  scene.triangle_materials[5] = 1;
  CHECK(components_of(scene).boxes.empty());
}

TEST_CASE("back faces of closed meshes give the masks of all faces, at aligned edges and from inside too") {
  Random random(4);
  for (int round = 0; round < 30; ++round) {
    std::vector<Triangle> triangles;
    for (int i = 0; i < 12; ++i) {
      const dvec3 low = glm::round(random.in_box(-4, 3) * 2.0) / 2.0, size = glm::round(random.in_box(1, 4)) / 2.0;
      std::vector<Triangle> b = box(low, low + size);
      if (i % 4 == 1) {
        for (Triangle& t : b) std::swap(t[0], t[1]);  // inside out: still closed
      }
      if (i % 4 == 2) b.pop_back();  // open
      triangles = joined(triangles, b);
    }
    std::vector<dvec3> points;
    for (int i = 0; i < 200; ++i) points.push_back(glm::round(random.in_box(-5, 3.9) * 4.0) / 4.0);
    Light light = frame_light();
    light.two_sided = true;
    if (round % 3 == 0) light.center = {0, 1, 0};  // the light may be inside a box
    ShadowConfig config = frame_config(64);
    const Scene scene = scene_of(triangles);
    CHECK(wrong_bits_of_exact_methods(scene, receivers_at(points), light, config) == 0);
    config.back_face_casters = false;
    CHECK(wrong_bits_of_exact_methods(scene, receivers_at(points), light, config) == 0);
  }
}
