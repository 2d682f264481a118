#include "rasterizer/coverage_reference.h"
#include "rasterizer/setup.h"
#include "tests/rasterizer/raster_support.h"

using namespace halfshade;
using testing::Random;

namespace {

// Coordinates in fx8 around one tile: mostly near it, sometimes as far as the guard band allows.
std::int32_t random_coordinate(Random& random) {
  switch (random.integer(0, 5)) {
    case 0:
      return static_cast<std::int32_t>(random.integer(-0x3fffff, 0x3fffff));
    case 1:
      return static_cast<std::int32_t>(random.integer(-20, 84) * 128);
    case 2:
      return static_cast<std::int32_t>(random.integer(-4096, 20480));
    default:
      return static_cast<std::int32_t>(random.integer(0, 16384));
  }
}

std::vector<TileTriangle> random_parts(std::uint64_t seed, std::size_t count) {
  Random random(seed);
  std::vector<TileTriangle> parts;
  while (parts.size() != count) {
    std::array<PixelPoint, 3> p;
    for (PixelPoint& q : p) q = {random_coordinate(random) / 256.0, random_coordinate(random) / 256.0, 1.0};
    if (random.integer(0, 3) == 0) p[2] = p[1] + PixelPoint(random.real(-2.0, 2.0), random.real(-2.0, 2.0), 0.0);
    ScreenTriangle triangle;
    TileTriangle part;
    if (!snap_triangle(p[0], p[1], p[2], triangle)) continue;
    const auto right = static_cast<std::uint32_t>(random.integer(1, 64));
    if (make_tile_triangle(triangle, {0, right, 0, 64}, part)) parts.push_back(part);
  }
  return parts;
}

std::size_t row_count(const std::vector<TileTriangle>& parts) {
  std::size_t rows = 0;
  for (const TileTriangle& part : parts) rows += part.height;
  return rows;
}

}  // namespace

TEST_CASE("the coverage kernel equals its reference on every target") {
  const std::vector<TileTriangle> parts = random_parts(1, 200000);
  std::vector<RowSpan> expected(row_count(parts));
  cover_rows_reference(parts, expected);
  testing::for_each_target([&] {
    std::vector<RowSpan> spans(expected.size(), 0xdeadbeefu);
    cover_rows(parts, spans);
    CHECK(spans == expected);
  });
}

TEST_CASE("the coverage kernel decides quotients next to integers as exact arithmetic does") {
  std::vector<TileTriangle> parts;
  Random random(2);
  for (int i = 0; i != 100000; ++i) {
    const auto step = static_cast<std::int32_t>(random.integer(1, 1 << 23));
    const auto column = static_cast<std::int32_t>(random.integer(-1, 65));
    const auto nudge = static_cast<std::int32_t>(random.integer(-1, 1));
    TileTriangle part;
    part.width = part.height = 64;
    part.a = {step, -step, 0};
    part.e = {-step * column + nudge, step * column + nudge, 0};
    part.b[2] = static_cast<std::int32_t>(random.integer(-9, 9));
    parts.push_back(part);
  }
  std::vector<RowSpan> expected(row_count(parts)), spans(expected.size());
  cover_rows_reference(parts, expected);
  testing::for_each_target([&] {
    cover_rows(parts, spans);
    CHECK(spans == expected);
  });
}

TEST_CASE("the coverage kernel writes nothing past its spans") {
  testing::for_each_target([] {
    for (std::uint64_t seed = 0; seed != 200; ++seed) {
      const std::vector<TileTriangle> parts = random_parts(seed, 1 + seed % 5);
      const std::size_t rows = row_count(parts);
      std::vector<RowSpan> spans(rows + 64, 0xdeadbeefu);
      cover_rows(parts, {spans.data(), rows});
      for (std::size_t i = rows; i != spans.size(); ++i) REQUIRE(spans[i] == 0xdeadbeefu);
    }
  });
}

TEST_CASE("covering no triangles writes nothing") { cover_rows({}, {}); }
