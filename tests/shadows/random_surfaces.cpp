// Connected surfaces, fine and bumpy, with receivers on them and any light: what outlines of patches, certificates of
// closed meshes and shared bounds of neighbouring receivers are for, and where they have been wrong.
#include <doctest/doctest.h>

#include <cmath>
#include <numbers>

#include "support/exact_ways.h"

using namespace halfshade;
using namespace halfshade::test;

namespace {

struct Case {
  std::vector<Triangle> triangles;
  std::vector<Receiver> receivers;
  Light light = frame_light();
  ShadowConfig config;
};

int pick(Random& random, int count) { return static_cast<int>(random.engine() % static_cast<unsigned>(count)); }

/// A wavy sheet; where `unruly`, some of its triangles are wound the other way.
void add_sheet(Random& random, double height, bool unruly, std::vector<Triangle>& triangles) {
  const int side = 8 + pick(random, 28);
  const double reach = random.uniform(0.5, 3.0), wave = random.uniform(0.0, 1.2), turns = random.uniform(0.5, 4.0),
               noise = std::exp2(random.uniform(-12.0, -2.0)), phase = random.uniform(0.0, 6.0);
  std::vector<std::vector<dvec3>> p(side + 1, std::vector<dvec3>(side + 1));
  for (int i = 0; i <= side; ++i) {
    for (int j = 0; j <= side; ++j) {
      const double x = reach * (2.0 * i / side - 1.0), z = reach * (2.0 * j / side - 1.0);
      const double y = wave * std::sin(turns * x + phase) * std::cos(1.3 * turns * z);
      p[i][j] = {x, height + y + random.uniform(-noise, noise), z};
    }
  }
  std::vector<Triangle> flat = sheet(p);
  for (std::size_t t = 1; unruly && t < flat.size(); t += 2) {
    if (pick(random, 20) == 0) std::swap(flat[t][0], flat[t][1]);
  }
  triangles.insert(triangles.end(), flat.begin(), flat.end());
}

/// A closed ball with bumps.
void add_ball(Random& random, std::vector<Triangle>& triangles) {
  const int rings = 6 + pick(random, 16), sectors = 2 * rings;
  const dvec3 center = random.in_box(-2.0, 2.0);
  const double radius = random.uniform(0.1, 1.5), noise = std::exp2(random.uniform(-10.0, -1.0));
  std::vector<std::vector<dvec3>> p(rings + 1, std::vector<dvec3>(sectors, center));
  for (int i = 0; i <= rings; ++i) {
    for (int j = 0; j < sectors; ++j) {
      const double a = std::numbers::pi * i / rings, b = std::numbers::pi * j / rings;
      if (i == 0 || i == rings) {
        p[i][j].y += i == 0 ? radius : -radius;
      } else {
        p[i][j] += radius * (1.0 + random.uniform(-noise, noise)) *
                   dvec3(std::sin(a) * std::cos(b), std::cos(a), std::sin(a) * std::sin(b));
      }
    }
  }
  for (int i = 0; i < rings; ++i) {
    for (int j = 0; j < sectors; ++j) {
      const int next = (j + 1) % sectors;
      if (i > 0) triangles.push_back({p[i][j], p[i][next], p[i + 1][j]});
      if (i < rings - 1) triangles.push_back({p[i + 1][j], p[i][next], p[i + 1][next]});
    }
  }
}

/// Above and below the triangles by any small distance, most of them on a triangle of their own, and on a floor.
void add_receivers(Random& random, Case& c) {
  const double lift = std::exp2(random.uniform(-20.0, -2.0));
  const std::size_t most = std::max<std::size_t>(50, 400'000'000 / c.triangles.size() / c.config.light_sample_count);
  for (std::uint32_t t = 0; t < c.triangles.size() && c.receivers.size() < std::min<std::size_t>(1500, most); ++t) {
    const auto& [a, b, d] = c.triangles[t];
    const dvec3 normal = glm::cross(b - a, d - a);
    const double length = glm::length(normal), s = random.uniform(0.0, 1.0), r = random.uniform(0.0, 1.0 - s);
    if (!(length > 0.0)) continue;
    const double side = pick(random, 2) == 0 ? lift : -lift;
    c.receivers.push_back({a + s * (b - a) + r * (d - a) + side / length * normal, pick(random, 8) == 0 ? kNone : t});
  }
  for (int k = 0; k < 100; ++k)
    c.receivers.push_back({{random.uniform(-3.0, 3.0), -1.5, random.uniform(-3.0, 3.0)}, kNone});
}

Case make_case(std::uint64_t seed) {
  Random random(seed);
  Case c;
  const int kind = pick(random, 3), parts = 1 + pick(random, 3);
  for (int k = 0; k < parts; ++k) {
    if (kind == 2) {
      add_ball(random, c.triangles);
    } else {
      add_sheet(random, k * random.uniform(0.05, 1.0), kind == 1, c.triangles);
    }
  }
  constexpr std::uint32_t kCounts[] = {16, 64, 64, 100, 256, 1024};
  c.config = frame_config(kCounts[pick(random, 6)]);
  c.config.pattern = pick(random, 4) == 0 ? SamplePattern::kStratified : SamplePattern::kRows;
  c.config.sample_sets = pick(random, 3) == 0 ? 4 : 1;
  c.config.seed = static_cast<std::uint32_t>(seed);
  const double size = std::exp2(random.uniform(-4.0, 3.0));
  const bool level = pick(random, 4) == 0;
  const dvec3 u = level ? dvec3(1, 0, 0) : glm::normalize(random.in_box(-1.0, 1.0) + dvec3(0.0, 0.0, 1.5));
  const dvec3 v = level ? dvec3(0, 0, 1) : glm::normalize(glm::cross(u, random.in_box(-1.0, 1.0) + dvec3(1.5, 0, 0)));
  c.light.center = {random.uniform(-3.0, 3.0), random.uniform(1.0, 5.0), random.uniform(-3.0, 3.0)};
  c.light.u = size * u, c.light.v = size * random.uniform(0.2, 1.5) * v;
  c.light.two_sided = pick(random, 2) == 0;
  if (pick(random, 6) == 0) c.light.shape = LightShape::kDisk, c.light.radius = size / 2.0;
  add_receivers(random, c);
  return c;
}

/// Points around the light's centre: anywhere in a ball, in a few clumps, on a line, or all but a few in one place.
std::vector<dvec3> sample_points(Random& random, const dvec3& center, double size) {
  const int kind = pick(random, 4), count = 1 + pick(random, 300);
  const dvec3 axis = random.in_box(-1.0, 1.0);
  std::vector<dvec3> points;
  for (int i = 0; i < count; ++i) {
    const dvec3 p = random.in_box(-0.5, 0.5);
    const double along = random.uniform(-0.5, 0.5);
    switch (kind) {
      case 0:
        points.push_back(center + size * p);
        break;
      case 1:
        points.push_back(center + size * (axis * (static_cast<double>(i % 3) - 1.0) + 0.02 * p));
        break;
      case 2:
        points.push_back(center + size * along * axis);
        break;
      default:
        points.push_back(i < 4 ? center + size * p : center);
    }
  }
  return points;
}

/// A light of any shape and pattern instead.
void change_light(std::uint64_t seed, Case& c) {
  Random random(seed ^ 0x5a5a);
  constexpr SamplePattern kPatterns[] = {SamplePattern::kRows, SamplePattern::kStratified,
                                         SamplePattern::kLowDiscrepancy, SamplePattern::kPoissonDisk};
  c.config.pattern = kPatterns[pick(random, 4)];
  c.config.light_sample_count = std::min<std::uint32_t>(c.config.light_sample_count, 1 + pick(random, 400));
  Light& light = c.light;
  const double size = glm::length(light.u);
  switch (pick(random, 6)) {
    case 0:
      light.shape = LightShape::kSphere, light.radius = size / 2.0;
      break;
    case 1:
      light.shape = LightShape::kEllipsoid;
      light.axes = {0.5 * light.u, 0.5 * light.v, random.uniform(0.01, 1.0) * glm::cross(light.u, light.v) / size};
      break;
    case 2:
      light.shape = LightShape::kSamples, light.points = sample_points(random, light.center, size);
      break;
    case 3:
      light.shape = LightShape::kPoint;
      break;
    case 4:
      light.shape = LightShape::kDisk, light.radius = size / 2.0;
      c.config.rotate_sets = pick(random, 2) == 0;
      break;
    default:
      break;  // the rectangle
  }
}

/// `every`: all exact methods on one case of so many, method exact on all.
void check_cases(std::uint64_t first, std::uint64_t count, std::uint64_t every, bool any_light) {
  for (std::uint64_t seed = first; seed < first + count; ++seed) {
    CAPTURE(seed);
    Case c = make_case(seed);
    if (any_light) change_light(seed, c);
    const Scene scene = scene_of(c.triangles);
    if (seed % every == 0) CHECK(wrong_bits_of_exact_methods(scene, c.receivers, c.light, c.config) == 0);
    const VisibilityMasks truth = solve(scene, c.receivers, c.light, c.config, ShadowMethod::kOracle);
    for (const Beams beams : {Beams::kNever, Beams::kAlways})
      CHECK(wrong_bits(solve_exact_by(beams, scene, c.receivers, c.light, c.config), truth) == 0);
  }
}

}  // namespace

TEST_CASE("random surfaces: the oracle's bits") { check_cases(0, 16, 8, false); }

TEST_CASE("random surfaces: the oracle's bits before lights of any shape") { check_cases(0, 24, 12, true); }

TEST_CASE("random surfaces long: the oracle's bits") { check_cases(1000, 800, 8, false); }

TEST_CASE("random surfaces long: the oracle's bits before lights of any shape") { check_cases(1000, 800, 8, true); }
