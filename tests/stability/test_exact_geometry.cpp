// Named stability cases about exact signs and the meeting of segments with edges, vertices and planes.
// Frame of all cases: y up, light [-1,1] x {4} x [-1,1] facing down, 16x16 cell-centre samples, receivers near y = 0.
#include <doctest/doctest.h>

#include <atomic>
#include <cmath>

#include "rasterizer/core/predicate.h"
#include "shadows/crossing.h"
#include "stability/cases.h"
#include "stability/integer_oracle.h"

using namespace halfshade;
using namespace halfshade::test;

namespace {

/// Open samples over all exact methods; every segment leaves a closed surface, so there must be none. Hierarchical
/// penumbra casting, which prepares every triangle for every group of samples and here does so for one receiver, takes
/// one case in `hpc_stride`.
std::uint64_t leaks_of_exact_methods(const std::vector<StabilityCase>& cases, std::size_t hpc_stride = 1) {
  std::uint64_t leaks = 0;
  for (std::size_t i = 0; i < cases.size(); ++i) {
    const StabilityCase& c = cases[i];
    for (const ShadowMethod method : exact_methods()) {
      if (method == ShadowMethod::kHierarchicalPenumbraCasting && i % hpc_stride != 0) continue;
      const VisibilityMasks masks = solve(c.scene, c.receivers, c.light, c.config, method);
      leaks += masks.sample_count - masks.blocked_count(0);
    }
  }
  return leaks;
}

/// Segments that do not count as exactly one crossing of the surface.
std::uint64_t not_crossed_once(const std::vector<StabilityCase>& cases) {
  std::uint64_t wrong = 0;
  for (const StabilityCase& c : cases) {
    DepthComplexity depth;
    solve_depth_complexity(c.scene, c.receivers, c.light, c.config, depth);
    for (const std::uint32_t count : depth.counts) wrong += count != 1;
  }
  return wrong;
}

std::uint64_t aims_of(const std::vector<StabilityCase>& cases) {
  std::uint64_t aims = 0;
  for (const StabilityCase& c : cases) aims += c.light.points.size();
  return aims;
}

/// Segments through vertices, tested with the triangles around the vertex alone: closed, they are all blocked; moved
/// by an infinitesimal, each crosses exactly one of them.
void check_fans(const Sphere& sphere, std::uint32_t shots) {
  std::vector<std::vector<std::size_t>> faces_at(sphere.vertices.size());
  for (std::size_t f = 0; f < sphere.faces.size(); ++f) {
    for (const std::uint32_t v : sphere.faces[f]) faces_at[v].push_back(f);
  }
  std::atomic<std::uint64_t> leaks = 0, not_once = 0;
  parallel_ranges(shots, 4096, [&](std::size_t begin, std::size_t end) {
    Random random(begin);
    std::uint64_t open = 0, wrong = 0;
    for (std::size_t shot = begin; shot != end; ++shot) {
      const dvec3 r = on_grid(random.in_box(-0.1, 0.1));
      const std::size_t v = shot % sphere.vertices.size();
      const vec3 from(r), to(2.0 * sphere.vertices[v] - r);
      int hits = 0, crossings = 0;
      for (const std::size_t f : faces_at[v]) {
        const auto& t = sphere.faces[f];
        const vec3 a(sphere.vertices[t[0]]), b(sphere.vertices[t[1]]), c(sphere.vertices[t[2]]);
        hits += blocks(a, b, c, from, to);
        crossings += crosses(a, b, c, from, to);
      }
      open += hits == 0;
      wrong += crossings != 1;
    }
    leaks += open;
    not_once += wrong;
  });
  CHECK(leaks == 0);
  CHECK(not_once == 0);
}

}  // namespace

TEST_CASE("S01 vertex_aim: segments through the vertices of a closed sphere never leak and cross it once") {
  for (const Sphere& sphere : {Sphere(32, 64), Sphere(100, 200)}) check_fans(sphere, 250000);
  const std::vector<StabilityCase> cases = sphere_aims(false, 32, 64, 20);
  CHECK(leaks_of_exact_methods(cases) == 0);
  CHECK(not_crossed_once(cases) == 0);
}

TEST_CASE("S01 vertex_aim: from inside to vertices and just beyond or before them, the bits are those of integers") {
  StabilityCase c = std::move(sphere_aims(false, 16, 32, 1)[0]);
  const dvec3 r = c.receivers[0].position_world;
  const std::vector<dvec3> through = c.light.points;
  for (const dvec3& l : through) {
    const dvec3 vertex = 0.5 * (l + r);
    for (const double reach : {1.0, 1.0 - 0x1p-30, 1.0 + 0x1p-30}) c.light.points.push_back(r + reach * (vertex - r));
  }
  c.light.points.resize(std::min<std::size_t>(c.light.points.size(), 4096));
  CHECK(wrong_against_integers(c.scene, c.receivers, c.light, c.config) == 0);
}

TEST_CASE("S01_long vertex_aim: a million aims at each sphere, 700,000 by every method") {
  for (const Sphere& sphere : {Sphere(32, 64), Sphere(100, 200)}) check_fans(sphere, 1000000);
  for (const int rings : {32, 100}) {
    const std::vector<StabilityCase> cases = sphere_aims(false, rings, 2 * rings, rings == 32 ? 252 : 49);
    CHECK(aims_of(cases) >= (rings == 32 ? 500000u : 200000u));
    CHECK(leaks_of_exact_methods(cases, rings == 32 ? 12 : 24) == 0);
    CHECK(not_crossed_once(cases) == 0);
  }
}

TEST_CASE("S02 edge_aim: segments through edge mid-points and random edge points never leak and cross once") {
  for (const int rings : {32, 100}) {
    const std::vector<StabilityCase> cases = sphere_aims(true, rings, 2 * rings, rings == 32 ? 6 : 2);
    CHECK(leaks_of_exact_methods(cases) == 0);
    CHECK(not_crossed_once(cases) == 0);
  }
  const StabilityCase c = std::move(sphere_aims(true, 16, 32, 1)[0]);
  CHECK(wrong_against_integers(c.scene, c.receivers, c.light, c.config) == 0);
}

TEST_CASE("S02_long edge_aim: 700,000 aims by every method") {
  for (const int rings : {32, 100}) {
    const std::vector<StabilityCase> cases = sphere_aims(true, rings, 2 * rings, rings == 32 ? 123 : 49);
    CHECK(aims_of(cases) >= (rings == 32 ? 500000u : 200000u));
    CHECK(leaks_of_exact_methods(cases, rings == 32 ? 12 : 24) == 0);
    CHECK(not_crossed_once(cases) == 0);
  }
}

TEST_CASE("S02 edge_aim: an exact hit of an edge blocks, one lattice unit beside an open edge does not") {
  const Triangle t = {dvec3(0, 0.5, -0.5), dvec3(0, 0.5, 0.5), dvec3(0.5, 0.5, 0)};
  const vec3 r(0.0f, 0.0f, 0.0f), on_edge(0.0f, 1.0f, 0.0f), beside(-0x1p-37f, 1.0f, 0.0f);
  CHECK(blocks(vec3(t[0]), vec3(t[1]), vec3(t[2]), r, on_edge));
  CHECK_FALSE(blocks(vec3(t[0]), vec3(t[1]), vec3(t[2]), r, beside));
  const Scene scene = scene_of({t});
  // The scene's frame is not centred on the edge: there, floats are 2^-25 apart.
  const Light light = sample_light({dvec3(on_edge), dvec3(-0x1p-24, 1.0, 0.0)});
  CHECK(wrong_against_integers(scene, receivers_at({dvec3(r)}), light, {}) == 0);
  CHECK(solve(scene, receivers_at({dvec3(r)}), light, {}, ShadowMethod::kExact).blocked_count(0) == 1);
}

namespace {

/// Blocked samples in closed form: column a_i is hidden where (x + a_i) / 2 <= 0.
std::uint32_t half_plane_count(double x) {
  std::uint32_t columns = 0;
  for (int i = 0; i < 16; ++i) columns += x + (-1.0 + (i + 0.5) * 0.125) <= 0.0;
  return columns * 16;
}

std::vector<ShadowMethod> exact_methods_and_oracle() {
  std::vector<ShadowMethod> methods = exact_methods();
  methods.push_back(ShadowMethod::kOracle);
  return methods;
}

}  // namespace

TEST_CASE("S03 halfplane_exact: the number of blocked samples is the closed form, ties included") {
  const std::vector<dvec3> points = half_plane_receivers();
  for (const ShadowMethod method : exact_methods_and_oracle()) {
    const VisibilityMasks masks =
        solve(scene_of(half_plane()), receivers_at(points), frame_light(), frame_config(), method);
    for (std::size_t i = 0; i < points.size(); ++i) {
      CAPTURE(points[i].x);
      CHECK(masks.blocked_count(i) == half_plane_count(points[i].x));
    }
  }
  CHECK(wrong_against_integers(scene_of(half_plane()), receivers_at(points), frame_light(), frame_config()) == 0);
}

TEST_CASE("S04 split_quad: two quads that meet leave no gap") {
  const Scene scene = scene_of(joined(half_plane(), quad({0, 2, -64}, {64, 2, -64}, {64, 2, 64}, {0, 2, 64})));
  const std::vector<dvec3> points = half_plane_receivers();
  for (const ShadowMethod method : exact_methods_and_oracle()) {
    const VisibilityMasks masks = solve(scene, receivers_at(points), frame_light(), frame_config(), method);
    for (std::size_t i = 0; i < points.size(); ++i) CHECK(masks.visibility(i) == 0.0f);
  }
}

TEST_CASE("S05 sliver_grazing: slivers of aspect 10^2 to 10^8 at grazing angles give the integers' bits") {
  Random random(5);
  for (double aspect = 1e2; aspect <= 1e8; aspect *= 10.0) {
    const std::vector<Triangle> triangles = slivers(random, aspect);
    const std::vector<Receiver> receivers = receivers_at(grazing_points(random, triangles));
    CHECK(wrong_against_integers(scene_of(triangles), receivers, frame_light(), frame_config()) == 0);
  }
}

TEST_CASE("S05 sliver_grazing: edges 11.2, 9.7, 1.4 and segments at 0.52 degrees to the plane: no false hit") {
  // In the plane y = 0 (moved away from the axes by nothing but x and z): corners from the three lengths.
  const double c = 11.2, b = 9.7, a = 1.4 + 0.101;  // 9.7 + 1.4 < 11.2: the shortest edge is as short as it can be
  const double x = (b * b - a * a + c * c) / (2.0 * c), z = std::sqrt(std::max(0.0, b * b - x * x));
  const Triangle t = {dvec3(0, 0, 0), dvec3(c, 0, 0), dvec3(x, 0, z)};
  Random random(387);
  std::uint64_t wrong = 0, blocked = 0;
  for (int round = 0; round < 40; ++round) {
    std::vector<dvec3> samples;
    const dvec3 r(random.uniform(-8, 16), random.uniform(-0.2, -0.02), random.uniform(-4, 4));
    for (int i = 0; i < 4096; ++i) {
      const dvec3 hit(random.uniform(-2, 13), 0.0, random.uniform(-1, 1) * (z + 0.5));
      const double along = glm::length(dvec2(hit.x - r.x, hit.z - r.z));
      // Twice the way to the plane, at exactly that angle: the receiver is moved down or up to where it must be.
      const double depth = along * 0.009075764;  // tan(0.52 degrees)
      samples.push_back({2.0 * hit.x - r.x, 2.0 * depth + r.y, 2.0 * hit.z - r.z});
    }
    const std::vector<Receiver> receivers = receivers_at({r});
    const Light light = sample_light(samples);
    wrong += wrong_against_integers(scene_of({t}), receivers, light, {});
    blocked += solve(scene_of({t}), receivers, light, {}, ShadowMethod::kOracle).blocked_count(0);
  }
  CHECK(wrong == 0);
  CHECK(blocked > 200);
}

TEST_CASE("S06 far_origin: moving the scene by offsets that stay exact in double changes no bit") {
  const std::vector<Triangle> triangles = joined(half_plane(), cases::scattered(6, 1000));
  const std::vector<dvec3> points = half_plane_receivers();
  const StabilityCase home = moved_case(triangles, points, dvec3(0.0), 1.0);
  CHECK(wrong_against_integers(home.scene, home.receivers, home.light, home.config) == 0);
  for (const ShadowMethod method : exact_methods()) {
    const VisibilityMasks masks = solve(home.scene, home.receivers, home.light, frame_config(), method);
    for (double offset = 1e2; offset <= 1e6; offset *= 10.0) {
      CAPTURE(offset);
      const StabilityCase far = moved_case(triangles, points, dvec3(offset, -offset, 2 * offset), 1.0);
      CHECK(wrong_bits(masks, solve(far.scene, far.receivers, far.light, frame_config(), method)) == 0);
    }
  }
}

TEST_CASE("S06 far_origin: offsets that round change at most 0.1 percent of the bits") {
  std::vector<Triangle> triangles = joined(half_plane(), cases::scattered(7, 1000));
  for (Triangle& t : triangles) {
    for (dvec3& p : t) p *= 1.0 / 3.0;
  }
  const std::vector<dvec3> points = half_plane_receivers();
  const StabilityCase home = moved_case(triangles, points, dvec3(0.0), 1.0);
  const VisibilityMasks masks = solve(home.scene, home.receivers, home.light, home.config, ShadowMethod::kOracle);
  for (double offset = 1e2; offset <= 1e6; offset *= 10.0) {
    CAPTURE(offset);
    const StabilityCase far = moved_case(triangles, points, dvec3(offset / 3.0), 1.0);
    // Every exact method and the oracle against the integers: one of them stands for all.
    CHECK(wrong_against_integers(far.scene, far.receivers, far.light, far.config) == 0);
    const VisibilityMasks moved = solve(far.scene, far.receivers, far.light, far.config, ShadowMethod::kOracle);
    const std::uint64_t changed = wrong_bits(masks, moved);
    CHECK(static_cast<double>(changed) <= 0.001 * 256.0 * static_cast<double>(points.size()));
    MESSAGE("offset " << offset << " / 3: " << changed << " of " << 256 * points.size() << " bits changed");
  }
}

TEST_CASE("S07 scale: scaling by powers of two from 2^-60 to 2^60 changes no bit") {
  const std::vector<Triangle> triangles = joined(half_plane(), cases::scattered(8, 200));
  const std::vector<dvec3> points = half_plane_receivers();
  const StabilityCase home = moved_case(triangles, points, dvec3(0.0), 1.0);
  for (const ShadowMethod method : exact_methods_and_oracle()) {
    const VisibilityMasks masks = solve(home.scene, home.receivers, home.light, home.config, method);
    for (const double scale : {0x1p-60, 0x1p-20, 0x1p20, 0x1p60}) {
      CAPTURE(scale);
      const StabilityCase m = moved_case(triangles, points, dvec3(0.0), scale);
      CHECK(wrong_bits(masks, solve(m.scene, m.receivers, m.light, m.config, method)) == 0);
    }
  }
}

namespace {

struct Filtered {
  std::uint64_t wrong = 0, undecided = 0, count = 0;
};

/// `make(random)` gives four points of which the last is nearly or quite in the plane of the others.
template <class Real, class Make>
Filtered filter_against_integers(std::uint64_t seed, std::size_t count, const Make& make) {
  std::atomic<std::uint64_t> wrong = 0, undecided = 0;
  parallel_ranges(count / 10000, 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t batch = begin; batch != end; ++batch) {
      Random random(seed * 1000003 + batch);
      std::uint64_t bad = 0, open = 0;
      for (int i = 0; i < 10000; ++i) {
        const std::array<vec3, 4> p = make(random);
        const int filtered = orient3d_filtered<Real>(p[0], p[1], p[2], p[3]);
        if (filtered == kUndecided) {
          ++open;
        } else {
          const Units d = in_units(p[3]);
          const Wide det = dot(in_units(p[0]) - d, cross(in_units(p[1]) - d, in_units(p[2]) - d));
          bad += filtered != (det > 0) - (det < 0);
        }
      }
      wrong += bad;
      undecided += open;
    }
  });
  return {wrong, undecided, count / 10000 * 10000};
}

std::array<vec3, 4> nearly_coplanar(Random& random) {
  const dvec3 a = random.in_box(-1, 1), b = random.in_box(-1, 1), c = random.in_box(-1, 1);
  const double u = random.uniform(-0.5, 1.0), v = random.uniform(-0.5, 1.0);
  const double away = std::exp2(-random.uniform(10.0, 40.0));
  const dvec3 d = glm::clamp(a + u * (b - a) + v * (c - a) + away * random.in_box(-1, 1), -1.9, 1.9);
  return {snap_to_lattice(a), snap_to_lattice(b), snap_to_lattice(c), snap_to_lattice(d)};
}

std::array<vec3, 4> small_triangle_and_point(Random& random) {
  const dvec3 a = random.in_box(-1, 1), e = 0.05 * random.in_box(-1, 1), f = 0.05 * random.in_box(-1, 1);
  return {snap_to_lattice(a), snap_to_lattice(a + e), snap_to_lattice(a + f), snap_to_lattice(random.in_box(-1, 1))};
}

/// A small triangle and a point within 2^-40 .. 2^-10 of its plane, as far away as the scene is wide.
std::array<vec3, 4> small_triangle_and_point_near_its_plane(Random& random) {
  const dvec3 a = random.in_box(-1, 1), e = 0.05 * random.in_box(-1, 1), f = 0.05 * random.in_box(-1, 1);
  const double away = std::exp2(-random.uniform(10.0, 40.0));
  const dvec3 d = a + random.uniform(-10, 10) * e + random.uniform(-10, 10) * f + away * random.in_box(-1, 1);
  return {snap_to_lattice(a), snap_to_lattice(a + e), snap_to_lattice(a + f),
          snap_to_lattice(glm::clamp(d, -1.9, 1.9))};
}

/// In one plane, exactly: corners on multiples of 2^-12, the point a whole number of edges away.
std::array<vec3, 4> coplanar(Random& random) {
  const auto on_grid = [&](double low, double high) { return glm::round(random.in_box(low, high) * 4096.0) / 4096.0; };
  const dvec3 a = on_grid(-1, 1), e = on_grid(-0.1, 0.1), f = on_grid(-0.1, 0.1);
  const dvec3 d = a + std::round(random.uniform(-4, 4)) * e + std::round(random.uniform(-4, 4)) * f;
  return {vec3(a), vec3(a + e), vec3(a + f), vec3(d)};
}

/// `count` determinants for each filter of the ladder; then how many an ordinary scene leaves undecided.
void check_filters(std::size_t count) {
  struct {
    std::string name;
    Filtered in_float, in_double;
  } sets[] = {
      {"nearly coplanar", filter_against_integers<float>(32, count, nearly_coplanar),
       filter_against_integers<double>(33, count, nearly_coplanar)},
      {"small, nearly coplanar", filter_against_integers<float>(35, count, small_triangle_and_point_near_its_plane),
       filter_against_integers<double>(36, count, small_triangle_and_point_near_its_plane)},
      {"small, anywhere", filter_against_integers<float>(34, count, small_triangle_and_point),
       filter_against_integers<double>(37, count, small_triangle_and_point)},
  };
  for (const auto& set : sets) {
    CAPTURE(set.name);
    CHECK(set.in_float.wrong == 0);
    CHECK(set.in_double.wrong == 0);
    CHECK(set.in_float.undecided < set.in_float.count);
    CHECK(set.in_double.undecided * 100 <= set.in_double.count);
    MESSAGE("undecided of " << count << " " << set.name << ": " << set.in_float.undecided << " (float), "
                            << set.in_double.undecided << " (double)");
  }
  CHECK(sets[2].in_float.undecided * 100 <= sets[2].in_float.count);
  const Filtered flat_float = filter_against_integers<float>(38, count / 10, coplanar),
                 flat_double = filter_against_integers<double>(39, count / 10, coplanar);
  CHECK(flat_float.wrong + flat_double.wrong == 0);
  MESSAGE("undecided of " << flat_float.count << " coplanar: " << flat_float.undecided << " (float), "
                          << flat_double.undecided << " (double)");
}

}  // namespace

TEST_CASE("S32 filter_bound: the float and double filters never accept a wrong sign, and leave little undecided") {
  check_filters(2000000);
}

TEST_CASE("S32_long filter_bound: a hundred million near-degenerate determinants") { check_filters(100000000); }
