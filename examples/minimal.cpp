// Soft shadow of a square plate on a floor, as text: the whole library in one call, no files.
#include <cstdio>

#include "halfshade/halfshade.h"

int main() {
  using namespace halfshade;

  // A plate of two triangles at height 2.
  Scene scene;
  scene.positions = {{-1, 2, -1}, {1, 2, -1}, {1, 2, 1}, {-1, 2, 1}};
  scene.triangles = {{0, 1, 2}, {0, 2, 3}};
  scene.triangle_materials = {0, 0};
  scene.materials.resize(1);

  // A square light at height 5 that faces the floor.
  Light light;
  light.center = {0, 5, 0};
  light.u = {2, 0, 0};
  light.v = {0, 0, 2};

  // Receivers on the floor.
  constexpr int kWidth = 64, kHeight = 24;
  std::vector<Receiver> receivers;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      receivers.push_back({dvec3((x + 0.5) / kWidth * 10 - 5, 0, (y + 0.5) / kHeight * 7.5 - 3.75), kNone});
    }
  }

  VisibilityMasks masks;
  solve_shadows(scene, receivers, light, {.light_sample_count = 256}, masks);

  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const float visibility = masks.visibility(static_cast<std::size_t>(y * kWidth + x));
      std::putchar("@#*+=-:. "[static_cast<int>(visibility * 8.0f)]);
    }
    std::putchar('\n');
  }
}
