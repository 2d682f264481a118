#include "shadows/opacity_average.h"

#include <algorithm>
#include <cmath>

namespace halfshade {

OpacityAverage::OpacityAverage(const OpacityBits& opacity)
    : width_(opacity.width), height_(opacity.height), sums_(std::size_t{width_ + 1} * (height_ + 1), 0) {
  const std::size_t stride = width_ + 1;
  for (std::size_t y = 0; y < height_; ++y) {
    std::uint32_t row = 0;
    for (std::size_t x = 0; x < width_; ++x) {
      const std::size_t bit = y * width_ + x;
      row += (opacity.bits[bit / 32] >> (bit % 32)) & 1;
      sums_[(y + 1) * stride + x + 1] = sums_[y * stride + x + 1] + row;
    }
  }
}

double OpacityAverage::within(double u, double v) const {
  const std::uint32_t x = std::min(static_cast<std::uint32_t>(u), width_ - 1),
                      y = std::min(static_cast<std::uint32_t>(v), height_ - 1);
  const double fu = u - x, fv = v - y;
  const std::uint32_t* at = sums_.data() + std::size_t{y} * (width_ + 1) + x;
  const double low = at[0] + (static_cast<double>(at[1]) - at[0]) * fu;
  at += width_ + 1;
  const double high = at[0] + (static_cast<double>(at[1]) - at[0]) * fu;
  return low + (high - low) * fv;
}

double OpacityAverage::integral(double u, double v) const {
  const double columns = std::floor(u / width_), rows = std::floor(v / height_);
  const double fu = std::clamp(u - columns * width_, 0.0, static_cast<double>(width_)),
               fv = std::clamp(v - rows * height_, 0.0, static_cast<double>(height_));
  return columns * rows * sums_.back() + columns * within(width_, fv) + rows * within(fu, height_) + within(fu, fv);
}

double OpacityAverage::average(double u, double v, double width, double height) const {
  // Below a thousandth of a texel the differences would be all rounding.
  const double w = 0.5 * std::max(width, 1e-3), h = 0.5 * std::max(height, 1e-3);
  const double sum = integral(u + w, v + h) - integral(u - w, v + h) - integral(u + w, v - h) + integral(u - w, v - h);
  return std::clamp(sum / (4.0 * w * h), 0.0, 1.0);
}

}  // namespace halfshade
