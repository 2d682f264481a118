// Frames after the first ones allocate nothing: scene updates, receivers that move, several lights.
#include <doctest/doctest.h>

#include "support/counted_new.h"
#include "support/embed_scene.h"

using namespace halfshade;
using namespace halfshade::test;

namespace {

Light hexagon() {
  Light light;
  light.shape = LightShape::kPolygon;
  for (int k = 0; k < 6; ++k) light.points.emplace_back(std::cos(k * 1.0471975512), 3.6, std::sin(k * 1.0471975512));
  return light;
}

}  // namespace

TEST_CASE("frames allocate nothing after warm-up") {
  EmbedScene s(24);
  Ground ground(48);
  Light disk = frame_light();
  disk.shape = LightShape::kDisk, disk.center = {1.0, 3.5, 0.5}, disk.normal = {0.1, -1.0, 0.0}, disk.radius = 0.7;
  Light both = frame_light();
  both.two_sided = true, both.center.y = 1.3;
  Light picture = frame_light();
  picture.emission_image = {"stripes", 2, 1, {vec3(1, 0, 0), vec3(0, 0, 2)}};
  std::vector<Light> lights = {frame_light(), disk, both, hexagon(), picture};
  const ShadowSolver solver({.light_sample_count = 100, .sample_sets = 3});
  Workspace workspace({.kept_lights = 5});
  const std::size_t all = ground.positions.size() * lights.size();
  std::vector<std::uint64_t> masks(all * solver.mask_words(lights));
  std::vector<float> visibility(all);
  std::vector<vec3> irradiance(all), total(ground.positions.size());
  std::vector<dvec3> deformed = s.meshes[2].positions;
  for (const Executor executor : {Executor::kSerial, Executor::kArena}) {
    Execution execution;
    execution.executor = executor;
    const auto frame = [&](int f) {
      s.scene.set_transform(s.ids[1], turned(0.1 * f, {0.7 - 0.05 * f, 1.0, 0.2}));
      for (std::size_t i = 0; i < deformed.size(); ++i) {
        deformed[i] = s.meshes[2].positions[i] * (1.0 + 0.02 * (f % 5));
      }
      s.scene.set_positions(s.ids[2], deformed);
      s.scene.commit(execution);
      for (std::size_t i = 0; i < ground.positions.size(); ++i) {
        ground.positions[i].y = 0.01 * static_cast<double>((i * 7 + static_cast<std::size_t>(f)) % 11);
      }
      lights[0].emission = vec3(0.1f * static_cast<float>(f));
      solver.solve(s.scene, ground.view(), lights, workspace, {masks, visibility, irradiance, total}, execution);
    };
    for (int f = 0; f < 8; ++f) frame(f);
    const std::uint64_t before = allocations_now().count;
    for (int f = 8; f < 16; ++f) frame(f);
    const std::uint64_t allocated = allocations_now().count - before;  // before doctest allocates something itself
    CAPTURE(static_cast<int>(executor));
    CHECK(allocated == 0);
    CHECK(workspace.stats().lights_kept == 5);
  }
  CHECK(blocked_bits(masks) > 1000);
}

TEST_CASE("lights that move allocate nothing after warm-up, and give the bits of lights that did not") {
  EmbedScene s(24);
  const Ground ground(48);
  Light disk = frame_light();
  disk.shape = LightShape::kDisk, disk.center = {1.0, 3.5, 0.5}, disk.normal = {0.1, -1.0, 0.0}, disk.radius = 0.7;
  Light both = frame_light();
  both.two_sided = true, both.center.y = 1.3;
  Light picture = frame_light();
  picture.emission_image = {"stripes", 2, 1, {vec3(1, 0, 0), vec3(0, 0, 2)}};
  Light ball = disk;
  ball.shape = LightShape::kSphere, ball.radius = 0.4;
  const std::vector<Light> first = {frame_light(), disk, both, picture, hexagon(), ball};
  struct Sets {
    SamplePattern pattern;
    bool rotate;
    std::uint32_t frames;  // the pattern stays for three calls, then it is that of the next of so many frames
  };
  for (const Sets& sets : {Sets{SamplePattern::kRows, false, 1}, Sets{SamplePattern::kRows, true, 1},
                           Sets{SamplePattern::kPoissonDisk, false, 1}, Sets{SamplePattern::kPoissonDisk, true, 2}}) {
    std::vector<Light> lights = first;
    if (sets.frames > 1) lights[3].emission_image = {};  // its weights are made anew with the samples
    const ShadowSolver solver(
        {.light_sample_count = 100, .pattern = sets.pattern, .sample_sets = 3, .rotate_sets = sets.rotate});
    CAPTURE(static_cast<int>(sets.pattern));
    CAPTURE(sets.frames);
    Workspace workspace({.kept_lights = 6});
    const std::size_t all = ground.positions.size() * lights.size();
    std::vector<std::uint64_t> masks(all * solver.mask_words(lights));
    std::vector<float> visibility(all);
    std::vector<vec3> irradiance(all), total(ground.positions.size());
    Execution serial;
    serial.executor = Executor::kSerial;
    const auto frame = [&](int f) {
      for (std::size_t i = 0; i < lights.size(); ++i) {
        lights[i].center = first[i].center + dvec3(0.05 * (f % 7), -0.03 * (f % 5), 0.02 * (f % 3));
        lights[i].normal = first[i].normal + dvec3(0.0, 0.0, 0.02 * (f % 4));
        lights[i].u = first[i].u + dvec3(0.0, 0.01 * (f % 2), 0.0);
        for (std::size_t k = 0; k < lights[i].points.size(); ++k) {
          lights[i].points[k] = first[i].points[k] * (1.0 - 0.01 * (f % 6)) + dvec3(0.05 * (f % 7), 0.0, 0.0);
        }
      }
      ReceiverView receivers = ground.view();
      receivers.frame = static_cast<std::uint32_t>(f) / 3 % sets.frames;
      solver.solve(s.scene, receivers, lights, workspace, {masks, visibility, irradiance, total}, serial);
    };
    for (int f = 0; f < 8; ++f) frame(f);
    const std::uint64_t before = allocations_now().count;
    for (int f = 8; f < 16; ++f) frame(f);
    const std::uint64_t allocated = allocations_now().count - before;
    CHECK(allocated == 0);
    CHECK(workspace.stats().lights_made == 6);
    Workspace fresh;
    ReceiverView receivers = ground.view();
    receivers.frame = 15 / 3 % sets.frames;
    const Solved anew = solve(solver, s.scene, receivers, lights, fresh, serial);
    CHECK(anew.masks == masks);
    CHECK(anew.irradiance == irradiance);
    CHECK(blocked_bits(masks) > 1000);
  }
}

TEST_CASE("clear gives the memory back, and so do scenes and workspaces that end") {
  const std::int64_t before = allocations_now().live;
  {
    EmbedScene s(12);
    const Ground ground(20);
    const Light light = frame_light();
    Workspace workspace;
    const ShadowSolver solver({.light_sample_count = 64});
    const Execution serial{Executor::kSerial};
    const std::vector<std::uint64_t> masks =
        solve(solver, s.scene, ground.view(), {&light, 1}, workspace, serial).masks;
    const std::int64_t full = allocations_now().live;
    CHECK(workspace.bytes() > 50000);
    workspace.clear();
    CHECK(full - allocations_now().live > 100000);
    CHECK(workspace.bytes() < 10000);
    CHECK(solve(solver, s.scene, ground.view(), {&light, 1}, workspace, serial).masks == masks);
  }
  CHECK(allocations_now().live == before);
}
