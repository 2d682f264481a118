// Named stability cases about exact signs and the meeting of segments with edges, vertices and planes.
// Frame of all cases: y up, light [-1,1] x {4} x [-1,1] facing down, 16x16 cell-centre samples, receivers near y = 0.
#include <doctest/doctest.h>

#include "rasterizer/core/predicate.h"
#include "rasterizer/core/unit_circle.h"
#include "support/lit_scene.h"

using namespace halfshade;
using namespace halfshade::test;
using halfshade::cases::half_plane;

namespace {

constexpr double kGrid = 0x1p12;

dvec3 on_grid(const dvec3& p) { return glm::round(p * kGrid) / kGrid; }

/// Closed UV sphere of radius 1/4 around the origin with vertices on multiples of 2^-12.
struct Sphere {
  std::vector<dvec3> vertices;
  std::vector<std::array<std::uint32_t, 3>> faces;

  Sphere(int rings, int segments) {
    vertices.push_back({0, 0.25, 0});
    for (int i = 1; i < rings; ++i) {
      for (int j = 0; j < segments; ++j) {
        const dvec2 polar = unit_circle(0.5 * i / rings), around = unit_circle(1.0 * j / segments);
        vertices.push_back(on_grid(0.25 * dvec3(polar.y * around.x, polar.x, polar.y * around.y)));
      }
    }
    vertices.push_back({0, -0.25, 0});
    const auto at = [&](int i, int j) -> std::uint32_t {
      if (i == 0) return 0;
      if (i == rings) return static_cast<std::uint32_t>(vertices.size() - 1);
      return static_cast<std::uint32_t>(1 + (i - 1) * segments + j % segments);
    };
    for (int i = 0; i < rings; ++i) {
      for (int j = 0; j < segments; ++j) {
        if (i > 0) faces.push_back({at(i, j), at(i, j + 1), at(i + 1, j)});
        if (i < rings - 1) faces.push_back({at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)});
      }
    }
  }

  Scene scene() const {
    std::vector<Triangle> triangles;
    for (const auto& f : faces) triangles.push_back({vertices[f[0]], vertices[f[1]], vertices[f[2]]});
    return scene_of(triangles);
  }
};

/// Is the segment from r to l blocked by any of the sphere's faces that `near` accepts? Exact.
template <class Near>
bool blocked_by(const Sphere& sphere, const dvec3& r, const dvec3& l, const Near& near) {
  for (const auto& f : sphere.faces) {
    if (!near(f)) continue;
    if (blocks(vec3(sphere.vertices[f[0]]), vec3(sphere.vertices[f[1]]), vec3(sphere.vertices[f[2]]), vec3(r), vec3(l)))
      return true;
  }
  return false;
}

Light sample_light(std::vector<dvec3> points) {
  Light light;
  light.shape = LightShape::kSamples;
  light.points = std::move(points);
  return light;
}

std::uint64_t leaks_of_exact_methods(const Scene& scene, const dvec3& receiver, const std::vector<dvec3>& samples) {
  std::uint64_t leaks = 0;
  for (const ShadowMethod method : exact_methods()) {
    const VisibilityMasks masks = solve(scene, receivers_at({receiver}), sample_light(samples), {}, method);
    leaks += samples.size() - masks.blocked_count(0);
  }
  return leaks;
}

}  // namespace

TEST_CASE("S01 vertex_aim: segments through the vertices of a closed sphere never leak") {
  for (const Sphere& sphere : {Sphere(32, 64), Sphere(100, 200)}) {
    Random random(1);
    std::vector<std::vector<std::size_t>> faces_at(sphere.vertices.size());
    for (std::size_t f = 0; f < sphere.faces.size(); ++f) {
      for (const std::uint32_t v : sphere.faces[f]) faces_at[v].push_back(f);
    }
    std::uint64_t leaks = 0;
    for (int shot = 0; shot < 500000; ++shot) {
      const dvec3 r = on_grid(random.in_box(-0.1, 0.1));
      const std::size_t v = static_cast<std::size_t>(shot) % sphere.vertices.size();
      const vec3 from(r), to(2.0 * sphere.vertices[v] - r);
      bool hit = false;
      for (const std::size_t f : faces_at[v]) {
        const auto& t = sphere.faces[f];
        hit = hit ||
              blocks(vec3(sphere.vertices[t[0]]), vec3(sphere.vertices[t[1]]), vec3(sphere.vertices[t[2]]), from, to);
      }
      leaks += !hit;
    }
    CHECK(leaks == 0);
  }
}

TEST_CASE("S01 vertex_aim: the methods block every sample that lies behind a vertex") {
  const Sphere sphere(32, 64);
  Random random(2);
  for (int round = 0; round < 20; ++round) {
    const dvec3 r = on_grid(random.in_box(-0.1, 0.1));
    std::vector<dvec3> samples;
    for (const dvec3& v : sphere.vertices) samples.push_back(2.0 * v - r);
    CHECK(leaks_of_exact_methods(sphere.scene(), r, samples) == 0);
  }
}

TEST_CASE("S02 edge_aim: segments through edge mid-points and random edge points never leak") {
  for (const Sphere& sphere : {Sphere(32, 64), Sphere(20, 40)}) {
    Random random(3);
    for (int round = 0; round < 10; ++round) {
      const dvec3 r = on_grid(random.in_box(-0.1, 0.1));
      std::vector<dvec3> samples;
      for (std::size_t f = 0; samples.size() < 4096 && f < sphere.faces.size(); ++f) {
        const dvec3 a = sphere.vertices[sphere.faces[f][0]], b = sphere.vertices[sphere.faces[f][1]];
        samples.push_back(a + b - r);  // the mid-point of the edge is the middle of the segment, exactly
        const double t = random.uniform(0.0, 1.0);
        samples.push_back(r + 2.0 * (a + t * (b - a) - r));
      }
      CHECK(leaks_of_exact_methods(sphere.scene(), r, samples) == 0);
    }
  }
}

TEST_CASE("S02 edge_aim: an exact hit of an edge blocks, one lattice unit beside an open edge does not") {
  const Triangle t = {dvec3(0, 0.5, -0.5), dvec3(0, 0.5, 0.5), dvec3(0.5, 0.5, 0)};
  const Sphere sphere(8, 16);
  const vec3 r(0.0f, 0.0f, 0.0f), on_edge(0.0f, 1.0f, 0.0f), beside(-0x1p-37f, 1.0f, 0.0f);
  CHECK(blocks(vec3(t[0]), vec3(t[1]), vec3(t[2]), r, on_edge));
  CHECK_FALSE(blocks(vec3(t[0]), vec3(t[1]), vec3(t[2]), r, beside));
  CHECK(blocked_by(sphere, dvec3(0), dvec3(0, 1, 0), [](const auto&) { return true; }));
}

namespace {

std::vector<dvec3> half_plane_receivers() {
  std::vector<dvec3> points;
  for (int i = -64; i <= 64; ++i) points.push_back({i / 64.0, 0.0, 0.25});
  return points;
}

/// Blocked samples in closed form: column a_i is hidden where (x + a_i) / 2 <= 0.
std::uint32_t half_plane_count(double x) {
  std::uint32_t columns = 0;
  for (int i = 0; i < 16; ++i) columns += x + (-1.0 + (i + 0.5) * 0.125) <= 0.0;
  return columns * 16;
}

}  // namespace

TEST_CASE("S03 halfplane_exact: the number of blocked samples is the closed form, ties included") {
  const std::vector<dvec3> points = half_plane_receivers();
  for (const ShadowMethod method : {ShadowMethod::kAliasFreeShadowMap, ShadowMethod::kExact, ShadowMethod::kOracle}) {
    const VisibilityMasks masks =
        solve(scene_of(half_plane()), receivers_at(points), frame_light(), frame_config(), method);
    for (std::size_t i = 0; i < points.size(); ++i) {
      CAPTURE(points[i].x);
      CHECK(masks.blocked_count(i) == half_plane_count(points[i].x));
    }
  }
}

TEST_CASE("S04 split_quad: two quads that meet leave no gap") {
  const Scene scene = scene_of(joined(half_plane(), quad({0, 2, -64}, {64, 2, -64}, {64, 2, 64}, {0, 2, 64})));
  const std::vector<dvec3> points = half_plane_receivers();
  for (const ShadowMethod method : {ShadowMethod::kAliasFreeShadowMap, ShadowMethod::kExact, ShadowMethod::kOracle}) {
    const VisibilityMasks masks = solve(scene, receivers_at(points), frame_light(), frame_config(), method);
    for (std::size_t i = 0; i < points.size(); ++i) CHECK(masks.visibility(i) == 0.0f);
  }
}

TEST_CASE("S05 sliver_grazing: slivers of aspect 10^2 to 10^8 at grazing angles give the oracle's bits") {
  Random random(5);
  for (double aspect = 1e2; aspect <= 1e8; aspect *= 10.0) {
    std::vector<Triangle> triangles;
    for (int i = 0; i < 60; ++i) {
      const dvec3 a = random.in_box(-2.0, 3.0), along = random.in_box(-1.0, 1.0), across = random.in_box(-1.0, 1.0);
      triangles.push_back({a, a + along, a + 0.5 * along + across / aspect});
    }
    std::vector<dvec3> points;
    for (int i = 0; i < 100; ++i) {  // receivers nearly in the planes of the slivers, seen at half a degree
      const Triangle& t = triangles[static_cast<std::size_t>(i) % triangles.size()];
      points.push_back(t[0] + random.uniform(-2.0, 2.0) * (t[1] - t[0]) + 0.009 * random.in_box(-1.0, 1.0));
    }
    CHECK(wrong_bits_of_exact_methods(scene_of(triangles), receivers_at(points), frame_light(), frame_config()) == 0);
  }
}

namespace {

struct Moved {
  Scene scene;
  std::vector<Receiver> receivers;
  Light light;
};

Moved moved(const std::vector<Triangle>& triangles, const std::vector<dvec3>& points, const dvec3& offset,
            double scale) {
  Moved m{scene_of(triangles), receivers_at(points), frame_light()};
  for (dvec3& p : m.scene.positions) p = p * scale + offset;
  for (Receiver& r : m.receivers) r.position_world = r.position_world * scale + offset;
  m.light.center = m.light.center * scale + offset;
  m.light.u *= scale;
  m.light.v *= scale;
  return m;
}

}  // namespace

TEST_CASE("S06 far_origin: moving the scene by offsets that stay exact in double changes no bit") {
  const std::vector<Triangle> triangles = joined(half_plane(), cases::scattered(6, 1000));
  const std::vector<dvec3> points = half_plane_receivers();
  const Moved home = moved(triangles, points, dvec3(0.0), 1.0);
  for (const ShadowMethod method : exact_methods()) {
    const VisibilityMasks masks = solve(home.scene, home.receivers, home.light, frame_config(), method);
    for (double offset = 1e2; offset <= 1e6; offset *= 10.0) {
      CAPTURE(offset);
      const Moved far = moved(triangles, points, dvec3(offset, -offset, 2 * offset), 1.0);
      CHECK(wrong_bits(masks, solve(far.scene, far.receivers, far.light, frame_config(), method)) == 0);
    }
  }
}

TEST_CASE("S06 far_origin: offsets that round change at most 0.1 percent of the bits") {
  std::vector<Triangle> triangles = cases::scattered(7, 300);
  for (Triangle& t : triangles) {
    for (dvec3& p : t) p *= 1.0 / 3.0;
  }
  const std::vector<dvec3> points = half_plane_receivers();
  const Moved home = moved(triangles, points, dvec3(0.0), 1.0), far = moved(triangles, points, dvec3(1e6 / 3.0), 1.0);
  const VisibilityMasks a =
      solve(home.scene, home.receivers, home.light, frame_config(), ShadowMethod::kAliasFreeShadowMap);
  const VisibilityMasks b =
      solve(far.scene, far.receivers, far.light, frame_config(), ShadowMethod::kAliasFreeShadowMap);
  CHECK(static_cast<double>(wrong_bits(a, b)) <= 0.001 * 256.0 * static_cast<double>(points.size()));
}

TEST_CASE("S07 scale: scaling by powers of two from 2^-60 to 2^60 changes no bit") {
  const std::vector<Triangle> triangles = joined(half_plane(), cases::scattered(8, 200));
  const std::vector<dvec3> points = half_plane_receivers();
  const Moved home = moved(triangles, points, dvec3(0.0), 1.0);
  const VisibilityMasks masks =
      solve(home.scene, home.receivers, home.light, frame_config(), ShadowMethod::kAliasFreeShadowMap);
  for (const double scale : {0x1p-60, 0x1p-20, 0x1p20, 0x1p60}) {
    const Moved m = moved(triangles, points, dvec3(0.0), scale);
    CHECK(wrong_bits(masks, solve(m.scene, m.receivers, m.light, frame_config(), ShadowMethod::kAliasFreeShadowMap)) ==
          0);
  }
}

namespace {

/// One filter of the ladder against 128-bit integers, on determinants made nearly zero.
template <class Real>
void check_filter(std::uint64_t seed, int count) {
  Random random(seed);
  std::uint64_t wrong = 0, undecided = 0;
  for (int i = 0; i < count; ++i) {
    const dvec3 a = random.in_box(-1, 1), b = random.in_box(-1, 1), c = random.in_box(-1, 1);
    const double u = random.uniform(-0.5, 1.0), v = random.uniform(-0.5, 1.0);
    const double away = std::exp2(-random.uniform(10.0, 40.0));
    const dvec3 d = glm::clamp(a + u * (b - a) + v * (c - a) + away * random.in_box(-1, 1), -1.9, 1.9);
    const vec3 p = snap_to_lattice(a), q = snap_to_lattice(b), r = snap_to_lattice(c), s = snap_to_lattice(d);
    const int filtered = orient3d_filtered<Real>(p, q, r, s);
    if (filtered == kUndecided) {
      ++undecided;
    } else {
      wrong += filtered != sign_of(orient3d_exact(p, q, r, s));
    }
  }
  CHECK(wrong == 0);
  CHECK(undecided < static_cast<std::uint64_t>(count));
  MESSAGE("undecided " << undecided << " of " << count);
}

}  // namespace

TEST_CASE("S32 filter_bound: the float and double filters never accept a wrong sign") {
  check_filter<float>(32, 4000000);
  check_filter<double>(33, 4000000);
}

TEST_CASE("S32 filter_bound: in an ordinary scene less than one percent is undecided") {
  Random random(34);
  int undecided = 0;
  for (int i = 0; i < 1000000; ++i) {
    const dvec3 a = random.in_box(-1, 1), e = 0.01 * random.in_box(-1, 1), f = 0.01 * random.in_box(-1, 1);
    undecided += orient3d_filtered<float>(snap_to_lattice(a), snap_to_lattice(a + e), snap_to_lattice(a + f),
                                          snap_to_lattice(random.in_box(-1, 1))) == kUndecided;
  }
  CHECK(undecided < 10000);
}
