#include <cmath>
#include <random>

#include "rasterizer/io/image.h"
#include "rasterizer/io/obj_scene.h"
#include "scratch.h"

namespace halfshade {
namespace {

using test::Scratch;

Scene load_text(std::string_view text, const ObjLoadOptions& options = {}) {
  const Scratch scratch;
  ObjLoadReport report;
  return load_obj(scratch.write("a.obj", text), options, report);
}

constexpr const char* kTriangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

TEST_CASE("a triangle loads with all four forms of corner") {
  const Scene scene =
      load_text(std::string(kTriangle) +
                "vt 0.25 0.5\nvn 0 0 2\nf 1 2 3\nf 1/1 2/1 3/1\nf 1//1 2//1 3//1\nf -3/-1/-1 -2/-1/-1 -1/-1/-1\n");
  REQUIRE(scene.triangles.size() == 4);
  for (const auto& triangle : scene.triangles) CHECK(triangle == std::array<std::uint32_t, 3>{0, 1, 2});
  CHECK(scene.triangle_uvs[0][1] == vec2(0.0f));
  CHECK(scene.triangle_uvs[1][1] == vec2(0.25f, 0.5f));
  CHECK(scene.triangle_normals[1][0] == vec3(0.0f));
  CHECK(scene.triangle_normals[3][2] == vec3(0.0f, 0.0f, 1.0f));
}

TEST_CASE("a scene without vt and vn has neither uvs nor normals") {
  const Scene scene = load_text(std::string(kTriangle) + "f 1 2 3\n");
  CHECK(scene.triangle_uvs.empty());
  CHECK(scene.triangle_normals.empty());
  REQUIRE(scene.materials.size() == 1);
  CHECK(scene.materials[0].name == "default");
  CHECK(scene.triangle_materials == std::vector<std::uint32_t>{0});
}

TEST_CASE("byte order mark, CR line ends, continued lines, comments and a missing last newline are accepted") {
  CHECK(load_text("\xef\xbb\xbfv 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\nf 1 2 3").triangles.size() == 1);
  CHECK(load_text("v 0 0 0\rv 1 0 0\rv 0 1 0\rf 1 2 3\r").triangles.size() == 1);
  CHECK(load_text("v 0 \\\n0 0\nv 1 0 0 # one\nv 0 1 \\\r\n 0\n# C:\\scenes\\\nf 1 \\\n2 \\\n3\n").triangles.size() ==
        1);
}

TEST_CASE("grouping, lines, colours, weights and tiny numbers are accepted") {
  const Scene scene =
      load_text("o a\ng b c\ns off\nv 0 0 0 1\nv 1 0 0 0.5 0.5 0.5\nv +0 1e-400 1\nl 1 2\np 1\nf 1 2 3\n");
  CHECK(scene.positions[2] == dvec3(0.0, 0.0, 1.0));
}

TEST_CASE("positions are read to the last bit") {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> uniform(-1000.0, 1000.0);
  std::string text;
  std::vector<double> expected;
  for (int i = 0; i < 3000; ++i) {
    char number[40];
    expected.push_back(uniform(random));
    std::snprintf(number, sizeof number, "%.17g", expected.back());
    text += (i % 3 == 0 ? "\nv " : " ") + std::string(number);
  }
  const Scene scene = load_text(text + "\nf 1 2 3\n");
  REQUIRE(scene.positions.size() == 1000);
  for (std::size_t i = 0; i < 3000; ++i) REQUIRE(scene.positions[i / 3][static_cast<int>(i % 3)] == expected[i]);
}

TEST_CASE("bit-equal positions are welded in order of first appearance, and -0 equals 0") {
  const Scratch scratch;
  ObjLoadReport report;
  const Scene scene = load_obj(
      scratch.write("a.obj", "v 5 0 0\nv 1 0 0\nv 5 -0 0\nv 5.000000000000001 0 0\nv 1 0 0\nf 3 5 4\n"), {}, report);
  CHECK(scene.positions == std::vector<dvec3>{{5, 0, 0}, {1, 0, 0}, {5.000000000000001, 0, 0}});
  CHECK(scene.triangles[0] == std::array<std::uint32_t, 3>{0, 1, 2});
  CHECK(report.welded_vertices == 2);
}

TEST_CASE("welding many vertices keeps every position") {
  std::string text;
  for (int i = 0; i < 20000; ++i) text += "v " + std::to_string(i % 5000) + " 0 " + std::to_string(i % 7) + "\n";
  const Scene scene = load_text(text + "f 1 2 20000\n");
  CHECK(scene.positions.size() == 20000);
  CHECK(scene.positions[19999] == dvec3(4999, 0, 19999 % 7));
  const Scene twice = load_text(text + text + "f 1 2 40000\n");
  CHECK(twice.positions.size() == 20000);
  CHECK(twice.triangles[0][2] == 19999);
}

TEST_CASE("texture coordinates lie on the grid of 2^-32") {
  const Scene scene =
      load_text(std::string(kTriangle) + "vt 0.1 1e-20\nvt -0 1000.123\nvt 1e-5 -3e-7\nf 1/1 2/2 3/3\n");
  for (const vec2& uv : scene.triangle_uvs[0]) {
    for (const double x : {double{uv.x}, double{uv.y}}) CHECK(std::fmod(x * 0x1p32, 1.0) == 0.0);
  }
  CHECK(scene.triangle_uvs[0][0] == vec2(0.1f, 0.0f));
  CHECK(std::signbit(scene.triangle_uvs[0][1].x) == false);
  CHECK(double{scene.triangle_uvs[0][2].x} == doctest::Approx(1e-5).epsilon(1e-4));
}

TEST_CASE("normals are normalised, and a zero normal means none") {
  const Scene scene = load_text(std::string(kTriangle) + "vn 3 0 4\nvn 0 0 0\nvn 1e30 0 0\nf 1//1 2//2 3//3\n");
  CHECK(scene.triangle_normals[0][0] == vec3(0.6f, 0.0f, 0.8f));
  CHECK(scene.triangle_normals[0][1] == vec3(0.0f));
  CHECK(scene.triangle_normals[0][2] == vec3(1.0f, 0.0f, 0.0f));
}

TEST_CASE("zero-area triangles are kept and counted") {
  const Scratch scratch;
  ObjLoadReport report;
  const Scene scene =
      load_obj(scratch.write("a.obj", "v 0 0 0\nv 1 1 1\nv 2 2 2\nv 0 1 0\nf 1 2 3\nf 1 1 2\nf 1 2 4\n"), {}, report);
  CHECK(scene.triangles.size() == 3);
  CHECK(report.zero_area_triangles == 2);
}

TEST_CASE("materials carry Kd, d, Tr and Tf, one after the other without influence") {
  const Scratch scratch;
  scratch.write("m.mtl",
                "# materials\nnewmtl a b\nKd 0.1 0.2 0.3\nd 0.25\nTf 0.5 0.6 0.7\nKs 1 1 1\nnewmtl grey\nKd 0.5\nTr "
                "0.25\nnewmtl plain\nillum 2\n");
  const auto obj =
      scratch.write("a.obj", std::string("mtllib m.mtl\n") + kTriangle +
                                 "f 1 2 3\nusemtl a b\nf 1 2 3\nusemtl grey\nf 1 2 3\nusemtl plain\nf 1 2 3\n");
  ObjLoadReport report;
  const Scene scene = load_obj(obj, {}, report);
  CHECK(report.warnings.empty());
  REQUIRE(scene.materials.size() == 4);
  CHECK(scene.materials[0].name == "a b");
  CHECK(scene.materials[0].diffuse == vec3(0.1f, 0.2f, 0.3f));
  CHECK(scene.materials[0].opacity == 0.25f);
  CHECK(scene.materials[0].transmittance == vec3(0.5f, 0.6f, 0.7f));
  CHECK(scene.materials[1].diffuse == vec3(0.5f));
  CHECK(scene.materials[1].opacity == 0.75f);
  CHECK(scene.materials[2].diffuse == Material{}.diffuse);
  CHECK(scene.materials[2].opacity == 1.0f);
  CHECK(scene.materials[1].transmittance == vec3(1.0f));
  CHECK(scene.triangle_materials == std::vector<std::uint32_t>{3, 0, 1, 2});
  CHECK(scene.materials[0].translucent());
  CHECK_FALSE(scene.materials[2].translucent());
}

TEST_CASE("map_Tf is a colour map of what passes, and makes a material clear unless d or Tr says otherwise") {
  const Scratch scratch;
  const std::vector<std::uint8_t> codes = {255, 0, 0, 10, 20, 30};
  std::vector<float> values;
  for (const std::uint8_t code : codes) values.push_back(static_cast<float>(code) / 255.0f);
  write_png(scratch.path("glass.png"), 2, 1, 3, values, false, 8, {});
  scratch.write("m.mtl",
                "newmtl pane\nmap_Kd glass.png\nmap_Tf glass.png\nnewmtl dim\nTr 0.25\nTf 0.5\nmap_Tf -clamp off "
                "glass.png\nnewmtl shut\nd 1\nmap_Tf glass.png\nnewmtl plain\n");
  const auto obj = scratch.write(
      "a.obj", std::string("mtllib m.mtl\n") + kTriangle + "vt 0 0\nusemtl pane\nf 1/1 2/1 3/1\nusemtl dim\nf 1 2 3\n");
  ObjLoadReport report;
  const Scene scene = load_obj(obj, {}, report);
  CHECK(report.warnings.empty());
  REQUIRE(scene.materials.size() == 4);
  REQUIRE(scene.color_maps.size() == 1);
  CHECK(scene.color_maps[0].rgb == codes);
  CHECK(scene.materials[0].transmittance_map == 0);
  CHECK(scene.materials[0].color_map == 0);
  CHECK(scene.materials[0].opacity == 0.0f);
  CHECK(scene.materials[1].transmittance_map == 0);
  CHECK(scene.materials[1].opacity == 0.75f);
  CHECK(scene.materials[1].transmittance == vec3(0.5f));
  CHECK_FALSE(scene.materials[2].translucent());
  CHECK(scene.materials[3].transmittance_map == kNone);
}

TEST_CASE("missing libraries, materials and textures are listed together, and are errors when strict") {
  const Scratch scratch;
  scratch.write("m.mtl", "newmtl a\nmap_Kd gone.png\nmap_d -clamp on sub\\also gone.png\nmap_Tf lost.png\n");
  const auto obj = scratch.write(
      "a.obj", std::string("mtllib m.mtl none.mtl\nusemtl a\n") + kTriangle + "f 1 2 3\nusemtl b\nf 1 2 3\n");
  ObjLoadReport report;
  const Scene scene = load_obj(obj, {}, report);
  CHECK(report.missing.size() == 5);
  CHECK(scene.materials[0].transmittance_map == kNone);
  CHECK(scene.materials[0].color_map == kNone);
  CHECK(scene.materials[0].alpha_map == kNone);
  CHECK(scene.triangle_materials == std::vector<std::uint32_t>{0, 1});
  const auto outcome = test::outcome_of([&] { load_obj(obj, {.strict = true}, report); });
  REQUIRE(outcome.threw);
  CHECK(outcome.code == ErrorCode::kBadInput);
  for (const char* what : {"none.mtl", "'gone.png'", "also gone.png", "lost.png", "material 'b'"})
    CHECK(outcome.has(what));
}

TEST_CASE("a file named without a directory finds what lies beside it, and what is missing is missing") {
  const Scratch scratch;
  scratch.write("m.mtl", "newmtl a\nmap_Kd gone.png\n");
  scratch.write("a.obj", std::string("mtllib m.mtl none.mtl\nusemtl a\n") + kTriangle + "f 1 2 3\n");
  const auto old = std::filesystem::current_path();
  std::filesystem::current_path(scratch.path());
  ObjLoadReport report;
  const auto outcome = test::outcome_of([&] { load_obj("a.obj", {}, report); });
  std::filesystem::current_path(old);
  CAPTURE(outcome.message);
  CHECK_FALSE(outcome.threw);
  CHECK(report.missing.size() == 2);
}

TEST_CASE("a wrong number in a library is an error with its line, and a warning when lenient") {
  for (const std::string line :
       {"Kd 0,5 1 1", "Kd nan 0 0", "Kd 1 2", "Kd -1 0 0", "d 2", "d", "Tf 1e400 0 0", "Kd spectral a.rfl"}) {
    CAPTURE(line);
    const Scratch scratch;
    scratch.write("m.mtl", "newmtl a\n" + line + "\n");
    const auto obj = scratch.write("a.obj", std::string("mtllib m.mtl\nusemtl a\n") + kTriangle + "f 1 2 3\n");
    ObjLoadReport report;
    const auto outcome = test::outcome_of([&] { load_obj(obj, {}, report); });
    CHECK(outcome.threw);
    CHECK(outcome.has("m.mtl:2: "));
    load_obj(obj, {.lenient = true}, report);
    CHECK(report.warnings.size() == 1);
  }
}

TEST_CASE("a texture used twice is loaded once, and map_d takes the luminance of a picture without alpha") {
  const Scratch scratch;
  const std::vector<float> pixels = {0, 0, 0, 1, 1, 1, 1, 0, 0, 0.25f, 0.25f, 0.25f};
  write_png(scratch.path("t.png"), 2, 2, 3, pixels, false, 8, {});
  scratch.write("m.mtl", "newmtl a\nmap_Kd t.png\nmap_d t.png\nnewmtl b\nmap_Kd ./t.png\nnewmtl c\nmap_d .\\t.png\n");
  const auto obj = scratch.write("a.obj", std::string("mtllib m.mtl\nusemtl a\n") + kTriangle + "f 1 2 3\n");
  ObjLoadReport report;
  const Scene scene = load_obj(obj, {}, report);
  CHECK(report.warnings.empty());
  REQUIRE(scene.color_maps.size() == 1);
  REQUIRE(scene.alpha_maps.size() == 1);
  CHECK(scene.color_maps[0].rgb == std::vector<std::uint8_t>{0, 0, 0, 255, 255, 255, 255, 0, 0, 64, 64, 64});
  CHECK(scene.alpha_maps[0].alpha == std::vector<std::uint8_t>{0, 255, 54, 64});
  CHECK(scene.materials[1].color_map == 0);
  CHECK(scene.materials[1].alpha_map == kNone);
  CHECK(scene.materials[2].alpha_map == 0);
}

TEST_CASE("all textures together must fit the budget") {
  const Scratch scratch;
  const std::vector<float> pixels(64 * 64, 0.5f);
  std::string library;
  for (const char* name : {"a", "b", "c"}) {
    write_png(scratch.path(std::string(name) + ".png"), 64, 64, 1, pixels, true, 8, {});
    library += std::string("newmtl ") + name + "\nmap_Kd " + name + ".png\n";
  }
  scratch.write("m.mtl", library);
  const auto obj = scratch.write("a.obj", std::string("mtllib m.mtl\n") + kTriangle + "f 1 2 3\n");
  ObjLoadReport report;
  CHECK_NOTHROW(load_obj(obj, {.max_texture_bytes = 3 * 64 * 64 * 3}, report));
  const auto outcome = test::outcome_of([&] { load_obj(obj, {.max_texture_bytes = 3 * 64 * 64 * 3 - 1}, report); });
  CHECK(outcome.code == ErrorCode::kLimit);
  CHECK(outcome.has("c.png"));
}

}  // namespace
}  // namespace halfshade
