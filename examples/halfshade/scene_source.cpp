#include "scene_source.h"

#define XXH_INLINE_ALL
#include <xxhash.h>

#include <fmt/format.h>

#include <charconv>

#include "halfshade/error.h"
#include "rasterizer/io/view_file.h"
#include "rasterizer/scenes/builtin.h"

namespace halfshade {
namespace {

constexpr std::string_view kBuiltin = "builtin:";

SceneSource load_builtin(std::string_view rest) {
  const std::size_t colon = rest.find(':');
  std::uint32_t size = 0;
  if (colon != std::string_view::npos) {
    const std::string_view digits = rest.substr(colon + 1);
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), size);
    if (error != std::errc() || end != digits.data() + digits.size() || size == 0) {
      throw Error(ErrorCode::kUsage, fmt::format("built-in scene size '{}' is not a whole number from 1", digits));
    }
  }
  BuiltinScene builtin = make_builtin_scene(rest.substr(0, colon), size);
  SceneSource source;
  source.scene = std::move(builtin.scene);
  source.view = std::move(builtin.view);
  return source;
}

/// A camera that sees the whole scene and a square light above it, for scenes that come without a view.
View fitted_view(const Scene& scene) {
  dvec3 low = scene.positions[0], high = low;
  for (const dvec3& p : scene.positions) low = glm::min(low, p), high = glm::max(high, p);
  const dvec3 center = (low + high) * 0.5;
  const double radius = std::max(glm::length(high - low) * 0.5, 1e-30);
  View view;
  view.camera.target = center;
  view.camera.eye = center + radius * 2.2 * glm::normalize(dvec3(0.5, 0.55, 1.0));
  view.camera.fov_y_deg = 50.0;
  Light light;
  light.name = "key";
  light.center = center + radius * dvec3(0.6, 1.6, 0.4);
  light.u = dvec3(0.4 * radius, 0, 0);
  light.v = dvec3(0, 0, 0.4 * radius);
  light.two_sided = true;
  view.lights.push_back(light);
  return view;
}

template <class T>
void update(XXH3_state_t& state, const std::vector<T>& values) {
  const std::uint64_t count = values.size();
  XXH3_128bits_update(&state, &count, sizeof count);
  XXH3_128bits_update(&state, values.data(), values.size() * sizeof(T));
}

}  // namespace

SceneSource load_scene(const std::string& name, const std::string& view_file, const ObjLoadOptions& options) {
  SceneSource source;
  if (name.starts_with(kBuiltin)) {
    source = load_builtin(std::string_view(name).substr(kBuiltin.size()));
  } else {
    const std::filesystem::path path(name);
    source.scene = load_obj(path, options, source.report);
    std::filesystem::path beside = path;
    beside.replace_extension(".view.json");
    if (view_file.empty() && std::filesystem::exists(beside)) {
      source.view = load_view(beside);
    } else if (view_file.empty()) {
      source.view = fitted_view(source.scene);
      source.view_was_made_up = true;
    }
  }
  if (!view_file.empty()) source.view = load_view(view_file);
  return source;
}

std::string scene_hash(const Scene& scene) {
  XXH3_state_t state;
  XXH3_128bits_reset(&state);
  update(state, scene.positions);
  update(state, scene.triangles);
  update(state, scene.triangle_materials);
  update(state, scene.triangle_uvs);
  update(state, scene.triangle_normals);
  for (const Material& m : scene.materials) {
    const float numbers[8] = {m.diffuse.x,       m.diffuse.y,       m.diffuse.z,       m.opacity,
                              m.transmittance.x, m.transmittance.y, m.transmittance.z, m.alpha_cutoff};
    const std::uint32_t maps[2] = {m.color_map, m.alpha_map};
    XXH3_128bits_update(&state, numbers, sizeof numbers);
    XXH3_128bits_update(&state, maps, sizeof maps);
  }
  for (const ColorMap& map : scene.color_maps) update(state, map.rgb);
  for (const AlphaMap& map : scene.alpha_maps) update(state, map.alpha);
  const XXH128_hash_t digest = XXH3_128bits_digest(&state);
  return fmt::format("{:016x}{:016x}", digest.high64, digest.low64);
}

}  // namespace halfshade
