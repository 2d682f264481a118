#include <doctest/doctest.h>
#include <tbb/task_arena.h>

#include "rasterizer/core/predicate.h"
#include "rasterizer/core/radix_sort.h"
#include "shadows/gears_region.h"
#include "shadows/method_options.h"
#include "support/lit_scene.h"

using namespace halfshade;
using namespace halfshade::test;

namespace {

VisibilityMasks gears(const Scene& scene, const std::vector<Receiver>& receivers, const ShadowConfig& config,
                      ShadowStats* stats = nullptr, const Light& light = frame_light()) {
  return solve(scene, receivers, light, config, ShadowMethod::kGears, stats);
}

Light shaped_light(LightShape shape, Random& random) {
  Light light = frame_light();
  light.shape = shape;
  light.two_sided = random.uniform(0, 1) < 0.5;
  light.radius = random.uniform(0.0, 2.0);
  light.normal = {random.uniform(-0.5, 0.5), -1.0, random.uniform(-0.5, 0.5)};
  light.axes = {dvec3(0.9, 0.3, 0.0), dvec3(-0.2, 0.5, 0.4), dvec3(0.1, -0.1, 0.3)};
  if (shape == LightShape::kPolygon) light.points = {{-1, 4, -0.5}, {0.2, 4, -1.1}, {1.2, 4, -0.4}, {0.8, 4, 0.8}};
  if (shape == LightShape::kSamples) {
    for (int i = 0; i < 40; ++i) light.points.push_back(light.center + random.in_box(-1.0, 1.0));
  }
  return light;
}

constexpr std::array kShapes = {LightShape::kPoint,   LightShape::kRectangle, LightShape::kDisk,   LightShape::kSphere,
                                LightShape::kSamples, LightShape::kEllipsoid, LightShape::kPolygon};

}  // namespace

TEST_CASE("a radix sort orders by key and keeps the order of equal keys") {
  struct Item {
    std::uint32_t key, place;
  };
  std::mt19937 engine(7);
  for (const std::uint32_t end : {1u, 2u, 2049u, 5000000u}) {
    std::vector<Item> items, scratch;
    for (std::uint32_t i = 0; i < 200000; ++i) items.push_back({static_cast<std::uint32_t>(engine() % end), i});
    parallel_radix_sort(items, scratch, end, [](const Item& item) { return item.key; });
    bool sorted = true;
    for (std::size_t i = 1; i < items.size(); ++i) {
      sorted = sorted && (items[i - 1].key < items[i].key ||
                          (items[i - 1].key == items[i].key && items[i - 1].place < items[i].place));
    }
    CHECK(sorted);
    CHECK(items.size() == 200000);
  }
}

TEST_CASE("every combination of GEARS' options gives the oracle's masks") {
  Random random(61);
  const Scene scene = scene_of(joined(random_triangles(random, 80, 1.0), random_triangles(random, 40, 0.2)));
  std::vector<dvec3> points = random_points(random, 300, -6.0, 3.9);
  const std::vector<dvec3> crowd = random_points(random, 300, 0.5, 0.6);  // a hot cell
  points.insert(points.end(), crowd.begin(), crowd.end());
  const std::vector<Receiver> receivers = receivers_at(points);
  ShadowConfig config = frame_config(36);
  const VisibilityMasks truth = solve(scene, receivers, frame_light(), config, ShadowMethod::kOracle);
  const std::array grids = {0u, 8u, 50u, 256u};
  const std::array budgets = {1u, 100u, 1u << 22};
  for (unsigned bits = 0; bits < 64; ++bits) {
    config.gears.region = bits & 1 ? GearsRegion::kHull : GearsRegion::kBox;
    config.gears.refine = bits & 2;
    config.gears.subdivide = bits & 4;
    config.gears.bounds = bits & 8;
    config.gears.coarse = bits & 16;
    config.back_face_casters = bits & 32;
    config.gears.grid = grids[bits % 4];
    config.gears.pair_budget = budgets[bits % 3];
    config.gears.study = bits % 5 == 0;
    config.gears.camera = (bits % 7) * 0.5;
    CAPTURE(bits);
    CHECK(wrong_bits(truth, gears(scene, receivers, config)) == 0);
  }
}

TEST_CASE("GEARS equals the oracle for every light shape, hull and frustum included") {
  for (const LightShape shape : kShapes) {
    for (std::uint64_t seed = 1; seed <= 4; ++seed) {
      CAPTURE(static_cast<int>(shape));
      CAPTURE(seed);
      Random random(seed + 70);
      const Light light = shaped_light(shape, random);
      const Scene scene = scene_of(random_triangles(random, 120, seed % 2 == 0 ? 3.0 : 0.7));
      const std::vector<Receiver> receivers = receivers_at(random_points(random, 400, -6.0, 6.0));
      ShadowConfig config = frame_config(30);
      config.gears.region = seed % 2 == 0 ? GearsRegion::kHull : GearsRegion::kBox;
      config.gears.refine = seed >= 3;
      const VisibilityMasks truth = solve(scene, receivers, light, config, ShadowMethod::kOracle);
      CHECK(wrong_bits(truth, gears(scene, receivers, config, nullptr, light)) == 0);
    }
  }
}

TEST_CASE("S31 for GEARS: box, hull and frustum hold every receiver that the triangle hides") {
  Random random(31);
  std::uint64_t hidden = 0;
  for (int round = 0; round < 150; ++round) {
    const Light light = shaped_light(kShapes[static_cast<std::size_t>(round) % kShapes.size()], random);
    const std::vector<Triangle> triangles = random_triangles(random, 20, round % 3 == 0 ? 3.0 : 1.0);
    const Scene scene = scene_of(triangles);
    const LatticeMesh mesh = make_lattice_mesh(scene, make_local_frame(scene.positions, light_extent(light)));
    const LightSamples samples = make_light_samples(light, frame_config(9), mesh.frame);
    ReceiverArray receivers;
    for (int i = 0; i < 60; ++i) {
      const vec3 p = mesh.frame.to_lattice(random.in_box(-4.0, 4.0));
      if (samples.one_sided && glm::dot(dvec3(p) - samples.center, samples.axis_n) <= 0.0) continue;
      receivers.push_back(p, vec3(0.0f), kNone, static_cast<std::uint32_t>(i), 0);
    }
    GearsOptions options;
    options.camera = round % 4 * 0.5;
    for (LightViewCells& cells : make_light_views(make_light_bound(light, samples), samples, receivers, 16)) {
      const GearsGrid grid = make_gears_grid(std::move(cells), receivers, options);
      const GearsProjector projector(grid);
      GearsBlocker blocker;
      for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
        const auto [a, b, c] = mesh.corners(t);
        projector.project({grid.view.to_view(dvec3(a)), grid.view.to_view(dvec3(b)), grid.view.to_view(dvec3(c))}, true,
                          blocker);
        std::vector<bool> listed(grid.on_grid, blocker.kind == InfluenceRegion::Kind::kEverywhere);
        if (blocker.kind == InfluenceRegion::Kind::kRows) {
          visit_nodes(grid, blocker, false, [&](std::uint32_t node) {
            for (std::uint32_t i = grid.nodes[node].begin; i < grid.nodes[node].end; ++i) {
              CHECK(!listed[i]);
              listed[i] = true;
            }
          });
        }
        for (std::uint32_t i = 0; i < grid.on_grid; ++i) {
          const vec3 r = receivers.position[grid.order[i]];
          bool hides = false;
          for (const vec3& l : samples.set(0)) hides = hides || blocks(a, b, c, r, l);
          if (!hides) continue;
          ++hidden;
          CAPTURE(round);
          CAPTURE(static_cast<int>(blocker.kind));
          REQUIRE(listed[i]);
          if (blocker.kind == InfluenceRegion::Kind::kRows) REQUIRE(projector.in_frustum(blocker, grid.position[i]));
        }
      }
    }
  }
  CHECK(hidden > 1000);
}

TEST_CASE("nodes that are covered stand for the same receivers as their cells") {
  Random random(9);
  const Scene scene = scene_of(random_triangles(random, 60, 2.0));
  const LatticeMesh mesh = make_lattice_mesh(scene, make_local_frame(scene.positions, light_extent(frame_light())));
  const LightSamples samples = make_light_samples(frame_light(), frame_config(4), mesh.frame);
  ReceiverArray receivers;
  for (std::uint32_t i = 0; i < 4000; ++i) {
    const dvec3 p = i < 2000 ? random.in_box(-4, 0) : dvec3(1, -2, 1) + 0.01 * random.in_box(-1, 1);
    receivers.push_back(mesh.frame.to_lattice(p), vec3(0.0f), kNone, i, 0);
  }
  auto views = make_light_views(make_light_bound(frame_light(), samples), samples, receivers, 16);
  REQUIRE(views.size() == 1);
  const GearsGrid grid = make_gears_grid(std::move(views[0]), receivers, {});
  CHECK(grid.subdivided > 0);
  CHECK(grid.order.size() == 4000);
  const GearsProjector projector(grid);
  GearsBlocker blocker;
  std::size_t nodes = 0, cells = 0;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto [a, b, c] = mesh.corners(t);
    projector.project({grid.view.to_view(dvec3(a)), grid.view.to_view(dvec3(b)), grid.view.to_view(dvec3(c))}, false,
                      blocker);
    if (blocker.kind != InfluenceRegion::Kind::kRows) continue;
    std::vector<std::uint8_t> by_node(grid.on_grid, 0), by_cell(grid.on_grid, 0);
    const auto note = [&](std::vector<std::uint8_t>& listed, std::size_t& count) {
      return [&](std::uint32_t n) {
        ++count;
        for (std::uint32_t i = grid.nodes[n].begin; i < grid.nodes[n].end; ++i) ++listed[i];
      };
    };
    visit_nodes(grid, blocker, true, note(by_node, nodes));
    visit_nodes(grid, blocker, false, note(by_cell, cells));
    for (std::uint32_t i = 0; i < grid.on_grid; ++i) {
      CHECK(by_node[i] <= 1);
      CHECK(by_node[i] >= by_cell[i]);
    }
  }
  CHECK(nodes < cells);
}

TEST_CASE("S16 for GEARS: as the light shrinks to a point, masks become the hard shadow's, camera C = light included") {
  Random random(16);
  const Scene scene = scene_of(random_triangles(random, 100, 0.8, -3.0, 3.5));
  const std::vector<Receiver> receivers = receivers_at(random_points(random, 400, -6.0, 3.0));
  Light point = frame_light();
  point.shape = LightShape::kPoint;
  ShadowConfig config = frame_config(16);
  const VisibilityMasks hard = solve(scene, receivers, point, config, ShadowMethod::kOracle);
  std::uint64_t last = ~std::uint64_t{0};
  for (const double camera : {0.0, 0.25, 4.0}) {
    config.gears.camera = camera;
    CHECK(wrong_bits(hard, gears(scene, receivers, config, nullptr, point)) == 0);
    last = ~std::uint64_t{0};
    for (const double side : {1.0, 0x1p-4, 0x1p-8, 0x1p-30, 0.0}) {
      Light light = frame_light();
      light.u *= side, light.v *= side;
      const VisibilityMasks masks = gears(scene, receivers, config, nullptr, light);
      CHECK(wrong_bits(masks, solve(scene, receivers, light, config, ShadowMethod::kOracle)) == 0);
      std::uint64_t different = 0;
      for (std::size_t i = 0; i < receivers.size(); ++i) {
        const std::uint32_t blocked = masks.blocked_count(i);
        different += hard.blocked_count(i) != 0 ? 16 - blocked : blocked;
      }
      CHECK(different <= last);
      last = different;
    }
    CHECK(last == 0);
  }
}

TEST_CASE("S24 for GEARS: a crowd in one cell is spread over cells of its own") {
  const Scene scene = scene_of(joined(quad({-1, 2, -1}, {1, 2, -1}, {1, 2, 1}, {-1, 2, 1}),
                                      quad({-1e-5, 1, -1e-5}, {1e-5, 1, -1e-5}, {1e-5, 1, 1e-5}, {-1e-5, 1, 1e-5})));
  Random random(24);
  std::vector<dvec3> points = {{100, 0, 90}};
  for (int i = 0; i < 20000; ++i) points.push_back(1e-4 * dvec3(random.uniform(-1, 1), 0.0, random.uniform(-1, 1)));
  ShadowConfig config = frame_config(4);
  ShadowStats one, many;
  config.gears.subdivide = false;
  const VisibilityMasks flat = gears(scene, receivers_at(points), config, &one);
  config.gears.subdivide = true;
  CHECK(wrong_bits(flat, gears(scene, receivers_at(points), config, &many)) == 0);
  CHECK(one.detail("gears.receivers_per_cell_max").value() == 20000);
  CHECK(many.detail("gears.receivers_per_cell_max").value() < 100);
  const std::vector<dvec3> equal(5000, dvec3(0.0));
  gears(scene, receivers_at(equal), config, &many);
  CHECK(many.detail("gears.receivers_per_cell_max").value() == 5000);
}

TEST_CASE("one receiver far away does not make GEARS test all others against every blocker") {
  Random random(12);
  const Scene scene = scene_of(random_triangles(random, 400, 0.3, -3.0, 3.5));
  std::vector<dvec3> points = random_points(random, 1000, -4.0, 3.0);
  ShadowConfig config = frame_config(16);
  ShadowStats near, far;
  gears(scene, receivers_at(points), config, &near);
  points.push_back({0, -20000, 0});
  const Light light = frame_light();
  const VisibilityMasks masks = gears(scene, receivers_at(points), config, &far);
  CHECK(wrong_bits(masks, solve(scene, receivers_at(points), light, config, ShadowMethod::kOracle)) == 0);
  CHECK(far.detail("gears.receivers_near").value() < 10);
  CHECK(far.pairs_tested < 2 * near.pairs_tested);
  config.progress = [last = 0.0](double done) mutable {
    CHECK(done >= last);
    last = done;
    return true;
  };
  CHECK(wrong_bits(masks, gears(scene, receivers_at(points), config)) == 0);
}

TEST_CASE("the study of GEARS counts assignments: necessary <= in the frustum <= in the box <= all") {
  Random random(53);
  const Scene scene = scene_of(random_triangles(random, 200, 0.3, -3.0, 3.0));
  const std::vector<Receiver> receivers = receivers_at(random_points(random, 1500, -6.0, 0.0));
  ShadowConfig config = frame_config(64);
  config.gears.study = true;
  config.gears.bounds = false;
  config.gears.coarse = false;
  ShadowStats plain, refined, hull;
  gears(scene, receivers, config, &plain);
  const double necessary = plain.detail("gears.assignments_necessary").value(),
               all = plain.detail("gears.assignments").value();
  CHECK(necessary > 0);
  CHECK(necessary <= plain.detail("gears.samples_in_frustum").value());
  CHECK(plain.detail("gears.samples_in_frustum").value() <= plain.detail("gears.samples_in_box").value());
  CHECK(plain.detail("gears.samples_in_hull").value() <= plain.detail("gears.samples_in_box").value());
  CHECK(plain.detail("gears.samples_in_box").value() <= all);
  config.gears.refine = true;
  gears(scene, receivers, config, &refined);
  config.gears.refine = false;
  config.gears.region = GearsRegion::kHull;
  gears(scene, receivers, config, &hull);
  CHECK(refined.detail("gears.assignments").value() < all);
  CHECK(hull.detail("gears.assignments").value() < all);
  CHECK(refined.detail("gears.assignments_necessary").value() == necessary);
  CHECK(hull.detail("gears.assignments_necessary").value() == necessary);

  std::uint64_t truth = 0;  // each triangle alone
  config.gears.study = false;
  for (std::uint32_t t = 0; t < scene.triangles.size(); ++t) {
    Scene alone = scene;  // the same frame: all positions stay
    alone.triangles = {scene.triangles[t]};
    alone.triangle_materials = {0};
    const VisibilityMasks masks = solve(alone, receivers, frame_light(), config, ShadowMethod::kOracle);
    for (std::size_t i = 0; i < receivers.size(); ++i) truth += masks.blocked_count(i) != 0;
  }
  CHECK(necessary == static_cast<double>(truth));
}

TEST_CASE("counters of GEARS do not depend on the number of threads") {
  Random random(3);
  const Scene scene = scene_of(random_triangles(random, 500, 0.5));
  const std::vector<Receiver> receivers = receivers_at(random_points(random, 3000, -6.0, 3.0));
  std::vector<std::vector<std::pair<std::string, double>>> details;
  std::vector<std::string> hashes;
  for (const int threads : {1, 2, 5}) {
    ShadowStats stats;
    VisibilityMasks masks;
    tbb::task_arena(threads).execute([&] { masks = gears(scene, receivers, frame_config(16), &stats); });
    stats.details.emplace_back("pairs_tested", static_cast<double>(stats.pairs_tested));
    details.push_back(stats.details);
    hashes.push_back(masks.hash());
  }
  CHECK(details[0] == details[1]);
  CHECK(details[0] == details[2]);
  CHECK(hashes[0] == hashes[1]);
  CHECK(hashes[0] == hashes[2]);
}

TEST_CASE("GEARS' options are set by name, and values out of range are refused") {
  ShadowConfig config;
  set_method_option(config, "gears.region=hull");
  set_method_option(config, "gears.grid=64");
  set_method_option(config, "gears.camera=1.5");
  set_method_option(config, "gears.pair-budget=1000");
  CHECK(config.gears.region == GearsRegion::kHull);
  CHECK(config.gears.grid == 64);
  CHECK(config.gears.camera == 1.5);
  CHECK(config.gears.pair_budget == 1000);
  for (const char* bad :
       {"gears.region=circle", "gears.grid=2000", "gears.camera=-1", "gears.pair-budget=0", "gears.refine=maybe"}) {
    CHECK_THROWS_AS(set_method_option(config, bad), Error);
  }
  const Scene scene = scene_of(quad({-1, 2, -1}, {1, 2, -1}, {1, 2, 1}, {-1, 2, 1}));
  config = frame_config();
  config.gears.grid = 7;
  CHECK_THROWS_AS(gears(scene, receivers_at({{0, 0, 0}}), config), Error);
  config.gears.grid = 0;
  config.gears.camera = NAN;
  CHECK_THROWS_AS(gears(scene, receivers_at({{0, 0, 0}}), config), Error);
}

TEST_CASE("GEARS stops when progress says so, and works afterwards") {
  Random random(8);
  const Scene scene = scene_of(random_triangles(random, 300, 1.0));
  const std::vector<Receiver> receivers = receivers_at(random_points(random, 500, -6.0, 3.0));
  ShadowConfig config = frame_config(16);
  config.progress = [](double) { return false; };
  CHECK_THROWS_AS(gears(scene, receivers, config), Error);
  double last = 0.0;
  config.progress = [&](double done) {
    CHECK(done >= last);
    CHECK(done <= 1.0);
    last = done;
    return true;
  };
  CHECK(gears(scene, receivers, config).receiver_count == 500);
}

TEST_CASE("an empty scene and no receivers are handled by GEARS") {
  const Scene empty;
  CHECK(gears(empty, receivers_at({{0, 0, 0}}), frame_config()).visibility(0) == 1.0f);
  CHECK(gears(empty, {}, frame_config()).words.empty());
}
