#include "halfshade/emission.h"

#include <algorithm>
#include <cmath>

#include "shadows/light_samples.h"
#include "shadows/sample_patterns.h"

namespace halfshade {
namespace {

/// Part of an axis of `texels` texels, in texels.
struct Range {
  double low, high;
  std::uint32_t first() const { return static_cast<std::uint32_t>(low); }
  std::uint32_t end(std::uint32_t texels) const {
    return std::min(texels, std::max(first() + 1, static_cast<std::uint32_t>(std::ceil(high))));
  }
  /// Length of the part inside texel i.
  double overlap(std::uint32_t i) const { return std::max(0.0, std::min(high, i + 1.0) - std::max(low, double(i))); }
};

Range range_around(double at, double half, std::uint32_t texels) {
  return {std::max(0.0, at - half) * texels, std::min(1.0, at + half) * texels};
}

dvec3 mean_over(const EmissionImage& image, const Range& x, const Range& y) {
  dvec3 sum(0.0);
  double area = 0.0;
  for (std::uint32_t row = y.first(); row < y.end(image.height); ++row) {
    for (std::uint32_t column = x.first(); column < x.end(image.width); ++column) {
      const double overlap = x.overlap(column) * y.overlap(row);
      sum += overlap * dvec3(image.rgb[std::size_t{row} * image.width + column]);
      area += overlap;
    }
  }
  return sum / area;
}

}  // namespace

std::vector<vec3> sample_emission(const EmissionImage& image, std::span<const dvec2> st) {
  if (image.empty()) throw Error(ErrorCode::kUsage, "emission: the image is empty");
  const double count = static_cast<double>(st.size()), half = 0.5 / std::sqrt(count);
  std::vector<vec3> weights;
  weights.reserve(st.size());
  for (const dvec2& p : st) {
    const Range x = range_around(p.x, half, image.width), y = range_around(1.0 - p.y, half, image.height);
    weights.emplace_back(mean_over(image, x, y) / count);
  }
  return weights;
}

std::vector<vec3> sample_emission(const Light& light, const ShadowConfig& config) {
  if (light.shape != LightShape::kRectangle) {
    throw Error(ErrorCode::kUsage, "light '" + light.name + "': only rectangles have emission images");
  }
  LightSamples samples;
  samples.count = config.light_sample_count;
  samples.sets = number_of_sets(light, config);
  samples.st = unit_square_samples(config.pattern, samples.count, config.frame, samples.sets, config.seed);
  return sample_emission(light.emission_image, samples);
}

std::vector<vec3> sample_emission(const EmissionImage& image, const LightSamples& samples) {
  std::vector<vec3> weights;
  for (std::uint32_t set = 0; set < samples.sets; ++set) {
    const std::span<const dvec2> st = std::span(samples.st).subspan(std::size_t{set} * samples.count, samples.count);
    const std::vector<vec3> part = sample_emission(image, st);
    weights.insert(weights.end(), part.begin(), part.end());
  }
  return weights;
}

vec3 weighted_visibility(std::span<const std::uint64_t> mask, std::span<const vec3> weights) {
  dvec3 sum(0.0);
  for (std::size_t i = 0; i < weights.size(); ++i) {
    if (!((mask[i / 64] >> (i % 64)) & 1)) sum += dvec3(weights[i]);
  }
  return vec3(sum);
}

}  // namespace halfshade
