// Scenes that change: equal bits to a scene made at once, and only what changed is made anew.
#include <doctest/doctest.h>

#include <cstring>

#include "support/embed_scene.h"

using namespace halfshade;
using namespace halfshade::test;

namespace {

const ShadowSolver& exact_solver() {
  static const ShadowSolver solver({.light_sample_count = 64});
  return solver;
}

/// Wrong bits against the oracle on a scene made at once from the same meshes.
std::uint64_t wrong_bits_now(const EmbedScene& s, const Ground& ground) {
  const ShadowScene fresh = fresh_copy(s);
  const Light light = frame_light();
  const Solved truth =
      solve(ShadowSolver({.method = ShadowMethod::kOracle, .light_sample_count = 64}), fresh, ground.view(), light);
  const Solved now = solve(exact_solver(), s.scene, ground.view(), light);
  REQUIRE(blocked_bits(truth.masks) > 100);
  return different_bits(truth.masks, now.masks);
}

}  // namespace

TEST_CASE("a scene of meshes gives the oracle's bits") {
  const EmbedScene s;
  CHECK(wrong_bits_now(s, Ground(20)) == 0);
  CHECK(s.scene.stats().commits == 1);
  CHECK(s.scene.stats().certified_triangles == s.scene.stats().triangles - 2);  // all but the ground
}

TEST_CASE("moving a mesh rounds that mesh alone and gives the bits of a scene made at once") {
  EmbedScene s;
  const std::uint64_t rounded = s.scene.stats().meshes_rounded;
  for (int step = 1; step <= 4; ++step) {
    CAPTURE(step);
    s.meshes[1].transform = turned(0.2 * step, {0.7 - 0.3 * step, 1.0, 0.2});
    s.scene.set_transform(s.ids[1], s.meshes[1].transform);
    CHECK(!s.scene.committed());
    s.scene.commit();
    CHECK(wrong_bits_now(s, Ground(12)) == 0);
  }
  CHECK(s.scene.stats().meshes_rounded == rounded + 4);
  CHECK(s.scene.stats().frame_changes == 0);
  CHECK(s.scene.stats().certificates_made == 4);  // one per mesh, when it came
  CHECK(s.scene.stats().tree_builds == 1);
}

TEST_CASE("a deformed mesh keeps its certificate while its seams stay closed, and loses it with them") {
  EmbedScene s;
  const std::uint64_t certified = s.scene.stats().certified_triangles;
  for (dvec3& p : s.meshes[2].positions) p *= dvec3(1.0, 1.0 + 0.3 * p.x, 1.0);
  s.scene.set_positions(s.ids[2], s.meshes[2].positions);
  s.scene.commit();
  CHECK(s.scene.stats().certificates_made == 4);
  CHECK(s.scene.stats().certified_triangles == certified);
  CHECK(wrong_bits_now(s, Ground(12)) == 0);

  // The box has three vertices per corner: one of them moves away.
  s.meshes[3].positions[0] += dvec3(-0.1, -0.2, -0.1);
  s.scene.set_positions(s.ids[3], s.meshes[3].positions);
  s.scene.commit();
  CHECK(s.scene.stats().certificates_made == 5);
  CHECK(s.scene.stats().certified_triangles == certified - 12);
  CHECK(wrong_bits_now(s, Ground(12)) == 0);
}

TEST_CASE("meshes come and go") {
  EmbedScene s;
  s.scene.remove_mesh(s.ids[1]);
  CHECK_THROWS_AS(s.scene.set_transform(s.ids[1], Transform{}), Error);
  s.meshes.erase(s.meshes.begin() + 1);
  s.scene.commit();
  CHECK(wrong_bits_now(s, Ground(12)) == 0);
  s.meshes.push_back(ball({0.3, 2.0, -0.6}, 0.6, 9));
  const std::uint32_t added = s.scene.add_mesh(s.meshes.back().view());
  CHECK(added == 4);
  s.scene.commit();
  CHECK(wrong_bits_now(s, Ground(12)) == 0);
  CHECK(s.scene.triangle_of(0) == MeshTriangle{s.ids[0], 0});
  CHECK(s.scene.triangle_of(2) == MeshTriangle{s.ids[2], 0});
  const auto last = static_cast<std::uint32_t>(s.scene.stats().triangles - 1);
  CHECK(s.scene.triangle_of(last) ==
        MeshTriangle{added, static_cast<std::uint32_t>(s.meshes.back().triangles.size() - 1)});
  CHECK_THROWS_AS(s.scene.triangle_of(last + 1), Error);
}

TEST_CASE("the frame changes when content leaves it, and the bits stay those of a scene made at once") {
  EmbedScene s;
  s.meshes[1].transform = moved_by({40.0, 1.0, 0.2});
  s.scene.set_transform(s.ids[1], s.meshes[1].transform);
  s.scene.commit();
  CHECK(s.scene.stats().frame_changes == 1);
  CHECK(wrong_bits_now(s, Ground(12)) == 0);
  CHECK(s.scene.reach()[1].x > 40.0);
}

TEST_CASE("a tree that got too bad is made anew") {
  EmbedScene s;
  s.scene.extend(PointView(std::vector<dvec3>{{-9, -9, -9}, {9, 9, 9}}));
  for (std::size_t i = 0; i < s.meshes[1].positions.size(); ++i) {
    s.meshes[1].positions[i] += dvec3(i % 7, i % 5, i % 3) * 0.8;  // torn apart: leaves that span everything
  }
  s.scene.set_positions(s.ids[1], s.meshes[1].positions);
  s.scene.commit();
  CHECK(s.scene.stats().tree_builds == 2);
  CHECK(s.scene.stats().tree_cost == 1.0);
  CHECK(wrong_bits_now(s, Ground(12)) == 0);
}

TEST_CASE("views with strides, in float, unaligned, or without triangles are the same mesh") {
  const OwnedMesh mesh = mesh_of(box({-1, 1, -1}, {1, 2, 1}));
  const Light light = frame_light();
  const Ground ground(12);
  std::vector<Solved> results;
  const auto solve_view = [&](const MeshView& view) {
    ShadowScene scene;
    scene.extend(frame_light());
    scene.extend(PointView(ground.positions));
    scene.add_mesh(view);
    scene.commit();
    results.push_back(solve(exact_solver(), scene, ground.view(), light));
  };
  solve_view(mesh.view());
  solve_view({.positions = mesh.positions});
  std::vector<unsigned char> bytes(mesh.positions.size() * 29 + 1);
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const vec3 p(mesh.positions[i]);
    std::memcpy(bytes.data() + 1 + i * 29, &p, sizeof p);
  }
  solve_view({.positions = {reinterpret_cast<const float*>(bytes.data() + 1), mesh.positions.size(), 29},
              .triangles = mesh.triangles});
  std::vector<std::array<std::uint32_t, 5>> padded;
  for (const auto& t : mesh.triangles) padded.push_back({t[0], t[1], t[2], 77, 78});
  solve_view({.positions = mesh.positions, .triangles = {padded[0].data(), padded.size(), sizeof padded[0]}});
  REQUIRE(blocked_bits(results[0].masks) > 100);
  for (const Solved& r : results) CHECK(r.masks == results[0].masks);
}

TEST_CASE("alpha maps perforate, from any channel of a picture") {
  OwnedMesh card = mesh_of(quad({-1, 1, -1}, {-1, 1, 1}, {1, 1, 1}, {1, 1, -1}));
  std::vector<vec2> uvs;
  for (const dvec3& p : card.positions) uvs.emplace_back(p.x * 0.5 + 0.5, p.z * 0.5 + 0.5);
  const std::vector<std::uint8_t> alpha = {255, 0, 0, 255};
  std::vector<std::uint8_t> rgba(2 * 12, 9);  // rows of 12 bytes: two texels and a gap
  for (int i = 0; i < 4; ++i) rgba[(i / 2) * 12 + (i % 2) * 4 + 3] = alpha[i];
  const Light light = frame_light();
  const Ground ground(16, 2.0);
  std::vector<Solved> results;
  for (const AlphaView& view : {AlphaView{alpha.data(), 2, 2}, AlphaView{rgba.data() + 3, 2, 2, 12, 4}}) {
    ShadowScene scene;
    scene.extend(light);
    MeshView mesh = card.view();
    mesh.uvs = uvs;
    mesh.alpha_map = scene.add_alpha_map(view);
    scene.add_mesh(mesh);
    scene.commit();
    results.push_back(solve(exact_solver(), scene, ground.view(), light));
    const Solved truth =
        solve(ShadowSolver({.method = ShadowMethod::kOracle, .light_sample_count = 64}), scene, ground.view(), light);
    CHECK(results.back().masks == truth.masks);
  }
  CHECK(results[0].masks == results[1].masks);
  ShadowScene whole;
  whole.extend(light);
  whole.add_mesh(card.view());
  whole.commit();
  const std::uint64_t all = blocked_bits(solve(exact_solver(), whole, ground.view(), light).masks);
  CHECK(blocked_bits(results[0].masks) < all * 6 / 10);
  CHECK(blocked_bits(results[0].masks) > all * 4 / 10);
}

TEST_CASE("wrong meshes are refused by name, and change nothing") {
  EmbedScene s;
  const auto message = [](const auto& call) -> std::string {
    try {
      call();
    } catch (const Error& error) {
      return error.what();
    }
    return "nothing was thrown";
  };
  std::vector<dvec3> three(3, dvec3(0.0));
  three[2].y = std::nan("");
  CHECK(message([&] { s.scene.add_mesh({.positions = three}); }) == "mesh: position 2 is not finite");
  three[2].y = 1e308;
  Transform large;
  large.row[1][1] = 1e10;
  CHECK(message([&] { s.scene.add_mesh({.positions = three, .transform = large}); }) ==
        "mesh: position 2 is not finite in world space");
  const std::vector<std::array<std::uint32_t, 3>> outside = {{0, 1, 2}, {0, 3, 1}};
  three[2].y = 0.0;
  CHECK(message([&] { s.scene.add_mesh({.positions = three, .triangles = outside}); }) ==
        "mesh: triangle 1 has vertex 3, there are 3");
  CHECK(message([&] { s.scene.add_mesh({.positions = three, .alpha_map = 0}); }) ==
        "mesh: alpha map 0, the scene has 0");
  CHECK(message([&] { s.scene.set_positions(s.ids[0], three); }) == "mesh 0: 3 positions, it has 6");
  CHECK(message([&] { s.scene.set_positions(99, three); }) == "mesh 99 is not in the scene");
  CHECK(message([&] { s.scene.add_alpha_map({}); }) == "alpha map: 0 x 0 texels, 1..65536 each way are allowed");
  CHECK(s.scene.committed());
  CHECK(wrong_bits_now(s, Ground(8)) == 0);
}

TEST_CASE("an empty scene blocks nothing") {
  ShadowScene scene;
  CHECK(!scene.committed());
  scene.extend(frame_light());
  scene.extend(PointView(Ground(4).positions));
  scene.commit();
  const Solved solved = solve(exact_solver(), scene, Ground(4).view(), frame_light());
  CHECK(blocked_bits(solved.masks) == 0);
  CHECK(solved.visibility == std::vector<float>(16, 1.0f));
}
