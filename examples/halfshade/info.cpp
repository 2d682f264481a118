// halfshade info: what a scene holds; without a scene, the built-in ones.
#include <fmt/format.h>

#include <map>

#include "rasterizer/scenes/builtin.h"
#include "scene_source.h"
#include "verbs.h"

namespace halfshade {
namespace {

void print_builtin_scenes() {
  fmt::print("built-in scenes (builtin:NAME or builtin:NAME:SIZE)\n");
  for (const BuiltinInfo& info : builtin_scenes()) {
    fmt::print("  {:<12} {}\n  {:<12} SIZE: {}\n", info.name, info.description, "", info.size_meaning);
  }
}

struct EdgeCounts {
  std::uint64_t edges = 0, open = 0, crowded = 0, same_direction = 0;
};

/// How many triangles use each edge, and in which directions; positions are welded already.
EdgeCounts count_edges(const Scene& scene) {
  std::vector<std::uint64_t> directed;
  directed.reserve(scene.triangles.size() * 3);
  for (const auto& t : scene.triangles) {
    for (int k = 0; k < 3; ++k) {
      const std::uint64_t a = t[k], b = t[(k + 1) % 3];
      if (a != b) directed.push_back(a < b ? (a << 33 | b << 1) : (b << 33 | a << 1 | 1));
    }
  }
  std::sort(directed.begin(), directed.end());
  EdgeCounts counts;
  for (std::size_t i = 0; i < directed.size();) {
    std::size_t j = i, backward = 0;
    for (; j < directed.size() && directed[j] >> 1 == directed[i] >> 1; ++j) backward += directed[j] & 1;
    ++counts.edges;
    counts.open += j - i == 1;
    counts.crowded += j - i > 2;
    counts.same_direction += j - i == 2 && backward != 1;
    i = j;
  }
  return counts;
}

void print_triangles(const Scene& scene) {
  std::uint64_t perforated = 0, translucent = 0;
  for (std::size_t t = 0; t < scene.triangles.size(); ++t) {
    const Material& m = scene.materials[scene.triangle_materials[t]];
    perforated += m.alpha_map != kNone && !scene.triangle_uvs.empty();
    translucent += m.translucent();
  }
  fmt::print("triangles    {} ({} with an alpha map, {} translucent)\n", scene.triangles.size(), perforated,
             translucent);
}

void print_light(const Light& light) {
  static constexpr const char* kNames[] = {"point", "rectangle", "disk", "sphere", "samples", "ellipsoid", "polygon"};
  dvec3 place = light.center;
  if (!light.points.empty()) {
    place = dvec3(0.0);
    for (const dvec3& p : light.points) place += p / static_cast<double>(light.points.size());
  }
  fmt::print("light        {}: {} at ({:g}, {:g}, {:g}){}\n", light.name, kNames[static_cast<int>(light.shape)],
             place.x, place.y, place.z, light.two_sided ? ", two-sided" : "");
}

void print_scene(const std::string& name, const ObjLoadOptions& options) {
  const SceneSource source = load_scene(name, "", options);
  const Scene& scene = source.scene;
  dvec3 low = scene.positions.at(0), high = low;
  for (const dvec3& p : scene.positions) low = glm::min(low, p), high = glm::max(high, p);
  const EdgeCounts edges = count_edges(scene);
  fmt::print("scene        {}\n", name);
  print_triangles(scene);
  fmt::print("vertices     {}\n", scene.positions.size());
  fmt::print("bounding box ({:g}, {:g}, {:g}) .. ({:g}, {:g}, {:g})\n", low.x, low.y, low.z, high.x, high.y, high.z);
  fmt::print("edges        {}: {} open, {} shared by more than two triangles, {} by two of opposite winding\n",
             edges.edges, edges.open, edges.crowded, edges.same_direction);
  fmt::print("materials    {}, {} colour maps, {} alpha maps\n", scene.materials.size(), scene.color_maps.size(),
             scene.alpha_maps.size());
  const Camera& camera = source.view.camera;
  fmt::print("camera       ({:g}, {:g}, {:g}) to ({:g}, {:g}, {:g}), {:g} degrees{}\n", camera.eye.x, camera.eye.y,
             camera.eye.z, camera.target.x, camera.target.y, camera.target.z, camera.fov_y_deg,
             source.view_was_made_up ? " (fitted: no view file)" : "");
  for (const Light& light : source.view.lights) print_light(light);
  fmt::print("hash         {}\n", scene_hash(scene));
  for (const std::string& warning : source.report.warnings) fmt::print(stderr, "halfshade: warning: {}\n", warning);
}

}  // namespace

void add_info(CLI::App& app) {
  CLI::App* verb = app.add_subcommand("info", "Describe a scene, or list the built-in ones");
  auto name = std::make_shared<std::string>();
  auto options = std::make_shared<ObjLoadOptions>();
  verb->add_option("scene", *name, "OBJ file or builtin:NAME[:SIZE]");
  verb->add_flag("--lenient", options->lenient, "Skip wrong faces and count them");
  verb->add_flag("--allow-path", options->allow_any_path, "Textures and materials may lie outside the OBJ's directory");
  verb->callback([name, options] { name->empty() ? print_builtin_scenes() : print_scene(*name, *options); });
}

}  // namespace halfshade
