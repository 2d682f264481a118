#include "rasterizer/coverage_reference.h"

namespace halfshade {

bool covers_pixel_reference(const TileTriangle& triangle, std::uint32_t i, std::uint32_t j) {
  for (std::size_t k = 0; k != 3; ++k) {
    const std::int64_t x_step = std::int64_t{triangle.a[k]} * i, y_step = std::int64_t{triangle.b[k]} * j;
    if (triangle.e[k] + x_step + y_step < 0) return false;
  }
  return true;
}

void cover_rows_reference(std::span<const TileTriangle> triangles, std::span<RowSpan> spans) {
  std::size_t written = 0;
  for (const TileTriangle& triangle : triangles) {
    for (std::uint32_t j = 0; j != triangle.height; ++j) {
      std::uint32_t begin = 0;
      while (begin != triangle.width && !covers_pixel_reference(triangle, begin, j)) ++begin;
      std::uint32_t end = begin;
      while (end != triangle.width && covers_pixel_reference(triangle, end, j)) ++end;
      spans[written++] = begin == end ? 0u : (triangle.column + begin) | (triangle.column + end) << 16;
    }
  }
}

}  // namespace halfshade
