// The whole pipeline: picture, window, threads, targets, depth, and inputs that must not hurt.
#include <tbb/task_arena.h>

#include <limits>

#include "halfshade/error.h"
#include "rasterizer/camera_frame.h"
#include "tests/rasterizer/raster_support.h"

using namespace halfshade;
using namespace halfshade::testing;

namespace {

std::size_t visible_samples(const GBuffer& gbuffer) {
  std::size_t count = 0;
  for (const std::uint32_t triangle : gbuffer.triangle) count += triangle != kNone;
  return count;
}

// A soup with the eye inside it, so that the near plane and the guard band cut some triangles.
LatticeMesh surrounding_soup() { return random_soup(7, 3000, 0.15); }
Camera camera_inside() { return looking_along_minus_z(0.5, 75.0); }

GBuffer crop(const GBuffer& whole, const PixelWindow& window) {
  GBuffer part = whole;
  part.window = window;
  const auto copy = [&](const auto& from, auto& to) {
    to.clear();
    for (std::uint32_t y = window.y0; y != window.y1; ++y) {
      const auto row = from.begin() + std::ptrdiff_t{y} * whole.width;
      to.insert(to.end(), row + window.x0, row + window.x1);
    }
  };
  copy(whole.triangle, part.triangle);
  copy(whole.position, part.position);
  copy(whole.geometric_normal, part.geometric_normal);
  copy(whole.shading_normal, part.shading_normal);
  copy(whole.albedo, part.albedo);
  copy(whole.depth, part.depth);
  return part;
}

void check_usage_error(const LatticeMesh& mesh, const Camera& camera, const RasterConfig& config) {
  GBuffer gbuffer;
  try {
    rasterize(mesh, camera, config, gbuffer);
    FAIL_CHECK("no error was thrown");
  } catch (const Error& error) {
    CHECK(error.code() == ErrorCode::kUsage);
  }
  CHECK(gbuffer.size() == 0);
}

}  // namespace

TEST_CASE("no triangles give an empty picture of full size") {
  RasterStats stats;
  const GBuffer gbuffer = render(LatticeMesh{}, Camera{}, 70, 33, {}, &stats);
  CHECK(gbuffer.size() == 70u * 33u);
  CHECK(gbuffer.position.size() == gbuffer.size());
  CHECK(visible_samples(gbuffer) == 0);
  CHECK(stats.triangles_in == 0);
  CHECK(stats.tile_entries == 0);
}

TEST_CASE("up is towards row 0 and right is towards higher columns") {
  LatticeMesh mesh;
  add_triangle(mesh, {0.2, 0.2, 0.0}, {0.5, 0.2, 0.0}, {0.2, 0.5, 0.0});
  const GBuffer gbuffer = render(mesh, looking_along_minus_z(), 64, 64);
  std::size_t upper_right = 0;
  for (std::uint32_t y = 0; y != 32; ++y) {
    for (std::uint32_t x = 32; x != 64; ++x) upper_right += gbuffer.triangle[y * 64 + x] == 0;
  }
  CHECK(upper_right > 10);
  CHECK(upper_right == visible_samples(gbuffer));
}

TEST_CASE("the field of view is vertical and pixels are square") {
  LatticeMesh mesh;  // a square that fills the picture's height exactly: tan(30 deg) = half side / distance
  const double s = 0.57735;
  add_quad(mesh, {-s, -s, 0.0}, {s, -s, 0.0}, {s, s, 0.0}, {-s, s, 0.0});
  const GBuffer gbuffer = render(mesh, looking_along_minus_z(1.0, 60.0), 200, 100);
  CHECK(visible_samples(gbuffer) == 100u * 100u);
  CHECK(gbuffer.triangle[50 * 200 + 49] == kNone);
  CHECK(gbuffer.triangle[50 * 200 + 50] != kNone);
}

TEST_CASE("positions lie on their triangle and on the ray through the sample's centre") {
  const LatticeMesh mesh = random_soup(3, 400, 0.4);
  const Camera camera = looking_along_minus_z(2.5, 50.0);
  const GBuffer gbuffer = render(mesh, camera, 160, 120);
  const CameraFrame frame = make_camera_frame(camera, mesh.frame, 160, 120);
  double worst_plane = 0.0, worst_px = 0.0;
  for (std::uint32_t i = 0; i != gbuffer.size(); ++i) {
    if (gbuffer.triangle[i] == kNone) continue;
    const auto corners = mesh.corners(gbuffer.triangle[i]);
    const dvec3 a(corners[0]), n = glm::cross(dvec3(corners[1]) - a, dvec3(corners[2]) - a);
    worst_plane = std::max(worst_plane, std::fabs(glm::dot(n, gbuffer.position[i] - a)) / glm::length(n));
    const PixelPoint p = frame.project(gbuffer.position[i]);
    const double dx = p.x / p.z - (i % 160 + 0.5), dy = p.y / p.z - (i / 160 + 0.5);
    worst_px = std::max({worst_px, std::fabs(dx), std::fabs(dy)});
    REQUIRE(gbuffer.depth[i] == doctest::Approx(p.z).epsilon(1e-6));
  }
  CHECK(visible_samples(gbuffer) > 5000);
  CHECK(worst_plane < 1e-12);
  CHECK(worst_px < 0.006);  // a sample beside the true outline, covered by the snapped one, is moved onto it
}

TEST_CASE("a ground plane that passes under and behind the eye is drawn in the right place") {
  LatticeMesh mesh;
  add_quad(mesh, {-1.0, -0.25, -1.0}, {1.0, -0.25, -1.0}, {1.0, -0.25, 1.0}, {-1.0, -0.25, 1.0});
  const Camera camera = looking_along_minus_z(0.0, 90.0);
  RasterStats stats;
  const GBuffer gbuffer = render(mesh, camera, 128, 128, {}, &stats);
  CHECK(stats.triangles_clipped == 2);
  const CameraFrame frame = make_camera_frame(camera, mesh.frame, 128, 128);
  for (std::uint32_t i = 0; i != gbuffer.size(); ++i) {
    const dvec3 ray = frame.ray(i % 128 + 0.5, i / 128 + 0.5);
    const dvec3 hit = ray * (ray.y < 0.0 ? -0.25 / ray.y : 0.0);
    const double inside = ray.y < 0.0 ? 1.0 - std::max(std::fabs(hit.x), std::fabs(hit.z)) : -1.0;
    if (inside < -0.01) REQUIRE(gbuffer.triangle[i] == kNone);
    if (inside < 0.01) continue;
    REQUIRE(gbuffer.triangle[i] != kNone);
    REQUIRE(glm::length(gbuffer.position[i] - hit) < 1e-12);
    REQUIRE(gbuffer.geometric_normal[i] == vec3(0.0f, 1.0f, 0.0f));
  }
}

TEST_CASE("from inside a closed box every sample shows a wall") {
  LatticeMesh mesh;
  const dvec3 p[8] = {{-.5, -.5, -.5}, {.5, -.5, -.5}, {-.5, .5, -.5}, {.5, .5, -.5},
                      {-.5, -.5, .5},  {.5, -.5, .5},  {-.5, .5, .5},  {.5, .5, .5}};
  for (const auto& f : {std::array{0, 1, 3, 2}, {4, 6, 7, 5}, {0, 4, 5, 1}, {2, 3, 7, 6}, {0, 2, 6, 4}, {1, 5, 7, 3}}) {
    add_quad(mesh, p[f[0]], p[f[1]], p[f[2]], p[f[3]]);
  }
  Random random(8);
  for (int i = 0; i != 30; ++i) {
    Camera camera;
    camera.eye = random.point(-0.4999, 0.4999);
    camera.target = random.point(-0.5, 0.5);
    camera.fov_y_deg = random.real(20.0, 150.0);
    const GBuffer gbuffer = render(mesh, camera, 100, 90);
    CAPTURE(i);
    CHECK(visible_samples(gbuffer) == gbuffer.size());
  }
}

TEST_CASE("a window shows the same bits as the crop of the whole picture") {
  const LatticeMesh mesh = surrounding_soup();
  const GBuffer whole = render(mesh, camera_inside(), 301, 203);
  for (const PixelWindow window :
       {PixelWindow{0, 301, 0, 203}, {13, 14, 17, 18}, {63, 65, 0, 203}, {5, 290, 70, 131}}) {
    CAPTURE(window.x0);
    CHECK(same_bits(render(mesh, camera_inside(), 301, 203, window), crop(whole, window)));
  }
}

TEST_CASE("any number of threads gives the same bits") {
  const LatticeMesh mesh = random_soup(9, 40000, 0.03);  // several chunks
  std::vector<GBuffer> pictures;
  std::vector<RasterStats> stats(3);
  for (const int threads : {1, 2, 7}) {
    tbb::task_arena arena(threads);
    arena.execute([&] { pictures.push_back(render(mesh, camera_inside(), 300, 200, {}, &stats[pictures.size()])); });
  }
  for (std::size_t i = 1; i != 3; ++i) {
    CHECK(same_bits(pictures[0], pictures[i]));
    CHECK(std::memcmp(&stats[0], &stats[i], sizeof(RasterStats)) == 0);
  }
}

TEST_CASE("any instruction set gives the same bits") {
  const LatticeMesh mesh = surrounding_soup();
  const GBuffer expected = render(mesh, camera_inside(), 301, 203);
  for_each_target([&] { CHECK(same_bits(render(mesh, camera_inside(), 301, 203), expected)); });
}

TEST_CASE("a G-buffer can be used again for a smaller picture") {
  const LatticeMesh mesh = surrounding_soup();
  GBuffer gbuffer;
  rasterize(mesh, camera_inside(), {301, 203, {}}, gbuffer);
  rasterize(mesh, camera_inside(), {97, 55, {}}, gbuffer);
  CHECK(same_bits(gbuffer, render(mesh, camera_inside(), 97, 55)));
}

TEST_CASE("the visible triangle is the nearest one the ray meets") {
  const LatticeMesh mesh = random_soup(10, 300, 0.5);
  const Camera camera = looking_along_minus_z(2.5, 50.0);
  const GBuffer gbuffer = render(mesh, camera, 96, 96);
  const CameraFrame frame = make_camera_frame(camera, mesh.frame, 96, 96);
  std::size_t different = 0;
  for (std::uint32_t i = 0; i != gbuffer.size(); ++i) {
    const dvec3 ray = frame.ray(i % 96 + 0.5, i / 96 + 0.5);
    double nearest = std::numeric_limits<double>::infinity();
    std::uint32_t triangle = kNone;
    for (std::uint32_t t = 0; t != mesh.triangles.size(); ++t) {
      const auto c = mesh.corners(t);
      const dvec3 a = dvec3(c[0]) - frame.eye, b = dvec3(c[1]) - frame.eye, d = dvec3(c[2]) - frame.eye;
      const double u = glm::dot(ray, glm::cross(a, b)), v = glm::dot(ray, glm::cross(b, d));
      const double w = glm::dot(ray, glm::cross(d, a)), determinant = u + v + w;
      if (!((u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0))) continue;
      const double depth = glm::dot(a, glm::cross(b, d)) / determinant;
      if (depth >= nearest) continue;
      nearest = depth;
      triangle = t;
    }
    different += triangle != gbuffer.triangle[i];
  }
  CHECK(different < 20);  // of 9216: samples within 1/256 px of an outline
}

TEST_CASE("of triangles at equal depth the first one wins, whatever their winding") {
  const std::array<dvec3, 3> p = {dvec3(-0.7, -0.6, 0.1), dvec3(0.8, -0.5, -0.3), dvec3(0.1, 0.9, 0.2)};
  for (int order = 0; order != 4; ++order) {
    LatticeMesh mesh;
    add_triangle(mesh, p[order % 3], p[(order + 1) % 3], p[(order + 2) % 3]);
    add_triangle(mesh, p[0], p[1], p[2]);
    add_triangle(mesh, p[1], p[0], p[2]);
    const GBuffer gbuffer = render(mesh, looking_along_minus_z(), 200, 200);
    CHECK(visible_samples(gbuffer) > 5000);
    for (const std::uint32_t triangle : gbuffer.triangle) REQUIRE((triangle == 0 || triangle == kNone));
  }
}

TEST_CASE("triangles without area, behind the eye or seen edge-on change nothing") {
  LatticeMesh good = random_soup(11, 50, 0.5), mesh = good;
  add_triangle(mesh, {0.1, 0.1, 0.1}, {0.1, 0.1, 0.1}, {0.1, 0.1, 0.1});
  add_triangle(mesh, {-0.5, -0.5, 0.5}, {0.0, 0.0, 0.5}, {0.5, 0.5, 0.5});  // collinear
  add_triangle(mesh, {-0.5, 0.0, 3.0}, {0.5, 0.0, 3.0}, {0.0, 1.0, 2.5});   // behind the eye
  add_triangle(mesh, {0.0, -0.5, 0.5}, {0.0, 0.5, 0.5}, {0.0, 0.0, -0.5});  // its plane holds the eye
  add_triangle(mesh, {0.0, 0.0, 2.0}, {0.5, 0.0, 3.0}, {0.0, 0.5, 3.0});    // touches the eye from behind
  mesh.triangles.push_back({0, 0, 1});
  RasterStats stats;
  const GBuffer gbuffer = render(mesh, looking_along_minus_z(), 128, 128, {}, &stats);
  CHECK(same_bits(gbuffer, render(good, looking_along_minus_z(), 128, 128)));
  CHECK(stats.triangles_in == 56);
  CHECK(stats.triangles_binned <= 50);
}

TEST_CASE("statistics count samples before the depth test") {
  LatticeMesh mesh;
  for (const double z : {0.0, 0.25, -0.25}) add_quad(mesh, {-1, -1, z}, {1, -1, z}, {1, 1, z}, {-1, 1, z});
  RasterStats stats;
  render(mesh, looking_along_minus_z(1.0, 40.0), 128, 64, {}, &stats);
  CHECK(stats.triangles_in == 6);
  CHECK(stats.triangles_binned == 6);
  CHECK(stats.samples_covered == 3u * 128u * 64u);
  CHECK(stats.tile_entries >= 6);
}

TEST_CASE("a degenerate camera is a usage error and nothing is written") {
  const LatticeMesh mesh = random_soup(12, 3, 0.5);
  const double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
  std::vector<Camera> cameras(10, looking_along_minus_z());
  cameras[0].target = cameras[0].eye;
  cameras[1].up = {0.0, 0.0, -3.0};
  cameras[2].up = {0.0, 0.0, 0.0};
  cameras[3].fov_y_deg = 0.0;
  cameras[4].fov_y_deg = 180.0;
  cameras[5].fov_y_deg = nan;
  cameras[6].eye.x = nan;
  cameras[7].target.y = infinity;
  cameras[8].up.z = nan;
  cameras[9].fov_y_deg = 1e-320;
  for (const Camera& camera : cameras) check_usage_error(mesh, camera, {64, 64, {}});
}

TEST_CASE("sizes and windows out of range are usage errors") {
  const LatticeMesh mesh = random_soup(12, 3, 0.5);
  for (const RasterConfig& config : {RasterConfig{0, 64, {}},
                                     {64, 0, {}},
                                     {16385, 64, {}},
                                     {64, 16385, {}},
                                     {64, 64, {0, 65, 0, 64}},
                                     {64, 64, {0, 64, 10, 10}},
                                     {64, 64, {9, 8, 0, 64}},
                                     {64, 64, {0, 64, 63, 65}}}) {
    check_usage_error(mesh, looking_along_minus_z(), config);
  }
}

TEST_CASE("the widest picture is drawn to its last column") {
  LatticeMesh mesh;
  add_quad(mesh, {-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0});
  const GBuffer gbuffer = render(mesh, looking_along_minus_z(0.0001, 1.0), 16384, 3);
  CHECK(visible_samples(gbuffer) == 16384u * 3u);
}
