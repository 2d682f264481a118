// Camera, receivers and masks of whole scenes against the oracle: 0 wrong bits.
#include <doctest/doctest.h>

#include <filesystem>

#include "rasterizer/core/hash.h"
#include "rasterizer/io/obj_scene.h"
#include "rasterizer/io/view_file.h"
#include "rasterizer/rasterizer.h"
#include "rasterizer/scenes/builtin.h"
#include "shadows/opaque_mesh.h"
#include "shadows/oracle.h"
#include "shadows/solver.h"
#include "support/lit_scene.h"

using namespace halfshade;
using namespace halfshade::test;

namespace {

struct Outcome {
  std::uint64_t receivers = 0, checked = 0, blocked = 0, wrong = 0;
  bool methods_agree = true;  // on the masks of all receivers
};

/// Renders the view's first light and checks one receiver in `every` with the oracle.
Outcome check_scene(const Scene& scene, const View& view, std::uint32_t size, std::uint32_t samples,
                    std::uint32_t every) {
  const Light& light = view.lights.at(0);
  const LatticeMesh mesh = make_lattice_mesh(scene, make_local_frame(scene.positions, light_extent(light)));
  GBuffer gbuffer;
  rasterize(mesh, view.camera, {size, size, {}}, gbuffer);
  ShadowConfig config;
  config.light_sample_count = samples;
  config.sample_sets = 2;
  const LightSamples light_samples = make_light_samples(light, config, mesh.frame);
  const ReceiverArray receivers = make_receivers(gbuffer, light_samples, 0);
  VisibilityMasks masks;
  ShadowStats stats;
  solve_masks(mesh, receivers, light, light_samples, config, masks, stats);
  Outcome outcome;
  for (const ShadowMethod method : exact_methods()) {
    VisibilityMasks other;
    config.method = method;
    solve_masks(mesh, receivers, light, light_samples, config, other, stats);
    outcome.methods_agree = outcome.methods_agree && other.words == masks.words;
  }
  const OpaqueMesh opaque(mesh);
  outcome.receivers = receivers.size();
  for (std::size_t i = 0; i < receivers.size(); ++i) {
    if (hash32(static_cast<std::uint32_t>(i), 1) % every != 0) continue;
    std::vector<std::uint64_t> truth(masks.words_per_receiver, 0);
    oracle_mask(opaque.get(), receivers, i, light_samples, truth);
    for (std::size_t w = 0; w < truth.size(); ++w) {
      outcome.wrong += static_cast<std::uint64_t>(std::popcount(truth[w] ^ masks.mask(i)[w]));
      outcome.blocked += static_cast<std::uint64_t>(std::popcount(truth[w]));
    }
    ++outcome.checked;
  }
  return outcome;
}

}  // namespace

TEST_CASE("built-in scenes: masks equal the oracle") {
  for (const BuiltinInfo& info : builtin_scenes()) {
    const std::string name(info.name);
    CAPTURE(name);
    const BuiltinScene builtin = make_builtin_scene(name, name == "grass" ? 2000 : 0);
    const Outcome outcome = check_scene(builtin.scene, builtin.view, 72, 64, 7);
    CHECK(outcome.receivers > 1000);
    CHECK(outcome.blocked > 0);
    CHECK(outcome.blocked < outcome.checked * 64);
    CHECK(outcome.wrong == 0);
    CHECK(outcome.methods_agree);
  }
}

TEST_CASE("built-in scenes: no option of the alias-free shadow map changes a mask") {
  for (const BuiltinInfo& info : builtin_scenes()) {
    const std::string name(info.name);
    CAPTURE(name);
    const BuiltinScene builtin = make_builtin_scene(name, name == "grass" ? 2000 : 0);
    if (builtin.scene.triangles.size() > 150000) continue;  // for time
    const Light& light = builtin.view.lights.at(0);
    const LatticeMesh mesh =
        make_lattice_mesh(builtin.scene, make_local_frame(builtin.scene.positions, light_extent(light)));
    GBuffer gbuffer;
    rasterize(mesh, builtin.view.camera, {32, 32, {}}, gbuffer);
    ShadowConfig config;
    config.method = ShadowMethod::kAliasFreeShadowMap;
    config.light_sample_count = 32;
    const LightSamples samples = make_light_samples(light, config, mesh.frame);
    const ReceiverArray receivers = make_receivers(gbuffer, samples, 0);
    VisibilityMasks masks, other;
    ShadowStats stats;
    solve_masks(mesh, receivers, light, samples, config, masks, stats);
    for (int outline = 0; outline < 6; ++outline) {
      CAPTURE(outline);
      const bool on = outline % 2 != 0;
      config.afsm = {static_cast<InfluenceOutline>(outline), on, on, on, on, on, on, 128};
      solve_masks(mesh, receivers, light, samples, config, other, stats);
      CHECK(other.hash() == masks.hash());
    }
  }
}

TEST_CASE("shared scenes: masks of one receiver in a hundred equal the oracle") {
  const std::filesystem::path folder = HALFSHADE_SHARED_SCENES;
  if (!std::filesystem::exists(folder)) {
    MESSAGE("skipped: there is no folder of shared scenes beside the project");
    return;
  }
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const std::filesystem::path name = entry.path().filename();
    if (!entry.is_directory()) continue;
    CAPTURE(name.string());
    ObjLoadReport report;
    const Scene scene = load_obj(entry.path() / (name.string() + ".obj"), {}, report);
    const Outcome outcome = check_scene(scene, load_view(entry.path() / (name.string() + ".view.json")), 112, 64, 100);
    CHECK(outcome.checked > 10);
    CHECK(outcome.blocked > 0);
    CHECK(outcome.wrong == 0);
    CHECK(outcome.methods_agree);
  }
}
