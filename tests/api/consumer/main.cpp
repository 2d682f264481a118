// Uses the installed library: half of a square light is hidden by a half-plane, seen from the point below its edge.
#include <cstdio>

#include "halfshade/halfshade.h"

int main() {
  halfshade::Scene scene;
  scene.positions = {{-64, 2, -64}, {0, 2, -64}, {0, 2, 64}, {-64, 2, 64}};
  scene.triangles = {{0, 1, 2}, {0, 2, 3}};
  scene.triangle_materials = {0, 0};
  scene.materials.resize(1);

  halfshade::Light light;
  light.center = {0, 4, 0};
  light.u = {2, 0, 0};
  light.v = {0, 0, 2};

  const halfshade::Receiver receiver{{0, 0, 0}};
  halfshade::VisibilityMasks masks;
  halfshade::ShadowConfig config;
  config.pattern = halfshade::SamplePattern::kUniform;
  halfshade::solve_shadows(scene, {&receiver, 1}, light, config, masks);

  // An error of the library is an error here: its type is known on both sides.
  bool refused = false;
  try {
    config.light_sample_count = 0;
    halfshade::solve_shadows(scene, {&receiver, 1}, light, config, masks);
  } catch (const halfshade::Error& error) {
    refused = error.code() == halfshade::ErrorCode::kUsage;
  }

  std::printf("visibility %.4f, expected 0.5\n", static_cast<double>(masks.visibility(0)));
  return masks.visibility(0) == 0.5f && refused ? 0 : 1;
}
