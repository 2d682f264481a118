#include "rasterizer/io/npy.h"

#include "scratch.h"

namespace halfshade {
namespace {

using test::Scratch;

template <class T>
void check_round_trip(const char* dtype, std::vector<std::size_t> shape) {
  const Scratch scratch;
  std::size_t count = 1;
  for (const std::size_t size : shape) count *= size;
  std::vector<T> values(count);
  for (std::size_t i = 0; i < count; ++i) values[i] = static_cast<T>(static_cast<T>(i) * 3 + static_cast<T>(1) / 2);
  write_npy(scratch.path("a.npy"), dtype, shape, values.data());
  const NpyArray array = read_npy(scratch.path("a.npy"));
  CHECK(array.dtype == dtype);
  CHECK(array.shape == shape);
  const auto back = array.as<T>();
  CHECK(std::vector<T>(back.begin(), back.end()) == values);
  CHECK((test::read_bytes(scratch.path("a.npy")).size() - count * sizeof(T)) % 64 == 0);
}

TEST_CASE("arrays of every dtype and of zero to three dimensions survive writing and reading") {
  check_round_trip<double>("f8", {5, 3});
  check_round_trip<double>("f8", {});
  check_round_trip<float>("f4", {7});
  check_round_trip<std::uint32_t>("u4", {2, 3, 4});
  check_round_trip<std::int32_t>("i4", {3, 1});
  check_round_trip<std::uint8_t>("u1", {9, 2});
  check_round_trip<std::uint8_t>("u1", {0, 2});
}

TEST_CASE("the header is what NumPy writes") {
  const Scratch scratch;
  const double values[6] = {};
  write_npy(scratch.path("a.npy"), "f8", std::vector<std::size_t>{2, 3}, values);
  const std::string bytes = test::read_bytes(scratch.path("a.npy"));
  CHECK(bytes.starts_with(
      std::string_view("\x93NUMPY\x01\x00\x76\x00{'descr': '<f8', 'fortran_order': False, 'shape': (2, 3), }", 68)));
  CHECK(bytes[127] == '\n');
  CHECK(bytes.size() == 128 + 48);
}

TEST_CASE("another dtype, or another type on reading, is refused") {
  const Scratch scratch;
  const float value = 1.0f;
  CHECK(test::outcome_of([&] { write_npy(scratch.path("a.npy"), "c8", {}, &value); }).code == ErrorCode::kUsage);
  write_npy(scratch.path("a.npy"), "f4", {}, &value);
  const NpyArray array = read_npy(scratch.path("a.npy"));
  CHECK(test::outcome_of([&] { array.as<double>(); }).code == ErrorCode::kBadInput);
}

std::string with_header(std::string_view header, std::string_view data) {
  const char length[2] = {static_cast<char>(header.size() & 0xff), static_cast<char>(header.size() >> 8)};
  return std::string("\x93NUMPY\x01\x00", 8) + std::string(length, 2) + std::string(header) + std::string(data);
}

TEST_CASE("damaged arrays are refused") {
  const std::string good = with_header("{'descr': '<f4', 'fortran_order': False, 'shape': (2,), }\n", "12345678");
  const Scratch scratch;
  CHECK(read_npy(scratch.write("a.npy", good)).shape == std::vector<std::size_t>{2});
  std::vector<std::string> bad = {"",
                                  "x",
                                  good.substr(0, 7),
                                  good.substr(0, 30),
                                  good.substr(0, good.size() - 1),
                                  good + "x",
                                  "\x93NUMPX" + good.substr(6)};
  bad.push_back(good);
  bad.back()[6] = 2;
  for (const char* header :
       {"{'descr': '<f4', 'fortran_order': True, 'shape': (2,), }",
        "{'descr': '>f4', 'fortran_order': False, 'shape': (2,), }",
        "{'descr': '<f2', 'fortran_order': False, 'shape': (2,), }",
        "{'descr': '|O', 'fortran_order': False, 'shape': (2,), }",
        "{'descr': '<f4', 'fortran_order': False, 'shape': (-2,), }", "{'descr': '<f4', 'fortran_order': False, }",
        "{'descr': '<f4', 'fortran_order': False, 'shape': (2,), 'x': 1}",
        "{'descr': '<f4', 'fortran_order': False, 'shape': (2,)} x",
        "{'descr': '<f4', 'fortran_order': False, 'shape': (4611686018427387904, 4, 2), }",
        "{'descr': '<f4', 'fortran_order': False, 'shape': (99999999999999999999,), }",
        "{'descr': '<f4', 'fortran_order': False, 'shape': (3000000000,), }",
        "{'descr': '<f4', 'descr': '<f4', 'shape': (2,), }", "{", ""}) {
    bad.push_back(with_header(header, "12345678"));
  }
  for (const std::string& bytes : bad) {
    const auto outcome = test::outcome_of([&] { read_npy(scratch.write("a.npy", bytes)); });
    CAPTURE(bytes);
    CHECK(outcome.threw);
    CHECK(outcome.code == ErrorCode::kBadInput);
    CHECK(outcome.has("a.npy: "));
  }
}

}  // namespace
}  // namespace halfshade
