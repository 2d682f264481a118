// Vector aliases and the few constants that every other header uses.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

namespace halfshade {

using vec2 = glm::vec2;    // float
using vec3 = glm::vec3;    // float
using dvec2 = glm::dvec2;  // double
using dvec3 = glm::dvec3;  // double
using dvec4 = glm::dvec4;  // double

static_assert(sizeof(vec3) == 3 * sizeof(float), "arrays of vec3 are handed out as packed floats");
static_assert(sizeof(dvec3) == 3 * sizeof(double), "arrays of dvec3 are handed out as packed doubles");

/// "No such index": a pixel without a triangle, a material without a map, a receiver without a triangle of its own.
inline constexpr std::uint32_t kNone = 0xffffffffu;

/// A half-open window of pixels: x0 <= x < x1, y0 <= y < y1.
struct PixelWindow {
  std::uint32_t x0 = 0, x1 = 0, y0 = 0, y1 = 0;     // first and past-the-last pixel of each axis
  std::uint32_t width() const { return x1 - x0; }   // pixels
  std::uint32_t height() const { return y1 - y0; }  // pixels
};

}  // namespace halfshade
