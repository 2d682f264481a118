// `glass`: coloured light on a floor. A stained-glass window (transmittance texture) in an opaque frame, three panes of
// primary colours that overlap, a closed slab, a veil of grey opacity, and an opaque ball among them.
#include "rasterizer/scenes/mesh_builder.h"
#include "rasterizer/scenes/recipes.h"

namespace halfshade {
namespace {

using Rgb = std::array<std::uint8_t, 3>;

constexpr std::array kGlassColors{Rgb{214, 38, 44},   Rgb{36, 72, 196},  Rgb{240, 190, 40}, Rgb{32, 150, 82},
                                  Rgb{236, 236, 224}, Rgb{140, 52, 168}, Rgb{250, 120, 30}, Rgb{60, 180, 214}};
constexpr Rgb kLead{0, 0, 0};
constexpr std::uint32_t kPieces = 28;  // of glass; each has the texels that are nearest to its seed

ColorMap stained_glass(std::uint32_t size) {
  std::vector<dvec2> seeds;
  for (std::uint32_t i = 0; i < kPieces; ++i) {
    Random random(7, i);
    const double x = random.uniform();
    seeds.emplace_back(x, random.uniform());
  }
  ColorMap map{"stained glass", size, size, {}};
  for (std::uint32_t y = 0; y < size; ++y) {
    for (std::uint32_t x = 0; x < size; ++x) {
      const dvec2 p((x + 0.5) / size, (y + 0.5) / size);
      double nearest = 4.0, second = 4.0;
      std::size_t piece = 0;
      for (std::size_t i = 0; i < seeds.size(); ++i) {
        const double distance = glm::length(p - seeds[i]);
        if (distance < nearest) piece = i;
        second = std::min(second, std::max(distance, nearest));
        nearest = std::min(nearest, distance);
      }
      const Rgb& rgb = second - nearest < 0.012 ? kLead : kGlassColors[piece % kGlassColors.size()];
      map.rgb.insert(map.rgb.end(), rgb.begin(), rgb.end());
    }
  }
  return map;
}

/// Soft stripes: opacity that goes up and down.
AlphaMap veil(std::uint32_t size) {
  AlphaMap map{"veil", size, size, {}};
  for (std::uint32_t y = 0; y < size; ++y) {
    for (std::uint32_t x = 0; x < size; ++x) {
      const double wave = 0.5 + 0.5 * unit_circle(6.0 * (x + 0.5) / size).x;
      map.alpha.push_back(static_cast<std::uint8_t>(255.0 * wave * wave));
    }
  }
  return map;
}

Material& glass(MeshBuilder& builder, Scene& scene, const std::string& name, const vec3& color) {
  Material& material = scene.materials[builder.material(name, color)];
  material.opacity = 0.0f;
  material.transmittance = color;
  return material;
}

void make_window(MeshBuilder& builder, Scene& scene, std::uint32_t size) {
  scene.color_maps.push_back(stained_glass(size));
  Material& material = glass(builder, scene, "stained glass", vec3(1.0f));
  material.color_map = material.transmittance_map = 0;
  constexpr double kLeft = -2.9, kRight = -0.5, kBottom = 0.25, kTop = 2.65, kFrame = 0.12;
  builder.card({kLeft, kBottom, 0}, {kRight, kBottom, 0}, {kRight, kTop, 0}, {kLeft, kTop, 0}, vec2(0.0f), vec2(1.0f));
  builder.material("frame", {0.30f, 0.24f, 0.18f});
  builder.box({kLeft - kFrame, 0.0, -0.08}, {kLeft, kTop, 0.08});
  builder.box({kRight, 0.0, -0.08}, {kRight + kFrame, kTop, 0.08});
  builder.box({kLeft - kFrame, kTop, -0.08}, {kRight + kFrame, kTop + kFrame, 0.08});
  builder.box({kLeft, 0.0, -0.08}, {kRight, kBottom, 0.08});
}

void make_panes(MeshBuilder& builder, Scene& scene) {
  constexpr std::array kColors{vec3(0.95f, 0.12f, 0.10f), vec3(0.98f, 0.85f, 0.10f), vec3(0.10f, 0.35f, 0.95f)};
  for (std::size_t i = 0; i < kColors.size(); ++i) {
    glass(builder, scene, "pane " + std::to_string(i + 1), kColors[i]);
    const double x = 0.3 + 0.42 * static_cast<double>(i), z = -0.55 * static_cast<double>(i);
    const double top = 2.0 + 0.1 * static_cast<double>(i);
    builder.quad(dvec3{x, 0.0, z}, dvec3{x + 1.3, 0.0, z}, dvec3{x + 1.3, top, z}, dvec3{x, top, z});
  }
}

}  // namespace

void make_glass(std::uint32_t size, BuiltinScene& out) {
  MeshBuilder builder(out.scene);
  builder.material("floor", {0.82f, 0.80f, 0.76f});
  builder.ground(9.0);
  make_window(builder, out.scene, size);
  make_panes(builder, out.scene);
  glass(builder, out.scene, "slab", {0.55f, 0.90f, 0.70f});  // crossed twice
  builder.box({-0.35, 0.35, 2.3}, {0.75, 0.5, 3.1});
  out.scene.alpha_maps.push_back(veil(size));
  Material& cloth = glass(builder, out.scene, "veil", vec3(0.9f));
  cloth.opacity = 0.85f, cloth.alpha_map = 0;
  builder.card({2.6, 0.0, 1.2}, {3.9, 0.0, 0.4}, {3.9, 1.6, 0.4}, {2.6, 1.6, 1.2}, vec2(0.0f), vec2(1.0f));
  builder.material("ball", {0.75f, 0.72f, 0.70f});
  const std::uint32_t first = builder.triangle_count();
  builder.ellipsoid({1.7, 0.45, 1.9}, dvec3(0.45), 48, 24);
  builder.smooth(first);
  builder.finish();
  out.view.camera = look({0.6, 4.2, 8.2}, {0.4, 0.55, 1.1}, 46.0);
  out.view.lights = {rectangle_light({-1.5, 6.0, -5.5}, {0.0, 0.5, 1.0}, 0.6, 0.6)};
}

}  // namespace halfshade
