// sRGB bytes of colour textures as linear light.
#pragma once

#include <array>
#include <cstddef>

namespace halfshade {

// x^2.4 for x in (0, 1] as (x^(1/5))^12. Newton from above converges to the fifth root monotonically; only operations
// that IEEE 754 rounds correctly take part, so the table below is the same everywhere.
constexpr double power_2_4(double x) {
  double root = 1.0;
  for (int i = 0; i != 30; ++i) root = (4.0 * root + x / (root * root * root * root)) / 5.0;
  const double cubed = root * root * root, sixth = cubed * cubed;
  return sixth * sixth;
}

// sRGB (IEC 61966-2-1) byte to linear light.
constexpr std::array<float, 256> make_srgb_table() {
  std::array<float, 256> table{};
  for (std::size_t i = 0; i != table.size(); ++i) {
    const double c = static_cast<double>(i) / 255.0;
    table[i] = static_cast<float>(c <= 0.04045 ? c / 12.92 : power_2_4((c + 0.055) / 1.055));
  }
  return table;
}

inline constexpr std::array<float, 256> kLinearFromSrgb = make_srgb_table();

}  // namespace halfshade
