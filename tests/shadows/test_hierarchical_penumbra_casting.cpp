#include <doctest/doctest.h>

#include <numeric>

#include <tbb/task_arena.h>

#include "halfshade/stream.h"
#include "rasterizer/core/parallel.h"
#include "rasterizer/core/predicate.h"
#include "rasterizer/rasterizer.h"
#include "rasterizer/scenes/builtin.h"
#include "rasterizer/scenes/scene_stream.h"
#include "shadows/blocker_buckets.h"
#include "shadows/method_options.h"
#include "shadows/penumbra_volume.h"
#include "shadows/receiver_hierarchy.h"
#include "support/lit_scene.h"

namespace halfshade::test {
namespace {

constexpr ShadowMethod kHpc = ShadowMethod::kHierarchicalPenumbraCasting;

std::vector<Triangle> confetti(std::uint64_t seed, int count, double size) {
  Random random(seed);
  std::vector<Triangle> triangles = box({-1.5, 0.2, -1.5}, {0.5, 1.0, 1.5});
  for (int i = 0; i < count; ++i) {
    const dvec3 c = random.in_box(-3, 3.8);
    triangles.push_back(
        {c + size * random.in_box(-1, 1), c + size * random.in_box(-1, 1), c + size * random.in_box(-1, 1)});
  }
  return triangles;
}

std::vector<dvec3> floor_and_air(std::uint64_t seed, int count) {
  Random random(seed);
  std::vector<dvec3> points;
  for (int i = 0; i < count; ++i) points.push_back({random.uniform(-5, 5), 0.0, random.uniform(-5, 5)});
  for (int i = 0; i < count / 4; ++i) points.push_back(random.in_box(-4, 3.9));
  return points;
}

VisibilityMasks solve_with(const std::vector<std::string>& settings, const Scene& scene,
                           const std::vector<Receiver>& receivers, const Light& light, ShadowConfig config,
                           ShadowStats* stats = nullptr) {
  for (const std::string& setting : settings) set_method_option(config, setting);
  return solve(scene, receivers, light, config, kHpc, stats);
}

}  // namespace

TEST_CASE("penumbra casting: every optimisation, alone and together, leaves all masks as they are") {
  const Scene scene = scene_of(confetti(1, 150, 0.8));
  const auto receivers = receivers_at(floor_and_air(2, 2400));
  ShadowConfig config = frame_config(96);
  config.pattern = SamplePattern::kStratified;
  config.sample_sets = 8;
  const VisibilityMasks truth = solve(scene, receivers, frame_light(), config, ShadowMethod::kOracle);
  const std::vector<std::vector<std::string>> variants = {
      {},
      {"hpc.umbra-bits=off"},
      {"hpc.plane-sets=off"},
      {"hpc.lazy-volumes=off"},
      {"hpc.masks-on-demand=off"},
      {"hpc.buckets=0"},
      {"hpc.buckets=256", "hpc.rebuild=0"},
      {"hpc.rebuild=1"},
      {"hpc.group=16", "hpc.leaf=1"},
      {"hpc.group=4096", "hpc.leaf=1000"},
      {"hpc.weigh-split=on", "hpc.group=48"},
      {"hpc.umbra-bits=off", "hpc.plane-sets=off", "hpc.lazy-volumes=off", "hpc.masks-on-demand=off", "hpc.buckets=0"}};
  for (const auto& settings : variants) {
    CAPTURE(settings.size());
    CHECK(wrong_bits(truth, solve_with(settings, scene, receivers, frame_light(), config)) == 0);
  }
}

TEST_CASE("penumbra casting: optimisations save what they are for") {
  const Scene scene = scene_of(confetti(3, 400, 0.5));
  const auto receivers = receivers_at(floor_and_air(4, 4000));
  const auto stats_with = [&](const std::vector<std::string>& settings) {
    ShadowStats stats;
    solve_with(settings, scene, receivers, frame_light(), frame_config(256), &stats);
    return stats;
  };
  const ShadowStats all = stats_with({});
  CHECK(all.detail("hpc.nodes_visited").value() <
        stats_with({"hpc.umbra-bits=off"}).detail("hpc.nodes_visited").value());
  CHECK(all.detail("hpc.plane_tests").value() <
        0.7 * stats_with({"hpc.plane-sets=off"}).detail("hpc.plane_tests").value());
  CHECK(all.detail("hpc.group_volumes").value() <
        stats_with({"hpc.lazy-volumes=off"}).detail("hpc.group_volumes").value());
  CHECK(all.detail("hpc.peak_mask_bytes").value() <
        stats_with({"hpc.masks-on-demand=off"}).detail("hpc.peak_mask_bytes").value());
  CHECK(stats_with({"hpc.masks-on-demand=off"}).detail("hpc.peak_masks").value() == receivers.size());
  CHECK(all.detail("hpc.hierarchy_rebuilds").value() > 0);
  CHECK(stats_with({"hpc.rebuild=1"}).detail("hpc.hierarchy_rebuilds").value() == 0);
}

TEST_CASE("penumbra casting: receivers in full umbra keep no mask") {
  ShadowStats stats;
  const std::vector<Triangle> roof = quad({-60, 3, -60}, {60, 3, -60}, {60, 3, 60}, {-60, 3, 60});
  const auto receivers = receivers_at(floor_and_air(5, 3000));
  const VisibilityMasks masks = solve_with({}, scene_of(roof), receivers, frame_light(), frame_config(64), &stats);
  std::size_t hidden = 0;
  for (std::size_t i = 0; i < receivers.size(); ++i) hidden += masks.visibility(i) == 0.0f;
  CHECK(hidden > 2000);
  CHECK(stats.detail("hpc.peak_masks").value() < 0.9 * static_cast<double>(hidden));
}

TEST_CASE("penumbra casting: all light shapes and sample numbers agree with the oracle, 8 sample sets included") {
  const Scene scene = scene_of(confetti(6, 40, 1.2));
  const auto receivers = receivers_at(floor_and_air(7, 250));
  for (const LightShape shape : {LightShape::kPoint, LightShape::kRectangle, LightShape::kDisk, LightShape::kSphere,
                                 LightShape::kEllipsoid, LightShape::kSamples}) {
    for (const std::uint32_t samples : {1u, 31u, 65u, 300u}) {
      Light light = frame_light();
      light.shape = shape;
      light.radius = 1.1;
      light.points = {{0, 4, 0}, {1, 3.5, 0}, {0, 4.5, 1}, {0.3, 4.2, -1}};
      ShadowConfig config = frame_config(samples);
      config.pattern = SamplePattern::kStratified;
      config.sample_sets = 8;
      CAPTURE(static_cast<int>(shape));
      CAPTURE(samples);
      CHECK(wrong_bits(solve(scene, receivers, light, config, ShadowMethod::kOracle),
                       solve(scene, receivers, light, config, kHpc)) == 0);
    }
  }
}

TEST_CASE("penumbra casting: alpha-tested triangles are cast after opaque ones, texel by texel") {
  Scene scene = scene_of(joined(quad({-3, 2, -3}, {3, 2, -3}, {3, 2, 3}, {-3, 2, 3}), confetti(8, 20, 0.5)));
  scene.alpha_maps.push_back({"stripes", 8, 1, {255, 0, 255, 0, 0, 255, 130, 120}});
  scene.materials.push_back(scene.materials[0]);
  scene.materials[1].alpha_map = 0;
  scene.triangle_materials[0] = scene.triangle_materials[1] = 1;
  scene.triangle_uvs.assign(scene.triangles.size(), {vec2(0.0f), vec2(0.0f), vec2(0.0f)});
  scene.triangle_uvs[0] = {vec2(0, 0), vec2(4, 0), vec2(4, 1)};
  scene.triangle_uvs[1] = {vec2(0, 0), vec2(4, 1), vec2(0, 1)};
  const auto receivers = receivers_at(floor_and_air(9, 800));
  const VisibilityMasks truth = solve(scene, receivers, frame_light(), frame_config(128), ShadowMethod::kOracle);
  CHECK(wrong_bits(truth, solve(scene, receivers, frame_light(), frame_config(128), kHpc)) == 0);
  const LatticeMesh mesh = make_lattice_mesh(scene, make_local_frame(scene.positions, {}));
  const std::vector<std::uint32_t> order = casting_order(mesh, 16);
  CHECK(std::max(order[order.size() - 1], order[order.size() - 2]) == 1);
  CHECK(std::min(order[order.size() - 1], order[order.size() - 2]) == 0);
}

TEST_CASE("penumbra volume: holds every receiver that the blocker hides from some sample") {
  Random random(10);
  for (int round = 0; round < 3000; ++round) {
    Light light = frame_light();
    light.shape = round % 3 == 0 ? LightShape::kSphere : (round % 3 == 1 ? LightShape::kDisk : LightShape::kRectangle);
    light.radius = random.uniform(0.0, 1.5);
    const LocalFrame frame = make_local_frame(std::vector<dvec3>{dvec3(-8), dvec3(8)}, light_extent(light));
    const LightSamples samples = make_light_samples(light, frame_config(64), frame);
    const LightBound bound = make_light_bound(light, samples);
    const KernelSamples kernel = make_kernel_samples(samples, bound);
    const std::vector<LightHull> groups = make_group_hulls(samples, kernel, 32);
    const dvec3 c = random.in_box(-5, 5);
    const double size = round % 2 == 0 ? 2.0 : 0.01;
    std::array<vec3, 3> corners;
    for (vec3& corner : corners) corner = frame.to_lattice(c + size * random.in_box(-1, 1));
    std::vector<PenumbraVolume> volumes(1 + groups.size());
    make_penumbra_volume(make_light_hull(bound, samples, kernel), corners, volumes[0]);
    for (std::size_t k = 0; k < groups.size(); ++k) make_penumbra_volume(groups[k], corners, volumes[k + 1]);
    for (std::uint32_t i = 0; i < 64; ++i) {
      const dvec3 l(kernel.points[i]);
      const double a = random.uniform(0, 1), b = random.uniform(0, 1 - a);
      const dvec3 hit = dvec3(corners[0]) * a + dvec3(corners[1]) * b + dvec3(corners[2]) * (1 - a - b);
      const vec3 r = snap_to_lattice(hit + (hit - l) * random.uniform(1e-9, 0.3));
      if (!blocks(corners[0], corners[1], corners[2], r, kernel.points[i])) continue;
      std::uint64_t tests = 0;
      CAPTURE(round);
      for (const std::size_t v : {std::size_t{0}, std::size_t{1} + i / 32}) {
        PenumbraVolume::PlaneSet active = volumes[v].all();
        REQUIRE(meets(volumes[v], r, r, active, tests));
      }
    }
  }
}

TEST_CASE("penumbra volume: a blocker in front of a rectangle gets a closed set of planes, one that pierces it none") {
  const Light light = frame_light();
  const LocalFrame frame = make_local_frame(std::vector<dvec3>{dvec3(-8), dvec3(8)}, light_extent(light));
  const LightSamples samples = make_light_samples(light, frame_config(256), frame);
  const LightBound bound = make_light_bound(light, samples);
  const LightHull hull = make_light_hull(bound, samples, make_kernel_samples(samples, bound));
  const auto volume_of = [&](const Triangle& t) {
    PenumbraVolume volume;
    make_penumbra_volume(hull, {frame.to_lattice(t[0]), frame.to_lattice(t[1]), frame.to_lattice(t[2])}, volume);
    return volume;
  };
  const PenumbraVolume below = volume_of({dvec3(-0.5, 2, 0.1), dvec3(0.6, 2.1, 0), dvec3(0, 2.2, 1)});
  CHECK(below.count == 8);  // 3 edges of the blocker, 4 of the light, the cap
  const auto holds = [&](const dvec3& p) {
    PenumbraVolume::PlaneSet active = below.all();
    std::uint64_t tests = 0;
    const vec3 q = frame.to_lattice(p);
    return meets(below, q, q, active, tests);
  };
  CHECK(holds({0, 0, 0.3}));
  CHECK_FALSE(holds({0, 3, 0.3}));
  CHECK_FALSE(holds({7, 0, 0}));
  CHECK_FALSE(holds({-7, 0, 0}));
  CHECK(volume_of({dvec3(-0.5, 3, 0), dvec3(0.5, 5, 0), dvec3(0, 4, 1)}).count == 0);
}

TEST_CASE("receiver hierarchy: holds each point once, in tight boxes and small leaves, within 64 levels") {
  Random random(11);
  std::vector<vec3> points;
  for (int i = 0; i < 5000; ++i) points.push_back(snap_to_lattice(random.in_box(-1, 1)));
  for (int i = 0; i < 3000; ++i) points.push_back(vec3(0.25f));  // coincident
  for (int i = 0; i < 38; ++i) points.push_back(vec3(std::ldexp(1.0f, -i), 0.0f, 0.0f));
  for (const bool weigh : {false, true}) {
    ReceiverHierarchy h;
    h.order.resize(points.size());
    std::iota(h.order.begin(), h.order.end(), 0u);
    build_receiver_hierarchy(points, {16, 1000, weigh}, h);
    CHECK(h.depth <= ReceiverHierarchy::kMostLevels);
    std::vector<int> seen(points.size(), 0);
    for (const ReceiverHierarchy::Node& node : h.nodes) {
      vec3 low(2.0f), high(-2.0f);
      for (std::uint32_t i = node.begin; i < node.end; ++i) {
        low = glm::min(low, points[h.order[i]]), high = glm::max(high, points[h.order[i]]);
        if (node.is_leaf()) ++seen[h.order[i]];
      }
      REQUIRE(node.low == low);
      REQUIRE(node.high == high);
      if (node.is_leaf() && node.low != node.high) REQUIRE(node.end - node.begin <= 16);
    }
    for (const int n : seen) REQUIRE(n == 1);
  }
}

TEST_CASE("area buckets: large blockers come first, in the order of the mesh within a bucket") {
  const Scene scene = scene_of(confetti(12, 500, 1.0));
  const LatticeMesh mesh = make_lattice_mesh(scene, make_local_frame(scene.positions, {}));
  AreaBuckets areas;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) areas.count(mesh.corners(t));
  areas.finish(8);
  const std::vector<std::uint32_t> order = casting_order(mesh, 8);
  std::uint32_t used = 1;
  for (std::size_t i = 1; i < order.size(); ++i) {
    const std::uint32_t before = areas.bucket_of(mesh.corners(order[i - 1])),
                        now = areas.bucket_of(mesh.corners(order[i]));
    REQUIRE(before <= now);
    used += before != now;
    if (before == now) REQUIRE(order[i - 1] < order[i]);
    if (before + 1 < now)
      REQUIRE(AreaBuckets::size_of(mesh.corners(order[i - 1])) > AreaBuckets::size_of(mesh.corners(order[i])));
  }
  CHECK(used >= 4);
}

TEST_CASE("penumbra casting: options out of range are refused by name") {
  const Scene scene = scene_of(confetti(13, 1, 1.0));
  ShadowConfig config = frame_config(16);
  config.hpc.group = 24;
  CHECK_THROWS_WITH_AS(solve(scene, receivers_at({dvec3(0)}), frame_light(), config, kHpc),
                       "hpc.group: 24 is not a multiple of 16 in 16..4096", Error);
  CHECK_THROWS_AS(set_method_option(config, "hpc.leaf=0"), Error);
  CHECK_THROWS_AS(set_method_option(config, "hpc.rebuild=1.5"), Error);
}

TEST_CASE("penumbra casting: masks and counters do not depend on the number of threads") {
  const Scene scene = scene_of(confetti(14, 300, 0.6));
  const auto receivers = receivers_at(floor_and_air(15, 6000));
  std::vector<std::string> hashes;
  std::vector<double> nodes;
  for (const int threads : {1, 2, 5}) {
    tbb::task_arena(threads).execute([&] {
      ShadowStats stats;
      hashes.push_back(solve(scene, receivers, frame_light(), frame_config(64), kHpc, &stats).hash());
      nodes.push_back(stats.detail("hpc.nodes_visited").value());
    });
  }
  CHECK(hashes[1] == hashes[0]);
  CHECK(hashes[2] == hashes[0]);
  CHECK(nodes[1] == nodes[0]);
  CHECK(nodes[2] == nodes[0]);
}

TEST_CASE("streamed penumbra casting: any pieces and parts give the masks of the whole scene") {
  Scene scene = scene_of(joined(quad({-3, 2, -3}, {3, 2, -3}, {3, 2, 3}, {-3, 2, 3}), confetti(16, 300, 0.6)));
  scene.alpha_maps.push_back({"stripes", 4, 1, {255, 0, 255, 0}});
  scene.materials.push_back(scene.materials[0]);
  scene.materials[1].alpha_map = 0;
  scene.triangle_materials[0] = scene.triangle_materials[1] = 1;
  scene.triangle_uvs.assign(scene.triangles.size(), {vec2(0.0f), vec2(4, 0), vec2(4, 1)});
  std::vector<Receiver> receivers = receivers_at(floor_and_air(17, 1500));
  for (std::uint32_t i = 0; i < 100; ++i) {  // receivers on triangles, and behind the light
    const auto& t = scene.triangles[i];
    receivers.push_back({(scene.positions[t[0]] + scene.positions[t[1]] + scene.positions[t[2]]) / 3.0, i});
    receivers.push_back({dvec3(i, 4.5, 0), kNone});
  }
  const VisibilityMasks truth = solve(scene, receivers, frame_light(), frame_config(96), ShadowMethod::kExact);
  for (const std::size_t piece : {1u, 97u, 100000u}) {
    for (const std::uint32_t buckets : {0u, 1u, 16u}) {
      SceneStream stream = stream_of_scene(std::make_shared<const Scene>(scene), piece);
      ShadowConfig config = frame_config(96);
      config.hpc.area_buckets = buckets;
      VisibilityMasks masks;
      ShadowStats stats;
      solve_shadows(stream, receivers, frame_light(), config, {{}, piece == 97 ? std::uint64_t{100000} : 0}, masks,
                    &stats);
      CAPTURE(piece);
      CAPTURE(buckets);
      CHECK(wrong_bits(truth, masks) == 0);
      CHECK((stats.detail("hpc.receiver_parts").value() > 1) == (piece == 97));
    }
  }
}

TEST_CASE("streamed penumbra casting: an empty stream and a directory that is not there are refused") {
  const auto receivers = receivers_at({dvec3(0)});
  VisibilityMasks masks;
  SceneStream empty = stream_of_scene(std::make_shared<const Scene>(), 10);
  CHECK_THROWS_WITH_AS(solve_shadows(empty, receivers, frame_light(), frame_config(16), {}, masks),
                       "the scene has no triangles", Error);
  SceneStream stream = stream_of_scene(std::make_shared<const Scene>(scene_of(confetti(18, 5, 1.0))), 10);
  try {
    solve_shadows(stream, receivers, frame_light(), frame_config(16), {"/nowhere/at/all", 0}, masks);
    FAIL("no error");
  } catch (const Error& error) {
    CHECK(error.code() == ErrorCode::kOutput);
  }
}

TEST_CASE("a picture drawn in pieces is the picture of the whole scene, and built-in grass the same in pieces") {
  const BuiltinScene whole = make_builtin_scene("grass", 700);
  const LatticeMesh mesh = make_lattice_mesh(whole.scene, make_local_frame(whole.scene.positions, {}));
  RasterConfig config;
  config.width = 150, config.height = 110;
  config.window = {13, 140, 5, 99};
  GBuffer truth;
  RasterStats stats, pieces;
  rasterize(mesh, whole.view.camera, config, truth, &stats);
  for (const std::size_t piece : {std::size_t{50}, std::size_t{1234}}) {
    StreamedScene streamed = stream_builtin_scene("grass", 700, piece);
    PiecewisePicture picture = begin_picture(config);
    std::uint32_t first = 0;
    pieces = {};
    for (streamed.stream.rewind(); streamed.stream.next(streamed.stream.piece);) {
      const LatticeMesh part = make_lattice_mesh(streamed.stream.piece, mesh.frame);
      for (std::uint32_t t = 0; t < part.triangles.size(); ++t) REQUIRE(part.corners(t) == mesh.corners(first + t));
      rasterize_piece(part, first, whole.view.camera, config, picture, pieces);
      first += static_cast<std::uint32_t>(part.triangles.size());
    }
    CHECK(first == mesh.triangles.size());
    CHECK(picture.gbuffer.triangle == truth.triangle);
    CHECK(picture.gbuffer.position == truth.position);
    CHECK(picture.gbuffer.shading_normal == truth.shading_normal);
    CHECK(picture.gbuffer.albedo == truth.albedo);
    CHECK(picture.gbuffer.depth == truth.depth);
    CHECK(pieces.samples_covered == stats.samples_covered);
  }
}

}  // namespace halfshade::test
