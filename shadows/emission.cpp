#include "halfshade/emission.h"

#include <algorithm>
#include <cmath>

#include "rasterizer/core/fp_environment.h"
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

/// Weights of one set behind those that are there. The image is known to be a good one.
void add_weights(const EmissionImage& image, std::span<const dvec2> st, std::vector<vec3>& weights) {
  const double count = static_cast<double>(st.size()), half = 0.5 / std::sqrt(count);
  for (const dvec2& p : st) {
    const Range x = range_around(p.x, half, image.width), y = range_around(1.0 - p.y, half, image.height);
    weights.emplace_back(mean_over(image, x, y) / count);
  }
}

void check_image(const EmissionImage& image) {
  if (image.empty()) throw Error(ErrorCode::kUsage, "emission: the image is empty");
  std::string fault = size_fault(image);
  if (fault.empty()) fault = texel_fault(image);
  if (!fault.empty()) throw Error(ErrorCode::kBadInput, "emission: " + fault);
}

}  // namespace

std::string size_fault(const EmissionImage& image) {
  const std::uint64_t wanted = std::uint64_t{image.width} * image.height;
  if (wanted != 0 && image.rgb.size() == wanted) return {};
  return "the image has " + std::to_string(image.rgb.size()) + " texels for " + std::to_string(image.width) + " x " +
         std::to_string(image.height);
}

std::string texel_fault(const EmissionImage& image) {
  const auto bad = std::find_if_not(image.rgb.begin(), image.rgb.end(), is_emission);
  if (bad == image.rgb.end()) return {};
  return "texel " + std::to_string(bad - image.rgb.begin()) + " of the image is negative or not finite";
}

std::vector<vec3> sample_emission(const EmissionImage& image, std::span<const dvec2> st) {
  const FpEnvironment environment;
  check_image(image);
  for (std::size_t i = 0; i < st.size(); ++i) {
    if (st[i].x >= 0.0 && st[i].x <= 1.0 && st[i].y >= 0.0 && st[i].y <= 1.0) continue;
    throw Error(ErrorCode::kBadInput, "emission: sample " + std::to_string(i) + " is not within 0..1");
  }
  std::vector<vec3> weights;
  weights.reserve(st.size());
  add_weights(image, st, weights);
  return weights;
}

std::vector<vec3> sample_emission(const Light& light, const ShadowConfig& config) {
  if (light.shape != LightShape::kRectangle) {
    throw Error(ErrorCode::kUsage, "light '" + light.name + "': only rectangles have emission images");
  }
  const FpEnvironment environment;
  LightSamples samples;
  samples.count = config.light_sample_count;
  samples.sets = number_of_sets(light, config);
  samples.st = unit_square_samples(config.pattern, samples.count, config.frame, samples.sets, config.seed);
  return sample_emission(light.emission_image, samples);
}

std::vector<vec3> sample_emission(const EmissionImage& image, const LightSamples& samples) {
  const FpEnvironment environment;
  check_image(image);
  std::vector<vec3> weights;
  weights.reserve(samples.st.size());
  for (std::uint32_t set = 0; set < samples.sets; ++set) {
    add_weights(image, std::span(samples.st).subspan(std::size_t{set} * samples.count, samples.count), weights);
  }
  return weights;
}

vec3 weighted_visibility(std::span<const std::uint64_t> mask, std::span<const vec3> weights) {
  const FpEnvironment environment;
  dvec3 sum(0.0);
  for (std::size_t i = 0; i < weights.size(); ++i) {
    if (!((mask[i / 64] >> (i % 64)) & 1)) sum += dvec3(weights[i]);
  }
  return vec3(sum);
}

}  // namespace halfshade
