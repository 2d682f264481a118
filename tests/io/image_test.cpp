#include "rasterizer/io/image.h"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <limits>
#include <random>

#include "rasterizer/io/srgb.h"
#include "scratch.h"

namespace halfshade {
namespace {

using test::Scratch;

std::size_t channel_index(const FloatImage& image, const std::string& name) {
  const auto found = std::find(image.channel_names.begin(), image.channel_names.end(), name);
  REQUIRE(found != image.channel_names.end());
  return static_cast<std::size_t>(found - image.channel_names.begin());
}

bool has_attribute(const ImageAttributes& attributes, const std::string& name, const std::string& text) {
  return std::find(attributes.begin(), attributes.end(), std::pair{name, text}) != attributes.end();
}

TEST_CASE("an EXR keeps half colours, float values, uint32 ids and text") {
  constexpr std::uint32_t kWidth = 37, kHeight = 5, kCount = kWidth * kHeight;
  std::mt19937 random(3);
  std::uniform_real_distribution<float> uniform(-10.0f, 10.0f);
  std::vector<float> color(kCount), depth(kCount);
  std::vector<std::uint32_t> ids(kCount);
  for (std::uint32_t i = 0; i < kCount; ++i)
    color[i] = uniform(random), depth[i] = uniform(random), ids[i] = static_cast<std::uint32_t>(random());
  ids[0] = 0xffffffffu;
  color[0] = 1e6f;
  color[1] = 0.333251953125f;  // a half
  const ImageChannel channels[] = {{"R", ImageChannel::Type::kHalf, color.data()},
                                   {"Z", ImageChannel::Type::kFloat, depth.data()},
                                   {"id.I", ImageChannel::Type::kUint32, ids.data()},
                                   {"shadow.key.V", ImageChannel::Type::kHalf, color.data()}};
  const Scratch scratch;
  write_exr(scratch.path("a.exr"), kWidth, kHeight, channels, {{"method", "exact"}, {"halfshade:seed", "7"}});
  CHECK(read_uint32_channel(scratch.path("a.exr"), "id.I") == ids);
  CHECK(test::outcome_of([&] { read_uint32_channel(scratch.path("a.exr"), "R"); }).code == ErrorCode::kBadInput);

  const FloatImage image = read_image(scratch.path("a.exr"));
  CHECK(image.width == kWidth);
  CHECK(image.height == kHeight);
  REQUIRE(image.channel_names.size() == 4);
  CHECK(has_attribute(image.attributes, "method", "exact"));
  CHECK(has_attribute(image.attributes, "halfshade:seed", "7"));
  const std::size_t r = channel_index(image, "R"), z = channel_index(image, "Z"),
                    v = channel_index(image, "shadow.key.V");
  CHECK(image.values[r] == 65504.0f);
  CHECK(image.values[4 + v] == color[1]);
  for (std::size_t i = 1; i < kCount; ++i) {
    REQUIRE(image.values[i * 4 + z] == depth[i]);
    REQUIRE(std::fabs(image.values[i * 4 + r] - color[i]) <= std::fabs(color[i]) * 0x1p-11f);
  }
}

TEST_CASE("a PNG keeps 8 and 16 bits, one and three channels, and text") {
  for (const int bits : {8, 16}) {
    for (const std::uint32_t channels : {1u, 3u}) {
      CAPTURE(bits);
      CAPTURE(channels);
      const float largest = bits == 8 ? 255.0f : 65535.0f;
      std::vector<float> values(16 * 9 * channels);
      for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<float>((i * 37) % 256) / largest;
      const Scratch scratch;
      write_png(scratch.path("a.png"), 16, 9, channels, values, false, bits,
                {{"method", "exact"}, {"mask hash", "00ff"}});
      const FloatImage image = read_image(scratch.path("a.png"));
      CHECK(image.width == 16);
      CHECK(image.height == 9);
      CHECK(image.channel_names.size() == channels);
      CHECK(image.values == values);
      CHECK(has_attribute(image.attributes, "method", "exact"));
      CHECK(has_attribute(image.attributes, "mask hash", "00ff"));
    }
  }
}

TEST_CASE("equal input gives equal bytes, without the time of writing") {
  const Scratch scratch;
  const std::vector<float> values(48, 0.3f);
  const ImageChannel channel{"R", ImageChannel::Type::kHalf, values.data()};
  for (const char* name : {"a", "b"}) {
    write_png(scratch.path(name + std::string(".png")), 4, 4, 3, values, true, 8, {{"seed", "1"}});
    write_exr(scratch.path(name + std::string(".exr")), 8, 6, {&channel, 1}, {{"seed", "1"}});
  }
  char today[16];
  const std::time_t now = std::time(nullptr);
  REQUIRE(std::strftime(today, sizeof today, "%Y:%m:%d", std::localtime(&now)) != 0);
  for (const char* kind : {".png", ".exr"}) {
    const std::string a = test::read_bytes(scratch.path(std::string("a") + kind));
    CHECK(a == test::read_bytes(scratch.path(std::string("b") + kind)));
    CHECK(a.find(today) == std::string::npos);
  }
}

TEST_CASE("the sRGB curve rounds to nearest, clamps, and agrees with its definition") {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInf = std::numeric_limits<float>::infinity();
  for (const int bits : {8, 16}) {
    const std::uint32_t largest = (1u << bits) - 1;
    for (const float x : {kNan, -kInf, -1.0f, -0.0f, 0.0f}) {
      CHECK(encode_srgb(x, bits) == 0);
      CHECK(encode_linear(x, bits) == 0);
    }
    for (const float x : {1.0f, 1.5f, kInf}) {
      CHECK(encode_srgb(x, bits) == largest);
      CHECK(encode_linear(x, bits) == largest);
    }
    for (int i = 0; i <= 20000; ++i) {
      const double x = i / 20000.0;
      const double exact = x <= 0.0031308 ? 12.92 * x : 1.055 * std::pow(x, 1.0 / 2.4) - 0.055;
      // The two pieces of the curve meet only to 1e-8, and x is rounded to float.
      REQUIRE(std::fabs(encode_srgb(static_cast<float>(x), bits) - exact * largest) <= 0.5 + 1e-3 * (bits - 7));
    }
  }
  CHECK(encode_srgb(0.5f, 8) == 188);
  CHECK(encode_srgb(0.18f, 8) == 118);
}

TEST_CASE("wrong sizes are refused before anything is written") {
  const Scratch scratch;
  const std::vector<float> values(12);
  const auto png = [&](std::uint32_t channels, int bits, std::uint32_t width) {
    return test::outcome_of([&] { write_png(scratch.path("a.png"), width, 2, channels, values, true, bits, {}); }).code;
  };
  CHECK(png(2, 8, 3) == ErrorCode::kUsage);
  CHECK(png(3, 12, 2) == ErrorCode::kUsage);
  CHECK(png(3, 8, 3) == ErrorCode::kUsage);
  CHECK(test::outcome_of([&] { write_exr(scratch.path("a.exr"), 2, 2, {}, {}); }).code == ErrorCode::kUsage);
  CHECK(scratch.file_count() == 0);
}

}  // namespace
}  // namespace halfshade
