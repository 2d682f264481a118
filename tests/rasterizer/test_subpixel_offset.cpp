// The picture's sampling points moved by a fraction of a pixel.
#include <set>

#include "halfshade/error.h"
#include "raster_support.h"
#include "rasterizer/camera_frame.h"

using namespace halfshade;
using namespace halfshade::testing;

namespace {

constexpr std::uint32_t kSide = 96;

GBuffer render_moved(const LatticeMesh& mesh, const dvec2& offset) {
  GBuffer gbuffer;
  RasterConfig config{kSide, kSide, {}};
  config.subpixel_offset = offset;
  rasterize(mesh, looking_along_minus_z(), config, gbuffer);
  return gbuffer;
}

}  // namespace

TEST_CASE("an offset of zero changes no bit") {
  const LatticeMesh mesh = random_soup(11, 300, 0.2);
  CHECK(same_bits(render_moved(mesh, {0.0, 0.0}), render(mesh, looking_along_minus_z(), kSide, kSide)));
}

TEST_CASE("an offset of whole pixels shows the neighbour's triangle") {
  const LatticeMesh mesh = random_soup(12, 300, 0.2);
  const GBuffer still = render_moved(mesh, {0.0, 0.0}), moved = render_moved(mesh, {1.0, -1.0});
  for (std::uint32_t y = 1; y < kSide; ++y) {
    for (std::uint32_t x = 0; x + 1 < kSide; ++x) {
      REQUIRE(moved.triangle[y * kSide + x] == still.triangle[(y - 1) * kSide + x + 1]);
    }
  }
}

TEST_CASE("surface points lie under the moved centres of their pixels") {
  const LatticeMesh mesh = random_soup(13, 100, 0.5);
  const CameraFrame camera = make_camera_frame(looking_along_minus_z(), LocalFrame(), kSide, kSide);
  for (const dvec2 offset : {dvec2(0.25, -0.375), dvec2(-0.5, 0.49)}) {
    const GBuffer gbuffer = render_moved(mesh, offset);
    std::size_t near = 0, shown = 0;
    for (std::uint32_t i = 0; i < gbuffer.size(); ++i) {
      if (gbuffer.triangle[i] == kNone) continue;
      const PixelPoint p = camera.project(gbuffer.position[i]);
      const double dx = p.x / p.z - (i % kSide + 0.5 + offset.x), dy = p.y / p.z - (i / kSide + 0.5 + offset.y);
      ++shown;
      near += std::fabs(dx) < 1e-9 && std::fabs(dy) < 1e-9;
    }
    CHECK(shown > 5000);
    CHECK(near > shown * 99 / 100);  // outlines are snapped to 1/256 pixel: there, points are clamped to the triangle
  }
}

TEST_CASE("jitter starts in the middle, repeats nowhere and fills the pixel evenly") {
  CHECK(subpixel_jitter(0) == dvec2(0.0));
  std::set<std::pair<double, double>> seen;
  dvec2 sum(0.0);
  for (std::uint32_t i = 0; i < 65536; ++i) {
    const dvec2 p = subpixel_jitter(i);
    REQUIRE((p.x >= -0.5 && p.x < 0.5 && p.y >= -0.5 && p.y < 0.5));
    seen.emplace(p.x, p.y);
    sum += p;
  }
  CHECK(seen.size() == 65536);
  CHECK(std::fabs(sum.x) < 10.0);
  CHECK(std::fabs(sum.y) < 10.0);
}

TEST_CASE("offsets beyond a pixel and not-a-number are refused") {
  const LatticeMesh mesh = random_soup(14, 1, 0.5);
  CHECK_THROWS_AS(render_moved(mesh, {1.5, 0.0}), Error);
  CHECK_THROWS_AS(render_moved(mesh, {0.0, NAN}), Error);
}
