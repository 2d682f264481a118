// The solver: results in the caller's memory, receivers, several lights, lighting, errors.
#include <doctest/doctest.h>

#include <numeric>

#include "support/embed_scene.h"

using namespace halfshade;
using namespace halfshade::test;

namespace {

std::string message_of(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "nothing was thrown";
}

Light morning_sun() {
  Light sun;
  sun.shape = LightShape::kSun, sun.normal = {0.6, -1.0, 0.2};
  return place_sun(sun, {-3, 0, -3}, {3, 2, 3});
}

std::vector<Light> three_lights() {
  Light disk = frame_light();
  disk.shape = LightShape::kDisk, disk.center = {1.0, 3.5, 0.5}, disk.normal = {0.1, -1.0, 0.0}, disk.radius = 0.7;
  Light point;
  point.shape = LightShape::kPoint, point.center = {-1.0, 3.0, 0.0};
  return {frame_light(), disk, point};
}

}  // namespace

TEST_CASE("several lights in one call equal one call each; masks have the words of the largest") {
  const EmbedScene s;
  const Ground ground(14);
  const std::vector<Light> lights = three_lights();
  const ShadowSolver solver({.light_sample_count = 100, .sample_sets = 3});
  CHECK(solver.sample_count(lights[0]) == 100);
  CHECK(solver.sample_count(lights[2]) == 1);
  CHECK(solver.mask_words(lights) == 2);
  const std::size_t n = ground.positions.size();
  for (const std::uint32_t kept : {1u, 2u, 3u}) {
    Workspace workspace({.kept_lights = kept});
    for (int call = 0; call < 2; ++call) {
      const Solved all = solve(solver, s.scene, ground.view(), lights, workspace);
      std::vector<vec3> total(n, vec3(0.0f));
      for (std::size_t k = 0; k < lights.size(); ++k) {
        const Solved one = solve(solver, s.scene, ground.view(), lights[k]);
        const std::size_t words = solver.mask_words(lights[k]);
        std::uint64_t wrong = 0;
        for (std::size_t i = 0; i < n; ++i) {
          for (std::size_t w = 0; w < 2; ++w) {
            const std::uint64_t expected = w < words ? one.masks[i * words + w] : 0;
            wrong += all.masks[(k * n + i) * 2 + w] != expected;
          }
          wrong += all.visibility[k * n + i] != one.visibility[i];
          wrong += all.irradiance[k * n + i] != one.irradiance[i];
          total[i] += one.irradiance[i];
        }
        CHECK(wrong == 0);
        CHECK(blocked_bits(one.masks) > 0);
      }
      CHECK(all.total == total);
      // Of three lights in two places the second one has a place of its own.
      const std::uint64_t with_own_place = kept == 3 ? 3 : (kept == 2 ? 1 : 0);
      CHECK(workspace.stats().lights_kept == (call == 1 ? with_own_place : 0));
      CHECK(workspace.stats().lights_made == (call == 1 ? 3 - with_own_place : 3));
    }
  }
}

TEST_CASE("without normals, the masks are those of solve_shadows on the same frame") {
  // A box that makes solve_shadows choose the scene's own frame: a cube of half-width 4 around the origin.
  std::vector<Triangle> triangles = box({-0.5, 1, -0.5}, {0.5, 2, 0.5});
  triangles.push_back({dvec3(-4), dvec3(-4), dvec3(-4)});
  triangles.push_back({dvec3(4), dvec3(4), dvec3(4)});
  const Scene scene = scene_of(triangles);
  ShadowScene embedded;
  const std::vector<dvec3> reach = {dvec3(-2), dvec3(2)};
  OwnedMesh mesh = mesh_of(box({-0.5, 1, -0.5}, {0.5, 2, 0.5}));
  embedded.extend(PointView(reach));
  embedded.add_mesh(mesh.view());
  embedded.commit();
  REQUIRE(embedded.reach() == std::array{dvec3(-4), dvec3(4)});
  const Ground ground(16);
  const ShadowConfig config{.light_sample_count = 200, .sample_sets = 5};
  VisibilityMasks masks;
  solve_shadows(scene, receivers_at(ground.positions), frame_light(), config, masks);
  ReceiverView view = ground.view();
  view.normals = {};
  const Solved solved = solve(ShadowSolver(config), embedded, view, frame_light());
  REQUIRE(blocked_bits(solved.masks) > 1000);
  CHECK(solved.masks == masks.words);
}

TEST_CASE("parts of the receivers get the bits of the whole") {
  const EmbedScene s;
  const Ground ground(15);
  const ShadowSolver solver({.light_sample_count = 64, .sample_sets = 7});
  const Light light = frame_light();
  const Solved whole = solve(solver, s.scene, ground.view(), light);
  Workspace workspace;
  std::vector<std::uint64_t> parts;
  for (std::size_t first = 0; first < 225; first += 45) {
    ReceiverView part{.positions = {&ground.positions[first].x, 45}, .normals = {&ground.normals[first].x, 45}};
    part.first = static_cast<std::uint32_t>(first);
    const Solved solved = solve(solver, s.scene, part, {&light, 1}, workspace);
    parts.insert(parts.end(), solved.masks.begin(), solved.masks.end());
  }
  CHECK(parts == whole.masks);
}

TEST_CASE("the own triangle does not block, and receivers that face away are dark") {
  ShadowScene scene;
  scene.extend(frame_light());
  OwnedMesh floor = mesh_of(quad({-3, 0, -3}, {-3, 0, 3}, {3, 0, 3}, {3, 0, -3}));
  const std::uint32_t id = scene.add_mesh(floor.view());
  scene.commit();
  const dvec3 below(0.5, -0.001, 0.7), up(0, 1, 0), down(0, -1, 0);
  const ShadowSolver solver({.light_sample_count = 16});
  const auto visibility = [&](const dvec3& normal, std::uint32_t mesh, std::uint32_t triangle) {
    return solve(solver, scene, {{&below.x, 1}, {&normal.x, 1}, {&mesh, 1}, {&triangle, 1}}, frame_light())
        .visibility[0];
  };
  CHECK(visibility(up, kNone, kNone) == 0.0f);
  const float one = visibility(up, id, 0), other = visibility(up, id, 1);
  CHECK(one + other == 1.0f);  // the point lies under one of the two
  CHECK(visibility(down, id, one == 1.0f ? 0 : 1) == 0.0f);
  CHECK(message_of([&] { visibility(up, id, 2); }) == "receiver 0: there is no triangle 2 of a mesh 0");
  CHECK(message_of([&] { visibility(dvec3(0.0), id, 0); }) == "receiver 0: the normal is zero or not finite");
}

TEST_CASE("irradiance is the integral over the light") {
  ShadowScene scene;
  scene.extend(PointView(std::vector<dvec3>{dvec3(-8), dvec3(8)}));
  scene.commit();
  const dvec3 origin(0.0), up(0, 1, 0);
  const ReceiverView receiver{.positions = {&origin.x, 1}, .normals = {&up.x, 1}};
  const ShadowSolver solver({.light_sample_count = 4096});
  const auto irradiance = [&](const Light& light) { return solve(solver, scene, receiver, light).irradiance[0]; };
  constexpr double kPi = 3.14159265358979;

  // Disk of radius a at height h, parallel: pi L a^2 / (a^2 + h^2).
  Light disk;
  disk.shape = LightShape::kDisk, disk.center = {0, 2, 0}, disk.normal = {0, -1, 0}, disk.radius = 1.5;
  disk.emission = {1.0f, 2.0f, 0.0f};
  const double expected = kPi * 2.25 / (2.25 + 4.0);
  CHECK(irradiance(disk).x == doctest::Approx(expected).epsilon(1e-3));
  CHECK(irradiance(disk).y == doctest::Approx(2.0 * expected).epsilon(1e-3));
  CHECK(irradiance(disk).z == 0.0f);

  // A sphere and the ellipsoid that is one: pi L (r / d)^2 towards the centre.
  Light sphere;
  sphere.shape = LightShape::kSphere, sphere.center = {0, 3, 0}, sphere.radius = 1.0;
  CHECK(irradiance(sphere).x == doctest::Approx(kPi / 9.0).epsilon(5e-3));
  sphere.shape = LightShape::kEllipsoid;
  CHECK(irradiance(sphere).x == doctest::Approx(kPi / 9.0).epsilon(5e-3));
  // Stretched along the view, an ellipsoid looks like the cone's cross-section: sin of the half angle = b / sqrt(..).
  sphere.axes = {dvec3(1, 0, 0), dvec3(0, 2, 0), dvec3(0, 0, -1)};
  const double sine2 = 1.0 / (1.0 + 9.0 - 4.0);  // tangent cone from (0, 0, 0): tan^2 = b^2 / (d^2 - a^2)
  CHECK(irradiance(sphere).x == doctest::Approx(kPi * sine2).epsilon(5e-3));

  // A rectangle and the polygon with its corners; a point.
  Light rectangle = frame_light();
  Light polygon;
  polygon.shape = LightShape::kPolygon, polygon.points = {{-1, 4, -1}, {1, 4, -1}, {1, 4, 1}, {-1, 4, 1}};
  CHECK(irradiance(rectangle).x == doctest::Approx(irradiance(polygon).x).epsilon(1e-3));
  rectangle.emission_image = {"one", 1, 1, {vec3(2.0f, 1.0f, 0.5f)}};
  CHECK(irradiance(rectangle).x == doctest::Approx(2.0 * irradiance(polygon).x).epsilon(1e-3));
  CHECK(irradiance(rectangle).z == doctest::Approx(0.5 * irradiance(polygon).x).epsilon(1e-3));
  Light point;
  point.shape = LightShape::kPoint, point.center = {3, 4, 0}, point.emission = vec3(25.0f);
  CHECK(irradiance(point).x == doctest::Approx(0.8));
}

TEST_CASE("a G-buffer of the scene asks for the same receivers as the caller could, under a far sun as well") {
  for (const Light& light : {frame_light(), morning_sun()}) {
    EmbedScene s;
    s.scene.extend(light);
    s.scene.commit();
    GBuffer gbuffer;
    RasterConfig raster;
    raster.width = 40, raster.height = 30;
    rasterize(s.scene, {.eye = {0, 3, 6}, .target = {0, 0.5, 0}, .fov_y_deg = 60.0}, raster, gbuffer);
    const ShadowSolver solver({.light_sample_count = 64, .sample_sets = 4});
    Workspace workspace;
    std::vector<std::uint64_t> masks(gbuffer.size());
    std::vector<float> visibility(gbuffer.size());
    solver.solve(s.scene, gbuffer, {&light, 1}, workspace, {.masks = masks, .visibility = visibility});

    std::vector<dvec3> positions;
    std::vector<vec3> normals;
    std::vector<std::uint32_t> meshes, triangles, entries;
    for (std::uint32_t i = 0; i < gbuffer.size(); ++i) {
      if (gbuffer.triangle[i] == kNone) {
        CHECK(masks[i] == ~std::uint64_t{0});
        CHECK(visibility[i] == 0.0f);
        continue;
      }
      entries.push_back(i);
      positions.push_back(s.scene.to_world(gbuffer.position[i]));
      normals.push_back(gbuffer.geometric_normal[i]);
      const MeshTriangle own = s.scene.triangle_of(gbuffer.triangle[i]);
      meshes.push_back(own.mesh), triangles.push_back(own.triangle);
    }
    REQUIRE(entries.size() > 300);
    REQUIRE(entries.size() < gbuffer.size());
    std::uint64_t wrong = 0;
    for (std::size_t k = 0; k < entries.size(); ++k) {
      ReceiverView one{{&positions[k].x, 1}, {&normals[k].x, 1}, {&meshes[k], 1}, {&triangles[k], 1}};
      one.first = entries[k];
      wrong += solve(solver, s.scene, one, {&light, 1}, workspace).masks[0] != masks[entries[k]];
    }
    CHECK(wrong == 0);
    CHECK(blocked_bits(masks) > 64 * (gbuffer.size() - entries.size()));
  }
}

TEST_CASE("a G-buffer is refused unless it shows the scene as it is") {
  EmbedScene s(6);
  GBuffer gbuffer;
  RasterConfig raster;
  raster.width = 24, raster.height = 16;
  const auto draw = [&](const ShadowScene& scene) { rasterize(scene, {.eye = {0, 3, 6}}, raster, gbuffer); };
  draw(s.scene);
  const ShadowSolver solver({.light_sample_count = 16});
  Workspace workspace;
  Light light = frame_light();
  std::vector<float> visibility(gbuffer.size());
  const std::string is_fine = "nothing was thrown";
  const auto solve_in = [&](const ShadowScene& scene, const GBuffer& from) {
    std::fill(visibility.begin(), visibility.end(), -1.0f);
    const std::string message = message_of([&] {
      solver.solve(scene, from, {&light, 1}, workspace, {.visibility = visibility});
    });
    CHECK((message == is_fine) == (*std::min_element(visibility.begin(), visibility.end()) >= 0.0f));
    return message;
  };
  const std::string is_older = "receivers: the G-buffer is older than a commit that changed meshes or frame";
  const std::string is_foreign = "receivers: the G-buffer shows another scene";

  CHECK(solve_in(s.scene, gbuffer) == is_fine);
  light.center.x += 0.5, light.u *= 0.5;
  s.scene.extend(light);  // within reach: nothing moves
  s.scene.commit();
  CHECK(solve_in(s.scene, gbuffer) == is_fine);

  const std::function<void()> changes[] = {
      [&] {
        s.scene.set_transform(s.ids[1], moved_by({0.6, 1.0, 0.2}));
      },
      [&] { s.scene.set_positions(s.ids[2], s.meshes[2].positions); },
      [&] { s.scene.remove_mesh(s.ids[3]); },
      [&] { s.scene.add_mesh(s.meshes[3].view()); },
      [&] {
        const dvec3 far(1e4, 0.0, 0.0);
        s.scene.extend(PointView(&far.x, 1));
      },
  };
  for (const auto& change : changes) {
    change();
    s.scene.commit();
    CHECK(solve_in(s.scene, gbuffer) == is_older);
    draw(s.scene);
    CHECK(solve_in(s.scene, gbuffer) == is_fine);
  }

  // A commit that was stopped in the middle has changed something.
  const GBuffer before = gbuffer;
  s.scene.set_transform(s.ids[1], moved_by({0.5, 1.0, 0.2}));
  s.scene.set_transform(s.ids[2], moved_by({-0.5, 1.0, 0.2}));
  CHECK_THROWS_AS(s.scene.commit({.executor = Executor::kSerial, .progress = [](double d) { return d < 0.25; }}),
                  Error);
  s.scene.set_transform(s.ids[1], moved_by({0.6, 1.0, 0.2}));
  s.scene.commit();
  CHECK(solve_in(s.scene, before) == is_older);
  draw(s.scene);

  // Another scene with the same content; the same scene in another place.
  EmbedScene twin(6);
  CHECK(solve_in(twin.scene, gbuffer) == is_foreign);
  CHECK(solve_in(ShadowScene(std::move(s.scene)), gbuffer) == is_fine);  // which ends the scene
  CHECK(solve_in(twin.scene, gbuffer) == is_foreign);

  // Who fills one by hand, or from a file, answers for it.
  GBuffer by_hand = gbuffer;
  by_hand.drawn = {};
  draw(twin.scene);
  by_hand.triangle = gbuffer.triangle, by_hand.position = gbuffer.position, by_hand.reach = gbuffer.reach;
  by_hand.geometric_normal = gbuffer.geometric_normal;
  CHECK(solve_in(twin.scene, by_hand) == is_fine);
  const std::vector<float> expected = visibility;
  CHECK(solve_in(twin.scene, gbuffer) == is_fine);
  CHECK(visibility == expected);
  const auto shown =
      std::find_if(by_hand.triangle.begin(), by_hand.triangle.end(), [](std::uint32_t t) { return t != kNone; });
  const std::size_t at = static_cast<std::size_t>(shown - by_hand.triangle.begin());
  const std::string receiver = "receiver " + std::to_string(at) + ": ";
  for (const double wrong : {2.0, -1e300, std::nan(""), HUGE_VAL}) {
    GBuffer spoilt = by_hand;
    spoilt.position[at].y = wrong;
    CHECK(solve_in(twin.scene, spoilt) == receiver + "the G-buffer's position is not in the local frame, -1..1");
    spoilt = by_hand;
    spoilt.reach = wrong;
    CHECK(solve_in(twin.scene, spoilt) == "receivers: the G-buffer's reach is not in 0..1");
  }
  by_hand.geometric_normal[at].z = std::nanf("");
  CHECK(solve_in(twin.scene, by_hand) == receiver + "the G-buffer's normal is not finite");
  *shown = 1000000;
  CHECK(solve_in(twin.scene, by_hand) == receiver + "the G-buffer belongs to another scene: there is no such triangle");
}

TEST_CASE("under a far sun, surfaces do not shadow themselves and what is close above them does") {
  // A ball of 3,200 triangles that stands on the ground, and a plate a hundredth of its radius above the ground.
  std::vector<OwnedMesh> meshes;
  meshes.push_back(mesh_of(quad({-3, 0, -3}, {-3, 0, 3}, {3, 0, 3}, {3, 0, -3})));
  meshes.push_back(ball({-0.8, 0.5, 0.3}, 0.5, 40));
  meshes.push_back(mesh_of(quad({1, 0.005, -1}, {1, 0.005, 1}, {2, 0.005, 1}, {2, 0.005, -1})));
  const OwnedMesh round = meshes[1];
  EmbedScene s(std::move(meshes));
  const Light light = morning_sun();
  s.scene.extend(light);
  s.scene.commit();

  const dvec3 to_sun = -glm::normalize(light.normal);
  std::vector<dvec3> positions, normals;
  std::vector<std::uint32_t> own_meshes, own;
  const auto add = [&](const dvec3& p, const dvec3& n, std::uint32_t mesh, std::uint32_t triangle) {
    positions.push_back(p), normals.push_back(n), own_meshes.push_back(mesh), own.push_back(triangle);
  };
  for (std::uint32_t t = 0; t < round.triangles.size(); ++t) {
    std::array<dvec3, 3> corner;
    for (int k = 0; k < 3; ++k) corner[k] = round.positions[round.triangles[t][k]];
    const dvec3 n = glm::cross(corner[1] - corner[0], corner[2] - corner[0]);
    if (!(glm::dot(n, to_sun) > 0.05 * glm::length(n))) continue;  // at the poles there are triangles without area
    for (const dvec3& c : corner) add(c * 0.98 + (corner[0] + corner[1] + corner[2]) * (0.02 / 3.0), n, s.ids[1], t);
  }
  const std::size_t lit = positions.size();
  for (int i = 0; i < 20; ++i) add({1.2 + 0.03 * i, 0.0, 0.07 * i - 0.7}, dvec3(0, 1, 0), s.ids[0], i % 2);
  const ReceiverView receivers{positions, normals, own_meshes, own};
  const Solved solved = solve(ShadowSolver({.light_sample_count = 64}), s.scene, receivers, light);
  const ShadowSolver oracle({.method = ShadowMethod::kOracle, .light_sample_count = 64});
  CHECK(different_bits(solved.masks, solve(oracle, s.scene, receivers, light).masks) == 0);
  REQUIRE(lit > 4000);
  for (std::size_t i = 0; i < positions.size(); ++i) {
    CAPTURE(i);
    REQUIRE(solved.visibility[i] == (i < lit ? 1.0f : 0.0f));
  }
}

TEST_CASE("every method runs, exact ones with equal bits") {
  const EmbedScene s(6);
  const Ground ground(8);
  ReceiverView receivers = ground.view();
  const Light light = frame_light();
  const Solved truth =
      solve(ShadowSolver({.method = ShadowMethod::kOracle, .light_sample_count = 32}), s.scene, receivers, light);
  for (const MethodTraits& method : shadow_methods()) {
    CAPTURE(method.name);
    if (method.method == ShadowMethod::kRaytrace) continue;
    const ShadowSolver solver({.method = method.method, .light_sample_count = 32});
    Workspace workspace;
    std::vector<float> visibility(ground.positions.size(), -1.0f);
    solver.solve(s.scene, receivers, light, workspace, {.visibility = visibility});
    float worst = 0.0f, sum = 0.0f;
    for (std::size_t i = 0; i < visibility.size(); ++i) {
      worst = std::max(worst, std::fabs(visibility[i] - truth.visibility[i]));
      sum += visibility[i];
    }
    if (method.exact) CHECK(worst == 0.0f);
    CHECK(sum > 20.0f);
    if (method.masks) continue;
    std::vector<std::uint64_t> masks(visibility.size());
    CHECK_THROWS_AS(solver.solve(s.scene, receivers, light, workspace, {.masks = masks}), Error);
  }
}

TEST_CASE("wrong calls are refused by name and write nothing") {
  EmbedScene s(6);
  Ground ground(4);
  const ShadowSolver solver({.light_sample_count = 64});
  Workspace workspace;
  std::vector<float> visibility(16, -1.0f);
  std::vector<std::uint64_t> masks(16, 7);
  std::vector<Light> lights = {frame_light()};
  const auto call = [&](const ReceiverView& receivers, const ShadowOutput& output) {
    return message_of([&] { solver.solve(s.scene, receivers, lights, workspace, output); });
  };
  const ShadowOutput out{.masks = masks, .visibility = visibility};
  CHECK(call(ground.view(), {.masks = std::span(masks).first(15)}) == "output: 15 entries for masks, 16 are needed");
  std::vector<vec3> irradiance(16);
  CHECK(call({.positions = ground.positions}, {.irradiance = irradiance}) ==
        "output: irradiance needs receivers with normals");
  ground.positions[5].z = std::nan("");
  CHECK(call(ground.view(), out) == "receiver 5: the position is not finite");
  ground.positions[5].z = 1e6;
  CHECK(call(ground.view(), out).find("receiver 5: the position") == 0);
  ground.positions[5].z = 0.0;
  CHECK(call({.positions = ground.positions, .normals = {&ground.normals[0].x, 3}}, out) ==
        "receivers: 3 normals for 16 positions");
  lights[0].center.y = 1e6;
  CHECK(call(ground.view(), out) == "light 0 'light' is outside the scene's reach; ShadowScene::extend widens it");
  lights[0].center.y = HUGE_VAL;
  CHECK(call(ground.view(), out) == "light 'light': a coordinate is not finite");
  lights[0] = frame_light();
  const float inf = std::numeric_limits<float>::infinity();
  for (const bool kept : {false, true}) {  // the samples of the light, which do not depend on what it emits
    CAPTURE(kept);
    const ShadowOutput lit{.visibility = visibility, .irradiance = irradiance};
    for (const vec3& wrong : {vec3(std::nanf(""), 1, 1), vec3(1, -1, 1), vec3(1, 1, inf)}) {
      lights[0].emission = wrong;
      CHECK(call(ground.view(), out) == "light 0 'light': the emission is negative or not finite");
      lights[0].emission = vec3(1.0f);
      lights[0].emission_image = {"image", 2, 1, {vec3(1.0f), wrong}};
      CHECK(call(ground.view(), lit) == "light 0 'light': texel 1 of the image is negative or not finite");
      lights[0].emission_image = {};
    }
    for (const auto& [width, height] : {std::pair{4000u, 4000u}, {0u, 1u}, {1u, 0u}, {~0u, ~0u}}) {
      lights[0].emission_image = {"image", width, height, {vec3(1.0f)}};
      const std::string what = "the image has 1 texels for " + std::to_string(width) + " x " + std::to_string(height);
      CHECK(call(ground.view(), out) == "light 0 'light': " + what);
      CHECK(call(ground.view(), lit) == "light 0 'light': " + what);
    }
    lights[0] = frame_light();
    CHECK(irradiance == std::vector<vec3>(16, vec3(0.0f)));
    CHECK(visibility == std::vector<float>(16, -1.0f));
    CHECK(call(ground.view(), {}) == "nothing was thrown");
  }
  CHECK(workspace.stats().lights_kept == 1);
  s.scene.set_transform(s.ids[1], moved_by({0, 1, 0}));
  CHECK(call(ground.view(), out) == "the scene has changes that are not committed");
  CHECK(visibility == std::vector<float>(16, -1.0f));
  CHECK(masks == std::vector<std::uint64_t>(16, 7));
  s.scene.commit();
  CHECK(call(ground.view(), out) == "nothing was thrown");
  Light samples;
  samples.shape = LightShape::kSamples;
  const auto counted = [&] { static_cast<void>(solver.sample_count(samples)); };
  CHECK(message_of(counted) == "light 'light': there are no sample points");
  CHECK(message_of([&] { static_cast<void>(solver.mask_words(samples)); }) == message_of(counted));
  CHECK(message_of([&] { solver.solve(s.scene, ground.view(), samples, workspace, out); }) == message_of(counted));
  samples.points.assign(4097, dvec3(0, 4, 0));
  CHECK(message_of(counted) == "light 'light': 4097 sample points, 1..4096 are allowed");
  CHECK_THROWS_AS(ShadowSolver({.light_sample_count = 5000}), Error);
  CHECK_THROWS_AS(ShadowSolver({.method = ShadowMethod::kRaytrace}), Error);
  CHECK_THROWS_AS(Workspace({.kept_lights = 0}), Error);
}
