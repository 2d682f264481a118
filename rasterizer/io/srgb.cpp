#include "rasterizer/io/srgb.h"

#include <algorithm>
#include <vector>

namespace halfshade {
namespace {

// Fifth root of a > 0 by Newton's iteration: only + - * /, whose rounding IEEE 754 fixes. From above it falls steadily.
double fifth_root(double a) {
  double x = 1.0;
  for (int k = 0; k < 64; ++k) {
    const double x2 = x * x;
    const double next = (4.0 * x + a / (x2 * x2)) / 5.0;
    if (next == x) break;
    x = next;
  }
  return x;
}

// Encoded 0..1 to linear 0..1; x^2.4 = x^2 * (x^2)^(1/5).
double decode(double encoded) {
  if (encoded <= 0.04045) return encoded / 12.92;
  const double x = (encoded + 0.055) / 1.055;
  return x * x * fifth_root(x * x);
}

// thresholds[k] is the smallest linear value that rounds to code k + 1.
std::vector<double> make_thresholds(int bits) {
  const std::uint32_t largest = (1u << bits) - 1;
  std::vector<double> thresholds(largest);
  for (std::uint32_t k = 0; k < largest; ++k) thresholds[k] = decode((k + 0.5) / largest);
  return thresholds;
}

}  // namespace

std::uint32_t encode_srgb(float linear, int bits) {
  static const std::vector<double> thresholds8 = make_thresholds(8), thresholds16 = make_thresholds(16);
  if (!(linear > 0.0f)) return 0;
  const std::vector<double>& thresholds = bits == 8 ? thresholds8 : thresholds16;
  const auto above = std::upper_bound(thresholds.begin(), thresholds.end(), static_cast<double>(linear));
  return static_cast<std::uint32_t>(above - thresholds.begin());
}

float decode_srgb(float encoded) {
  static const std::vector<float> table = [] {
    std::vector<float> values(65536);
    for (std::uint32_t code = 0; code < 65536; ++code) values[code] = static_cast<float>(decode(code / 65535.0));
    return values;
  }();
  return table[encode_linear(encoded, 16)];
}

std::uint32_t encode_linear(float value, int bits) {
  if (!(value > 0.0f)) return 0;
  const double largest = (1u << bits) - 1;
  return static_cast<std::uint32_t>(std::min(1.0, static_cast<double>(value)) * largest + 0.5);
}

}  // namespace halfshade
