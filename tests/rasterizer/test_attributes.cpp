#include "rasterizer/attributes.h"

#include "tests/rasterizer/raster_support.h"

using namespace halfshade;
using namespace halfshade::testing;

namespace {

// A square facing +z that fills the picture of square_camera(), uv (0, 0) bottom left to (1, 1) top right.
struct TexturedSquare {
  Scene scene;
  LatticeMesh mesh;

  explicit TexturedSquare(const dvec2& uv_offset = dvec2(0.0)) {
    add_quad(mesh, {-0.5, -0.5, 0.0}, {0.5, -0.5, 0.0}, {0.5, 0.5, 0.0}, {-0.5, 0.5, 0.0});
    const vec2 o(uv_offset);
    scene.triangle_uvs = {{o, o + vec2(1, 0), o + vec2(1, 1)}, {o, o + vec2(1, 1), o + vec2(0, 1)}};
    scene.triangle_materials = {0, 0};
    scene.materials.resize(1);
    mesh.scene = &scene;
  }
  TexturedSquare(const TexturedSquare&) = delete;
};

// The square's sides are just outside the picture: tan(half angle) = 0.5 / 1.
Camera square_camera() { return looking_along_minus_z(1.0, 53.13); }

AlphaMap checker() { return {"checker", 2, 2, {255, 0, 0, 255}}; }  // top row: opaque left, clear right

bool all_of_quadrant(const GBuffer& gbuffer, std::uint32_t x0, std::uint32_t y0, bool visible) {
  for (std::uint32_t y = y0; y != y0 + gbuffer.height / 2; ++y) {
    for (std::uint32_t x = x0; x != x0 + gbuffer.width / 2; ++x) {
      if ((gbuffer.triangle[y * gbuffer.width + x] != kNone) != visible) return false;
    }
  }
  return true;
}

void check_checker_is_visible(const TexturedSquare& square) {
  const GBuffer gbuffer = render(square.mesh, square_camera(), 64, 64);
  CHECK(all_of_quadrant(gbuffer, 0, 0, true));
  CHECK(all_of_quadrant(gbuffer, 32, 0, false));
  CHECK(all_of_quadrant(gbuffer, 0, 32, false));
  CHECK(all_of_quadrant(gbuffer, 32, 32, true));
}

}  // namespace

TEST_CASE("the alpha test leaves out samples under clear texels; row 0 of the map is the top") {
  TexturedSquare square;
  square.scene.alpha_maps.push_back(checker());
  square.scene.materials[0].alpha_map = 0;
  check_checker_is_visible(square);
}

TEST_CASE("alpha maps repeat outside 0..1") {
  for (const dvec2 offset : {dvec2(1024.0, -512.0), dvec2(-7.0, 3.0)}) {
    TexturedSquare square(offset);
    square.scene.alpha_maps.push_back(checker());
    square.scene.materials[0].alpha_map = 0;
    check_checker_is_visible(square);
  }
}

TEST_CASE("what lies behind a clear texel is seen") {
  TexturedSquare square;
  square.scene.alpha_maps.push_back(checker());
  square.scene.materials.resize(2);
  square.scene.materials[0].alpha_map = 0;
  add_quad(square.mesh, {-1, -1, -0.5}, {1, -1, -0.5}, {1, 1, -0.5}, {-1, 1, -0.5});
  square.scene.triangle_materials = {0, 0, 1, 1};
  square.scene.triangle_uvs.resize(4);
  const GBuffer gbuffer = render(square.mesh, square_camera(), 64, 64);
  CHECK(gbuffer.triangle[10 * 64 + 10] <= 1);
  CHECK(gbuffer.triangle[10 * 64 + 50] >= 2);
  CHECK(gbuffer.triangle[10 * 64 + 50] != kNone);
}

TEST_CASE("a texel is opaque from the cutoff on") {
  const AlphaMap map{"ramp", 3, 1, {127, 128, 255}};
  CHECK(!is_opaque(map, 0.1, 0.5, 0.5f));
  CHECK(is_opaque(map, 0.5, 0.5, 0.5f));
  CHECK(!is_opaque(map, 0.5, 0.5, 1.0f));
  CHECK(is_opaque(map, 0.9, 0.5, 1.0f));
  CHECK(is_opaque(map, 0.1, 0.5, 0.0f));
}

TEST_CASE("texture coordinates of any size pick a texel inside the map") {
  const AlphaMap map{"grey", 3, 5, std::vector<std::uint8_t>(15, 255)};
  for (const double u : {0.0, -1e-300, 1.0, -1.0, 1e9, -1e9, 1e17, -1e17, 1e300, -1e300, std::nan(""), HUGE_VAL}) {
    CHECK(is_opaque(map, u, u, 0.5f));
    CHECK(is_opaque(map, u, -u, 0.5f));
  }
}

TEST_CASE("texels follow floor(u W) mod W and H - 1 - floor(v H) mod H") {
  AlphaMap map{"numbered", 7, 5, std::vector<std::uint8_t>(35)};
  for (int x = -20; x != 20; ++x) {
    for (int y = -20; y != 20; ++y) {
      const std::uint32_t column = static_cast<std::uint32_t>(((x % 7) + 7) % 7);
      const std::uint32_t row = 4 - static_cast<std::uint32_t>(((y % 5) + 5) % 5);
      map.alpha.assign(35, 0);
      map.alpha[row * 7 + column] = 255;
      REQUIRE(is_opaque(map, (x + 0.5) / 7.0, (y + 0.5) / 5.0, 0.5f));
    }
  }
}

TEST_CASE("albedo is the diffuse colour times the decoded texel") {
  TexturedSquare square;
  square.scene.color_maps.push_back({"flat", 1, 1, {255, 188, 0}});
  square.scene.materials[0].color_map = 0;
  square.scene.materials[0].diffuse = vec3(0.5f, 1.0f, 1.0f);
  const GBuffer gbuffer = render(square.mesh, square_camera(), 8, 8);
  CHECK(gbuffer.albedo[27].x == 0.5f);
  CHECK(gbuffer.albedo[27].y == doctest::Approx(0.50288646).epsilon(1e-6));
  CHECK(gbuffer.albedo[27].z == 0.0f);
}

TEST_CASE("a black diffuse colour beside a colour map counts as white, without one as black") {
  TexturedSquare square;
  square.scene.color_maps.push_back({"flat", 1, 1, {255, 255, 255}});
  square.scene.materials[0].diffuse = vec3(0.0f);
  CHECK(render(square.mesh, square_camera(), 8, 8).albedo[27] == vec3(0.0f));
  square.scene.materials[0].color_map = 0;
  CHECK(render(square.mesh, square_camera(), 8, 8).albedo[27] == vec3(1.0f));
}

TEST_CASE("colour maps are sampled bilinearly, row 0 at the top") {
  TexturedSquare square;
  square.scene.color_maps.push_back({"corners", 2, 2, {255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255}});
  square.scene.materials[0].color_map = 0;
  square.scene.materials[0].diffuse = vec3(1.0f);
  const GBuffer gbuffer = render(square.mesh, looking_along_minus_z(1.0, 53.130102), 64, 64);
  const vec3 top_left = gbuffer.albedo[16 * 64 + 16], bottom_left = gbuffer.albedo[48 * 64 + 16];
  CHECK(top_left.x > 0.95f);
  CHECK(bottom_left.z > 0.95f);
  const vec3 middle = gbuffer.albedo[32 * 64 + 32];
  CHECK(middle.x == doctest::Approx(0.5f).epsilon(0.05));
  CHECK(middle.y == doctest::Approx(0.5f).epsilon(0.05));
}

TEST_CASE("a mesh without a scene is light grey") {
  LatticeMesh mesh;
  add_triangle(mesh, {-1, -1, 0}, {1, -1, 0}, {0, 1, 0});
  CHECK(render(mesh, looking_along_minus_z(1.0), 8, 8).albedo[27] == vec3(0.8f));
}

TEST_CASE("normals are on the camera's side for both windings") {
  for (const bool reversed : {false, true}) {
    LatticeMesh mesh;
    const dvec3 a(-1, -1, 0), b(1, -1, 0), c(0, 1, 0);
    add_triangle(mesh, a, reversed ? c : b, reversed ? b : c);
    const GBuffer gbuffer = render(mesh, looking_along_minus_z(1.0), 8, 8);
    CHECK(gbuffer.geometric_normal[27] == vec3(0.0f, 0.0f, 1.0f));
    CHECK(gbuffer.shading_normal[27] == vec3(0.0f, 0.0f, 1.0f));
  }
}

TEST_CASE("shading normals are interpolated, unit, and flipped with the geometric one") {
  TexturedSquare square;
  const vec3 tilted = glm::normalize(vec3(0.6f, 0.0f, -0.8f));  // points away from the camera
  square.scene.triangle_normals.assign(2, {tilted, tilted, tilted});
  const GBuffer gbuffer = render(square.mesh, square_camera(), 16, 16);
  for (std::size_t i = 0; i != gbuffer.size(); ++i) {
    REQUIRE(glm::length(gbuffer.shading_normal[i] + tilted) < 1e-6f);
    REQUIRE(gbuffer.geometric_normal[i] == vec3(0.0f, 0.0f, 1.0f));
  }
}

TEST_CASE("zero shading normals mean the geometric normal") {
  TexturedSquare square;
  square.scene.triangle_normals.assign(2, {vec3(0.0f), vec3(0.0f), vec3(0.0f)});
  CHECK(render(square.mesh, square_camera(), 8, 8).shading_normal[27] == vec3(0.0f, 0.0f, 1.0f));
}

TEST_CASE("weights are never negative and sum to one, also for rays that miss") {
  Random random(4);
  for (int i = 0; i != 100000; ++i) {
    const std::array<vec3, 3> corners = {vec3(random.point(-1, 1)), vec3(random.point(-1, 1)),
                                         vec3(random.point(-1, 1))};
    const dvec3 eye = random.point(-2, 2);
    const dvec3 weights = make_barycentric_planes(corners, eye).weights(random.point(-1, 1));
    REQUIRE(weights.x >= 0.0);
    REQUIRE(weights.y >= 0.0);
    REQUIRE(weights.z >= 0.0);
    REQUIRE(std::fabs(weights.x + weights.y + weights.z - 1.0) < 1e-15);
  }
}
