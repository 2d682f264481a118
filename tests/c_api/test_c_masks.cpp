// The C interface gives what the C++ interface gives, bit by bit: for every shape of light, with alpha maps, normals
// and own triangles.
#include <doctest/doctest.h>

#include <algorithm>
#include <random>

#include "halfshade/c_api.h"
#include "halfshade/halfshade.h"

namespace {

using namespace halfshade;

constexpr std::size_t kReceivers = 300;
constexpr std::uint32_t kTriangles = 60;

/// One content for both interfaces.
struct Content {
  std::vector<vec3> vertices;
  std::vector<std::array<std::uint32_t, 3>> triangles;
  std::vector<vec2> uvs;
  std::vector<std::uint8_t> alpha;  // 8 x 8
  std::vector<dvec3> receivers;
  std::vector<vec3> normals;
  std::vector<std::uint32_t> meshes, own;
};

Content make_content(std::uint32_t seed) {
  std::mt19937 random(seed);
  // No distribution of the library: its bits differ from one to the next.
  const auto unit = [&random] { return static_cast<float>(random() >> 8) * 0x1p-23f - 1.0f; };
  Content c;
  for (std::uint32_t i = 0; i < 3 * kTriangles; ++i) {
    c.vertices.emplace_back(unit(), 1.0f + unit() * 0.5f, unit());
    c.uvs.emplace_back(unit() * 3.0f, unit() * 3.0f);
    if (i % 3 == 0) c.triangles.push_back({i, i + 1, i + 2});
  }
  for (int i = 0; i < 64; ++i) c.alpha.push_back(static_cast<std::uint8_t>(random()));
  for (std::size_t i = 0; i < kReceivers; ++i) {
    c.receivers.emplace_back(unit(), 0.1 * unit(), unit());
    c.normals.emplace_back(0.3f * unit(), 1.0f, 0.3f * unit());
    c.meshes.push_back(i % 4 == 0 ? 0 : kNone);
    c.own.push_back(static_cast<std::uint32_t>(i % kTriangles));
  }
  return c;
}

/// A light in both forms; `corners` is the memory of the C one's points.
struct TwoLights {
  Light cpp;
  halfshade_light c = {};
  std::vector<dvec3> corners;
};

halfshade_points points_of(const std::vector<dvec3>& values) {
  return {values.data(), values.size(), 0, HALFSHADE_FLOAT64};
}
halfshade_points points_of(const std::vector<vec3>& values) {
  return {values.data(), values.size(), 0, HALFSHADE_FLOAT32};
}

void set(double (&to)[3], const dvec3& from) {
  for (int k = 0; k < 3; ++k) to[k] = from[k];
}

TwoLights make_light(LightShape shape) {
  TwoLights light;
  light.cpp.shape = shape;
  light.cpp.center = {0.25, 3, 0.125};
  light.cpp.u = {1, 0, 0.25};
  light.cpp.v = {0, 0.125, 1};
  light.cpp.normal = {0.1, -1, 0};
  light.cpp.radius = 0.5;
  light.cpp.axes = {dvec3(0.5, 0, 0), dvec3(0, 0.25, 0), dvec3(0, 0, 0.75)};
  light.cpp.emission = {1, 2, 0.5};
  light.cpp.points = {dvec3(0, 3, 0), dvec3(1, 3, 0), dvec3(1, 3, 1), dvec3(0, 3, 1)};
  light.corners = light.cpp.points;
  light.c.struct_size = sizeof light.c;
  light.c.shape = static_cast<halfshade_light_shape>(shape);
  set(light.c.center, light.cpp.center);
  set(light.c.u, light.cpp.u);
  set(light.c.v, light.cpp.v);
  set(light.c.normal, light.cpp.normal);
  light.c.radius = light.cpp.radius;
  for (std::size_t k = 0; k < 3; ++k) set(light.c.axes[k], light.cpp.axes[k]);
  for (int k = 0; k < 3; ++k) light.c.emission[k] = light.cpp.emission[k];
  light.c.points = points_of(light.corners);
  return light;
}

struct Results {
  std::vector<std::uint64_t> masks;
  std::vector<float> visibility;
  std::vector<vec3> irradiance;
};

Results sized(std::size_t words) {
  return {std::vector<std::uint64_t>(kReceivers * words, ~std::uint64_t{0}), std::vector<float>(kReceivers, -1.0f),
          std::vector<vec3>(kReceivers)};
}

Results solve_in_cpp(const Content& content, const Light& light, const ShadowConfig& config) {
  ShadowScene scene;
  MeshView mesh;
  mesh.positions = content.vertices;
  mesh.triangles = content.triangles;
  mesh.uvs = content.uvs;
  mesh.alpha_map = scene.add_alpha_map({content.alpha.data(), 8, 8});
  scene.add_mesh(mesh);
  scene.extend(light);
  scene.commit();
  const ShadowSolver solver(config);
  Workspace workspace;
  Results results = sized(solver.mask_words(light));
  ReceiverView receivers;
  receivers.positions = content.receivers;
  receivers.normals = content.normals;
  receivers.meshes = content.meshes;
  receivers.triangles = content.own;
  solver.solve(scene, receivers, light, workspace,
               {.masks = results.masks, .visibility = results.visibility, .irradiance = results.irradiance});
  return results;
}

Results solve_in_c(const Content& content, const halfshade_light& light, const halfshade_solver_desc& config) {
  halfshade_context* context = nullptr;
  REQUIRE(halfshade_context_create(nullptr, &context) == HALFSHADE_OK);
  const auto ok = [&](halfshade_status status) {
    INFO(halfshade_last_error(context));
    REQUIRE(status == HALFSHADE_OK);
  };
  halfshade_scene* scene = nullptr;
  halfshade_solver* solver = nullptr;
  halfshade_workspace* workspace = nullptr;
  ok(halfshade_scene_create(context, nullptr, &scene));
  halfshade_alpha_desc alpha = {};
  alpha.struct_size = sizeof alpha;
  alpha.data = content.alpha.data();
  alpha.width = alpha.height = 8;
  halfshade_mesh_desc mesh = {};
  mesh.struct_size = sizeof mesh;
  mesh.positions = points_of(content.vertices);
  mesh.triangles = {content.triangles[0].data(), content.triangles.size(), 0};
  for (int k = 0; k < 3; ++k) mesh.transform[k][k] = 1.0;
  mesh.uvs = {&content.uvs[0].x, content.uvs.size(), 0};
  mesh.alpha_cutoff = 0.5f;
  ok(halfshade_scene_add_alpha_map(context, scene, &alpha, &mesh.alpha_map));
  ok(halfshade_scene_add_mesh(context, scene, &mesh, nullptr));
  ok(halfshade_scene_extend_light(context, scene, &light));
  ok(halfshade_scene_commit(context, scene));
  ok(halfshade_solver_create(context, &config, &solver));
  ok(halfshade_workspace_create(context, nullptr, &workspace));
  std::size_t words = 0;
  ok(halfshade_solver_mask_words(context, solver, &light, 1, &words));
  Results results = sized(words);
  halfshade_receivers receivers = {};
  receivers.struct_size = sizeof receivers;
  receivers.positions = points_of(content.receivers);
  receivers.normals = points_of(content.normals);
  receivers.meshes = {content.meshes.data(), kReceivers, 0};
  receivers.triangles = {content.own.data(), kReceivers, 0};
  receivers.lift = HALFSHADE_DEFAULT_LIFT;
  receivers.frame = HALFSHADE_NONE;
  halfshade_output output = {};
  output.struct_size = sizeof output;
  output.masks = results.masks.data();
  output.mask_count = results.masks.size();
  output.visibility = results.visibility.data();
  output.visibility_count = kReceivers;
  output.irradiance = &results.irradiance[0].x;
  output.irradiance_count = 3 * kReceivers;
  ok(halfshade_solve(context, solver, scene, workspace, &receivers, &light, 1, &output));
  halfshade_workspace_destroy(&workspace);
  halfshade_solver_destroy(&solver);
  halfshade_scene_destroy(&scene);
  halfshade_context_destroy(&context);
  return results;
}

TEST_CASE("C and C++ give the same masks, visibility and irradiance") {
  for (const LightShape shape : {LightShape::kPoint, LightShape::kRectangle, LightShape::kDisk, LightShape::kSphere,
                                 LightShape::kSamples, LightShape::kEllipsoid, LightShape::kPolygon}) {
    CAPTURE(static_cast<int>(shape));
    const std::uint32_t seed = 7 + static_cast<std::uint32_t>(shape);
    const Content content = make_content(seed);
    const TwoLights light = make_light(shape);
    const Results expected =
        solve_in_cpp(content, light.cpp, {.light_sample_count = 100, .sample_sets = 4, .seed = seed});
    halfshade_solver_desc config = {};
    config.struct_size = sizeof config;
    config.light_sample_count = 100;
    config.sample_sets = 4;
    config.seed = seed;
    const Results got = solve_in_c(content, light.c, config);
    CHECK(got.masks == expected.masks);
    CHECK(got.visibility == expected.visibility);
    CHECK(got.irradiance == expected.irradiance);
    // Not equal for want of content: some samples are hidden, some are not.
    const auto [darkest, brightest] = std::minmax_element(got.visibility.begin(), got.visibility.end());
    CHECK(*brightest - *darkest > 0.2f);
  }
}

TEST_CASE("methods and their options go through C by name") {
  const Content content = make_content(3);
  const TwoLights light = make_light(LightShape::kRectangle);
  const Results expected = solve_in_cpp(content, light.cpp, {});
  halfshade_solver_desc config = {};
  config.struct_size = sizeof config;
  config.light_sample_count = 256;
  config.sample_sets = 1;
  for (const char* method : {"exact", "afsm", "hpc", "gears", "stsv", "oracle"}) {
    CAPTURE(method);
    config.method = method;
    config.options = " hpc.leaf=4  gears.grid=32 ";
    CHECK(solve_in_c(content, light.c, config).masks == expected.masks);
  }
}

}  // namespace
