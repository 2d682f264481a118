#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "shadows/blocker_tree.h"
#include "shadows/exact_engine.h"
#include "shadows/light_view.h"
#include "shadows/solver.h"
#include "support/exact_ways.h"

using namespace halfshade;
using namespace halfshade::test;

namespace {

std::vector<Triangle> random_triangles(std::uint64_t seed, int count) {
  Random random(seed);
  std::vector<Triangle> triangles;
  for (int i = 0; i < count; ++i) {
    const dvec3 c = random.in_box(-4, 3.5);
    const double size = i % 10 == 0 ? 2.0 : 0.2;
    triangles.push_back(
        {c + size * random.in_box(-1, 1), c + size * random.in_box(-1, 1), c + size * random.in_box(-1, 1)});
  }
  return triangles;
}

/// A wavy sheet of 3,200 triangles whose vertices are up to `noise` too high or too low.
std::vector<Triangle> waves(Random& random, double phase, double noise) {
  constexpr int kSide = 40;
  std::vector<std::vector<dvec3>> p(kSide + 1, std::vector<dvec3>(kSide + 1));
  for (int i = 0; i <= kSide; ++i) {
    for (int j = 0; j <= kSide; ++j) {
      const double x = 4.0 * i / kSide - 2.0, z = 4.0 * j / kSide - 2.0;
      const double wave = 0.8 * std::sin(2.1 * x + phase) * std::cos(1.7 * z);
      p[i][j] = {x, wave + random.uniform(-noise, noise), z};
    }
  }
  return sheet(p);
}

}  // namespace

TEST_CASE("the blocker tree holds every triangle once, in full leaves, inside the boxes above it") {
  for (const int count : {1, 15, 16, 17, 300, 5000}) {
    CAPTURE(count);
    const Scene scene = scene_of(random_triangles(1, count));
    const Light light = frame_light();
    const LatticeMesh mesh = make_lattice_mesh(scene, make_local_frame(scene.positions, light_extent(light)));
    const LightSamples samples = make_light_samples(light, frame_config(16), mesh.frame);
    const LightBound bound = make_light_bound(light, samples);
    const LightFrame frame{dvec3(bound.center), samples.axis_u, samples.axis_v, samples.axis_n};
    BlockerTree tree;
    build_blocker_tree(mesh, tree);
    BlockerFit fit;
    fit_blocker_tree(mesh, tree, make_kernel_samples(samples, bound), frame, fit);
    std::vector<std::uint32_t> order = tree.order;
    std::sort(order.begin(), order.end());
    REQUIRE(order.size() == static_cast<std::size_t>(count));
    for (std::uint32_t t = 0; t < order.size(); ++t) REQUIRE(order[t] == t);
    CHECK(tree.leaves.size() <= static_cast<std::size_t>(count) / 6 + 1);
    std::size_t reached = 0;
    for (const BlockerTree::Node& node : fit.nodes) {
      for (std::uint32_t i = 0; i < node.count; ++i) {
        if ((node.child[i] & BlockerTree::kLeafBit) == 0) continue;
        const BlockerTree::Leaf& leaf = tree.leaves[node.child[i] & ~BlockerTree::kLeafBit];
        reached += leaf.count;
        for (std::uint32_t lane = 0; lane < leaf.count; ++lane) {
          for (const vec3& p : mesh.corners(leaf.triangle[lane])) {
            const dvec3 q = frame.to_frame(dvec3(p));
            for (int axis = 0; axis < 3; ++axis) {
              REQUIRE(q[axis] >= node.low[axis][i]);
              REQUIRE(q[axis] <= node.high[axis][i]);
            }
          }
        }
      }
    }
    CHECK(reached == static_cast<std::size_t>(count));
  }
}

TEST_CASE("groups of the tree hold every edge of their triangles once, on its side") {
  // Sixteen octahedra in a row.
  std::vector<std::array<dvec3, 3>> triangles;
  for (int i = 0; i < 16; ++i) {
    const dvec3 c{3.0 * i, 0.0, 0.0};
    for (int k = 0; k < 8; ++k) {
      const dvec3 x{k & 1 ? 1.0 : -1.0, 0, 0}, y{0, k & 2 ? 1.0 : -1.0, 0}, z{0, 0, k & 4 ? 1.0 : -1.0};
      const bool turned = std::popcount(static_cast<unsigned>(k)) % 2 == 0;
      triangles.push_back({c + x, c + (turned ? z : y), c + (turned ? y : z)});
    }
  }
  const Scene scene = scene_of(triangles);
  const LatticeMesh mesh = make_lattice_mesh(scene, make_local_frame(scene.positions, light_extent(frame_light())));
  BlockerTree tree;
  build_blocker_tree(mesh, tree);
  std::size_t seen = 0, sides = 0;
  for (const BlockerTree::Node& node : tree.nodes) {
    if (!node.is_group) continue;
    const auto check = [&](const BlockerTree::Edge& edge, std::uint16_t triangle, std::uint16_t from,
                           std::uint16_t to) {
      if (triangle == BlockerTree::kGroupSlots) return;
      ++sides;
      const BlockerTree::Leaf& leaf = tree.leaves[node.first_leaf() + triangle / BlockerTree::kWidth];
      const std::array<vec3, 3> corners = mesh.corners(leaf.triangle[triangle % BlockerTree::kWidth]);
      const vec3 a = tree.vertices[node.first_vertex + from], b = tree.vertices[node.first_vertex + to];
      bool found = false;
      for (std::size_t k = 0; k < 3; ++k) found = found || (corners[k] == a && corners[(k + 1) % 3] == b);
      CHECK(found);
      CHECK(edge.from < edge.to);
    };
    for (std::uint32_t e = 0; e < node.edges; ++e) {
      const BlockerTree::Edge& edge = tree.edges[node.first_edge + e];
      check(edge, edge.left, edge.from, edge.to);
      check(edge, edge.right, edge.to, edge.from);
      seen += edge.left != BlockerTree::kGroupSlots && edge.right != BlockerTree::kGroupSlots;
    }
  }
  CHECK(sides == 3 * triangles.size());
  CHECK(seen >= 150);  // of 192 edges; the others lie between two groups
  for (std::uint32_t t = 0; t < triangles.size(); ++t) {
    const BlockerTree::Leaf& leaf = tree.leaves[tree.place[t] / BlockerTree::kWidth];
    CHECK(leaf.triangle[tree.place[t] % BlockerTree::kWidth] == t);
  }
}

TEST_CASE("the tree culls: few leaves are tested per receiver") {
  const Scene scene = scene_of(random_triangles(2, 20000));
  std::vector<dvec3> points;
  Random random(3);
  for (int i = 0; i < 2000; ++i) points.push_back({random.uniform(-4, 4), -4.5, random.uniform(-4, 4)});
  ShadowStats stats;
  Light small = frame_light();
  small.u *= 0.1, small.v *= 0.1;
  solve(scene, receivers_at(points), small, frame_config(64), ShadowMethod::kExact, &stats);
  CHECK(stats.leaves_tested > 0);
  CHECK(stats.leaves_tested < 2000 * 100);  // of about 1,700 leaves
}

TEST_CASE("receivers in and near the light's plane, and light samples of many sets, give the oracle's bits") {
  Random random(4);
  std::vector<dvec3> points;
  for (int i = 0; i < 400; ++i) {
    const double height = i % 4 == 0 ? 0.0 : std::exp2(-random.uniform(0.0, 24.0));
    points.push_back({random.uniform(-4, 4), 4.0 + (i % 2 == 0 ? height : -height), random.uniform(-4, 4)});
  }
  Light light = frame_light();
  light.two_sided = true;
  ShadowConfig config = frame_config(100);
  config.sample_sets = 5;
  config.pattern = SamplePattern::kStratified;
  CHECK(wrong_bits_of_exact_methods(scene_of(random_triangles(5, 300)), receivers_at(points), light, config) == 0);
  light.shape = LightShape::kDisk;
  light.radius = 1.5;
  CHECK(wrong_bits_of_exact_methods(scene_of(random_triangles(6, 300)), receivers_at(points), light, config) == 0);
}

TEST_CASE("disks of any number of samples have rows, and give the oracle's bits") {
  Random random(7);
  std::vector<dvec3> points;
  for (int i = 0; i < 300; ++i)
    points.push_back({random.uniform(-4, 4), random.uniform(-4.5, 3.5), random.uniform(-4, 4)});
  Light light = frame_light();
  light.shape = LightShape::kDisk, light.radius = 1.5, light.normal = {0.3, -1.0, 0.2};
  const Scene scene = scene_of(random_triangles(8, 400));
  for (const std::uint32_t count : {1u, 2u, 5u, 16u, 63u, 100u, 256u, 1000u, 1024u, 2500u, 4096u}) {
    for (const std::uint32_t sets : {1u, 3u}) {
      CAPTURE(count);
      CAPTURE(sets);
      ShadowConfig config = frame_config(count);
      config.pattern = SamplePattern::kRows;
      config.sample_sets = sets, config.frame = sets == 1 ? 0 : 9;
      const LightSamples samples =
          make_light_samples(light, config, make_local_frame(std::vector<dvec3>{{-8, -8, -8}, {8, 8, 8}}, {}));
      ExactLight kept;
      prepare_exact_light(light, samples, kept);
      CHECK((count < 16 || kept.rows.anywhere == (sets > 1)));
      CHECK(wrong_bits(solve(scene, receivers_at(points), light, config, ShadowMethod::kExact),
                       solve(scene, receivers_at(points), light, config, ShadowMethod::kOracle)) == 0);
    }
  }
}

TEST_CASE("samples that form no rows take a cell each, and rows, columns and offsets bound where they lie") {
  Light light = frame_light();
  Random random(9);
  for (int i = 0; i < 200; ++i) light.points.push_back(light.center + (i < 60 ? 0.01 : 1.0) * random.in_box(-1.0, 1.0));
  for (const LightShape shape : {LightShape::kRectangle, LightShape::kDisk}) {
    for (const SamplePattern pattern :
         {SamplePattern::kStratified, SamplePattern::kLowDiscrepancy, SamplePattern::kPoissonDisk}) {
      for (const std::uint32_t count : {17u, 256u, 2150u, 4096u}) {
        for (const std::uint32_t sets : {1u, 3u}) {
          CAPTURE(count);
          CAPTURE(sets);
          light.shape = shape, light.radius = 1.2, light.normal = {0.1, -1.0, 0.3};
          ShadowConfig config = frame_config(count);
          config.pattern = pattern, config.sample_sets = sets;
          const LightSamples samples =
              make_light_samples(light, config, make_local_frame(std::vector<dvec3>{{-8, -8, -8}, {8, 8, 8}}, {}));
          ExactLight kept;
          prepare_exact_light(light, samples, kept);
          const SampleRows& rows = kept.rows;
          REQUIRE(rows.anywhere);
          CHECK(rows.rows <= SampleRows::kMaxRows);
          CHECK(rows.columns <= SampleRows::kMaxColumns);
          for (std::uint32_t set = 0; set < sets; ++set) {
            std::vector<bool> seen(count, false);
            for (std::uint32_t row = 0; row < rows.rows; ++row) {
              for (std::uint32_t column = 0; column < rows.columns; ++column) {
                if (!rows.holds(set, row, column)) continue;
                const std::size_t at = set * rows.stride + rows.slot(row, column);
                const std::uint16_t sample = rows.sample_of[at];
                REQUIRE(sample < count);
                REQUIRE(!seen[sample]);
                seen[sample] = true;
                const dvec3 p = kept.front.to_frame(dvec3(samples.set(set)[sample]));
                const double x = p.x * double{rows.scale}, y = p.y * double{rows.row_scale};
                REQUIRE(std::fabs(x - double{rows.column_of[at]}) <= 1e-4);
                REQUIRE(std::fabs(y - double{rows.row_of[at]}) <= 1e-4);
                REQUIRE(column - x >= double{rows.least_offset} - 1e-4);
                REQUIRE(column - x <= double{rows.most_offset} + 1e-4);
                REQUIRE(row - y >= double{rows.least_row_offset} - 1e-4);
                REQUIRE(row - y <= double{rows.most_row_offset} + 1e-4);
              }
            }
            CHECK(std::count(seen.begin(), seen.end(), true) == static_cast<std::ptrdiff_t>(count));
          }
          // Cells are near to the samples: no picture of ranks alone.
          if (count == 256 && shape == LightShape::kRectangle && pattern != SamplePattern::kPoissonDisk)
            CHECK(rows.most_offset - rows.least_offset < 6.0f);
        }
      }
    }
  }
}

TEST_CASE(
    "lights without a plane give the oracle's bits to receivers all around, near to them and between their samples") {
  const std::vector<Triangle> some = random_triangles(31, 500);
  Random random(32);
  Light light = frame_light();
  light.center = {0.3, 0.4, -0.2}, light.radius = 0.9;
  light.axes = {dvec3(1.2, 0.3, 0.0), dvec3(-0.1, 0.5, 0.2), dvec3(0.0, -0.02, 0.05)};
  std::vector<dvec3> points;
  for (int i = 0; i < 500; ++i) {
    const dvec3 way = glm::normalize(random.in_box(-1.0, 1.0) + dvec3(1e-3));
    points.push_back(light.center + way * (i % 5 == 0 ? random.uniform(0.0, 1.1) : random.uniform(1.0, 5.0)));
  }
  for (int i = 0; i < 200; ++i) light.points.push_back(light.center + (i % 2 ? 0.9 : 0.05) * random.in_box(-1.0, 1.0));
  // And triangles that end between the samples.
  std::vector<Triangle> triangles = some;
  for (int i = 0; i < 60; ++i) {
    const dvec3 c = light.center + random.in_box(-1.0, 1.0);
    triangles.push_back({c, c + random.in_box(-0.5, 0.5), c + random.in_box(-3.0, 3.0)});
  }
  const Scene scene = scene_of(triangles);
  for (const LightShape shape :
       {LightShape::kSphere, LightShape::kEllipsoid, LightShape::kSamples, LightShape::kPoint}) {
    for (const std::uint32_t sets : {1u, 4u}) {
      CAPTURE(static_cast<int>(shape));
      CAPTURE(sets);
      light.shape = shape;
      ShadowConfig config = frame_config(sets == 1 ? 300 : 64);
      config.sample_sets = sets, config.rotate_sets = sets > 1;
      const VisibilityMasks truth = solve(scene, receivers_at(points), light, config, ShadowMethod::kOracle);
      std::uint64_t blocked = 0;
      for (const std::uint64_t word : truth.words) blocked += static_cast<std::uint64_t>(std::popcount(word));
      CHECK(blocked > 50);
      CHECK(wrong_bits(solve(scene, receivers_at(points), light, config, ShadowMethod::kExact), truth) == 0);
    }
  }
}

TEST_CASE("outlines of a bumpy surface give the oracle's bits for samples anywhere, in a plane or not") {
  for (const std::uint64_t seed : {3, 4}) {
    CAPTURE(seed);
    Random random(seed);
    const std::vector<Triangle> triangles = waves(random, static_cast<double>(seed), 0.0);
    std::vector<Receiver> receivers, below;
    for (std::uint32_t t = 0; t < triangles.size(); ++t) {
      const auto& [a, b, c] = triangles[t];
      receivers.push_back({(a + b + c) / 3.0 + dvec3(0.0, t % 2 ? 1e-4 : -1e-4, 0.0), t});
    }
    for (int i = 0; i < 1600; ++i) below.push_back({{0.1 * (i % 40) - 4.0, -4.0, 0.1 * (i / 40) - 1.0}, kNone});
    const Scene scene = scene_of(triangles);
    Scene textured = scene;  // opaque everywhere as well, but textured triangles have no part in outlines
    textured.alpha_maps = {{"opaque", 1, 1, {255}}}, textured.materials.resize(1), textured.materials[0].alpha_map = 0;
    textured.triangle_materials.assign(triangles.size(), 0);
    textured.triangle_uvs.assign(triangles.size(), {vec2(0, 0), vec2(1, 0), vec2(0, 1)});
    Light light = frame_light();
    light.center = {1.5, 2.5, -1.5}, light.normal = glm::cross(light.u, light.v), light.radius = 1.0;
    light.two_sided = true;
    for (const LightShape shape : {LightShape::kRectangle, LightShape::kDisk, LightShape::kSphere}) {
      for (const std::uint32_t sets : {1u, 5u}) {
        CAPTURE(static_cast<int>(shape));
        CAPTURE(sets);
        light.shape = shape;
        ShadowConfig config = frame_config(100);
        config.pattern = SamplePattern::kLowDiscrepancy, config.sample_sets = sets;
        ShadowStats on_it, stats, one_by_one;
        const VisibilityMasks masks = solve_exact_by(Beams::kNever, scene, receivers, light, config, &on_it);
        CHECK(wrong_bits(masks, solve(scene, receivers, light, config, ShadowMethod::kOracle)) == 0);
        CHECK(on_it.pairs_sampled * 2 < on_it.pairs_tested);
        const VisibilityMasks truth = solve(scene, below, light, config, ShadowMethod::kOracle);
        CHECK(wrong_bits(solve_exact_by(Beams::kNever, scene, below, light, config, &stats), truth) == 0);
        CHECK(wrong_bits(solve_exact_by(Beams::kNever, textured, below, light, config, &one_by_one), truth) == 0);
        CHECK(stats.pairs_sampled * 3 < one_by_one.pairs_sampled);
      }
    }
  }
}

TEST_CASE(
    "outlines of a bumpy surface give the oracle's bits to receivers on it, before a light that is tilted and wide") {
  // Packets whose box reaches farther to one side of its middle than to the other: turned towards the light, the middle
  // of a box of the lattice is not the middle of its heights. Vertices just below all of these receivers were once
  // bounded as if some lay below the vertex, and edges left out of rows that they cross.
  for (const std::uint64_t seed : {0, 11}) {
    CAPTURE(seed);
    Random random(seed);
    const std::vector<Triangle> triangles = waves(random, static_cast<double>(seed), 0.03);
    std::vector<Receiver> receivers;
    for (std::uint32_t t = 0; t < triangles.size(); ++t) {
      const auto& [a, b, c] = triangles[t];
      receivers.push_back({(a + b + c) / 3.0 + dvec3(0.0, 1e-4, 0.0), t});
    }
    Light light = frame_light();
    light.center = {2.0, 4.2, -2.4};
    light.u = {3.7, 0.0, 3.1}, light.v = {-2.3, 3.17, 2.8};
    light.two_sided = true;
    ShadowConfig config = frame_config(64);
    config.pattern = SamplePattern::kRows;
    const Scene scene = scene_of(triangles);
    CHECK(wrong_bits(solve(scene, receivers, light, config, ShadowMethod::kExact),
                     solve(scene, receivers, light, config, ShadowMethod::kOracle)) == 0);
    light.shape = LightShape::kDisk, light.radius = 2.4, light.normal = glm::cross(light.u, light.v);
    CHECK(wrong_bits(solve(scene, receivers, light, config, ShadowMethod::kExact),
                     solve(scene, receivers, light, config, ShadowMethod::kOracle)) == 0);
  }
}

TEST_CASE("triangles at a receiver's height that end where what is asked of the light does, give the oracle's bits") {
  // Receivers low over the plane of a small light and far to its side, whose place and height are known least well;
  // each with triangles that have an edge in a plane through it and one of the light's outer columns or rows.
  Light light = frame_light();
  light.u *= 0.05, light.v *= 0.05;
  ShadowConfig config = frame_config(64);
  config.pattern = SamplePattern::kRows;
  for (const std::uint64_t seed : {1, 2, 3}) {
    CAPTURE(seed);
    Random random(seed);
    std::vector<Triangle> triangles;
    std::vector<dvec3> points;
    for (int i = 0; i < 96; ++i) {
      const double height = std::exp2(-random.uniform(1.0, 9.0));
      const dvec3 r = light.center + dvec3(random.uniform(-0.3, 0.3), -height, random.uniform(-4.0, 4.0));
      points.push_back(r);
      for (int k = 0; k < 4; ++k) {
        const dvec3 out = k < 2 ? light.u : light.v, along = k < 2 ? light.v : light.u;
        const double side = k % 2 == 0 ? 1.0 : -1.0, column = 7.0 / 8.0 + random.uniform(-1e-3, 1e-3);
        const dvec3 l = light.center + side * column * out, q = glm::mix(r, l, random.uniform(0.01, 0.3));
        const double reach = random.uniform(0.5, 4.0) * glm::length(q - r);
        const dvec3 edge = glm::normalize(along) * reach + (l - r) * random.uniform(-0.3, 0.3);
        triangles.push_back({q + edge, q - edge, q + glm::normalize(out) * side * reach * 0.2});
      }
    }
    const Scene scene = scene_of(triangles);
    const auto masks = solve(scene, receivers_at(points), light, config, ShadowMethod::kOracle);
    std::uint64_t blocked = 0;
    for (const std::uint64_t word : masks.words) blocked += static_cast<std::uint64_t>(std::popcount(word));
    CHECK(blocked > 100);
    CHECK(wrong_bits(solve(scene, receivers_at(points), light, config, ShadowMethod::kExact), masks) == 0);
  }
}

TEST_CASE("alpha-tested triangles before lights of any kind give the oracle's bits, wherever their texture lies") {
  std::uint64_t open = 0, blocked = 0;
  for (std::uint64_t seed = 0; seed < 24; ++seed) {
    CAPTURE(seed);
    Random random(seed);
    Scene scene = scene_of(random_triangles(100 + seed, 80));
    AlphaMap map;
    map.width = seed % 4 == 0 ? 1 + static_cast<std::uint32_t>(seed) / 8 : 3 + static_cast<std::uint32_t>(seed) * 5;
    map.height = seed % 3 == 0 ? 1 : 64;
    for (std::uint32_t i = 0; i < map.width * map.height; ++i)
      map.alpha.push_back(static_cast<std::uint8_t>(random.uniform(0.0, 256.0)));
    Material material;
    material.alpha_map = 0, material.alpha_cutoff = 0.4f;
    scene.alpha_maps = {map}, scene.materials = {material};
    scene.triangle_materials.assign(scene.triangles.size(), 0);
    const double far = std::exp2(random.uniform(-3.0, 12.0)), size = std::exp2(random.uniform(-4.0, 5.0));
    for (std::size_t t = 0; t < scene.triangles.size(); ++t) {
      std::array<vec2, 3> uv;
      for (vec2& p : uv)
        p = vec2(dvec2(random.in_box(-far, far)) * (t % 2 ? 1.0 : 0.0) + dvec2(random.in_box(-size, size)));
      scene.triangle_uvs.push_back(uv);
    }
    std::vector<dvec3> points;
    for (int i = 0; i < 300; ++i)
      points.push_back({random.uniform(-4, 4), random.uniform(-4.5, 2.0), random.uniform(-4, 4)});
    Light light = frame_light();
    light.radius = 1.0, light.normal = {0.2, -1.0, 0.1};
    constexpr LightShape kShapes[] = {LightShape::kRectangle, LightShape::kDisk, LightShape::kSphere};
    light.shape = kShapes[seed % 3];
    ShadowConfig config = frame_config(64);
    config.pattern = seed % 2 ? SamplePattern::kRows : SamplePattern::kLowDiscrepancy;
    config.sample_sets = seed % 5 == 0 ? 3 : 1;
    const VisibilityMasks truth = solve(scene, receivers_at(points), light, config, ShadowMethod::kOracle);
    CHECK(wrong_bits(solve(scene, receivers_at(points), light, config, ShadowMethod::kExact), truth) == 0);
    for (const std::uint64_t word : truth.words) blocked += static_cast<std::uint64_t>(std::popcount(word));
    open += 300 * 64;
  }
  CHECK(blocked > 10'000);
  CHECK(blocked < open / 2);
}

TEST_CASE("outlines and texels that pass through samples as near as rounding lets them give the oracle's bits") {
  // Corners of triangles lie on the ways from a receiver to three samples; their texture has its texels' corners there.
  for (std::uint64_t seed = 0; seed < 12; ++seed) {
    CAPTURE(seed);
    Random random(seed);
    Light light = frame_light();
    light.radius = 1.0, light.normal = {0.2, -1.0, 0.1}, light.two_sided = true;
    constexpr LightShape kShapes[] = {LightShape::kRectangle, LightShape::kSphere, LightShape::kDisk};
    light.shape = kShapes[seed % 3];
    ShadowConfig config = frame_config(100);
    config.pattern = seed % 2 ? SamplePattern::kUniform : SamplePattern::kLowDiscrepancy;
    const LightSamples samples = make_light_samples(
        light, config, make_local_frame(std::vector<dvec3>{{-8, -8, -8}, {8, 8, 8}}, light_extent(light)));
    const LocalFrame frame = make_local_frame(std::vector<dvec3>{{-8, -8, -8}, {8, 8, 8}}, light_extent(light));
    std::vector<Triangle> triangles;
    std::vector<dvec3> points;
    const bool textured = seed >= 6;
    std::vector<std::array<vec2, 3>> uvs;
    const auto sample = [&] {
      const vec3 l = samples.set(0)[static_cast<std::size_t>(random.engine() % samples.count)];
      return light.center + (dvec3(l) - samples.center) / frame.scale;
    };
    for (int i = 0; i < 150; ++i) {
      const dvec3 r{random.uniform(-2.0, 2.0), random.uniform(-4.0, 1.0), random.uniform(-2.0, 2.0)};
      points.push_back(r);
      for (int k = 0; k < 3; ++k) {
        const double at = random.uniform(0.1, 0.7);
        Triangle t;
        for (dvec3& corner : t) corner = glm::mix(r, sample(), at);
        triangles.push_back(t);
        uvs.push_back({vec2(0, 0), vec2(1, 0), vec2(0, 1)});
      }
    }
    Scene scene = scene_of(triangles);
    if (textured) {
      AlphaMap map{"checks", 8, 8, {}};
      for (int i = 0; i < 64; ++i) map.alpha.push_back((i + i / 8) % 2 ? 255 : 0);
      Material material;
      material.alpha_map = 0;
      scene.alpha_maps = {map}, scene.materials = {material};
      scene.triangle_materials.assign(scene.triangles.size(), 0), scene.triangle_uvs = uvs;
    }
    ShadowStats stats;
    const VisibilityMasks truth = solve(scene, receivers_at(points), light, config, ShadowMethod::kOracle);
    CHECK(wrong_bits(solve(scene, receivers_at(points), light, config, ShadowMethod::kExact, &stats), truth) == 0);
    CHECK(stats.exact_fallbacks > 100);
    if (textured) continue;
    ShadowStats by_beams;
    CHECK(wrong_bits(solve_exact_by(Beams::kAlways, scene, receivers_at(points), light, config, &by_beams), truth) ==
          0);
    CHECK((by_beams.clusters_by_sample > 0) == samples.flat);
    CHECK(by_beams.exact_fallbacks > 100);
  }
}

TEST_CASE("beams give the oracle's bits to receivers anywhere, on triangles that hold the light's centre or lie flat") {
  Random random(41);
  std::vector<Triangle> triangles = random_triangles(42, 800);
  triangles = joined(triangles, box({-1.5, -2.0, -1.5}, {-0.5, -1.0, -0.5}));
  for (int i = 0; i < 12; ++i) {  // a floor whose triangles share a plane, and planes through the middle of the light
    const double x = -3.0 + 0.5 * i;
    triangles.push_back({dvec3(x, -3, -3), dvec3(x + 0.5, -3, -3), dvec3(x, -3, 3)});
    triangles.push_back({dvec3(x + 0.5, -3, -3), dvec3(x + 0.5, -3, 3), dvec3(x, -3, 3)});
    const dvec3 away = random.in_box(-1.0, 1.0);
    triangles.push_back({frame_light().center, frame_light().center + 4.0 * away, away});
  }
  const Scene scene = scene_of(triangles);
  std::vector<Receiver> receivers = receivers_at({});
  for (std::uint32_t t = 0; t < triangles.size(); ++t) {  // on all triangles, in their plane as near as rounding allows
    const auto& [a, b, c] = triangles[t];
    receivers.push_back({0.4 * a + 0.35 * b + 0.25 * c, t});
  }
  for (int i = 0; i < 400; ++i) receivers.push_back({random.in_box(-4.0, 4.0), kNone});
  for (int i = 0; i < 40; ++i) receivers.push_back({random.in_box(-0.45, 0.45) + dvec3(-1.0, -1.5, -1.0), kNone});
  for (int i = 0; i < 60; ++i) {  // near the light's plane
    const Light light = frame_light();
    receivers.push_back({light.center + random.uniform(-2.0, 2.0) * light.u + random.uniform(-2.0, 2.0) * light.v +
                             random.uniform(-1e-3, 1e-3) * glm::cross(light.u, light.v),
                         kNone});
  }
  for (const std::uint32_t count : {1u, 15u, 100u, 1024u}) {
    for (const SamplePattern pattern : {SamplePattern::kRows, SamplePattern::kLowDiscrepancy}) {
      CAPTURE(count);
      CAPTURE(static_cast<int>(pattern));
      Light light = frame_light();
      light.two_sided = count != 15;
      light.shape = count == 100 ? LightShape::kDisk : LightShape::kRectangle;
      light.radius = 1.5, light.normal = glm::cross(light.u, light.v);
      ShadowConfig config = frame_config(count);
      config.pattern = pattern;
      ShadowStats stats;
      const VisibilityMasks masks = solve_exact_by(Beams::kAlways, scene, receivers, light, config, &stats);
      CHECK(wrong_bits(masks, solve(scene, receivers, light, config, ShadowMethod::kOracle)) == 0);
      CHECK(stats.clusters_by_sample > 3);
    }
  }
}

TEST_CASE("receivers far from each other ask each for itself, and get the oracle's bits") {
  const Scene scene = scene_of(random_triangles(43, 6000));
  Light light = frame_light();
  light.u *= 0.2, light.v *= 0.2;
  const ShadowConfig config = frame_config(100);
  Random random(44);
  std::vector<Receiver> receivers;
  for (int i = 0; i < 48; ++i) receivers.push_back({random.in_box(-4.0, 4.0), kNone});
  ShadowStats together;
  const VisibilityMasks masks = solve(scene, receivers, light, config, ShadowMethod::kExact, &together);
  CHECK(wrong_bits(masks, solve(scene, receivers, light, config, ShadowMethod::kOracle)) == 0);
  std::uint64_t listed = 0;  // lists of 16 receivers each would be a seventh of that
  for (const Receiver& receiver : receivers) {
    ShadowStats alone;
    solve(scene, {receiver}, light, config, ShadowMethod::kExact, &alone);
    listed += alone.leaves_listed;
  }
  CHECK(2 * together.leaves_listed > listed);
}

TEST_CASE("calls that keep what method exact builds get the masks of calls that do not") {
  const Scene scene = scene_of(random_triangles(45, 500));
  Random random(46);
  std::vector<Receiver> receivers;
  for (int i = 0; i < 80; ++i) receivers.push_back({random.in_box(-4.0, 4.0), kNone});
  KeptExact kept;
  Light light = frame_light();
  const LatticeMesh mesh =
      make_lattice_mesh(scene, make_local_frame(scene.positions, receiver_reach(receivers, light)));
  for (const bool certificates : {false, true, true}) {
    for (const LightShape shape : {LightShape::kRectangle, LightShape::kSphere, LightShape::kPoint}) {
      light.shape = shape, light.radius = 0.5;
      ShadowConfig config = frame_config(60);
      config.back_face_casters = certificates;
      const ReceiverRequest request = make_receiver_request(mesh.frame, receivers, light, config);
      VisibilityMasks alone, masks;
      ShadowStats stats;
      solve_masks(mesh, request.receivers, light, request.samples, config, alone, stats);
      solve_masks(mesh, request.receivers, light, request.samples, config, masks, stats, &kept);
      CHECK(masks.words == alone.words);
    }
  }
}

TEST_CASE("beams are for clusters that packets take longer for, and what was left is tried again") {
  const BeamChoice::Cluster wide{256, 400, 256}, narrow{256, 4, 256};
  BeamChoice choice;
  CHECK_FALSE(choice.takes_beams(wide, Beams::kWhereCheaper));  // nothing is known yet
  CHECK(choice.takes_beams(narrow, Beams::kAlways));
  const auto run = [&](const BeamChoice::Cluster& cluster, double packet_ms, double beam_ms) {
    int beams = 0;
    for (int i = 0; i < 1000; ++i) {
      const bool takes = choice.takes_beams(cluster, Beams::kWhereCheaper);
      choice.took(cluster, takes, takes ? beam_ms : packet_ms);
      beams += takes;
    }
    return beams;
  };
  CHECK(run(wide, 30.0, 5.0) > 950);
  CHECK(run(wide, 30.0, 5.0) < 1000);  // packets are tried again
  CHECK(run(wide, 5.0, 30.0) < 50);
  CHECK(run(narrow, 0.5, 5.0) == 0);
  CHECK(run(wide, 30.0, 5.0) > 900);
}
