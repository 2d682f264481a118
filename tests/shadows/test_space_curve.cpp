#include <doctest/doctest.h>

#include <algorithm>
#include <cstdlib>
#include <vector>

#include "shadows/space_curve.h"

using namespace halfshade;

TEST_CASE("Hilbert's curve visits every cell once and goes from neighbour to neighbour") {
  for (const std::uint32_t corner : {0u, 1024u - 16u}) {  // the first and the last 16^3 cells along each axis
    std::vector<std::pair<std::uint32_t, std::array<int, 3>>> cells;
    for (std::uint32_t x = 0; x < 16; ++x) {
      for (std::uint32_t y = 0; y < 16; ++y) {
        for (std::uint32_t z = 0; z < 16; ++z) {
          cells.push_back({HilbertCurve::code(corner + x, corner + y, corner + z),
                           {static_cast<int>(x), static_cast<int>(y), static_cast<int>(z)}});
        }
      }
    }
    std::sort(cells.begin(), cells.end());
    for (std::size_t i = 1; i < cells.size(); ++i) {
      CHECK(cells[i].first == cells[i - 1].first + 1);
      int steps = 0;
      for (std::size_t k = 0; k < 3; ++k) steps += std::abs(cells[i].second[k] - cells[i - 1].second[k]);
      CHECK(steps == 1);
    }
  }
}

TEST_CASE("points are ordered by the curve, those dropped left out, alike ones by index") {
  std::vector<vec3> points;
  for (int i = 0; i < 4000; ++i) {
    points.emplace_back(static_cast<float>(i * 37 % 101), static_cast<float>(i * 53 % 89), static_cast<float>(i % 7));
  }
  points.push_back(points[5]), points.push_back(points[5]);
  const auto order = order_along<HilbertCurve>(points, [](std::uint32_t i) { return i % 3 != 0 || i >= 4000; });
  CHECK(order.size() == 4002 - 1334);
  const auto at = [&](std::uint32_t i) { return std::find(order.begin(), order.end(), i) - order.begin(); };
  CHECK(at(4000) == at(5) + 1);
  CHECK(at(4001) == at(5) + 2);
  // Runs of 16 are compact: their boxes are far smaller than those of any 16 points.
  double sum = 0.0;
  for (std::size_t i = 0; i + 16 <= order.size(); i += 16) {
    vec3 low(1e9f), high(-1e9f);
    for (std::size_t k = i; k < i + 16; ++k)
      low = glm::min(low, points[order[k]]), high = glm::max(high, points[order[k]]);
    sum += static_cast<double>(glm::length(high - low));
  }
  CHECK(sum / static_cast<double>(order.size() / 16) < 25.0);
}
