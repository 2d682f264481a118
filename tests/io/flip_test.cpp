// FLIP: its bounds, its symmetry, values that can be followed by hand, and that more noise is more error.
#include <doctest/doctest.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "halfshade/error.h"
#include "rasterizer/io/flip.h"

using namespace halfshade;

namespace {

std::vector<vec3> flat(std::uint32_t side, const vec3& color) { return {std::size_t{side} * side, color}; }

/// Random colours; `amount` away from `base` at most.
std::vector<vec3> noisy(const std::vector<vec3>& base, float amount, std::uint32_t seed) {
  std::mt19937 engine(seed);
  std::vector<vec3> result = base;
  for (vec3& c : result) {
    for (int k = 0; k < 3; ++k) {
      c[k] = std::clamp(c[k] + amount * (static_cast<float>(engine() >> 8) * 0x1p-23f - 1.0f), 0.0f, 1.0f);
    }
  }
  return result;
}

double flip(const std::vector<vec3>& a, const std::vector<vec3>& b, std::uint32_t side, double ppd = 67.0) {
  return mean_of(flip_errors(a, b, side, side, ppd));
}

/// Of colours without any structure: only the colour difference counts.
double flip_of_flat(const vec3& a, const vec3& b) { return flip(flat(32, a), flat(32, b), 32); }

}  // namespace

TEST_CASE("FLIP of equal pictures is 0 everywhere") {
  const std::vector<vec3> picture = noisy(flat(40, vec3(0.5f)), 0.5f, 1);
  for (const float e : flip_errors(picture, picture, 40, 40)) CHECK(e == 0.0f);
}

TEST_CASE("FLIP of any two pictures is within 0 and 1, and the same both ways round") {
  for (std::uint32_t seed = 0; seed < 8; ++seed) {
    const auto a = noisy(flat(33, vec3(0.5f)), 0.6f, seed), b = noisy(flat(33, vec3(0.3f)), 0.6f, seed + 100);
    const std::vector<float> there = flip_errors(a, b, 33, 33), back = flip_errors(b, a, 33, 33);
    CHECK(there == back);
    CHECK(*std::min_element(there.begin(), there.end()) >= 0.0f);
    CHECK(*std::max_element(there.begin(), there.end()) <= 1.0f);
  }
}

TEST_CASE("FLIP of flat colours is what the formulas give by hand") {
  // Lightness 100 against 0: 100^0.7 = 25.119. The largest distance, green against blue: lightness 87.735 and 32.297,
  // (a, b) times 0.01 lightness: (-75.61, 72.98) and (25.58, -34.84); 55.44 + 147.75 = 203.19, to the 0.7th 41.27. Its
  // bend at 0.4 is 16.51; 0.95 + 0.05 * (25.119 - 16.51) / (41.27 - 16.51) = 0.9674.
  CHECK(flip_of_flat(vec3(0.0f), vec3(1.0f)) == doctest::Approx(0.9674).epsilon(2e-4));
  CHECK(flip_of_flat({0, 1, 0}, {0, 0, 1}) == doctest::Approx(1.0).epsilon(1e-4));
  // Linear 0.18418651851 has lightness 50: 50^0.7 = 15.462, below the bend: 0.95 * 15.462 / 16.51 = 0.8897.
  CHECK(flip_of_flat(vec3(0.18418651851f), vec3(0.0f)) == doctest::Approx(0.8897).epsilon(5e-4));
}

TEST_CASE("FLIP grows with noise, and an edge weighs more than the same difference without one") {
  const std::vector<vec3> base = flat(48, vec3(0.4f));
  double before = 0.0;
  for (const float amount : {0.02f, 0.05f, 0.1f, 0.2f, 0.4f}) {
    const double now = flip(base, noisy(base, amount, 7), 48);
    CHECK(now > before);
    before = now;
  }
  std::vector<vec3> step = base;
  for (std::size_t i = 0; i < step.size(); ++i) step[i] = vec3(i % 48 < 24 ? 0.4f : 0.45f);
  const std::vector<float> errors = flip_errors(base, step, 48, 48);
  CHECK(errors[24 * 48 + 25] > 1.2f * errors[24 * 48 + 46]);
  CHECK(errors[24 * 48 + 2] < 0.01f);  // far on the side where nothing changed
}

TEST_CASE("FLIP from farther away blurs fine patterns into their mean") {
  std::vector<vec3> checker = flat(64, vec3(0.0f));
  for (std::uint32_t i = 0; i < 64 * 64; ++i) checker[i] = vec3((i % 64 + i / 64) % 2 == 0 ? 1.0f : 0.0f);
  const std::vector<vec3> mean = flat(64, vec3(0.5f));
  const double near = flip(checker, mean, 64, 8.0), far = flip(checker, mean, 64, 67.0);
  CHECK(near > 2.0 * far);
  CHECK(far < 0.1);
}

TEST_CASE("FLIP does not depend on the number of threads, and takes values out of range as the nearest in range") {
  const auto a = noisy(flat(50, vec3(0.5f)), 0.5f, 3), b = noisy(flat(50, vec3(0.5f)), 0.5f, 4);
  const std::vector<float> here = flip_errors(a, b, 50, 50);
  for (const int threads : {1, 3}) {
    tbb::task_arena(threads).execute([&] { CHECK(flip_errors(a, b, 50, 50) == here); });
  }
  auto odd = flat(8, vec3(1.0f));
  odd[3] = {2.0f, std::numeric_limits<float>::infinity(), 1.0f};
  CHECK(flip(odd, flat(8, vec3(1.0f)), 8) == 0.0);
  odd[3] = vec3(std::numeric_limits<float>::quiet_NaN());
  CHECK(std::isfinite(flip(odd, flat(8, vec3(1.0f)), 8)));
}

TEST_CASE("FLIP refuses pictures that do not fit together, and screens that are none") {
  const auto a = flat(4, vec3(0.5f));
  CHECK_THROWS_AS(flip_errors(a, a, 4, 5), Error);
  CHECK_THROWS_AS(flip_errors(a, flat(3, vec3(0.5f)), 4, 4), Error);
  CHECK_THROWS_AS(flip_errors({}, {}, 0, 0), Error);
  for (const double ppd : {0.0, 1e4, std::nan("")}) CHECK_THROWS_AS(flip_errors(a, a, 4, 4, ppd), Error);
}

TEST_CASE("FLIP of visibility takes it as the grey that the reports show") {
  const std::vector<float> black(100, 0.0f), white(100, 1.0f), grey(100, 0.5f);
  CHECK(mean_flip_of_grey(black, white, 10, 10) == doctest::Approx(0.9674).epsilon(2e-4));
  // Code 0.5 is linear 0.2140, lightness 53.39: 0.95 * 53.39^0.7 / 16.51 = 0.9315.
  CHECK(mean_flip_of_grey(black, grey, 10, 10) == doctest::Approx(0.9315).epsilon(1e-3));
}
