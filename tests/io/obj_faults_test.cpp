// S36: every OBJ row of the table of input faults.
#include <ctime>
#include <random>

#include <sys/stat.h>

#include "rasterizer/io/obj_scene.h"
#include "scratch.h"

namespace halfshade {
namespace {

using test::Scratch;

constexpr const char* kVertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";  // lines 1 to 3

struct Fault {
  std::string line;                 // line 4 of the file
  std::vector<const char*> expect;  // parts of the message
};

test::Outcome load(const std::filesystem::path& file, const ObjLoadOptions& options = {}) {
  ObjLoadReport report;
  return test::outcome_of([&] { load_obj(file, options, report); });
}

const std::vector<Fault>& faults() {
  static const std::vector<Fault> list = {
      {"f 1 2 99", {"'99'", "1..3 or -3..-1"}},
      {"f 1 2 4", {"'4'", "1..3"}},
      {"f 1 2 -9", {"'-9'", "-3..-1"}},
      {"f 1 2 -4", {"'-4'", "-3..-1"}},
      {"f 0 1 2", {"'0'", "1..3"}},
      {"f 4294967297 2 3", {"'4294967297'", "out of range", "1..3"}},
      {"f 99999999999999999999 2 3", {"'99999999999999999999'", "out of range", "1..3"}},
      {"f -99999999999999999999 2 3", {"out of range", "1..3"}},
      {"f 2147483647 2 3", {"'2147483647'", "1..3"}},
      {"f -2147483648 2 3", {"'-2147483648'", "1..3"}},
      {"f 1 2", {"2 corners", "3..65535"}},
      {"f", {"0 corners", "3..65535"}},
      {"f 1 2 x", {"'x'", "not an integer"}},
      {"f 1 2 3.5", {"'3.5'", "not an integer"}},
      {"f 1/1 2/1 3/1", {"texture index '1'", "none yet"}},
      {"f 1//1 2//1 3//1", {"normal index '1'", "none yet"}},
      {"f 1/2/3/4 2 3", {"'1/2/3/4'", "more than 3"}},
      {"f / 2 3", {"not an integer"}},
      {"v nan inf -inf", {"'nan'", "not finite", "allowed -3.4028235e38..3.4028235e38"}},
      {"v 0 -infinity 0", {"'-infinity'", "not finite"}},
      {"v abc 0 0", {"'abc'", "not a number"}},
      {"v 1,5 0 0", {"'1,5'", "not a number"}},
      {"v 0x10 0 0", {"'0x10'", "not a number"}},
      {"v 0 1", {"2 numbers", "3..8"}},
      {"v", {"0 numbers", "3..8"}},
      {"v 1e400 0 0", {"'1e400'", "too large", "3.4028235e38"}},
      {"v 1e39 0 0", {"'1e39'", "too large", "3.4028235e38"}},
      {"v 0 0 0 0 0 0 0 0 0", {"more than 8"}},
      {"vt nan 0", {"'nan'", "not finite"}},
      {"vt 1e10 0", {"10000000000", "out of range", "-2^30..2^30"}},
      {"vt", {"0 numbers", "1..3"}},
      {"vn 0 1", {"2 numbers", "3..3"}},
      {"mtllib", {"without a file name"}},
  };
  return list;
}

TEST_CASE("S36 obj_faults: a wrong line is refused with file, line, value and range, quickly and in little memory") {
  const Scratch scratch;
  const test::PeakMemory memory;
  for (const Fault& fault : faults()) {
    CAPTURE(fault.line);
    const auto outcome = load(scratch.write("bad.obj", std::string(kVertices) + fault.line + "\nf 1 2 3\n"));
    CAPTURE(outcome.message);
    CHECK(outcome.threw);
    CHECK(outcome.code == ErrorCode::kBadInput);
    CHECK(outcome.has("bad.obj:4: "));
    for (const char* part : fault.expect) CHECK(outcome.has(part));
    CHECK(outcome.seconds < test::kHang);
  }
  CHECK(memory.growth() < 16.0);
}

TEST_CASE("S36 obj_faults: indices are checked against what came before, not against the whole file") {
  const Scratch scratch;
  const auto outcome = load(scratch.write("a.obj", "v 0 0 0\nv 1 0 0\nf 1 2 3\nv 0 1 0\n"));
  CHECK(outcome.has("a.obj:3: position index '3' is out of range, allowed 1..2 or -2..-1"));
}

TEST_CASE("S36 obj_faults: lenient reading skips the faces of wrong lines and counts them") {
  for (const Fault& fault : faults()) {
    CAPTURE(fault.line);
    if (fault.line == "mtllib") continue;
    const Scratch scratch;
    ObjLoadReport report;
    const auto file = scratch.write("bad.obj", std::string(kVertices) + fault.line + "\nf 1 2 3\n");
    const Scene scene = load_obj(file, {.lenient = true}, report);
    CHECK(scene.triangles.size() == 1);
    CHECK(report.skipped_faces == (fault.line[0] == 'f' ? 1 : 0));
    CHECK(!report.warnings.empty());
  }
}

TEST_CASE("S36 obj_faults: lenient reading keeps the numbering and skips faces that use a wrong vertex") {
  const Scratch scratch;
  ObjLoadReport report;
  const auto file =
      scratch.write("a.obj", "v 0 0 0\nv x 0 0\nv 1 0 0\nv 0 1 0\nvt nan\nf 1 2 3\nf 1 3 4\nf 1/1 3/1 4/1\n");
  const Scene scene = load_obj(file, {.lenient = true}, report);
  REQUIRE(scene.triangles.size() == 1);
  CHECK(scene.positions[scene.triangles[0][2]] == dvec3(0, 1, 0));
  CHECK(report.skipped_faces == 2);
}

TEST_CASE("S36 obj_faults: files without faces are refused") {
  const Scratch scratch;
  for (const char* text : {"", "\n\n", "# nothing\n", kVertices}) {
    const auto outcome = load(scratch.write("empty.obj", text));
    CHECK(outcome.code == ErrorCode::kBadInput);
    CHECK(outcome.has("empty.obj: no geometry"));
  }
}

TEST_CASE("S36 obj_faults: 200 kB of random bytes are refused, with and without zero bytes") {
  const Scratch scratch;
  for (const int lowest : {0, 1, 32}) {
    CAPTURE(lowest);
    std::mt19937 random(36);
    std::string noise(200000, '\0');
    for (char& c : noise)
      c = static_cast<char>(lowest + static_cast<int>(random() % (256u - static_cast<unsigned>(lowest))));
    const auto outcome = load(scratch.write("noise.obj", noise));
    CHECK(outcome.threw);
    CHECK(outcome.code == ErrorCode::kBadInput);
    CHECK(load(scratch.path("noise.obj"), {.lenient = true}).threw);
  }
}

TEST_CASE("S36 obj_faults: directories, devices, fifos and missing files are refused without being opened") {
  const Scratch scratch;
  REQUIRE(::mkfifo(scratch.path("fifo.obj").c_str(), 0600) == 0);
  std::filesystem::create_directory(scratch.path("dir.obj"));
  const std::pair<std::filesystem::path, const char*> files[] = {{scratch.path("fifo.obj"), "is a fifo"},
                                                                 {scratch.path("dir.obj"), "is a directory"},
                                                                 {"/dev/zero", "is a device"},
                                                                 {scratch.path("none.obj"), "cannot read"}};
  for (const auto& [file, expected] : files) {
    const auto outcome = load(file);
    CAPTURE(outcome.message);
    CHECK(outcome.code == ErrorCode::kBadInput);
    CHECK(outcome.has(expected));
    CHECK(outcome.seconds < test::kHang);
  }
}

TEST_CASE("S36 obj_faults: very many unknown materials are listed in no more than linear time") {
  const Scratch scratch;
  const auto seconds = [&](int count) {
    std::string text = kVertices;
    for (int i = 0; i < count; ++i) text += "usemtl " + std::to_string(i) + "\nf 1 2 3\n";
    ObjLoadReport report;
    const auto file = scratch.write("many.obj", text);
    const std::clock_t start = std::clock();
    load_obj(file, {}, report);
    CHECK(report.missing.size() == static_cast<std::size_t>(count));
    return static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
  };
  // 16 times as many took 250 times as long when each was compared with all before it.
  const double few = seconds(5000), many = seconds(80000);
  CHECK(many < 0.2 + 64.0 * few);
}

TEST_CASE("S36 obj_faults: files and lines that are too long are refused") {
  const Scratch scratch;
  const auto small = load(scratch.write("big.obj", kVertices), {.max_file_bytes = 10});
  CHECK(small.code == ErrorCode::kLimit);
  CHECK(small.has("allowed 10 bytes"));
  const auto line = load(scratch.write("line.obj", "v 0 0 0\n#" + std::string((1 << 20) + 1, 'x')));
  CHECK(line.has("line.obj:2: line of 1048578 bytes, allowed at most 1048576"));
}

TEST_CASE("S36 obj_faults: a face of 65535 corners is read, one of 65536 is not") {
  const Scratch scratch;
  for (const std::size_t corners : {65535u, 65536u}) {
    std::string text = kVertices, face = "f";
    for (std::size_t i = 0; i < corners; ++i) face += i % 3 == 0 ? " 1" : i % 3 == 1 ? " 2" : " 3";
    const auto outcome = load(scratch.write("face.obj", text + face + "\n"));
    CHECK(outcome.threw == (corners == 65536u));
    CHECK(outcome.seconds < test::kHang);
  }
}

TEST_CASE("S36 obj_faults: an unknown keyword is a warning with its line") {
  const Scratch scratch;
  ObjLoadReport report;
  load_obj(scratch.write("a.obj", std::string(kVertices) + "vertex 1\nf 1 2 3\n"), {}, report);
  REQUIRE(report.warnings.size() == 1);
  CHECK(report.warnings[0].find("a.obj:4: unknown keyword 'vertex'") != std::string::npos);
}

}  // namespace
}  // namespace halfshade
