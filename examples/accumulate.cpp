// Temporal jitter through the library alone: the same shadow asked for frame by frame with other light samples, counted
// in integers. The scene is committed once, and one workspace serves all frames. Prints the error of the average, and
// the power of the number of frames by which it falls.
#include <cstdio>
#include <numeric>

#include "halfshade/halfshade.h"

int main() {
  using namespace halfshade;

  // A plate of two triangles at height 2 under a disk light at height 5.
  const std::vector<vec3> corners = {{-1, 2, -1}, {1, 2, -1}, {1.2f, 2, 1}, {-1, 2, 1}};
  const std::vector<std::array<std::uint32_t, 3>> triangles = {{0, 1, 2}, {0, 2, 3}};
  Light light;
  light.shape = LightShape::kDisk;
  light.center = {0, 5, 0};
  light.radius = 1.0;

  // Receivers on the floor.
  std::vector<dvec3> floor;
  for (int i = 0; i < 64 * 64; ++i) floor.push_back({i % 64 * 0.15 - 4.7, 0, i / 64 * 0.15 - 4.7});
  std::vector<std::uint32_t> all(floor.size());
  std::iota(all.begin(), all.end(), 0u);

  ShadowScene scene;
  MeshView plate;
  plate.positions = corners;
  plate.triangles = triangles;
  scene.add_mesh(plate);
  scene.extend(light);
  scene.extend(floor);
  scene.commit();

  Workspace workspace;
  VisibilityMasks masks;
  const auto add_frame = [&](std::uint32_t samples, std::uint32_t frame, VisibilityAccumulator& sum) {
    const ShadowSolver solver({.light_sample_count = samples});
    ReceiverView receivers;
    receivers.positions = floor;
    receivers.frame = frame;
    masks.reset(floor.size(), samples);
    ShadowOutput output;
    output.masks = masks.words;
    solver.solve(scene, receivers, light, workspace, output);
    sum.add(masks);
  };

  VisibilityAccumulator truth(floor.size());
  for (std::uint32_t frame = 0; frame < 16; ++frame) add_frame(1024, 1000 + frame, truth);

  VisibilityAccumulator mean(floor.size());
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
