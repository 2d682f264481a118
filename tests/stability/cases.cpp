#include "stability/cases.h"

#include <cmath>

namespace halfshade::test {

Sphere::Sphere(int rings, int segments) {
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

Scene Sphere::scene() const {
  std::vector<Triangle> triangles;
  for (const auto& f : faces) triangles.push_back({vertices[f[0]], vertices[f[1]], vertices[f[2]]});
  return scene_of(triangles);
}

std::vector<Triangle> uv_sphere(const dvec3& center, double radius, int rings, int segments) {
  const auto at = [&](int i, int j) {
    const dvec2 polar = unit_circle(0.5 * i / rings), around = unit_circle(1.0 * (j % segments) / segments);
    return center + radius * dvec3(polar.y * around.x, polar.x, polar.y * around.y);
  };
  std::vector<Triangle> triangles;
  for (int i = 0; i < rings; ++i) {
    for (int j = 0; j < segments; ++j) {
      if (i > 0) triangles.push_back({at(i, j), at(i, j + 1), at(i + 1, j)});
      if (i < rings - 1) triangles.push_back({at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)});
    }
  }
  return triangles;
}

Light sample_light(std::vector<dvec3> points) {
  Light light;
  light.shape = LightShape::kSamples;
  light.points = std::move(points);
  return light;
}

std::vector<StabilityCase> sphere_aims(bool at_edges, int rings, int segments, int aims, const dvec3& offset) {
  const Sphere sphere(rings, segments);
  Random random(at_edges ? 3 : 2);
  Scene scene = sphere.scene();
  for (dvec3& p : scene.positions) p += offset;
  std::vector<StabilityCase> cases;
  std::size_t next = 0;
  for (int aim = 0; aim < aims; ++aim) {
    const dvec3 r = on_grid(random.in_box(-0.1, 0.1));
    std::vector<dvec3> samples;
    const std::size_t targets = at_edges ? sphere.faces.size() : sphere.vertices.size();
    for (std::size_t i = 0; i < targets && samples.size() < 4096; ++i, next = (next + 1) % targets) {
      if (!at_edges) {
        samples.push_back(2.0 * sphere.vertices[next] - r + offset);
        continue;
      }
      const std::size_t k = random.engine() % 3;
      const auto& f = sphere.faces[next];
      const dvec3 a = sphere.vertices[f[k]], b = sphere.vertices[f[(k + 1) % 3]];
      samples.push_back(a + b - r + offset);  // the mid-point of the edge is the middle of the segment, exactly
      samples.push_back(r + 2.0 * (a + random.uniform(0.0, 1.0) * (b - a) - r) + offset);
    }
    cases.push_back({at_edges ? "S02 edge_aim" : "S01 vertex_aim",
                     scene,
                     receivers_at({r + offset}),
                     sample_light(std::move(samples)),
                     {}});
  }
  return cases;
}

std::vector<dvec3> half_plane_receivers() {
  std::vector<dvec3> points;
  for (int i = -64; i <= 64; ++i) points.push_back({i / 64.0, 0.0, 0.25});
  return points;
}

std::vector<Triangle> slivers(Random& random, double aspect) {
  std::vector<Triangle> triangles;
  for (int i = 0; i < 60; ++i) {
    const dvec3 a = random.in_box(-2.0, 3.0), along = random.in_box(-1.0, 1.0), across = random.in_box(-1.0, 1.0);
    triangles.push_back({a, a + along, a + 0.5 * along + across / aspect});
  }
  return triangles;
}

std::vector<dvec3> grazing_points(Random& random, const std::vector<Triangle>& triangles) {
  std::vector<dvec3> points;
  for (std::size_t i = 0; i < 100; ++i) {
    const Triangle& t = triangles[i % triangles.size()];
    points.push_back(t[0] + random.uniform(-2.0, 2.0) * (t[1] - t[0]) + 0.009 * random.in_box(-1.0, 1.0));
  }
  return points;
}

StabilityCase moved_case(const std::vector<Triangle>& triangles, const std::vector<dvec3>& points, const dvec3& offset,
                         double scale) {
  StabilityCase m{scale == 1.0 ? "S06 far_origin" : "S07 scale", scene_of(triangles), receivers_at(points),
                  frame_light(), frame_config()};
  for (dvec3& p : m.scene.positions) p = p * scale + offset;
  for (Receiver& r : m.receivers) r.position_world = r.position_world * scale + offset;
  m.light.center = m.light.center * scale + offset;
  m.light.u *= scale;
  m.light.v *= scale;
  return m;
}

std::vector<dvec3> floor_points(int side, double reach) {
  std::vector<dvec3> points;
  for (int i = 0; i < side * side; ++i) {
    points.push_back(
        {((i % side) * 2.0 / (side - 1) - 1.0) * reach, 0.0, ((i / side) * 2.0 / (side - 1) - 1.0) * reach});
  }
  return points;
}

Scene alpha_card(float cutoff, const dvec2& uv_low, const dvec2& uv_high) {
  Scene scene = scene_of(quad({-1, 2, -1}, {1, 2, -1}, {1, 2, 1}, {-1, 2, 1}));
  AlphaMap map{"ramp", 4, 4, {}};
  for (int i = 0; i < 16; ++i) map.alpha.push_back(static_cast<std::uint8_t>(i * 17));
  scene.alpha_maps.push_back(map);
  scene.materials[0].alpha_map = 0;
  scene.materials[0].alpha_cutoff = cutoff;
  const vec2 a(uv_low.x, uv_low.y), b(uv_high.x, uv_low.y), c(uv_high.x, uv_high.y), d(uv_low.x, uv_high.y);
  scene.triangle_uvs = {{a, b, c}, {a, c, d}};
  return scene;
}

std::vector<dvec3> bar_receivers() {  // one period of the shadow: the bars' own, times 4 / 0.5
  std::vector<dvec3> points;
  for (int i = 0; i < 256; ++i) points.push_back({i / 256.0 / 8.0, 0.0, 0.013});
  return points;
}

std::vector<dvec3> wire_receivers(int count) {
  std::vector<dvec3> points;
  for (int i = 0; i < count; ++i) points.push_back({(i - count / 2) * 1.0 / count, 0.0, 0.0});
  return points;
}

namespace {

/// Receivers on the triangles themselves, lifted towards the light as the camera's are.
std::vector<Receiver> surface_receivers(const std::vector<Triangle>& triangles, double lift, std::uint64_t seed) {
  Random random(seed);
  std::vector<Receiver> receivers;
  for (std::uint32_t t = 0; t < triangles.size(); ++t) {
    const auto& [a, b, c] = triangles[t];
    const dvec3 normal = glm::cross(b - a, c - a);
    if (normal.y == 0.0) continue;
    const double u = random.uniform(0.05, 0.45), v = random.uniform(0.05, 0.45);
    receivers.push_back(
        {a + u * (b - a) + v * (c - a) + lift * glm::normalize(normal) * (normal.y > 0 ? 1.0 : -1.0), t});
  }
  return receivers;
}

std::vector<dvec3> random_around(std::uint64_t seed, int count, const dvec3& low, const dvec3& high) {
  Random random(seed);
  std::vector<dvec3> points;
  for (int i = 0; i < count; ++i) {
    points.push_back({random.uniform(low.x, high.x), random.uniform(low.y, high.y), random.uniform(low.z, high.z)});
  }
  return points;
}

std::vector<dvec3> joined_points(std::vector<dvec3> a, const std::vector<dvec3>& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

std::vector<Triangle> through_light_plane(std::uint64_t seed, int count) {
  Random random(seed);
  std::vector<Triangle> triangles = {{dvec3(2, 3, 0), dvec3(2, 5, 0.5), dvec3(2, 3, 1)}};
  for (int i = 1; i < count; ++i) {
    const dvec3 c(random.uniform(-4, 4), 4.0, random.uniform(-4, 4));
    triangles.push_back({c + random.in_box(-3, 3), c + random.in_box(-3, 3), c + random.in_box(-1, 1)});
  }
  return triangles;
}

class Catalogue {
 public:
  void add(const char* name, const std::vector<Triangle>& triangles, const std::vector<dvec3>& points,
           const Light& light = frame_light(), const ShadowConfig& config = frame_config()) {
    cases_.push_back({name, scene_of(triangles), receivers_at(points), light, config});
  }
  void add(const char* name, Scene scene, const std::vector<dvec3>& points) {
    cases_.push_back({name, std::move(scene), receivers_at(points), frame_light(), frame_config()});
  }
  void add(std::vector<StabilityCase> more) {
    for (StabilityCase& c : more) cases_.push_back(std::move(c));
  }
  std::vector<StabilityCase> take() { return std::move(cases_); }

 private:
  std::vector<StabilityCase> cases_;
};

void add_geometry(Catalogue& list) {
  list.add(sphere_aims(false, 32, 64, 2));
  list.add(sphere_aims(true, 32, 64, 2));
  list.add("S03 halfplane_exact", half_plane(), half_plane_receivers());
  list.add("S04 split_quad", joined(half_plane(), quad({0, 2, -64}, {64, 2, -64}, {64, 2, 64}, {0, 2, 64})),
           half_plane_receivers());
  Random random(5);
  for (const double aspect : {1e2, 1e5, 1e8}) {
    const std::vector<Triangle> triangles = slivers(random, aspect);
    list.add("S05 sliver_grazing", triangles, grazing_points(random, triangles));
  }
  const std::vector<Triangle> scattered = joined(half_plane(), cases::scattered(6, 1000));
  for (const double offset : {0.0, 1e6}) {
    list.add({moved_case(scattered, half_plane_receivers(), dvec3(offset, -offset, 2 * offset), 1.0)});
  }
  list.add({moved_case(scattered, half_plane_receivers(), dvec3(0.0), 0x1p-60)});
  for (const double slope : {0.0, 1e-7, 0.577}) {
    std::vector<Triangle> card = plate(0);
    for (Triangle& t : card) {
      for (dvec3& p : t) p.y = slope * p.x;
    }
    list.add("S08 coplanar", card, floor_points(15, 2.0));
  }
  const std::vector<Triangle> ball = uv_sphere({0, 0, 0}, 1.0, 16, 32);
  list.add({{"S09 lone_plane_acne", scene_of(ball), surface_receivers(ball, 4e-6, 9), frame_light(), frame_config()}});
}

void add_lights(Catalogue& list) {
  const std::vector<Triangle> plates = joined(plate(2), box({-2, 0.5, -2}, {-1, 1.0, 2}));
  std::vector<dvec3> beyond = random_around(10, 100, {-30, -2, -30}, {30, 3.99, 30});
  beyond.push_back({20, 0, 0.5});
  list.add("S10 behind_light_vertex", through_light_plane(10, 60), beyond);
  list.add("S11 light_in_triangle", std::vector<Triangle>{{dvec3(-0.5, 3, 0), dvec3(0.5, 5, 0), dvec3(0, 4, 1)}},
           floor_points(20, 6.0));
  list.add("S11 light_in_triangle", std::vector<Triangle>{{dvec3(-2, 4, 0), dvec3(2, 4, 0), dvec3(0, 4, 2)}},
           floor_points(20, 6.0));
  list.add("S12 receiver_behind_light", plate(2), {{0, 5, 0}, {3, 4, 0}, {0, 4, 0}, {0, 3.9, 0}, {1, 0, 1}});
  list.add("S13 light_in_box", box({-3, 3, -3}, {3, 4.5, 3}),
           joined_points(floor_points(9, 8.0), random_around(13, 100, {-2.9, 3.01, -2.9}, {2.9, 3.9, 2.9})));
  list.add("S14 inside_room", joined(box({-8, -8, -8}, {8, 8, 8}), box({-1, 0.5, -1}, {1, 1.5, 1})),
           joined_points(floor_points(12, 5.0), random_around(14, 100, dvec3(-7.9), dvec3(7.9))));
  list.add("S15 open_mesh_winding", half_plane(), floor_points(11, 1.0));
  Light point = frame_light(), segment = frame_light(), tiny = frame_light();
  point.shape = LightShape::kPoint;
  segment.v = dvec3(0.0);
  tiny.u *= 0x1p-30;
  tiny.v *= 0x1p-30;
  for (const Light& light : {point, segment, tiny}) list.add("S16 zero_light", plates, floor_points(13, 4.9), light);
  for (const std::uint32_t n : {1u, 65u, 1025u})
    list.add("S17 N_sweep", plates, floor_points(9, 4.0), frame_light(), frame_config(n));
}

void add_tests_on_planes_and_textures(Catalogue& list) {
  list.add("S18 stsv_both_sides", std::vector<Triangle>{{dvec3(0, 1, -1), dvec3(0, 1, 1), dvec3(0, 3, 0)}},
           {{0.5, 0, 0}, {-0.5, 0, 0}});
  list.add("S19 on_plane_div0",
           joined(quad({-2, 0, -2}, {2, 0, -2}, {2, 0, 2}, {-2, 0, 2}),
                  quad({-2, -1, -2}, {2, -1, -2}, {2, -1, 2}, {-2, -1, 2})),
           {{0.5, 0, 0}, {0, 0, 0}, {0.5, -0.5, 0.5}});
  list.add("S20 alpha_ties", alpha_card(0.5f, {0, 0}, {1, 1}), floor_points(9, 1.0));
  list.add("S20 alpha_ties", alpha_card(119.0f / 255.0f, {-3.5, -3.5}, {4.25, 4.25}), floor_points(9, 1.0));
  list.add("S21 fence_minify", bars(), bar_receivers());
  for (const double width : {0.01, 0.05, 0.0625, 0.1}) list.add("S22 wire_sweep", wire(width), wire_receivers(64));
}

}  // namespace

std::vector<StabilityCase> stability_cases() {
  Catalogue list;
  add_geometry(list);
  add_lights(list);
  add_tests_on_planes_and_textures(list);
  return list.take();
}

}  // namespace halfshade::test
