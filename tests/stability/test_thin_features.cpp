// S22: what the renderer says about features finer than the samples.
#include <doctest/doctest.h>

#include "shadows/receiver_request.h"
#include "shadows/thin_features.h"
#include "stability/cases.h"

using namespace halfshade;
using namespace halfshade::test;

namespace {

using Rows = std::array<std::uint64_t, kProbeSide>;

ThinFeatures look(const std::vector<Triangle>& triangles, const std::vector<dvec3>& points, const Light& light,
                  const ShadowConfig& config) {
  const Scene scene = scene_of(triangles);
  const std::vector<Receiver> receivers = receivers_at(points);
  const LocalFrame frame = make_local_frame(scene.positions, receiver_reach(receivers, light));
  const ReceiverRequest q = make_receiver_request(frame, receivers, light, config);
  const std::vector<float> visibility(q.receivers.size(), 1.0f);
  const LatticeMesh mesh = make_lattice_mesh(scene, frame);
  KeptExact nothing, kept;
  kept.build(mesh, true);
  const ThinFeatures found = find_thin_features(mesh, q.receivers, visibility, light, config, 100, nothing);
  const ThinFeatures by_tree = find_thin_features(mesh, q.receivers, visibility, light, config, 100, kept);
  CHECK(by_tree.seeing == found.seeing);
  CHECK(by_tree.share_of_light == found.share_of_light);
  return found;
}

/// Short runs one cell at a time: the definition.
std::uint32_t short_cells_slowly(const Rows& rows, std::uint32_t shortest) {
  const int n = kProbeSide;
  const auto at = [&](int x, int y) { return rows[static_cast<std::size_t>(y)] >> x & 1; };
  const auto run_is_short = [&](int x, int y, int dx, int dy) {
    int begin = 0, end = 0;  // of the run around (x, y), as steps from it
    const auto inside = [&](int k) { return x + k * dx >= 0 && x + k * dx < n && y + k * dy >= 0 && y + k * dy < n; };
    while (inside(begin - 1) && at(x + (begin - 1) * dx, y + (begin - 1) * dy) == at(x, y)) --begin;
    while (inside(end + 1) && at(x + (end + 1) * dx, y + (end + 1) * dy) == at(x, y)) ++end;
    return inside(begin - 1) && inside(end + 1) && end - begin + 1 < static_cast<int>(shortest);
  };
  std::uint32_t count = 0;
  for (int y = 0; y < n; ++y) {
    for (int x = 0; x < n; ++x) count += run_is_short(x, y, 1, 0) || run_is_short(x, y, 0, 1);
  }
  return count;
}

}  // namespace

TEST_CASE("S22 wire_sweep: cells in short runs are counted as their definition says") {
  Random random(22);
  for (int round = 0; round < 200; ++round) {
    Rows rows{};
    const int runs = round % 4;  // noise, then ever longer runs
    for (std::uint64_t& row : rows) {
      row = random.engine();
      for (int k = 0; k < runs; ++k) row &= row << 1 | row >> 63;
      if (random.uniform(0, 1) < 0.5) row = ~row;
    }
    if (round >= 150) std::fill(rows.begin(), rows.end(), rows[0]);
    for (const std::uint32_t shortest : {2u, 3u, 4u, 8u, 16u, 63u}) {
      CAPTURE(round);
      CAPTURE(shortest);
      CHECK(cells_in_short_runs(rows, shortest) == short_cells_slowly(rows, shortest));
    }
  }
}

TEST_CASE("S22 wire_sweep: a wire or a gap narrower than the distance between samples is noticed, wider ones are not") {
  const std::vector<dvec3> points = wire_receivers(100);
  for (const double width : {0.01, 0.05, 0.0625, 0.1}) {
    CAPTURE(width);
    const auto gap = joined(quad({-64, 2, -64}, {-width / 2, 2, -64}, {-width / 2, 2, 64}, {-64, 2, 64}),
                            quad({width / 2, 2, -64}, {64, 2, -64}, {64, 2, 64}, {width / 2, 2, 64}));
    for (const auto& triangles : {wire(width), gap}) {
      const ThinFeatures found = look(triangles, points, frame_light(), frame_config());
      CHECK(found.probes == 100);
      CHECK((found.seeing > 50) == (2.0 * width < 0.125));  // not all: the probes' cells are samples themselves
      CHECK((found.seeing == 0) == (2.0 * width >= 0.125));
      if (2.0 * width < 0.125) CHECK(found.share_of_light == doctest::Approx(width).epsilon(0.35));
    }
    // Four times as many samples are half as far apart.
    CHECK((look(wire(width), points, frame_light(), frame_config(1024)).seeing > 50) == (2.0 * width < 0.0625));
  }
}

TEST_CASE("S22 wire_sweep: edges, corners and small triangles of one big surface are no thin features") {
  std::vector<Triangle> grid;  // one plate of 800 triangles, each smaller than the distance between samples
  for (int i = -10; i < 10; ++i) {
    for (int k = -10; k < 10; ++k) {
      const auto cell = quad({i * 0.05, 2, k * 0.05}, {i * 0.05 + 0.05, 2, k * 0.05},
                             {i * 0.05 + 0.05, 2, k * 0.05 + 0.05}, {i * 0.05, 2, k * 0.05 + 0.05});
      grid.insert(grid.end(), cell.begin(), cell.end());
    }
  }
  for (const auto& triangles : {plate(2), grid, uv_sphere({0, 2, 0}, 0.7, 32, 64)}) {
    CHECK(look(triangles, floor_points(10, 2.0), frame_light(), frame_config()).seeing == 0);
  }
}

TEST_CASE("S22 wire_sweep: lights without area or with samples of their own have no distance between samples") {
  Light point = frame_light();
  point.shape = LightShape::kPoint;
  for (const Light& light : {point, sample_light({{0, 4, 0}, {1, 4, 0}})}) {
    CHECK(look(wire(0.01), wire_receivers(10), light, frame_config()).probes == 0);
  }
  CHECK(look(wire(0.01), wire_receivers(10), frame_light(), frame_config(4096)).probes == 0);
  CHECK(look(wire(0.01), wire_receivers(10), frame_light(), frame_config(1)).probes == 0);
}
