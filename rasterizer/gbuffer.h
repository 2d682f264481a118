// Geometry buffer: what the camera sees, one entry per pixel sample.
#pragma once

#include "halfshade/types.h"

namespace halfshade {

/// One entry per sample of `window`, row-major, row 0 = top. With spp = k*k subsamples per pixel the buffer is simply a
/// k times finer picture: sample (x, y) belongs to pixel (x / k, y / k).
/// Entries whose triangle is kNone show the background; their other values are zero.
struct GBuffer {
  std::uint32_t width = 0, height = 0;  // the whole picture, in samples
  PixelWindow window;                   // the part held here, in samples
  double reach = 1.0;                   // power of two, at least every |coordinate| of what was drawn; local frame
  std::vector<std::uint32_t> triangle;  // visible triangle, or kNone
  std::vector<dvec3> position;          // local frame, interpolated in double, not snapped
  std::vector<vec3> geometric_normal;   // unit, on the camera's side of the triangle
  std::vector<vec3>
      shading_normal;        // unit, interpolated, flipped to the camera's side; = geometric where the scene has none
  std::vector<vec3> albedo;  // linear RGB
  std::vector<float> depth;  // distance along the camera's axis, local frame units

  std::size_t size() const { return triangle.size(); }
};

}  // namespace halfshade
