// S39: what an OBJ or MTL names must be a regular file inside the OBJ's directory.
#include <sys/stat.h>

#include "rasterizer/io/image.h"
#include "rasterizer/io/obj_scene.h"
#include "scratch.h"

namespace halfshade {
namespace {

using test::Scratch;
namespace fs = std::filesystem;

// scene/ holds the OBJ; secret.mtl and secret.png lie beside scene/.
struct Case {
  Scratch scratch;
  fs::path directory = scratch.path("scene");

  Case() {
    fs::create_directory(directory);
    scratch.write("secret.mtl", "newmtl secret\nKd 1 0 0\n");
    write_png(scratch.path("secret.png"), 1, 1, 1, std::vector<float>{1.0f}, true, 8, {});
    fs::create_symlink(scratch.path("secret.mtl"), directory / "link.mtl");
    fs::create_symlink(scratch.path("secret.png"), directory / "link.png");
    fs::create_directory_symlink(scratch.path(), directory / "up");
    fs::create_directory(directory / "folder");
    fs::create_symlink("/dev/zero", directory / "zero");
    fs::create_symlink("loop", directory / "loop");
    REQUIRE(::mkfifo((directory / "fifo").c_str(), 0600) == 0);
  }

  test::Outcome load_with_library(const std::string& name, bool allow = false) const {
    scratch.write("scene/a.obj", "v 0 0 0\nmtllib " + name + "\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    ObjLoadReport report;
    return test::outcome_of([&] { load_obj(directory / "a.obj", {.allow_any_path = allow}, report); });
  }
  test::Outcome load_with_texture(const std::string& keyword, const std::string& name, bool allow = false) const {
    scratch.write("scene/m.mtl", "newmtl a\n" + keyword + " " + name + "\n");
    return load_with_library("m.mtl", allow);
  }
};

TEST_CASE("S39 path_escape: libraries outside the scene's directory are refused") {
  const Case scene;
  const std::string outside = scene.scratch.path("secret.mtl").string();
  for (const std::string& name :
       {std::string("../secret.mtl"), std::string("..\\secret.mtl"), outside, std::string("link.mtl"),
        std::string("up/secret.mtl"), std::string("folder/../../secret.mtl"), std::string("../../../etc/passwd"),
        std::string("../none.mtl"), std::string("../../dev/zero"), std::string("/dev/zero"), std::string("zero")}) {
    const auto outcome = scene.load_with_library(name);
    CAPTURE(name);
    CAPTURE(outcome.message);
    CHECK(outcome.threw);
    CHECK(outcome.code == ErrorCode::kBadInput);
    CHECK(outcome.has("a.obj:2: mtllib"));
    CHECK(outcome.has("outside"));
    CHECK(outcome.seconds < test::kHang);
  }
}

TEST_CASE("S39 path_escape: textures outside the scene's directory are refused") {
  const Case scene;
  const std::string outside = scene.scratch.path("secret.png").string();
  for (const std::string keyword : {"map_Kd", "map_d"}) {
    for (const std::string& name :
         {std::string("../secret.png"), outside, std::string("link.png"), std::string("up\\secret.png"),
          std::string("-clamp on ../secret.png"), std::string("/dev/zero"), std::string("../../..")}) {
      const auto outcome = scene.load_with_texture(keyword, name);
      CAPTURE(name);
      CAPTURE(outcome.message);
      CHECK(outcome.code == ErrorCode::kBadInput);
      CHECK(outcome.has("m.mtl:2: " + keyword));
      CHECK(outcome.has("outside"));
      CHECK(outcome.seconds < test::kHang);
    }
  }
}

TEST_CASE("S39 path_escape: fifos, directories and devices are refused even where every path is allowed") {
  const Case scene;
  for (const bool allow : {false, true}) {
    for (const std::string name : {"fifo", "folder", ".", "loop"}) {
      CAPTURE(name);
      for (const auto& outcome : {scene.load_with_library(name, allow), scene.load_with_texture("map_Kd", name, allow),
                                  scene.load_with_texture("map_d", name, allow)}) {
        CAPTURE(outcome.message);
        CHECK(outcome.code == ErrorCode::kBadInput);
        CHECK(outcome.threw);
        CHECK(outcome.seconds < test::kHang);
      }
    }
  }
  CHECK(scene.load_with_library("/dev/zero", true).has("is a device"));
  CHECK(scene.load_with_texture("map_Kd", "zero", true).has("is a device"));
}

TEST_CASE("S39 path_escape: with every path allowed, regular files outside are read") {
  const Case scene;
  CHECK_FALSE(scene.load_with_library("../secret.mtl", true).threw);
  CHECK_FALSE(scene.load_with_texture("map_Kd", "link.png", true).threw);
}

TEST_CASE("S39 path_escape: an absolute path or a link that stays inside the scene's directory is read") {
  const Case scene;
  scene.scratch.write("scene/in side.mtl", "newmtl a\n");
  fs::create_symlink("in side.mtl", scene.directory / "inside");
  CHECK_FALSE(scene.load_with_library((scene.directory / "in side.mtl").string()).threw);
  CHECK_FALSE(scene.load_with_library("inside").threw);
  CHECK_FALSE(scene.load_with_library("folder/../in side.mtl").threw);
}

}  // namespace
}  // namespace halfshade
