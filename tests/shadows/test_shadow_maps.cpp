// Depth maps, how receivers find their place in them, and the methods that compare with them.
#include <doctest/doctest.h>

#include <algorithm>
#include <numeric>

#include <tbb/task_arena.h>

#include "rasterizer/scenes/builtin.h"
#include "shadows/light_maps.h"
#include "support/lit_picture.h"
#include "support/lit_scene.h"

using namespace halfshade;
using namespace halfshade::test;

namespace {

constexpr ShadowMethod kVisibilityMethods[] = {ShadowMethod::kShadowAccumulation, ShadowMethod::kShadowMap,
                                               ShadowMethod::kPercentageCloserFiltering,
                                               ShadowMethod::kPercentageCloserSoftShadows};

LatticeMesh lattice_of(const Scene& scene) {
  const std::vector<dvec3> reach = {dvec3(-1), dvec3(1)};
  return make_lattice_mesh(scene, make_local_frame(scene.positions, reach));
}

std::vector<Triangle> card(double z, double half = 1.0) {
  return quad({-half, -half, z}, {half, -half, z}, {half, half, z}, {-half, half, z});
}

/// Looks along +z from the world's origin, slopes of one either way.
DepthMap map_along_z(const LatticeMesh& mesh, std::uint32_t side) {
  DepthMap map;
  map.camera.eye = mesh.frame.to_local(dvec3(0));
  map.camera.forward = {0, 0, 1};
  map.camera.focal_px = map.camera.center_x_px = map.camera.center_y_px = side * 0.5;
  map.width = map.height = side;
  return map;
}

double mean(const std::vector<float>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

double rms_difference(const std::vector<float>& a, const std::vector<float>& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (double{a[i]} - b[i]) * (double{a[i]} - b[i]);
  return std::sqrt(sum / static_cast<double>(a.size()));
}

std::vector<float> visibility_at(const Scene& scene, const std::vector<dvec3>& points, const Light& light,
                                 ShadowConfig config, ShadowMethod method) {
  config.method = method;
  std::vector<float> visibility;
  const std::vector<Receiver> receivers = receivers_at(points);
  solve_visibility(scene, receivers, light, config, visibility);
  return visibility;
}

Light point_light(const dvec3& center) {
  Light light;
  light.shape = LightShape::kPoint;
  light.center = center;
  return light;
}

}  // namespace

TEST_CASE("layers show one surface after the other, and end where there are no more") {
  const Scene scene = scene_of(joined(card(0.75, 2), joined(card(0.25, 0.1), card(0.5, 0.1))));
  const LatticeMesh mesh = lattice_of(scene);
  DepthMap map = map_along_z(mesh, 96);
  draw_depth_map(mesh, 8, map);
  REQUIRE(map.layers.size() == 3);
  const double unit = mesh.frame.scale;
  const std::size_t center = 48 * 96 + 48, corner = 0;
  const auto depth = [&](std::size_t layer, std::size_t at) { return 1.0 / double{map.layers[layer][at]} / unit; };
  CHECK(depth(0, center) == doctest::Approx(0.25).epsilon(1e-6));
  CHECK(depth(1, center) == doctest::Approx(0.5).epsilon(1e-6));
  CHECK(depth(2, center) == doctest::Approx(0.75).epsilon(1e-6));
  CHECK(depth(0, corner) == doctest::Approx(0.75).epsilon(1e-6));
  CHECK(map.layers[1][corner] == 0.0f);
}

TEST_CASE("peeling stops at the limit, and coincident triangles are one layer") {
  const Scene scene = scene_of(joined(card(0.5), joined(card(0.5), card(0.75))));
  const LatticeMesh mesh = lattice_of(scene);
  DepthMap map = map_along_z(mesh, 32);
  draw_depth_map(mesh, 1, map);
  CHECK(map.layers.size() == 1);
  draw_depth_map(mesh, 8, map);
  CHECK(map.layers.size() == 2);
}

TEST_CASE("a light that is surrounded sees receivers on every side of it") {
  // A ball of small cards around the light, a receiver behind each of them and one beside it.
  std::vector<Triangle> triangles;
  std::vector<dvec3> behind, beside;
  Random random(7);
  for (int i = 0; i < 200; ++i) {
    const dvec3 direction = glm::normalize(random.in_box(-1, 1) + dvec3(1e-9));
    const dvec3 a = glm::normalize(glm::cross(direction, dvec3(0.3, 0.5, 0.8))), b = glm::cross(direction, a);
    const dvec3 c = direction * 2.0;
    const auto q =
        quad(c - 0.05 * a - 0.05 * b, c + 0.05 * a - 0.05 * b, c + 0.05 * a + 0.05 * b, c - 0.05 * a + 0.05 * b);
    triangles.insert(triangles.end(), q.begin(), q.end());
    behind.push_back(direction * 4.0);
  }
  const Scene scene = scene_of(triangles);
  const Light light = point_light({0.01, 0.02, 0.03});
  const ShadowConfig config = frame_config(1);
  std::vector<float> visibility = visibility_at(scene, behind, light, config, ShadowMethod::kShadowMap);
  CHECK(std::count(visibility.begin(), visibility.end(), 0.0f) == 200);
  for (const dvec3& p : behind) beside.push_back(p * 0.25);  // before the cards
  visibility = visibility_at(scene, beside, light, config, ShadowMethod::kShadowMap);
  CHECK(std::count(visibility.begin(), visibility.end(), 1.0f) == 200);
}

TEST_CASE("a receiver at the light itself, beside it or far away gets a number between 0 and 1") {
  const Scene scene =
      scene_of(joined(box({-1, 1, -1}, {1, 1.5, 1}), quad({-64, 0, -64}, {64, 0, -64}, {64, 0, 64}, {-64, 0, 64})));
  const std::vector<dvec3> points = {{0, 4, 0}, {3, 4, 0}, {0, 3.999, 0}, {50, 1, 50}, {0, 0.01, 0}, {0, 9, 0}};
  Light sphere;
  sphere.shape = LightShape::kSphere;
  sphere.center = {0, 4, 0};
  sphere.radius = 0.5;
  for (const Light& light : {frame_light(), sphere, point_light({0, 4, 0})}) {
    for (const ShadowMethod method : kVisibilityMethods) {
      const std::vector<float> visibility = visibility_at(scene, points, light, frame_config(16), method);
      CAPTURE(std::string(name_of(method)));
      for (const float v : visibility) {
        CHECK(v >= 0.0f);
        CHECK(v <= 1.0f);
      }
      CHECK(visibility[4] < 0.5f);  // under the box
      CHECK(visibility[3] > 0.7f);  // without a normal the floor before it counts a little
    }
  }
}

TEST_CASE("one map per light sample gives the oracle's masks where no edge is near") {
  const Scene scene = scene_of(box({-1, 1, -1}, {1, 1.5, 1}));
  std::vector<dvec3> points;
  Random random(3);
  for (int i = 0; i < 200; ++i) points.push_back({random.uniform(-2.3, 2.3), 0, random.uniform(-2.3, 2.3)});
  ShadowConfig config = frame_config(64);
  config.shadow_map.resolution = 1024;
  const std::vector<Receiver> receivers = receivers_at(points);
  const VisibilityMasks truth = solve(scene, receivers, frame_light(), config, ShadowMethod::kOracle);
  const std::uint64_t wrong =
      wrong_bits(truth, solve(scene, receivers, frame_light(), config, ShadowMethod::kShadowMapPerSample));
  CHECK(wrong <= 60);  // of 12800: lexels are 0.005 wide, and some segments pass nearer to the box's edges
  config.shadow_map.resolution = 64;
  CHECK(wrong_bits(truth, solve(scene, receivers, frame_light(), config, ShadowMethod::kShadowMapPerSample)) > wrong);
}

TEST_CASE("holes of an alpha-tested card are holes in the map") {
  const BuiltinScene fence = make_builtin_scene("fence", 4), mesh = make_builtin_scene("fence_mesh", 4);
  ShadowConfig config = frame_config(16);
  std::array<double, 2> means{};
  for (int k = 0; k < 2; ++k) {
    const BuiltinScene& scene = k == 0 ? fence : mesh;
    const LitPicture picture = make_lit_picture(scene.scene, scene.view.camera, scene.view.lights[0], config, 64);
    means[k] = mean(visibility_by(picture, config, ShadowMethod::kShadowMapPerSample));
  }
  CHECK(means[0] > 0.1);
  CHECK(means[0] < 0.999);
  CHECK(means[0] == doctest::Approx(means[1]).epsilon(0.02));
}

TEST_CASE("filters without extent are the plain shadow map") {
  const BuiltinScene builtin = make_builtin_scene("columns", 2);
  ShadowConfig config = frame_config(1);
  config.shadow_map.pcf_radius = 0;
  const Light light = point_light(builtin.view.lights[0].center);
  const LitPicture picture = make_lit_picture(builtin.scene, builtin.view.camera, light, config);
  REQUIRE(picture.receivers.size() > 500);
  const std::vector<float> plain = visibility_by(picture, config, ShadowMethod::kShadowMap);
  CHECK(mean(plain) < 0.99);
  for (const ShadowMethod method : kVisibilityMethods) {
    CAPTURE(std::string(name_of(method)));
    CHECK(visibility_by(picture, config, method) == plain);
  }
}

TEST_CASE("the order of triangles and the number of threads change nothing") {
  const BuiltinScene builtin = make_builtin_scene("room", 2);
  Scene reversed = builtin.scene;
  std::reverse(reversed.triangles.begin(), reversed.triangles.end());
  std::reverse(reversed.triangle_materials.begin(), reversed.triangle_materials.end());
  std::reverse(reversed.triangle_uvs.begin(), reversed.triangle_uvs.end());
  std::reverse(reversed.triangle_normals.begin(), reversed.triangle_normals.end());
  ShadowConfig config = frame_config(4);
  config.shadow_map.layers = 4;
  config.shadow_map.resolution = 256;
  const Light& light = builtin.view.lights[0];
  LitPicture picture = make_lit_picture(builtin.scene, builtin.view.camera, light, config);
  LitPicture other = make_lit_picture(reversed, builtin.view.camera, light, config);
  other.receivers = picture.receivers;
  for (const MethodTraits& traits : shadow_methods()) {
    if (traits.exact || traits.method == ShadowMethod::kRaytrace ||
        traits.method == ShadowMethod::kAliasFreeLookupTable)
      continue;
    CAPTURE(std::string(traits.name));
    const std::vector<float> visibility = visibility_by(picture, config, traits.method);
    CHECK(visibility_by(other, config, traits.method) == visibility);
    std::vector<float> alone;
    tbb::task_arena arena(1);
    arena.execute([&] { alone = visibility_by(picture, config, traits.method); });
    CHECK(alone == visibility);
  }
}

TEST_CASE("options out of range are refused by name") {
  const Scene scene = scene_of(card(1));
  ShadowConfig config = frame_config(1);
  const auto message = [&](ShadowMethod method) -> std::string {
    try {
      visibility_at(scene, {{0, 0, 0}}, frame_light(), config, method);
    } catch (const Error& e) {
      CHECK(e.code() == ErrorCode::kUsage);
      return e.what();
    }
    return "";
  };
  config.shadow_map.resolution = 9000;
  for (const ShadowMethod method : kVisibilityMethods) {
    CHECK(message(method).find("map.resolution: 9000") != std::string::npos);
  }
  CHECK(message(ShadowMethod::kShadowMapPerSample).find("16..8192") != std::string::npos);
  config.shadow_map = {};
  config.shadow_map.kernel = 65;
  CHECK(message(ShadowMethod::kShadowAccumulation).find("shadow-accumulation.kernel") != std::string::npos);
}

TEST_CASE("every approximate method draws every built-in scene, and its mean error is small") {
  for (const BuiltinInfo& info : builtin_scenes()) {
    const std::uint32_t size =
        info.name == "grass" || info.name == "torus_knot" ? 500 : (info.name == "hairball" ? 40 : 8);
    const BuiltinScene builtin = make_builtin_scene(info.name, size);
    ShadowConfig config = frame_config(16);
    config.shadow_map.resolution = 512;
    for (const Light& light : builtin.view.lights) {
      const LitPicture picture = make_lit_picture(builtin.scene, builtin.view.camera, light, config);
      const std::vector<float> truth = visibility_by(picture, config, ShadowMethod::kExact);
      for (const MethodTraits& traits : shadow_methods()) {
        if (traits.exact || traits.method == ShadowMethod::kRaytrace) continue;
        const std::string scene(info.name), method(traits.name);
        CAPTURE(scene);
        CAPTURE(method);
        const std::vector<float> visibility = visibility_by(picture, config, traits.method);
        REQUIRE(visibility.size() == truth.size());
        if (truth.empty()) continue;
        CHECK(*std::min_element(visibility.begin(), visibility.end()) >= 0.0f);
        CHECK(*std::max_element(visibility.begin(), visibility.end()) <= 1.0f);
        const bool hard =
            traits.method == ShadowMethod::kShadowMap || traits.method == ShadowMethod::kPercentageCloserFiltering;
        CHECK(std::fabs(mean(visibility) - mean(truth)) < 0.08);
        CHECK(rms_difference(visibility, truth) < (hard ? 0.4 : 0.2));
        config.method = traits.method;
        CHECK_FALSE(method_assumptions(config, light).empty());
      }
    }
  }
}
