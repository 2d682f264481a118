#include "rasterizer/io/flip.h"

#include <algorithm>
#include <cmath>
#include <string>

#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>

#include "halfshade/error.h"
#include "rasterizer/core/parallel.h"
#include "rasterizer/io/srgb.h"

namespace halfshade {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kColorExponent = 0.7;     // the paper's q_c
constexpr double kFeatureExponent = 0.5;   // q_f
constexpr double kBend = 0.4;              // p_c: up to this share of the largest colour difference the scale is steep
constexpr double kBent = 0.95;             // p_t: ... and has come this far
constexpr double kFeatureDegrees = 0.082;  // width of the edges and points looked for

using Plane = std::vector<double>;  // [height][width]

struct Size {
  std::size_t width, height;
  std::size_t count() const { return width * height; }
};

// ---- colour spaces ------------------------------------------------------------------------------------------------

/// Linear RGB to XYZ over that of white, for the primaries and the white point (D65) of IEC 61966-2-1. Columns.
const glm::dmat3& relative_xyz() {
  static const glm::dmat3 matrix = [] {
    const glm::dmat3 xyz(dvec3(0.4124564, 0.2126729, 0.0193339), dvec3(0.3575761, 0.7151522, 0.1191920),
                         dvec3(0.1804375, 0.0721750, 0.9503041));
    const dvec3 white = xyz * dvec3(1.0);
    return glm::dmat3(xyz[0] / white, xyz[1] / white, xyz[2] / white);
  }();
  return matrix;
}

/// The opponent space of the filters, YCxCz: CIELAB without its cube roots.
dvec3 to_opponent(const dvec3& rgb) {
  const dvec3 xyz = relative_xyz() * rgb;
  return {116.0 * xyz.y - 16.0, 500.0 * (xyz.x - xyz.y), 200.0 * (xyz.y - xyz.z)};
}

dvec3 from_opponent(const dvec3& c) {
  static const glm::dmat3 inverse = glm::inverse(relative_xyz());
  const double y = (c.x + 16.0) / 116.0;
  return inverse * dvec3(y + c.y / 500.0, y, y - c.z / 200.0);
}

double lab_curve(double t) {
  constexpr double kDelta = 6.0 / 29.0;
  return t > kDelta * kDelta * kDelta ? std::cbrt(t) : t / (3.0 * kDelta * kDelta) + 4.0 / 29.0;
}

/// CIELAB with a and b weighed by lightness: bright colours look more colourful.
dvec3 to_hunt_lab(const dvec3& rgb) {
  const dvec3 xyz = relative_xyz() * rgb;
  const double x = lab_curve(xyz.x), y = lab_curve(xyz.y), z = lab_curve(xyz.z), lightness = 116.0 * y - 16.0;
  return {lightness, 0.01 * lightness * 500.0 * (x - y), 0.01 * lightness * 200.0 * (y - z)};
}

double color_distance(const dvec3& a, const dvec3& b) {
  const dvec3 d = a - b;
  return std::pow(std::fabs(d.x) + std::sqrt(d.y * d.y + d.z * d.z), kColorExponent);
}

/// Distance in 0..1; the largest is that of the two primaries farthest apart, green and blue.
double scaled_color_distance(double distance) {
  static const double largest = color_distance(to_hunt_lab({0, 1, 0}), to_hunt_lab({0, 0, 1}));
  const double bend = kBend * largest;
  if (distance < bend) return kBent * distance / bend;
  return std::min(1.0, kBent + (distance - bend) / (largest - bend) * (1.0 - kBent));
}

// ---- filters ------------------------------------------------------------------------------------------------------

/// Taps at -radius .. radius.
using Taps = std::vector<double>;

template <class Function>
Taps make_taps(int radius, const Function& f) {
  Taps taps;
  for (int i = -radius; i <= radius; ++i) taps.push_back(f(i));
  return taps;
}

Taps scaled(Taps taps, double factor) {
  for (double& t : taps) t *= factor;
  return taps;
}

double sum_of(const Taps& taps) {
  double sum = 0.0;
  for (const double t : taps) sum += t;
  return sum;
}

/// Positive taps add up to 1, negative ones to -1.
Taps balanced(Taps taps) {
  double positive = 0.0, negative = 0.0;
  for (const double t : taps) (t > 0.0 ? positive : negative) += t;
  for (double& t : taps) t /= t > 0.0 ? positive : -negative;
  return taps;
}

/// The taps along x, then along y; beyond the border the picture goes on with its border's values.
Plane filtered(const Plane& in, const Size& size, const Taps& along_x, const Taps& along_y) {
  const std::size_t radius = along_x.size() / 2, width = size.width;
  Plane across(size.count(), 0.0), out(size.count(), 0.0);
  parallel_ranges(size.height, 8, [&](std::size_t begin, std::size_t end) {
    std::vector<double> row(width + 2 * radius);
    for (std::size_t y = begin; y < end; ++y) {
      const double* from = &in[y * width];
      for (std::size_t i = 0; i < row.size(); ++i) row[i] = from[std::clamp(i, radius, radius + width - 1) - radius];
      for (std::size_t k = 0; k < along_x.size(); ++k) {
        for (std::size_t x = 0; x < width; ++x) across[y * width + x] += along_x[k] * row[x + k];
      }
    }
  });
  parallel_ranges(size.height, 8, [&](std::size_t begin, std::size_t end) {
    for (std::size_t y = begin; y < end; ++y) {
      for (std::size_t k = 0; k < along_y.size(); ++k) {
        const double* row = &across[(std::clamp(y + k, radius, radius + size.height - 1) - radius) * width];
        for (std::size_t x = 0; x < width; ++x) out[y * width + x] += along_y[k] * row[x];
      }
    }
  });
  return out;
}

/// Contrast sensitivity of one channel of the opponent space as a blur: a sum of two Gaussians in degrees.
struct Sensitivity {
  double a1, b1, a2, b2;
};
constexpr Sensitivity kSensitivities[3] = {{1.0, 0.0047, 0.0, 1e-5},    // light and dark
                                           {1.0, 0.0053, 0.0, 1e-5},    // red and green
                                           {34.1, 0.04, 13.5, 0.025}};  // blue and yellow

Plane as_seen(const Plane& plane, const Size& size, const Sensitivity& s, double pixels_per_degree) {
  constexpr double kWidest = 0.04;  // of all b: the kernels have equal size
  const int radius = static_cast<int>(std::ceil(3.0 * std::sqrt(kWidest / (2.0 * kPi * kPi)) * pixels_per_degree));
  Plane sum(plane.size(), 0.0);
  double weight = 0.0;
  for (const auto& [a, b] : {std::pair{s.a1, s.b1}, std::pair{s.a2, s.b2}}) {
    if (a == 0.0) continue;
    const Taps taps = make_taps(radius, [&, b = b](int i) {
      const double degrees = i / pixels_per_degree;
      return std::exp(-kPi * kPi * degrees * degrees / b);
    });
    const double amplitude = a * std::sqrt(kPi / b), volume = sum_of(taps) * sum_of(taps);
    const Plane part = filtered(plane, size, scaled(taps, amplitude), taps);
    for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += part[i];
    weight += amplitude * volume;
  }
  for (double& v : sum) v /= weight;
  return sum;
}

// ---- the two pipelines --------------------------------------------------------------------------------------------

/// What of a picture is compared.
struct Looks {
  std::vector<dvec3> color;  // blurred, Hunt-adjusted CIELAB
  Plane edges, points;       // lengths of the first and second derivatives of the achromatic channel
};

Plane gradient_length(const Plane& plane, const Size& size, const Taps& derivative, const Taps& smooth) {
  Plane x = filtered(plane, size, derivative, smooth);
  const Plane y = filtered(plane, size, smooth, derivative);
  for (std::size_t i = 0; i < x.size(); ++i) x[i] = std::sqrt(x[i] * x[i] + y[i] * y[i]);
  return x;
}

Looks look_at(std::span<const vec3> rgb, const Size& size, double pixels_per_degree) {
  std::array<Plane, 3> opponent;
  for (Plane& plane : opponent) plane.resize(size.count());
  for (std::size_t i = 0; i < size.count(); ++i) {
    dvec3 c(0.0);
    for (int k = 0; k < 3; ++k) c[k] = rgb[i][k] > 0.0f ? std::min(1.0, double{rgb[i][k]}) : 0.0;
    c = to_opponent(c);
    for (int k = 0; k < 3; ++k) opponent[static_cast<std::size_t>(k)][i] = c[k];
  }
  Looks looks;
  const double deviation = 0.5 * kFeatureDegrees * pixels_per_degree, variance = deviation * deviation;
  const int radius = static_cast<int>(std::ceil(3.0 * deviation));
  const auto bell = [&](int i) { return std::exp(-i * i / (2.0 * variance)); };
  Taps smooth = make_taps(radius, bell);
  smooth = scaled(smooth, 1.0 / sum_of(smooth));
  Plane grey = opponent[0];
  for (double& v : grey) v = (v + 16.0) / 116.0;
  looks.edges = gradient_length(grey, size, balanced(make_taps(radius, [&](int i) { return -i * bell(i); })), smooth);
  looks.points = gradient_length(
      grey, size, balanced(make_taps(radius, [&](int i) { return (i * i / variance - 1.0) * bell(i); })), smooth);
  for (std::size_t k = 0; k < 3; ++k) opponent[k] = as_seen(opponent[k], size, kSensitivities[k], pixels_per_degree);
  looks.color.resize(size.count());
  for (std::size_t i = 0; i < size.count(); ++i) {
    const dvec3 seen = from_opponent({opponent[0][i], opponent[1][i], opponent[2][i]});
    looks.color[i] = to_hunt_lab(glm::clamp(seen, dvec3(0.0), dvec3(1.0)));
  }
  return looks;
}

}  // namespace

std::vector<float> flip_errors(std::span<const vec3> a, std::span<const vec3> b, std::uint32_t width,
                               std::uint32_t height, double pixels_per_degree) {
  const Size size{width, height};
  if (size.count() == 0 || a.size() != size.count() || b.size() != size.count()) {
    throw Error(ErrorCode::kUsage, "FLIP: two pictures of " + std::to_string(width) + "x" + std::to_string(height) +
                                       " pixels are needed; these have " + std::to_string(a.size()) + " and " +
                                       std::to_string(b.size()) + " pixels");
  }
  if (!(pixels_per_degree >= 1.0 && pixels_per_degree <= 1000.0)) {
    throw Error(ErrorCode::kUsage,
                "FLIP: pixels per degree " + std::to_string(pixels_per_degree) + " is not in 1..1000");
  }
  const Looks of_a = look_at(a, size, pixels_per_degree), of_b = look_at(b, size, pixels_per_degree);
  std::vector<float> errors(size.count());
  for (std::size_t i = 0; i < errors.size(); ++i) {
    const double color = scaled_color_distance(color_distance(of_a.color[i], of_b.color[i]));
    const double edges = std::fabs(of_a.edges[i] - of_b.edges[i]), points = std::fabs(of_a.points[i] - of_b.points[i]);
    const double feature = std::pow(std::max(edges, points) / std::sqrt(2.0), kFeatureExponent);
    errors[i] = static_cast<float>(std::pow(color, 1.0 - std::min(1.0, feature)));
  }
  return errors;
}

double mean_flip_of_grey(std::span<const float> a, std::span<const float> b, std::uint32_t width,
                         std::uint32_t height) {
  const auto colors = [](std::span<const float> grey) {
    std::vector<vec3> rgb;
    rgb.reserve(grey.size());
    for (const float v : grey) rgb.emplace_back(decode_srgb(v));
    return rgb;
  };
  return mean_of(flip_errors(colors(a), colors(b), width, height));
}

double mean_of(std::span<const float> values) {
  double sum = 0.0;
  for (const float v : values) sum += v;
  return values.empty() ? 0.0 : sum / static_cast<double>(values.size());
}

}  // namespace halfshade
