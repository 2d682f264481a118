#include "rasterizer/clip.h"

#include "tests/rasterizer/raster_support.h"

using namespace halfshade;
using testing::Random;

namespace {

constexpr ClipVolume kVolume{-16000.0, 16768.0, -16000.0, 16768.0};

// The new points of a clipped triangle: those that are none of its corners.
std::vector<PixelPoint> new_points(const std::array<PixelPoint, 3>& triangle) {
  const ClippedPolygon polygon = clip_triangle(triangle, kVolume);
  std::vector<PixelPoint> points;
  for (std::uint32_t i = 0; i != polygon.count; ++i) {
    const PixelPoint& p = polygon.points[i];
    if (p != triangle[0] && p != triangle[1] && p != triangle[2]) points.push_back(p);
  }
  return points;
}

}  // namespace

TEST_CASE("a triangle inside the clip volume is returned unchanged") {
  const std::array<PixelPoint, 3> triangle = {PixelPoint(1, 2, 1), PixelPoint(90, 4, 2), PixelPoint(5, 60, 3)};
  const ClippedPolygon polygon = clip_triangle(triangle, kVolume);
  CHECK(polygon.count == 3);
  CHECK(!polygon.clipped);
  for (std::uint32_t i = 0; i != 3; ++i) CHECK(polygon.points[i] == triangle[i]);
}

TEST_CASE("a triangle outside one plane disappears and does not count as clipped") {
  const ClippedPolygon behind =
      clip_triangle({PixelPoint(1, 2, -1), PixelPoint(3, 4, -2), PixelPoint(5, 9, 0)}, kVolume);
  CHECK(behind.count == 0);
  CHECK(!behind.clipped);
  CHECK(clip_triangle({PixelPoint(2e4, 2, 1), PixelPoint(3e4, 4, 1), PixelPoint(5e4, 9, 1)}, kVolume).count == 0);
}

TEST_CASE("a corner behind the eye leaves a quadrilateral on the near plane") {
  const ClippedPolygon polygon =
      clip_triangle({PixelPoint(0.01, 0, 1), PixelPoint(0, 0.01, 1), PixelPoint(0, 0, -1)}, kVolume);
  CHECK(polygon.clipped);
  CHECK(polygon.count == 4);
  for (std::uint32_t i = 0; i != polygon.count; ++i) CHECK(polygon.points[i].z >= kNearPlane * (1.0 - 1e-9));
}

TEST_CASE("clipped points lie inside the volume") {
  Random random(5);
  for (int i = 0; i != 100000; ++i) {
    std::array<PixelPoint, 3> triangle;
    for (PixelPoint& p : triangle) {
      p = {random.real(-3e4, 3e4), random.real(-3e4, 3e4), random.real(-1.0, 2.0)};
    }
    const ClippedPolygon polygon = clip_triangle(triangle, kVolume);
    for (std::uint32_t k = 0; k != polygon.count; ++k) {
      const PixelPoint& p = polygon.points[k];
      const double slack = 1e-9;  // px * w
      REQUIRE(p.z >= kNearPlane - 1e-12);
      REQUIRE(p.x >= kVolume.x_min_px * p.z - slack);
      REQUIRE(p.x <= kVolume.x_max_px * p.z + slack);
      REQUIRE(p.y >= kVolume.y_min_px * p.z - slack);
      REQUIRE(p.y <= kVolume.y_max_px * p.z + slack);
    }
  }
}

TEST_CASE("neighbours get the same new point on their shared edge, bit for bit") {
  Random random(6);
  int compared = 0;
  for (int i = 0; i != 10000; ++i) {
    const PixelPoint inside(random.real(0, 100), random.real(0, 100), random.real(0.5, 1.0));
    const PixelPoint outside(random.real(-9e4, 9e4), random.real(-9e4, 9e4), random.real(-1.0, 1.0));
    const PixelPoint other(random.real(0, 100), random.real(0, 100), 0.7);
    const PixelPoint third(random.real(0, 100), random.real(0, 100), 0.9);
    const auto first = new_points({inside, outside, other}), second = new_points({outside, inside, third});
    if (first.empty()) continue;
    bool shared = false;
    for (const PixelPoint& p : first) {
      for (const PixelPoint& q : second) shared = shared || p == q;
    }
    CHECK(shared);
    ++compared;
  }
  CHECK(compared > 5000);
}

TEST_CASE("corners that are not numbers leave nothing") {
  const double nan = std::nan("");
  CHECK(
      clip_triangle({PixelPoint(nan, nan, nan), PixelPoint(nan, nan, nan), PixelPoint(nan, nan, nan)}, kVolume).count ==
      0);
}
