#include "shadows/light_samples.h"

#include <algorithm>
#include <cmath>

#include "rasterizer/core/reuse.h"
#include "rasterizer/core/unit_circle.h"
#include "rasterizer/core/unit_vector.h"
#include "shadows/polygon_light.h"
#include "shadows/sample_patterns.h"

namespace halfshade {

// Unit square to unit sphere, area-preserving (Archimedes' cylinder).
dvec3 unit_sphere_point(const dvec2& st) {
  const double z = 1.0 - 2.0 * st.y;
  const dvec2 ring = std::sqrt(std::max(0.0, 1.0 - z * z)) * unit_circle(st.x);
  return {ring.x, ring.y, z};
}

namespace {

void make_orthonormal(const dvec3& normal, LightSamples& samples) {
  samples.axis_n = unit_vector(normal);
  const dvec3 n = glm::abs(samples.axis_n);
  const dvec3 other = n.x <= n.y && n.x <= n.z ? dvec3(1, 0, 0) : (n.y <= n.z ? dvec3(0, 1, 0) : dvec3(0, 0, 1));
  samples.axis_u = glm::normalize(glm::cross(other, samples.axis_n));
  samples.axis_v = glm::cross(samples.axis_n, samples.axis_u);
}

/// Rows of a disk run along `axis_u`, which make_orthonormal takes from the axes of the frame: turned by 4.8 degrees,
/// the edges of buildings cross a row or two instead of lying between two rows (docs/sampling.md).
void turn_axes(LightSamples& samples) {
  samples.axis_u = glm::normalize(samples.axis_u * 12.0 + samples.axis_v);
  samples.axis_v = glm::cross(samples.axis_n, samples.axis_u);
}

/// Unit square to unit disk, area-preserving (Shirley and Chiu 1997).
dvec2 concentric_disk(const dvec2& st) {
  const double a = 2.0 * st.x - 1.0, b = 2.0 * st.y - 1.0;
  if (a == 0.0 && b == 0.0) return {0.0, 0.0};
  return std::fabs(a) > std::fabs(b) ? a * unit_circle(b / a * 0.125) : b * unit_circle(0.25 - a / b * 0.125);
}

void require(bool condition, const Light& light, const char* what) {
  if (!condition) throw Error(ErrorCode::kBadInput, "light '" + light.name + "': " + what);
}

void check_numbers(const ShadowConfig& config) {
  if (config.light_sample_count < 1 || config.light_sample_count > 4096) {
    throw Error(ErrorCode::kUsage,
                "light samples: " + std::to_string(config.light_sample_count) + " is not in 1..4096");
  }
  if (config.sample_sets < 1 || config.sample_sets > 256) {
    throw Error(ErrorCode::kUsage, "sample sets: " + std::to_string(config.sample_sets) + " is not in 1..256");
  }
  if (config.frame >= kMaxFrames) {
    throw Error(ErrorCode::kUsage,
                "frame: " + std::to_string(config.frame) + " is not below " + std::to_string(kMaxFrames));
  }
}

void check_sample_points(const Light& light) {
  require(!light.points.empty(), light, "there are no sample points");
  if (light.points.size() <= 4096) return;
  throw Error(ErrorCode::kUsage, "light '" + light.name + "': " + std::to_string(light.points.size()) +
                                     " sample points, 1..4096 are allowed");
}

void check_shape(const Light& light) {
  if (light.shape == LightShape::kSun) {
    throw Error(ErrorCode::kUsage,
                "light '" + light.name + "': a sun has no place of its own; place_sun() gives it one");
  }
  require(is_finite(light.center) && is_finite(light.u) && is_finite(light.v) && is_finite(light.normal) &&
              std::isfinite(light.radius),
          light, "a coordinate is not finite");
  require(light.radius >= 0.0, light, "the radius is negative");
  require(std::all_of(light.axes.begin(), light.axes.end(), is_finite), light, "a coordinate is not finite");
  require(light.shape != LightShape::kDisk || light.normal != dvec3(0.0), light, "the normal is zero");
  if (light.shape == LightShape::kSamples) {
    check_sample_points(light);
    require(std::all_of(light.points.begin(), light.points.end(), is_finite), light, "a sample point is not finite");
  }
}

/// Gram and Schmidt; the axes stay those of the frame where the ellipsoid has no two independent ones.
void describe_ellipsoid(const Light& light, LightSamples& samples) {
  const dvec3 a = near_one(light.axes[0]), b = near_one(light.axes[1]);
  const dvec3 n = glm::cross(a, b);
  if (!(glm::length(n) > 1e-9 * glm::length(a) * glm::length(b))) return;
  samples.axis_u = glm::normalize(a);
  samples.axis_n = glm::normalize(n);
  samples.axis_v = glm::cross(samples.axis_n, samples.axis_u);
}

/// A rectangle without area (a segment or a point) is not flat: it has no facing, and the general, volumetric treatment
/// covers it.
void describe_rectangle(const Light& light, LightSamples& samples) {
  const dvec3 u = near_one(light.u), v = near_one(light.v), normal = glm::cross(u, v);
  const double length = glm::length(normal);
  samples.flat = length > 1e-9 * glm::length(u) * glm::length(v);
  if (!samples.flat) return;
  samples.axis_n = normal / length;
  samples.axis_u = glm::normalize(u);
  samples.axis_v = glm::cross(samples.axis_n, samples.axis_u);
}

void describe_polygon(const PolygonLight& polygon, const LocalFrame& frame, LightSamples& samples) {
  samples.center = frame.to_local(polygon.center);
  samples.flat = true;
  samples.axis_u = polygon.axis_u, samples.axis_v = polygon.axis_v, samples.axis_n = polygon.axis_n;
  for (const dvec2& corner : polygon.corners) samples.outline.push_back(corner * frame.scale);
}

void describe_points(const Light& light, const LocalFrame& frame, LightSamples& samples) {
  dvec3 low = light.points[0], high = low;
  for (const dvec3& p : light.points) low = glm::min(low, p), high = glm::max(high, p);
  samples.center = (frame.to_local(low) + frame.to_local(high)) * 0.5;
  samples.count = static_cast<std::uint32_t>(light.points.size());
  for (const dvec3& p : light.points) samples.points.push_back(frame.to_lattice(p));
}

/// Rotation by `turns` around the unit vector `axis` (Rodrigues).
dvec3 rotated(const dvec3& p, const dvec3& axis, double turns) {
  const dvec2 angle = unit_circle(turns);
  return p * angle.x + glm::cross(axis, p) * angle.y + axis * (glm::dot(axis, p) * (1.0 - angle.x));
}

/// Turn of set `set` in units of a whole turn: the golden section spreads any number of sets evenly.
double turn_of_set(std::uint32_t set) {
  const double x = set * 0.6180339887498949;
  return x - std::floor(x);
}

/// Offset from the light's centre, world units; `set` counts only where sets are rotated copies. `in_disk`: `st` lies
/// in the disk around (1/2, 1/2) already.
dvec3 sample_offset(const Light& light, const LightSamples& samples, const dvec2& st, std::uint32_t set, bool in_disk) {
  switch (light.shape) {
    case LightShape::kRectangle:
      return light.u * (st.x - 0.5) + light.v * (st.y - 0.5);
    case LightShape::kDisk: {
      if (in_disk) return light.radius * (samples.axis_u * (2.0 * st.x - 1.0) + samples.axis_v * (2.0 * st.y - 1.0));
      const dvec2 p = light.radius * concentric_disk(st);
      return rotated(samples.axis_u * p.x + samples.axis_v * p.y, samples.axis_n, turn_of_set(set));
    }
    case LightShape::kSphere: {
      const dvec3 axis = unit_sphere_point({turn_of_set(3 * set + 1), turn_of_set(2 * set + 1)});
      return light.radius * rotated(unit_sphere_point(st), axis, turn_of_set(set));
    }
    case LightShape::kEllipsoid: {
      const dvec3 p = unit_sphere_point(st);
      return light.axes[0] * p.x + light.axes[1] * p.y + light.axes[2] * p.z;
    }
    default:
      return dvec3(0.0);
  }
}

/// Places in the unit square, [set][sample].
std::vector<dvec2> pattern_samples(const PatternKey& key, std::vector<dvec2> reuse) {
  std::vector<dvec2> st =
      unit_square_samples(key.pattern, key.count, key.frame, key.rotate ? 1 : key.sets, key.seed, std::move(reuse));
  st.resize(std::size_t{key.sets} * key.count);
  if (key.disk) disk_rows(std::span(st).first(key.count));
  if (key.rotate) {
    for (std::size_t i = key.count; i < st.size(); ++i) st[i] = st[i - key.count];
  }
  return st;
}

}  // namespace

std::uint32_t number_of_sets(const Light& light, const ShadowConfig& config) {
  if (light.shape == LightShape::kPoint || light.shape == LightShape::kSamples) return 1;
  return config.interleave ? kInterleavedSets : config.sample_sets;
}

void check_light(const Light& light, const ShadowConfig& config) {
  check_numbers(config);
  check_shape(light);
  if (light.shape == LightShape::kPolygon) make_polygon_light(light);
}

std::uint32_t samples_of(const Light& light, const ShadowConfig& config) {
  if (light.shape == LightShape::kSamples) {
    check_sample_points(light);
    return static_cast<std::uint32_t>(light.points.size());
  }
  return light.shape == LightShape::kPoint ? 1 : config.light_sample_count;
}

LightSamples make_light_samples(const Light& light, const ShadowConfig& config, const LocalFrame& frame,
                                LightSamples reuse) {
  check_numbers(config);
  check_shape(light);
  LightSamples samples;
  samples.points = emptied(reuse.points), samples.outline = emptied(reuse.outline);
  samples.center = frame.to_local(light.center);
  samples.sets = number_of_sets(light, config);
  samples.interleaved = samples.sets == kInterleavedSets && config.interleave;
  PolygonLight polygon;
  if (light.shape == LightShape::kRectangle) describe_rectangle(light, samples);
  if (light.shape == LightShape::kDisk) {
    samples.flat = light.radius > 0.0;
    make_orthonormal(light.normal, samples);
  }
  if (light.shape == LightShape::kEllipsoid) describe_ellipsoid(light, samples);
  if (light.shape == LightShape::kPolygon) {
    polygon = make_polygon_light(light);
    describe_polygon(polygon, frame, samples);
  }
  samples.one_sided = samples.flat && !light.two_sided;
  if (light.shape == LightShape::kSamples) {
    describe_points(light, frame, samples);
    return samples;
  }
  samples.count = samples_of(light, config);
  const bool rotate = config.rotate_sets && (light.shape == LightShape::kDisk || light.shape == LightShape::kSphere);
  const bool disk_of_rows = light.shape == LightShape::kDisk && config.pattern == SamplePattern::kRows,
             disk = disk_of_rows && config.frame == 0 && !rotate;
  if (disk_of_rows) turn_axes(samples);
  samples.st_key = {config.pattern, samples.count, samples.sets, config.seed, config.frame, rotate, disk};
  samples.st =
      reuse.st_key == samples.st_key ? std::move(reuse.st) : pattern_samples(samples.st_key, emptied(reuse.st));
  for (std::size_t i = 0; i < samples.st.size(); ++i) {
    const dvec2 st = samples.st[i];
    const auto turn = rotate ? config.frame + static_cast<std::uint32_t>(i / samples.count) : 0;
    const dvec3 offset = light.shape == LightShape::kPolygon
                             ? polygon.offset(st)
                             : sample_offset(light, samples, st, turn, disk && i < samples.count);
    samples.points.push_back(snap_to_lattice(samples.center + frame.to_local_vector(offset)));
  }
  return samples;
}

std::array<dvec3, 2> light_box(const Light& light) {
  dvec3 reach(0.0);
  switch (light.shape) {
    case LightShape::kPoint:
      break;
    case LightShape::kRectangle:
      reach = (glm::abs(light.u) + glm::abs(light.v)) * 0.5;
      break;
    case LightShape::kSamples:
    case LightShape::kPolygon: {
      dvec3 low = light.points[0], high = low;
      for (const dvec3& p : light.points) low = glm::min(low, p), high = glm::max(high, p);
      return {low, high};
    }
    case LightShape::kEllipsoid: {
      const auto& [a, b, c] = light.axes;  // the norm of each coordinate's row
      reach = glm::sqrt(a * a + b * b + c * c);
      break;
    }
    default:
      reach = dvec3(light.radius);
  }
  return {light.center - reach, light.center + reach};
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
    case LightShape::kPolygon:
      return light.points;
    default: {
      const auto [low, high] = light_box(light);
      return {high, low};
    }
  }
}

}  // namespace halfshade
