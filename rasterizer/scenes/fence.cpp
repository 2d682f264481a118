// One picket fence twice: `fence` is a card with an opacity texture, `fence_mesh` the same shape as triangles.
//
// Both are made from the rectangles below, in texels of one period of the fence. All coordinates are small multiples of
// a power of two, so that they are exact in float and on the lattice: the two scenes cast the same shadow bit for bit,
// save for segments through the very border of a rectangle (there a texel owns its low edge only, a triangle all its
// edges).
#include <bit>

#include "rasterizer/scenes/mesh_builder.h"
#include "rasterizer/scenes/recipes.h"

namespace halfshade {
namespace {

constexpr std::uint32_t kPeriod = 16, kRows = 64;  // texels
constexpr double kHeight = 2.0;                    // metres

struct TexelRect {
  std::uint32_t x0, x1, y0, y1;  // half-open, y upwards
};

constexpr std::array kOpaque{
    TexelRect{4, 12, 0, 56}, TexelRect{5, 11, 56, 58},  TexelRect{6, 10, 58, 60}, TexelRect{7, 9, 60, 62},
    TexelRect{0, 4, 12, 17}, TexelRect{12, 16, 12, 17},  // lower rail left and right of the picket
    TexelRect{0, 4, 42, 47}, TexelRect{12, 16, 42, 47},
};

AlphaMap fence_texture() {
  AlphaMap map;
  map.name = "fence";
  map.width = kPeriod;
  map.height = kRows;
  map.alpha.assign(kPeriod * kRows, 0);
  for (const TexelRect& rect : kOpaque) {
    for (std::uint32_t y = rect.y0; y < rect.y1; ++y) {
      for (std::uint32_t x = rect.x0; x < rect.x1; ++x) map.alpha[(kRows - 1 - y) * kPeriod + x] = 255;
    }
  }
  return map;
}

/// Width of one period: the whole fence is between 4 and 8 metres wide.
double period_width(std::uint32_t pickets) { return 8.0 / static_cast<double>(std::bit_ceil(pickets)); }

void make_surroundings(MeshBuilder& builder, BuiltinScene& out) {
  builder.material("sand", {0.66f, 0.58f, 0.46f});
  builder.ground(8.0);
  builder.material("fence", {0.80f, 0.80f, 0.76f});
  out.view.camera = look({1.5, 3.5, 8.5}, {0.0, 0.55, 1.0}, 50.0);
  out.view.lights = {rectangle_light({-3.0, 5.5, -6.0}, {0.0, 0.5, 0.0}, 1.6, 1.6)};
}

}  // namespace

void make_fence(std::uint32_t size, BuiltinScene& out) {
  MeshBuilder builder(out.scene);
  make_surroundings(builder, out);
  out.scene.alpha_maps.push_back(fence_texture());
  out.scene.materials.back().alpha_map = 0;
  const double half = 0.5 * size * period_width(size);
  builder.card({-half, 0.0, 0.0}, {half, 0.0, 0.0}, {half, kHeight, 0.0}, {-half, kHeight, 0.0}, {0.0f, 0.0f},
               {static_cast<float>(size), 1.0f});
  builder.finish();
}

void make_fence_mesh(std::uint32_t size, BuiltinScene& out) {
  MeshBuilder builder(out.scene);
  make_surroundings(builder, out);
  const double texel_x = period_width(size) / kPeriod, texel_y = kHeight / kRows;
  for (std::uint32_t picket = 0; picket < size; ++picket) {
    const double left = (static_cast<double>(picket) - 0.5 * size) * period_width(size);
    for (const TexelRect& rect : kOpaque) {
      const double x0 = left + rect.x0 * texel_x, x1 = left + rect.x1 * texel_x;
      const double y0 = rect.y0 * texel_y, y1 = rect.y1 * texel_y;
      builder.quad(dvec3{x0, y0, 0.0}, dvec3{x1, y0, 0.0}, dvec3{x1, y1, 0.0}, dvec3{x0, y1, 0.0});
    }
  }
  builder.finish();
}

}  // namespace halfshade
