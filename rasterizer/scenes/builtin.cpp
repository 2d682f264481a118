#include "rasterizer/scenes/builtin.h"

#include "halfshade/error.h"
#include "rasterizer/core/parallel.h"
#include "rasterizer/scenes/recipes.h"

namespace halfshade {
namespace {

struct Recipe {
  BuiltinInfo info;
  std::uint32_t default_size, min_size, max_size;
  void (*make)(std::uint32_t size, BuiltinScene& out);
};

constexpr std::array kRecipes{
    Recipe{{"demo", "still life: torus knot, columns, plant, trellis, thin rods", "sides of round shapes, 8..256 (48)"},
           48,
           8,
           256,
           make_demo},
    Recipe{{"columns", "a hall of octagonal columns with lintels", "columns per row, 1..256 (5)"},
           5,
           1,
           256,
           make_columns},
    Recipe{{"bars", "two crossed layers of thin bars over a floor", "bars per layer, 1..100000 (14)"},
           14,
           1,
           100000,
           make_bars},
    Recipe{{"fence", "picket fence as one alpha-tested card", "pickets, 1..4096 (16)"}, 16, 1, 4096, make_fence},
    Recipe{{"fence_mesh", "the same fence as triangles", "pickets, 1..4096 (16)"}, 16, 1, 4096, make_fence_mesh},
    Recipe{{"torus_knot", "a smooth closed knot above a floor", "triangles, about, 300..20000000 (40000)"},
           40000,
           300,
           20000000,
           make_torus_knot},
    Recipe{{"grass", "a lawn of bent blades, five triangles each", "blades, 1..10000000 (20000)"},
           20000,
           1,
           10000000,
           make_grass},
    Recipe{{"hairball", "closed curled hairs on a ball, 44 triangles each", "hairs, 1..1000000 (1000)"},
           1000,
           1,
           1000000,
           make_hairball},
    Recipe{{"room", "closed furnished room, the light under its ceiling", "books on each shelf, 1..1000 (18)"},
           18,
           1,
           1000,
           make_room},
    Recipe{{"field", "a matrix of small closed animals", "animals per side, 1..256 (24)"}, 24, 1, 256, make_field},
    Recipe{{"glass", "stained glass, coloured panes and a veil over a floor", "texels per side, 8..2048 (256)"},
           256,
           8,
           2048,
           make_glass},
    Recipe{{"sphere", "a ball above a floor", "sides, 4..4096 (64)"}, 64, 4, 4096, make_sphere},
};

constexpr auto kInfos = [] {
  std::array<BuiltinInfo, kRecipes.size()> infos;
  for (std::size_t i = 0; i < infos.size(); ++i) infos[i] = kRecipes[i].info;
  return infos;
}();

const Recipe& find_recipe(std::string_view name) {
  std::string known;
  for (const Recipe& recipe : kRecipes) {
    if (recipe.info.name == name) return recipe;
    known += (known.empty() ? "" : ", ") + std::string(recipe.info.name);
  }
  throw Error(ErrorCode::kUsage, "no built-in scene '" + std::string(name) + "'; there are: " + known);
}

}  // namespace

std::span<const BuiltinInfo> builtin_scenes() { return kInfos; }

std::uint32_t checked_builtin_size(std::string_view name, std::uint32_t size) {
  const Recipe& recipe = find_recipe(name);
  if (size == 0) size = recipe.default_size;
  if (size < recipe.min_size || size > recipe.max_size) {
    throw Error(ErrorCode::kUsage, "built-in scene '" + std::string(name) + "': size " + std::to_string(size) +
                                       " is outside " + std::to_string(recipe.min_size) + ".." +
                                       std::to_string(recipe.max_size));
  }
  return size;
}

BuiltinScene make_builtin_scene(std::string_view name, std::uint32_t size) {
  const Recipe& recipe = find_recipe(name);
  size = checked_builtin_size(name, size);
  const FpEnvironment environment;
  BuiltinScene result;
  result.scene.name = name;
  recipe.make(size, result);
  return result;
}

Light rectangle_light(const dvec3& center, const dvec3& target, double width, double height) {
  const dvec3 toward = target - center;
  const dvec3 normal = toward / std::sqrt(glm::dot(toward, toward));
  const dvec3 across = std::fabs(normal.y) < 0.99 ? glm::cross(normal, dvec3{0.0, 1.0, 0.0}) : dvec3{1.0, 0.0, 0.0};
  const dvec3 u = (across - normal * glm::dot(across, normal));
  const dvec3 unit_u = u / std::sqrt(glm::dot(u, u));
  Light light;
  light.shape = LightShape::kRectangle;
  light.center = center;
  light.u = unit_u * width;
  light.v = glm::cross(normal, unit_u) * height;  // so that u x v points along `normal`
  return light;
}

Camera look(const dvec3& eye, const dvec3& target, double fov_y_deg) {
  Camera camera;
  camera.eye = eye;
  camera.target = target;
  camera.fov_y_deg = fov_y_deg;
  return camera;
}

}  // namespace halfshade
