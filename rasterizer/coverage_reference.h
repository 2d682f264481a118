// The contract of coverage_kernel.h in plain scalar code: every pixel of the box against every edge.
#pragma once

#include "rasterizer/coverage_kernel.h"

namespace halfshade {

bool covers_pixel_reference(const TileTriangle& triangle, std::uint32_t i, std::uint32_t j);

void cover_rows_reference(std::span<const TileTriangle> triangles, std::span<RowSpan> spans);

}  // namespace halfshade
