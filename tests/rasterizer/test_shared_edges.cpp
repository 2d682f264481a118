// Fill rule at the level of set-up and coverage: no pixel is lost or drawn twice between neighbours.
#include "rasterizer/coverage_reference.h"
#include "rasterizer/setup.h"
#include "tests/rasterizer/raster_support.h"

using namespace halfshade;
using testing::Random;

namespace {

constexpr std::uint32_t kSide = 128;  // pixels; four tiles
constexpr PixelWindow kPicture{0, kSide, 0, kSide};

struct Fx8Point {
  std::int64_t x = 0, y = 0;
};

std::int64_t orient(const Fx8Point& a, const Fx8Point& b, const Fx8Point& p) {
  return (b.x - a.x) * (p.y - a.y) - (b.y - a.y) * (p.x - a.x);
}

int sign(std::int64_t value) { return (value > 0) - (value < 0); }

Fx8Point pixel_center(std::uint32_t x, std::uint32_t y) {
  return {std::int64_t{x} * 256 + 128, std::int64_t{y} * 256 + 128};
}

// How often each pixel is covered.
class CoverageCount {
 public:
  std::uint8_t at(std::uint32_t x, std::uint32_t y) const { return counts_[y * kSide + x]; }

  void draw(const std::array<PixelPoint, 3>& triangle) {
    const ClippedPolygon polygon = clip_triangle(triangle, volume_);
    for (std::uint32_t i = 2; i < polygon.count; ++i) {
      ScreenTriangle piece;
      if (snap_triangle(polygon.points[0], polygon.points[i - 1], polygon.points[i], piece)) draw(piece);
    }
  }

  void clear(const PixelWindow& box) {
    for (std::uint32_t y = box.y0; y != box.y1; ++y)
      std::fill_n(&counts_[y * kSide + box.x0], box.width(), std::uint8_t{0});
  }

 private:
  void draw(const ScreenTriangle& piece) {
    const PixelWindow box = covered_box(piece, kPicture);
    if (box.width() == 0 || box.height() == 0) return;
    for (std::uint32_t y = box.y0 / 64 * 64; y < box.y1; y += 64) {
      for (std::uint32_t x = box.x0 / 64 * 64; x < box.x1; x += 64) draw_tile(piece, {x, x + 64, y, y + 64});
    }
  }

  void draw_tile(const ScreenTriangle& piece, const PixelWindow& tile) {
    TileTriangle part;
    if (!make_tile_triangle(piece, tile, part)) return;
    std::array<RowSpan, 64> spans;
    cover_rows({&part, 1}, {spans.data(), part.height});
    for (std::uint32_t j = 0; j != part.height; ++j) {
      for (std::uint32_t x = span_begin(spans[j]); x != span_end(spans[j]); ++x) {
        ++counts_[(tile.y0 + part.row + j) * kSide + tile.x0 + x];
      }
    }
  }

  const ClipVolume volume_{kSide / 2.0 - kGuardBandPx, kSide / 2.0 + kGuardBandPx, kSide / 2.0 - kGuardBandPx,
                           kSide / 2.0 + kGuardBandPx};
  std::array<std::uint8_t, kSide * kSide> counts_{};
};

// ---- pairs inside the guard band: integers decide everything
// ---------------------------------------------------------

// Arbitrary, on pixel centres and corners, or on coarse steps.
std::int64_t random_fx8(Random& random, std::int64_t low, std::int64_t high) {
  const std::int64_t x = random.integer(low, high);
  switch (random.integer(0, 3)) {
    case 0:
      return x / 128 * 128;
    case 1:
      return x / 256 * 256 + 128;
    default:
      return x;
  }
}

Fx8Point random_point(Random& random, std::int64_t low, std::int64_t high) {
  return {random_fx8(random, low, high), random_fx8(random, low, high)};
}

Fx8Point beside(Random& random, const Fx8Point& a, const Fx8Point& b) {
  const double t = random.real(-0.2, 1.2);
  return {a.x + static_cast<std::int64_t>(t * static_cast<double>(b.x - a.x)) + random.integer(-3, 3),
          a.y + static_cast<std::int64_t>(t * static_cast<double>(b.y - a.y)) + random.integer(-3, 3)};
}

struct Pair {
  Fx8Point a, b, c, d;  // triangles a b c and b a d, on opposite sides of a b
};

Pair random_pair(Random& random, int index) {
  for (;;) {
    Pair pair;
    if (index % 40 == 0) {  // large
      pair = {random_point(random, 8192, 24576), random_point(random, 8192, 24576), random_point(random, 8192, 24576),
              random_point(random, 8192, 24576)};
    } else if (index % 40 == 1) {  // slivers, down to 1/256 px thin
      pair.a = random_point(random, 8192, 24576);
      pair.b = random_point(random, 8192, 24576);
      pair.c = beside(random, pair.a, pair.b);
      pair.d = beside(random, pair.a, pair.b);
    } else {  // small, around the corner where four tiles meet
      const std::int64_t low = random.integer(60, 64) * 256, high = low + 256 * random.integer(1, 5);
      pair = {random_point(random, low, high), random_point(random, low, high), random_point(random, low, high),
              random_point(random, low, high)};
    }
    if (sign(orient(pair.a, pair.b, pair.c)) * sign(orient(pair.a, pair.b, pair.d)) < 0) return pair;
  }
}

// Any depth: snapping must give the same point back.
PixelPoint at_random_depth(Random& random, const Fx8Point& p) {
  const double w = random.real(0.1, 4.0);
  return {static_cast<double>(p.x) / 256.0 * w, static_cast<double>(p.y) / 256.0 * w, w};
}

// +1 strictly inside, 0 on the border, -1 outside.
int locate(const Fx8Point& a, const Fx8Point& b, const Fx8Point& c, const Fx8Point& p) {
  const int winding = sign(orient(a, b, c));
  return std::min({winding * sign(orient(a, b, p)), winding * sign(orient(b, c, p)), winding * sign(orient(c, a, p))});
}

bool count_is_right(const Pair& pair, const Fx8Point& p, std::uint32_t count) {
  const int first = locate(pair.a, pair.b, pair.c, p), second = locate(pair.b, pair.a, pair.d, p);
  if (first > 0 || second > 0) return count == 1;
  if (first < 0 && second < 0) return count == 0;
  const bool on_shared_edge = orient(pair.a, pair.b, p) == 0 && first == 0 && second == 0 &&
                              (p.x != pair.a.x || p.y != pair.a.y) && (p.x != pair.b.x || p.y != pair.b.y);
  return on_shared_edge ? count == 1 : count <= 1;  // the outline belongs to whoever is beyond it
}

PixelWindow box_of(const Pair& pair) {
  const auto [x0, x1] = std::minmax({pair.a.x, pair.b.x, pair.c.x, pair.d.x});
  const auto [y0, y1] = std::minmax({pair.a.y, pair.b.y, pair.c.y, pair.d.y});
  const auto clamp = [](std::int64_t v) { return static_cast<std::uint32_t>(std::clamp<std::int64_t>(v, 0, kSide)); };
  return {clamp(x0 / 256 - 1), clamp(x1 / 256 + 2), clamp(y0 / 256 - 1), clamp(y1 / 256 + 2)};
}

// ---- pairs that are clipped: homogeneous edge functions in double, undecided close to a line
// --------------------------

struct HomogeneousTriangle {
  std::array<dvec3, 3> edge;  // edge . (x, y, 1) = weight / w
  dvec3 inverse_w{0.0};

  explicit HomogeneousTriangle(const std::array<PixelPoint, 3>& v) {
    for (std::size_t k = 0; k != 3; ++k) edge[k] = glm::cross(v[(k + 1) % 3], v[(k + 2) % 3]);
    const double determinant = glm::dot(v[0], edge[0]);
    for (dvec3& e : edge) e /= determinant;
    inverse_w = edge[0] + edge[1] + edge[2];
  }
};

constexpr int kUnclear = 2;

// -1 where line . p < 0, 1 where > 0, kUnclear within 1/64 px of the line.
int side_of_line(const dvec3& line, const dvec3& p) {
  const double value = glm::dot(line, p);
  if (std::fabs(value) <= std::hypot(line.x, line.y) / 64.0) return kUnclear;
  return value > 0.0 ? 1 : -1;
}

// 1 inside, 0 outside, kUnclear.
int classify(const HomogeneousTriangle& triangle, const dvec3& p) {
  int inside = 1;
  const dvec3 near_line = dvec3(0.0, 0.0, 1.0 / kNearPlane) - triangle.inverse_w;
  for (const dvec3& line : {triangle.edge[0], triangle.edge[1], triangle.edge[2], near_line}) {
    const int side = side_of_line(line, p);
    if (side == kUnclear) return kUnclear;
    if (side < 0) inside = 0;
  }
  return inside;
}

PixelPoint random_far_point(Random& random) {
  const double reach = random.integer(0, 2) == 0 ? 200.0 : 200000.0;
  const double w = random.integer(0, 3) == 0 ? -random.real(0.001, 1.0) : random.real(0.001, 1.0);
  return PixelPoint(random.real(-reach, reach), random.real(-reach, reach), 1.0) * w;
}

// The fourth point is beyond the shared edge in the pair's plane of weights, so the triangles do not overlap.
PixelPoint beyond_edge(Random& random, const PixelPoint& a, const PixelPoint& b, const PixelPoint& c) {
  return a * random.real(0.2, 1.5) + b * random.real(0.2, 1.5) - c * random.real(0.1, 1.0);
}

}  // namespace

TEST_CASE("S33 shared_edge_raster: a shared edge is covered by exactly one triangle, pixel centre by pixel centre") {
  constexpr int kPairs = 1000000;
  Random random(33);
  static CoverageCount coverage;
  std::uint64_t wrong = 0, covered = 0, first_wrong_pair = 0;
  for (int i = 0; i != kPairs; ++i) {
    const Pair pair = random_pair(random, i);
    const PixelPoint a = at_random_depth(random, pair.a), b = at_random_depth(random, pair.b);
    coverage.draw({a, b, at_random_depth(random, pair.c)});
    coverage.draw({b, at_random_depth(random, pair.d), a});
    const PixelWindow box = box_of(pair);
    for (std::uint32_t y = box.y0; y != box.y1; ++y) {
      for (std::uint32_t x = box.x0; x != box.x1; ++x) {
        covered += coverage.at(x, y);
        if (count_is_right(pair, pixel_center(x, y), coverage.at(x, y))) continue;
        if (wrong++ == 0) first_wrong_pair = static_cast<std::uint64_t>(i);
      }
    }
    coverage.clear(box);
  }
  CAPTURE(first_wrong_pair);
  CHECK(wrong == 0);
  CHECK(covered > 1000000);
}

TEST_CASE("S33 shared_edge_raster: clipped by the near plane and the guard band, a shared edge still has no gap") {
  constexpr int kPairs = 10000;
  Random random(34);
  static CoverageCount coverage;
  std::uint64_t wrong = 0, twice = 0, covered = 0, clipped = 0;
  const ClipVolume volume{kSide / 2.0 - kGuardBandPx, kSide / 2.0 + kGuardBandPx, kSide / 2.0 - kGuardBandPx,
                          kSide / 2.0 + kGuardBandPx};
  for (int i = 0; i != kPairs; ++i) {
    const PixelPoint a = random_far_point(random), b = random_far_point(random), c = random_far_point(random);
    const std::array<PixelPoint, 3> first = {a, b, c}, second = {b, a, beyond_edge(random, a, b, c)};
    coverage.draw(first);
    coverage.draw(second);
    clipped += clip_triangle(first, volume).clipped;
    const HomogeneousTriangle exact_first(first), exact_second(second);
    for (std::uint32_t y = 0; y < kSide; y += 3) {
      for (std::uint32_t x = 0; x < kSide; x += 3) {
        const std::uint32_t count = coverage.at(x, y);
        covered += count;
        twice += count > 1;
        const dvec3 p(x + 0.5, y + 0.5, 1.0);
        const int in_first = classify(exact_first, p), in_second = classify(exact_second, p);
        if (in_first == kUnclear || in_second == kUnclear) continue;
        wrong += count != static_cast<std::uint32_t>(in_first + in_second);
      }
    }
    coverage.clear(kPicture);
  }
  CHECK(wrong == 0);
  CHECK(twice == 0);
  CHECK(covered > 1000000);
  CHECK(clipped > 5000);
}

namespace {

// Top-left rule, independently: the sample is moved right by an infinitesimal, and down by an even smaller one.
bool oracle_covers(Fx8Point a, Fx8Point b, Fx8Point c, const Fx8Point& p) {
  if (orient(a, b, c) < 0) std::swap(b, c);
  const std::array<Fx8Point, 3> v = {a, b, c};
  for (std::size_t k = 0; k != 3; ++k) {
    const Fx8Point& from = v[k];
    const Fx8Point& to = v[(k + 1) % 3];
    const std::int64_t value = orient(from, to, p), d_right = from.y - to.y, d_down = to.x - from.x;
    if (value < 0 || (value == 0 && (d_right < 0 || (d_right == 0 && d_down < 0)))) return false;
  }
  return true;
}

}  // namespace

TEST_CASE("S33 shared_edge_raster: holes and double coverage at T-junctions are exactly those of the scalar oracle") {
  Random random(35);
  static CoverageCount coverage;
  std::uint64_t wrong = 0, holes = 0;
  for (int i = 0; i != 20000; ++i) {
    const Fx8Point a = random_point(random, 8192, 24576), b = random_point(random, 8192, 24576);
    const double t = random.real(0.1, 0.9);  // the middle point is rounded off the edge a b
    const Fx8Point middle = {a.x + static_cast<std::int64_t>(std::floor(t * static_cast<double>(b.x - a.x) + 0.5)),
                             a.y + static_cast<std::int64_t>(std::floor(t * static_cast<double>(b.y - a.y) + 0.5))};
    const Fx8Point c = {a.x + (b.y - a.y) / 4, a.y - (b.x - a.x) / 4},
                   d = {a.x - (b.y - a.y) / 4, a.y + (b.x - a.x) / 4};
    const std::array<std::array<Fx8Point, 3>, 3> triangles = {{{a, b, c}, {a, middle, d}, {middle, b, d}}};
    for (const auto& v : triangles) {
      coverage.draw({at_random_depth(random, v[0]), at_random_depth(random, v[1]), at_random_depth(random, v[2])});
    }
    const PixelWindow box = box_of({a, b, c, d});
    for (std::uint32_t y = box.y0; y != box.y1; ++y) {
      for (std::uint32_t x = box.x0; x != box.x1; ++x) {
        std::uint32_t expected = 0;
        for (const auto& v : triangles) expected += oracle_covers(v[0], v[1], v[2], pixel_center(x, y));
        wrong += coverage.at(x, y) != expected;
        holes += expected == 0 && locate(a, b, c, pixel_center(x, y)) < 0 && locate(b, a, d, pixel_center(x, y)) > 0;
      }
    }
    coverage.clear(kPicture);
  }
  CHECK(wrong == 0);
  CHECK(holes > 0);
}
