// Small scenes for tests: triangles, one light, explicit receivers, solved through the public interface.
#pragma once

#include <bit>
#include <random>

#include "halfshade/depth_complexity.h"
#include "halfshade/shadows.h"
#include "rasterizer/scenes/hard_cases.h"

namespace halfshade::test {

// Geometry that the failure atlas shows as well.
using cases::box;
using cases::frame_light;
using cases::joined;
using cases::quad;
using cases::scene_of;
using cases::Triangle;

inline ShadowConfig frame_config(std::uint32_t samples = 256) {
  ShadowConfig config;
  config.light_sample_count = samples;
  config.pattern = SamplePattern::kUniform;
  return config;
}

inline std::vector<Receiver> receivers_at(const std::vector<dvec3>& points) {
  std::vector<Receiver> result;
  for (const dvec3& p : points) result.push_back({p, kNone});
  return result;
}

inline VisibilityMasks solve(const Scene& scene, const std::vector<Receiver>& receivers, const Light& light,
                             ShadowConfig config, ShadowMethod method, ShadowStats* stats = nullptr) {
  config.method = method;
  VisibilityMasks masks;
  solve_shadows(scene, receivers, light, config, masks, stats);
  return masks;
}

inline std::uint64_t wrong_bits(const VisibilityMasks& a, const VisibilityMasks& b) {
  if (a.words.size() != b.words.size()) return ~std::uint64_t{0};
  std::uint64_t count = 0;
  for (std::size_t i = 0; i < a.words.size(); ++i)
    count += static_cast<std::uint64_t>(std::popcount(a.words[i] ^ b.words[i]));
  return count;
}

/// Methods whose masks must equal the oracle's in every bit.
inline const std::vector<ShadowMethod>& exact_methods() {
  static const std::vector<ShadowMethod> methods = {ShadowMethod::kAliasFreeShadowMap, ShadowMethod::kExact,
                                                    ShadowMethod::kHierarchicalPenumbraCasting, ShadowMethod::kGears,
                                                    ShadowMethod::kSoftTexturedShadowVolumes};
  return methods;
}

/// Wrong bits of all exact methods together against the oracle.
inline std::uint64_t wrong_bits_of_exact_methods(const Scene& scene, const std::vector<Receiver>& receivers,
                                                 const Light& light, const ShadowConfig& config) {
  const VisibilityMasks truth = solve(scene, receivers, light, config, ShadowMethod::kOracle);
  std::uint64_t wrong = 0;
  for (const ShadowMethod method : exact_methods()) {
    wrong += wrong_bits(truth, solve(scene, receivers, light, config, method));
  }
  return wrong;
}

struct Random {
  std::mt19937_64 engine;
  explicit Random(std::uint64_t seed) : engine(seed) {}
  double uniform(double low, double high) {
    return low + (high - low) * (static_cast<double>(engine() >> 11) * 0x1p-53);
  }
  dvec3 in_box(double low, double high) {
    const double x = uniform(low, high), y = uniform(low, high);
    return {x, y, uniform(low, high)};
  }
};

inline std::vector<Triangle> random_triangles(Random& random, int count, double size, double low = -4.0,
                                              double high = 5.0) {
  std::vector<Triangle> triangles;
  for (int i = 0; i < count; ++i) {
    const dvec3 center = random.in_box(low, high);
    Triangle t;
    for (dvec3& p : t) p = center + size * random.in_box(-1.0, 1.0);
    triangles.push_back(t);
  }
  return triangles;
}

/// Two triangles for each quad of a grid of points, of as many rows as columns.
inline std::vector<Triangle> sheet(const std::vector<std::vector<dvec3>>& p) {
  std::vector<Triangle> triangles;
  for (std::size_t i = 0; i + 1 < p.size(); ++i) {
    for (std::size_t j = 0; j + 1 < p.size(); ++j) {
      triangles.push_back({p[i][j], p[i][j + 1], p[i + 1][j]});
      triangles.push_back({p[i + 1][j], p[i][j + 1], p[i + 1][j + 1]});
    }
  }
  return triangles;
}

inline std::vector<dvec3> random_points(Random& random, int count, double low, double high) {
  std::vector<dvec3> points;
  for (int i = 0; i < count; ++i) points.push_back(random.in_box(low, high));
  return points;
}

/// What lies between points and the samples of frame_light().
inline DepthComplexity depth_of(const Scene& scene, const std::vector<dvec3>& points, std::uint32_t samples) {
  DepthComplexity depth;
  solve_depth_complexity(scene, receivers_at(points), frame_light(), frame_config(samples), depth);
  return depth;
}

}  // namespace halfshade::test
