// The sun: a direction and an angle that become a disk with a place.
#include <doctest/doctest.h>

#include <cmath>
#include <limits>

#include "support/lit_picture.h"
#include "support/lit_scene.h"

using namespace halfshade;
using namespace halfshade::test;

namespace {

constexpr double kPi = 3.14159265358979323846;

Light sun(const dvec3& direction, double angular_diameter_deg = 0.533) {
  Light light;
  light.shape = LightShape::kSun;
  light.normal = direction;
  light.angular_diameter_deg = angular_diameter_deg;
  return light;
}

double degrees_between(const dvec3& a, const dvec3& b) {
  return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b)) * 180.0 / kPi;
}

/// Share of a disk of radius 1 that lies at x < edge.
double share_of_disk(double edge) {
  if (std::fabs(edge) >= 1.0) return edge > 0.0 ? 1.0 : 0.0;
  return (kPi / 2.0 + std::asin(edge) + edge * std::sqrt(1.0 - edge * edge)) / kPi;
}

}  // namespace

TEST_CASE("a placed sun shows its diameter, and its centre within 0.014 degrees of its direction, all over the box") {
  const dvec3 low(-3.0, 100.0, 7.0), high(5.0, 101.0, 9.0), direction(0.3, -2.0, 1.0);
  for (const double diameter : {0.533, 10.0, 60.0}) {
    const Light disk = place_sun(sun(direction, diameter), low, high);
    CHECK(disk.shape == LightShape::kDisk);
    CHECK_FALSE(disk.two_sided);
    const dvec3 middle = (low + high) * 0.5;
    CHECK(degrees_between(middle - disk.center, direction) < 1e-9);
    const dvec3 rim = disk.center + disk.radius * glm::normalize(glm::cross(direction, dvec3(1, 0, 0)));
    CHECK(2.0 * degrees_between(rim - middle, disk.center - middle) == doctest::Approx(diameter).epsilon(1e-9));
    for (int corner = 0; corner < 8; ++corner) {
      const dvec3 p(corner & 1 ? high.x : low.x, corner & 2 ? high.y : low.y, corner & 4 ? high.z : low.z);
      CHECK(degrees_between(p - disk.center, direction) < 0.014);
    }
  }
}

TEST_CASE("a plate's edge hides the part of the sun that geometry says, where parallel light puts it") {
  // The plate's edge is the z axis moved to height 2; it covers x < 0. The sun stands 30 degrees from the zenith.
  const double height = 2.0, slope = std::tan(kPi / 6.0), diameter = 0.533 * kPi / 180.0;
  const Scene scene = scene_of(quad({-20, height, -20}, {0, height, -20}, {0, height, 20}, {-20, height, 20}));
  const Light disk = place_sun(sun({-slope, -1.0, 0.0}), {-20, 0, -20}, {20, height, 20});
  // A receiver at x sees the edge at an angle from the zenith; the sun's disk spans its diameter around 30 degrees.
  std::vector<dvec3> points;
  const double shadow_edge = -slope * height, penumbra = diameter * height / (std::cos(kPi / 6) * std::cos(kPi / 6));
  for (int i = -12; i <= 12; ++i) points.push_back({shadow_edge + penumbra * 0.05 * i, 0.0, 0.5});
  const VisibilityMasks masks =
      solve(scene, receivers_at(points), disk, frame_config(1024), ShadowMethod::kExact, nullptr);
  for (std::size_t i = 0; i < points.size(); ++i) {
    CAPTURE(i);
    const double edge_angle = std::atan2(-points[i].x, height);  // from the zenith towards +x, where the sun stands
    const double hidden = share_of_disk((edge_angle - kPi / 6.0) / (diameter * 0.5));
    CHECK(std::fabs(masks.visibility(i) - (1.0 - hidden)) < 0.02);
  }
}

TEST_CASE("all exact methods give the oracle's bits under the sun") {
  Random random(11);
  const Scene scene = scene_of(joined(random_triangles(random, 60, 0.7, -2.0, 2.0), box({-1, -2, -1}, {0.5, 0, 0.5})));
  const auto receivers = receivers_at(random_points(random, 200, -2.5, 2.5));
  for (const double diameter : {0.533, 20.0}) {
    const Light disk = place_sun(sun({0.4, -1.0, 0.2}, diameter), dvec3(-2.5), dvec3(2.5));
    for (const SamplePattern pattern : {SamplePattern::kRows, SamplePattern::kUniform}) {
      ShadowConfig config = frame_config(100);
      config.pattern = pattern;
      CHECK(wrong_bits_of_exact_methods(scene, receivers, disk, config) == 0);
    }
  }
}

TEST_CASE("a far sun does not lift a picture's receivers far off their surface") {
  const Scene scene =
      scene_of(joined(box({-1, 0, -1}, {1, 1, 1}), quad({-4, 0, 4}, {4, 0, 4}, {4, 0, -4}, {-4, 0, -4})));
  const Light disk = place_sun(sun({0.5, -1.0, 0.3}), {-4, 0, -4}, {4, 1, 4});
  Camera camera;
  camera.eye = {0, 6, 9};
  const LitPicture picture = make_lit_picture(scene, camera, disk, frame_config(16));
  REQUIRE(picture.receivers.size() > 500);
  const double scale = picture.mesh.frame.scale;
  for (std::size_t i = 0; i < picture.receivers.size(); ++i) {
    if (picture.receivers.triangle[i] < 12) continue;  // the floor
    const dvec3 p(picture.receivers.position[i]);
    const double lift = picture.mesh.frame.to_world(p).y;
    REQUIRE(lift > 0.0);
    REQUIRE(lift * scale <= 1.1 * kReceiverOffsetOfScene * 8.0 * scale);
  }
}

TEST_CASE("suns without a place, a direction or a sensible size are refused, other lights are left alone") {
  const Scene scene = scene_of(quad({-1, 2, -1}, {1, 2, -1}, {1, 2, 1}, {-1, 2, 1}));
  CHECK_THROWS_WITH_AS(solve(scene, receivers_at({{0, 0, 0}}), sun({0, -1, 0}), frame_config(), ShadowMethod::kExact),
                       doctest::Contains("place_sun"), Error);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::pair<Light, const char*> bad[] = {{sun({0, 0, 0}), "direction"},
                                               {sun({0, nan, 0}), "direction"},
                                               {sun({0, -1, 0}, 0.0), "0.000000 is not above 0"},
                                               {sun({0, -1, 0}, 60.1), "up to 60"},
                                               {sun({0, -1, 0}, nan), "up to 60"}};
  for (const auto& [light, what] : bad) {
    CHECK_THROWS_WITH_AS(place_sun(light, dvec3(0), dvec3(1)), doctest::Contains(what), Error);
  }
  CHECK_THROWS_WITH_AS(place_sun(sun({0, -1, 0}), dvec3(0), dvec3(std::numeric_limits<double>::infinity())),
                       doctest::Contains("box"), Error);
  CHECK(place_sun(sun({0, -1e300, 0}), dvec3(2), dvec3(2)).center == dvec3(2, 2 + kSunDistance, 2));
  CHECK(place_sun(frame_light(), dvec3(0), dvec3(1)).shape == LightShape::kRectangle);
  CHECK(place_sun(frame_light(), dvec3(0), dvec3(1)).center == frame_light().center);
}
