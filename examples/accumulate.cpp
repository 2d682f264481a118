// Temporal jitter through the library alone: the same shadow asked for frame by frame with other light samples, counted
// in integers. Prints the error of the average, and the power of the number of frames by which it falls.
#include <cstdio>
#include <numeric>

#include "halfshade/halfshade.h"

int main() {
  using namespace halfshade;

  // A plate of two triangles at height 2 under a disk light at height 5.
  Scene scene;
  scene.positions = {{-1, 2, -1}, {1, 2, -1}, {1.2, 2, 1}, {-1, 2, 1}};
  scene.triangles = {{0, 1, 2}, {0, 2, 3}};
  scene.triangle_materials = {0, 0};
  scene.materials.resize(1);
  Light light;
  light.shape = LightShape::kDisk;
  light.center = {0, 5, 0};
  light.normal = {0, -1, 0};
  light.radius = 1.0;

  // Receivers on the floor.
  std::vector<Receiver> receivers;
  for (int i = 0; i < 64 * 64; ++i) receivers.push_back({dvec3(i % 64 * 0.15 - 4.7, 0, i / 64 * 0.15 - 4.7), kNone});
  std::vector<std::uint32_t> all(receivers.size());
  std::iota(all.begin(), all.end(), 0u);

  VisibilityMasks masks;
  const auto add_frame = [&](std::uint32_t samples, std::uint32_t frame, VisibilityAccumulator& sum) {
    solve_shadows(scene, receivers, light, {.light_sample_count = samples, .frame = frame}, masks);
    sum.add(masks);
  };

  VisibilityAccumulator truth(receivers.size());
  for (std::uint32_t frame = 0; frame < 16; ++frame) add_frame(1024, 1000 + frame, truth);

  VisibilityAccumulator mean(receivers.size());
  std::vector<double> frames, errors;
  for (std::uint32_t frame = 0; frame < 32; ++frame) {
    add_frame(64, frame, mean);
    const VisibilityError error = visibility_error(mean, truth, all);
    frames.push_back(frame + 1.0);
    errors.push_back(error.rmse);
    std::printf("%2u frames  RMSE %.5f  max %.5f  %.*s\n", frame + 1, error.rmse, error.worst,
                static_cast<int>(error.rmse / errors[0] * 40.0), "########################################");
  }
  const double slope = convergence_exponent(frames, errors);
  std::printf("error ~ frames^%.2f (random: -0.5)\n", slope);
  return errors.back() < 0.25 * errors.front() ? 0 : 1;
}
