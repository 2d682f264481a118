#include "shadows/set_sequence.h"

#include <cmath>

#include "rasterizer/core/hash.h"

namespace halfshade {
namespace {

/// What makes one set differ from another.
struct RowPlan {
  bool along_v = false;
  int tilt = 0;                  // rows climbed over the length of a row
  std::uint32_t generator = 19;  // of the lattice that shifts the rows
  double shift = 0.0;            // of all rows, in columns
  double height = 0.0;           // of level rows within their stripes, before each stripe's own offset
};

double fraction(double x) { return x - std::floor(x); }

double van_der_corput(std::uint32_t index) {
  double result = 0.0;
  for (double digit = 0.5; index != 0; index >>= 1, digit *= 0.5) result += (index & 1) * digit;
  return result;
}

RowPlan plan_of(std::uint32_t side, std::uint32_t index) {
  static constexpr std::uint32_t kGenerators[2][kTiltedSets] = {{19, 13, 21, 11},
                                                                {39, 25, 43, 29}};  // odd: coprime to side
  static constexpr int kTilts[kTiltedSets] = {1, -1, -1, 1};
  const auto& generators = kGenerators[side == 64];
  RowPlan plan;
  plan.shift = fraction(index * 0.6180339887498949);
  if (index < kTiltedSets) {
    plan.along_v = index % 2 == 1, plan.tilt = kTilts[index], plan.generator = generators[index];
  } else {
    plan.generator = generators[0], plan.height = van_der_corput(index - kTiltedSets);
  }
  return plan;
}

/// Place of a sample in the unit square, x along the rows.
dvec2 place_of(const RowPlan& plan, std::uint32_t side, std::uint32_t seed, std::uint32_t row, std::uint32_t column) {
  const double n = side;
  const double shift = fraction((row * plan.generator % side + 0.5) / n + plan.shift);
  const double x = (column + shift) / n;
  if (plan.tilt != 0) return {x, (row + (plan.tilt > 0 ? x : 1.0 - x)) / n};
  return {x, (row + fraction(hash_unit(row, seed) + plan.height)) / n};
}

LightSamples make_row_set(const Light& light, const ShadowConfig& config, const LocalFrame& frame, std::uint32_t side,
                          std::uint32_t first, LightSamples samples) {
  RowPlan plan = plan_of(side, first);
  const dvec3 along = plan.along_v ? light.v : light.u, across = plan.along_v ? light.u : light.v;
  samples.axis_u = glm::normalize(along + across * (plan.tilt / static_cast<double>(side)));
  samples.axis_v = glm::cross(samples.axis_n, samples.axis_u);
  samples.points.clear(), samples.st.clear();
  for (std::uint32_t set = 0; set < samples.sets; ++set) {
    plan = plan_of(side, first + set);
    for (std::uint32_t i = 0; i < side * side; ++i) {
      const std::uint32_t row = i / side, column = i % side;
      const dvec2 p = place_of(plan, side, config.seed, row, column) - 0.5;
      samples.st.emplace_back(column / static_cast<double>(side), row / static_cast<double>(side));
      samples.points.push_back(snap_to_lattice(samples.center + frame.to_local_vector(along * p.x + across * p.y)));
    }
  }
  return samples;
}

}  // namespace

bool has_row_sets(const Light& light) {
  return light.shape == LightShape::kRectangle && glm::length(light.u) > 0.0 && glm::length(light.v) > 0.0 &&
         std::fabs(glm::dot(light.u, light.v)) < 1e-6 * glm::length(light.u) * glm::length(light.v);
}

LightSamples make_sets(const Light& light, const ShadowConfig& asked, const LocalFrame& frame, std::uint32_t side,
                       std::uint32_t first, std::uint32_t count) {
  ShadowConfig config = asked;
  config.light_sample_count = side * side;
  config.sample_sets = count, config.interleave = false, config.rotate_sets = false;
  config.pattern = SamplePattern::kLowDiscrepancy;
  config.frame = first;
  LightSamples samples = make_light_samples(light, config, frame);
  return has_row_sets(light) ? make_row_set(light, config, frame, side, first, std::move(samples)) : samples;
}

}  // namespace halfshade
