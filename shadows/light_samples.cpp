#include "shadows/light_samples.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "rasterizer/core/hash.h"
#include "rasterizer/core/unit_circle.h"

namespace halfshade {
namespace {

/// Rows of the cell grid: the exact grid with rows <= columns <= 2 rows where the count has one, else
/// floor(sqrt(count)) rows whose numbers of columns differ by at most one; each sample stands for the same area either
/// way.
std::uint32_t row_count(std::uint32_t count) {
  auto root = static_cast<std::uint32_t>(std::sqrt(static_cast<double>(count)));
  while (root * root > count) --root;
  for (std::uint32_t rows = root; rows >= 1 && count <= 2 * rows * rows; --rows) {
    if (count % rows == 0) return rows;
  }
  return root;
}

double fraction(double x) { return x - std::floor(x); }

/// Shift of row `row` as a fraction of a column: a rank-1 lattice whose generator is coprime to the number of rows and
/// near the golden section of it, so that neighbouring rows are spread well.
double row_shift(std::uint32_t row, std::uint32_t rows) {
  auto gcd = [](std::uint32_t a, std::uint32_t b) {
    while (b != 0) a = std::exchange(b, a % b);
    return a;
  };
  auto generator = static_cast<std::uint32_t>(rows * 0.6180339887498949 + 0.5);
  while (generator > 1 && gcd(generator, rows) != 1) --generator;
  return (static_cast<double>((std::uint64_t{row} * generator) % rows) + 0.5) / rows;
}

void make_orthonormal(const dvec3& normal, LightSamples& samples) {
  samples.axis_n = glm::normalize(normal);
  const dvec3 n = glm::abs(samples.axis_n);
  const dvec3 other = n.x <= n.y && n.x <= n.z ? dvec3(1, 0, 0) : (n.y <= n.z ? dvec3(0, 1, 0) : dvec3(0, 0, 1));
  samples.axis_u = glm::normalize(glm::cross(other, samples.axis_n));
  samples.axis_v = glm::cross(samples.axis_n, samples.axis_u);
}

/// Unit square to unit disk, area-preserving (Shirley and Chiu 1997).
dvec2 concentric_disk(const dvec2& st) {
  const double a = 2.0 * st.x - 1.0, b = 2.0 * st.y - 1.0;
  if (a == 0.0 && b == 0.0) return {0.0, 0.0};
  return std::fabs(a) > std::fabs(b) ? a * unit_circle(b / a * 0.125) : b * unit_circle(0.25 - a / b * 0.125);
}

/// Unit square to unit sphere, area-preserving (Archimedes' cylinder).
dvec3 sphere_point(const dvec2& st) {
  const double z = 1.0 - 2.0 * st.y;
  const dvec2 ring = std::sqrt(std::max(0.0, 1.0 - z * z)) * unit_circle(st.x);
  return {ring.x, ring.y, z};
}

void require(bool condition, const Light& light, const char* what) {
  if (!condition) throw Error(ErrorCode::kBadInput, "light '" + light.name + "': " + what);
}

bool finite(const dvec3& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

void check(const Light& light, const ShadowConfig& config) {
  if (config.light_sample_count < 1 || config.light_sample_count > 4096) {
    throw Error(ErrorCode::kUsage,
                "light samples: " + std::to_string(config.light_sample_count) + " is not in 1..4096");
  }
  if (config.sample_sets < 1 || config.sample_sets > 256) {
    throw Error(ErrorCode::kUsage, "sample sets: " + std::to_string(config.sample_sets) + " is not in 1..256");
  }
  require(
      finite(light.center) && finite(light.u) && finite(light.v) && finite(light.normal) && std::isfinite(light.radius),
      light, "a coordinate is not finite");
  require(light.radius >= 0.0, light, "the radius is negative");
  if (light.shape == LightShape::kSamples) {
    require(!light.points.empty(), light, "there are no sample points");
    if (light.points.size() > 4096) {
      throw Error(ErrorCode::kUsage, "light '" + light.name + "': " + std::to_string(light.points.size()) +
                                         " sample points, 1..4096 are allowed");
    }
    require(std::all_of(light.points.begin(), light.points.end(), finite), light, "a sample point is not finite");
  }
}

/// Frame of the light: centre, axes, flatness. A rectangle without area (a segment or a point) is not flat: it has no
/// facing, and the general, volumetric treatment covers it.
void describe(const Light& light, const LocalFrame& frame, LightSamples& samples) {
  samples.center = frame.to_local(light.center);
  if (light.shape == LightShape::kRectangle) {
    const dvec3 normal = glm::cross(light.u, light.v);
    const double length = glm::length(normal);
    samples.flat = length > 1e-9 * glm::length(light.u) * glm::length(light.v) && length > 0.0;
    if (samples.flat) {
      samples.axis_n = normal / length;
      samples.axis_u = glm::normalize(light.u);
      samples.axis_v = glm::cross(samples.axis_n, samples.axis_u);
    }
  } else if (light.shape == LightShape::kDisk) {
    require(glm::length(light.normal) > 0.0, light, "the normal is zero");
    samples.flat = light.radius > 0.0;
    make_orthonormal(light.normal, samples);
  } else if (light.shape == LightShape::kSamples) {
    dvec3 low = light.points[0], high = low;
    for (const dvec3& p : light.points) low = glm::min(low, p), high = glm::max(high, p);
    samples.center = (frame.to_local(low) + frame.to_local(high)) * 0.5;
  }
  samples.one_sided = samples.flat && !light.two_sided;
}

dvec3 sample_offset(const Light& light, const LightSamples& samples, const dvec2& st) {
  switch (light.shape) {
    case LightShape::kRectangle:
      return light.u * (st.x - 0.5) + light.v * (st.y - 0.5);
    case LightShape::kDisk: {
      const dvec2 p = light.radius * concentric_disk(st);
      return samples.axis_u * p.x + samples.axis_v * p.y;
    }
    case LightShape::kSphere:
      return light.radius * sphere_point(st);
    default:
      return dvec3(0.0);
  }
}

}  // namespace

dvec2 unit_square_sample(SamplePattern pattern, std::uint32_t index, std::uint32_t count, std::uint32_t set,
                         std::uint32_t seed) {
  const std::uint32_t rows = row_count(count);
  const std::uint32_t row = static_cast<std::uint32_t>((std::uint64_t{index} * rows + rows - 1) / count);
  const std::uint32_t first = static_cast<std::uint32_t>(std::uint64_t{row} * count / rows);
  const std::uint32_t columns = static_cast<std::uint32_t>(std::uint64_t{row + 1} * count / rows) - first;
  double s = 0.5, t = 0.5;
  if (pattern == SamplePattern::kStratified) {
    s = hash_unit(index, hash32(seed, 2 * set));
    t = hash_unit(index, hash32(seed, 2 * set + 1));
  } else {
    if (pattern == SamplePattern::kRows) s = row_shift(row, rows);
    s = fraction(s + set * 0.7548776662466927);  // R2 sequence (Roberts 2018): sets differ by spread-out offsets
    t = fraction(t + set * 0.5698402909980532);
  }
  return {(index - first + s) / columns, (first + t * columns) / count};
}

LightSamples make_light_samples(const Light& light, const ShadowConfig& config, const LocalFrame& frame) {
  check(light, config);
  LightSamples samples;
  describe(light, frame, samples);
  if (light.shape == LightShape::kSamples) {
    samples.count = static_cast<std::uint32_t>(light.points.size());
    for (const dvec3& p : light.points) samples.points.push_back(frame.to_lattice(p));
    return samples;
  }
  const bool point = light.shape == LightShape::kPoint;
  samples.count = point ? 1 : config.light_sample_count;
  samples.sets = point ? 1 : config.sample_sets;
  samples.points.reserve(std::size_t{samples.count} * samples.sets);
  for (std::uint32_t set = 0; set < samples.sets; ++set) {
    for (std::uint32_t i = 0; i < samples.count; ++i) {
      const dvec2 st = unit_square_sample(config.pattern, i, samples.count, set, config.seed);
      const dvec3 offset = frame.to_local_vector(sample_offset(light, samples, st));
      samples.points.push_back(snap_to_lattice(samples.center + offset));
    }
  }
  return samples;
}

std::vector<dvec3> light_extent(const Light& light) {
  switch (light.shape) {
    case LightShape::kPoint:
      return {light.center};
    case LightShape::kRectangle: {
      const dvec3 a = (light.u + light.v) * 0.5, b = (light.u - light.v) * 0.5;
      return {light.center + a, light.center - a, light.center + b, light.center - b};
    }
    case LightShape::kSamples:
      return light.points;
    default:
      return {light.center + dvec3(light.radius), light.center - dvec3(light.radius)};
  }
}

}  // namespace halfshade
