#include "scene_source.h"

#define XXH_INLINE_ALL
#include <xxhash.h>

#include <fmt/format.h>

#include <charconv>

#include "halfshade/error.h"
#include "rasterizer/io/obj_stream.h"
#include "rasterizer/io/view_file.h"
#include "rasterizer/scenes/builtin.h"
#include "rasterizer/scenes/scene_stream.h"

namespace halfshade {
namespace {

constexpr std::string_view kBuiltin = "builtin:";

/// "NAME" or "NAME:SIZE"; size 0 = the scene's default.
struct BuiltinName {
  std::string_view name;
  std::uint32_t size = 0;
};

BuiltinName parse_builtin(std::string_view rest) {
  const std::size_t colon = rest.find(':');
  BuiltinName builtin{rest.substr(0, colon)};
  if (colon == std::string_view::npos) return builtin;
  const std::string_view digits = rest.substr(colon + 1);
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), builtin.size);
  if (error != std::errc() || end != digits.data() + digits.size() || builtin.size == 0) {
    throw Error(ErrorCode::kUsage, fmt::format("built-in scene size '{}' is not a whole number from 1", digits));
  }
  return builtin;
}

SceneSource load_builtin(std::string_view rest) {
  const BuiltinName wanted = parse_builtin(rest);
  BuiltinScene builtin = make_builtin_scene(wanted.name, wanted.size);
  SceneSource source;
  source.scene = std::move(builtin.scene);
  source.view = std::move(builtin.view);
  return source;
}

std::pair<dvec3, dvec3> box_of(const Scene& scene) {
  dvec3 low = scene.positions[0], high = low;
  for (const dvec3& p : scene.positions) low = glm::min(low, p), high = glm::max(high, p);
  return {low, high};
}

View view_around(const Scene& scene) {
  const auto [low, high] = box_of(scene);
  return fitted_view(low, high);
}

/// The view file beside an OBJ, if there is one.
std::filesystem::path view_beside(const std::filesystem::path& scene) {
  std::filesystem::path beside = scene;
  beside.replace_extension(".view.json");
  return std::filesystem::exists(beside) ? beside : std::filesystem::path();
}

template <class T>
void update(XXH3_state_t& state, const std::vector<T>& values) {
  const std::uint64_t count = values.size();
  XXH3_128bits_update(&state, &count, sizeof count);
  XXH3_128bits_update(&state, values.data(), values.size() * sizeof(T));
}

}  // namespace

View fitted_view(const dvec3& low, const dvec3& high) {
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

SceneSource load_scene(const std::string& name, const std::string& view_file, const ObjLoadOptions& options) {
  SceneSource source;
  if (name.starts_with(kBuiltin)) {
    source = load_builtin(std::string_view(name).substr(kBuiltin.size()));
  } else {
    const std::filesystem::path path(name);
    source.scene = load_obj(path, options, source.report);
    const std::filesystem::path beside = view_beside(path);
    if (view_file.empty() && !beside.empty()) {
      source.view = load_view(beside);
    } else if (view_file.empty()) {
      source.view = view_around(source.scene);
      source.view_was_made_up = true;
    }
  }
  if (!view_file.empty()) source.view = load_view(view_file);
  const auto [low, high] = box_of(source.scene);
  place_suns(source.view, low, high);
  return source;
}

void place_suns(View& view, const dvec3& low, const dvec3& high) {
  for (Light& light : view.lights) light = place_sun(light, low, high);
}

StreamSource open_stream(const std::string& name, const std::string& view_file, const ObjLoadOptions& options,
                         std::size_t triangles_per_piece) {
  StreamSource source;
  if (name.starts_with(kBuiltin)) {
    const BuiltinName builtin = parse_builtin(std::string_view(name).substr(kBuiltin.size()));
    StreamedScene scene = stream_builtin_scene(builtin.name, builtin.size, triangles_per_piece);
    source.stream = std::move(scene.stream);
    source.view = std::move(scene.view);
  } else {
    source.stream = stream_obj(name, options, source.report);
    const std::filesystem::path beside = view_beside(name);
    source.needs_view = view_file.empty() && beside.empty();
    if (!beside.empty() && view_file.empty()) source.view = load_view(beside);
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
    const std::uint32_t maps[3] = {m.color_map, m.alpha_map, m.transmittance_map};
    XXH3_128bits_update(&state, numbers, sizeof numbers);
    XXH3_128bits_update(&state, maps, sizeof maps);
  }
  for (const ColorMap& map : scene.color_maps) update(state, map.rgb);
  for (const AlphaMap& map : scene.alpha_maps) update(state, map.alpha);
  const XXH128_hash_t digest = XXH3_128bits_digest(&state);
  return fmt::format("{:016x}{:016x}", digest.high64, digest.low64);
}

}  // namespace halfshade
