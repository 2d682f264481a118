#include <cfenv>
#include <string>

#include "rasterizer/io/obj_scene.h"
#include "rasterizer/io/obj_stream.h"
#include "scratch.h"

namespace halfshade {
namespace {

using test::Scratch;

// Vertices used long after they were written, negative indices, polygons, a joined line, materials that come and go.
std::string sample_text(const std::string& line_end) {
  std::string text = "mtllib m.mtl" + line_end;
  for (int i = 0; i < 60; ++i) {
    text += "v " + std::to_string(i % 7) + " " + std::to_string(i * i % 11) + " " + std::to_string(i) + line_end;
    if (i % 5 == 0) text += "vt 0." + std::to_string(i) + " 0.5" + line_end;
    if (i < 4) continue;
    if (i % 13 == 0) text += "usemtl red" + line_end;
    if (i % 17 == 0) text += "usemtl unknown" + line_end;
    text += i % 3 == 0 ? "f 1/1 -2/1 -1/-1" : (i % 3 == 1 ? "f -4 -3 -2 -1" : "f 2 \\" + line_end + "-2 -1");
    text += line_end;
  }
  return text;
}

void check_equal(const Scene& whole, SceneStream& stream) {
  std::size_t t = 0;
  for (stream.rewind(); stream.next(stream.piece);) {
    const Scene& piece = stream.piece;
    REQUIRE(piece.triangle_uvs.size() == piece.triangles.size());
    for (std::size_t i = 0; i < piece.triangles.size(); ++i, ++t) {
      REQUIRE(t < whole.triangles.size());
      for (int k = 0; k < 3; ++k) {
        REQUIRE(piece.positions[piece.triangles[i][k]] == whole.positions[whole.triangles[t][k]]);
      }
      REQUIRE(piece.triangle_uvs[i] == whole.triangle_uvs[t]);
      REQUIRE(piece.materials[piece.triangle_materials[i]].name == whole.materials[whole.triangle_materials[t]].name);
    }
  }
  CHECK(t == whole.triangles.size());
}

TEST_CASE("an OBJ read in pieces of any size has the triangles of the whole file, twice") {
  for (const char* line_end : {"\n", "\r\n", "\r"}) {
    const Scratch scratch;
    scratch.write("m.mtl", "newmtl red\nKd 1 0 0\n");
    const auto file = scratch.write("a.obj", sample_text(line_end));
    ObjLoadReport report, streamed;
    const Scene whole = load_obj(file, {}, report);
    for (const std::size_t chunk : {1u, 7u, 64u, 1000u, 1000000u}) {
      CAPTURE(chunk);
      SceneStream stream = stream_obj(file, {}, streamed, chunk);
      check_equal(whole, stream);
      check_equal(whole, stream);
      CHECK(streamed.faces == report.faces);
      CHECK(streamed.missing == report.missing);
    }
  }
}

TEST_CASE("a byte order mark counts at the start of the file alone, wherever a piece starts") {
  const Scratch scratch;
  const std::string triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
  const auto file = scratch.write("a.obj", "\xef\xbb\xbf" + triangle +
                                               "\xef\xbb\xbf"
                                               "f 1 3 2\nf 2 1 3\n");
  ObjLoadReport report;
  CHECK(load_obj(file, {}, report).triangles.size() == 2);
  for (const std::size_t chunk : {1u, 8u, 1000u}) {
    SceneStream stream = stream_obj(file, {}, report, chunk);
    std::size_t count = 0;
    for (stream.rewind(); stream.next(stream.piece);) count += stream.piece.triangles.size();
    CHECK(count == 2);
  }
}

TEST_CASE("the caller's rounding mode changes nothing of an OBJ, whole or in pieces") {
  const Scratch scratch;
  scratch.write("m.mtl", "newmtl red\nKd 1 0 0\n");
  const auto file = scratch.write("a.obj", sample_text("\n"));
  ObjLoadReport report;
  const Scene whole = load_obj(file, {}, report);
  std::fesetround(FE_UPWARD);
  SceneStream stream = stream_obj(file, {}, report, 64);
  check_equal(whole, stream);
  CHECK(std::fegetround() == FE_UPWARD);
  std::fesetround(FE_TONEAREST);
}

TEST_CASE("errors in an OBJ read in pieces name the line of the whole file") {
  const Scratch scratch;
  const auto file = scratch.write("a.obj", "v 0 0 0\nv 1 0 0\n\nv 0 1 0\nf 1 2 3\nf 1 2 9\n");
  ObjLoadReport report;
  std::string whole, pieces;
  try {
    load_obj(file, {}, report);
  } catch (const Error& error) {
    whole = error.what();
  }
  try {
    stream_obj(file, {}, report, 9);
  } catch (const Error& error) {
    pieces = error.what();
  }
  CHECK(whole.find(":6:") != std::string::npos);
  CHECK(pieces == whole);
}

TEST_CASE("an OBJ without triangles and a directory are refused as a stream, too") {
  const Scratch scratch;
  ObjLoadReport report;
  CHECK_THROWS_AS(stream_obj(scratch.write("a.obj", "v 0 0 0\n"), {}, report), Error);
  CHECK_THROWS_AS(stream_obj(scratch.path(), {}, report), Error);
}

}  // namespace
}  // namespace halfshade
