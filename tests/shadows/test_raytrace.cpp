// Method raytrace, whether Embree was built in or not.
#include <doctest/doctest.h>

#include "rasterizer/scenes/builtin.h"
#include "shadows/raytrace/embree_rays.h"
#include "shadows/raytrace/raytrace.h"
#include "support/lit_picture.h"
#include "support/lit_scene.h"

using namespace halfshade;
using namespace halfshade::test;

TEST_CASE("the core library refuses to trace rays and says where they are traced") {
  const std::vector<Receiver> receivers = receivers_at({{0, 0, 0}});
  ShadowConfig config = frame_config(4);
  config.method = ShadowMethod::kRaytrace;
  VisibilityMasks masks;
  CHECK_THROWS_WITH_AS(solve_shadows(scene_of(box({-1, 1, -1}, {1, 2, 1})), receivers, frame_light(), config, masks),
                       doctest::Contains("not part of the core library"), Error);
}

TEST_CASE("rays give nearly the exact masks in both modes, or a clear error without Embree") {
  const BuiltinScene builtin = make_builtin_scene("demo", 12);
  for (const std::uint32_t samples : {1u, 6u, 16u, 64u, 100u}) {
    ShadowConfig config = frame_config(samples);
    const LitPicture picture = make_lit_picture(builtin.scene, builtin.view.camera, builtin.view.lights[0], config);
    VisibilityMasks truth, masks;
    ShadowStats stats;
    solve_masks(picture.mesh, picture.receivers, picture.light, picture.samples, config, truth, stats);
    for (const bool robust : {true, false}) {
      config.raytrace.robust = robust;
      const auto trace = [&] {
        solve_raytrace(picture.mesh, picture.receivers, picture.samples, config, masks, stats);
      };
      if (!embree_available()) {
        CHECK_THROWS_WITH_AS(trace(), doctest::Contains("built without Embree"), Error);
        continue;
      }
      trace();
      CAPTURE(samples);
      CHECK(wrong_bits(truth, masks) * 1000 <= picture.receivers.size() * samples);
    }
  }
}
