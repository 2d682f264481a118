// View files: read, written, read again; cameras and light samples made from what was accepted.
#include <cmath>

#include "fuzz/fuzz_target.h"
#include "rasterizer/camera_frame.h"
#include "rasterizer/io/view_file.h"
#include "shadows/light_samples.h"

namespace halfshade::fuzz {
namespace {

View read(const std::string& name, std::string_view text, Refusal& refusal) {
  View view;
  const auto file = write_file(name, text);
  refusal = refusal_of([&] { view = load_view(file); });
  return view;
}

void check_samples(const Light& light, const dvec3& scene_corner) {
  const auto refusal = refusal_of([&] {
    const std::array<dvec3, 2> scene = {dvec3(0.0), scene_corner};
    const std::vector<dvec3> extent = light_extent(light);
    const LocalFrame frame = make_local_frame(scene, extent);
    const LightSamples samples = make_light_samples(light, {.light_sample_count = 16}, frame);
    require(samples.points.size() == std::size_t{samples.sets} * samples.count,
            "as many samples as there are said to be");
    for (const vec3& p : samples.points) {
      require(is_finite(dvec3(p)), "light samples are finite");
      for (int axis = 0; axis < 3; ++axis) require(std::fabs(p[axis]) <= 2.0f, "light samples lie in the local frame");
    }
  });
  if (refusal.refused) require(!refusal.message.empty(), "refusals say why");
}

}  // namespace

void fuzz_view(Bytes input) {
  Refusal refusal;
  const View view = read("input.view.json", as_text(input), refusal);
  if (refusal.refused) {
    require(refusal.message.starts_with(directory().string()), "messages name the view file or the picture at fault");
    return;
  }
  const std::string written = view_to_json(view);
  const View again = read("again.view.json", written, refusal);
  require(!refusal.refused, "what was written can be read: " + refusal.message);
  require(view_to_json(again) == written, "every bit comes back");
  for (const dvec3& corner : {dvec3(1.0), dvec3(1e6, 1.0, 1e-6)}) {
    for (const Light& light : view.lights) check_samples(light, corner);
  }
  refusal_of([&] {
    const CameraFrame frame = make_camera_frame(view.camera, {}, 64, 48);
    require(is_finite(frame.right) && is_finite(frame.up) && is_finite(frame.forward), "camera axes are finite");
  });
}

}  // namespace halfshade::fuzz
