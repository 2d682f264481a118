#include "shadows/set_sequence.h"

#include <cmath>

#include "rasterizer/core/unit_vector.h"

namespace halfshade {
namespace {

/// Shift of a row of all that a round has, as a fraction of a column: a rank-1 lattice near the golden section.
double shift_of(std::uint32_t row, std::uint32_t rows) {
  const std::uint32_t generator = static_cast<std::uint32_t>(rows * 0.6180339887498949) | 1;  // rows: a power of two
  return (row * generator % rows + 0.5) / rows;
}

/// Row `row` of set `set`, among all rows of the round.
std::uint32_t row_of_round(const SetRound& round, std::uint32_t set, std::uint32_t row) {
  return row * round.count + set;
}

LightSamples make_row_sets(const Light& light, const LocalFrame& frame, const SetShape& shape, const SetRound& round,
                           LightSamples samples) {
  const dvec3 along = round.index % 2 == 1 ? light.v : light.u;
  dvec3 across = round.index % 2 == 1 ? light.u : light.v;
  if (glm::dot(glm::cross(samples.axis_n, along), across) < 0.0) across = -across;  // rows rise along axis_v
  samples.axis_u = unit_vector(along);
  samples.axis_v = glm::cross(samples.axis_n, samples.axis_u);
  samples.points.clear(), samples.st.clear(), samples.st_key = {};
  const std::uint32_t rows = shape.rows * round.count;
  for (std::uint32_t set = 0; set < round.count; ++set) {
    for (std::uint32_t i = 0; i < shape.size(); ++i) {
      const std::uint32_t row = row_of_round(round, set, i / shape.columns), column = i % shape.columns;
      const double x = (column + shift_of(row, rows)) / shape.columns, y = (row + 0.5) / rows;
      samples.st.emplace_back(column / static_cast<double>(shape.columns),
                              (i / shape.columns) / static_cast<double>(shape.rows));
      samples.points.push_back(
          snap_to_lattice(samples.center + frame.to_local_vector(along * (x - 0.5) + across * (y - 0.5))));
    }
  }
  return samples;
}

}  // namespace

bool has_row_sets(const Light& light) {
  return light.shape == LightShape::kRectangle && glm::length(light.u) > 0.0 && glm::length(light.v) > 0.0 &&
         std::fabs(glm::dot(light.u, light.v)) < 1e-6 * glm::length(light.u) * glm::length(light.v);
}

std::vector<bool> row_wraps(const SetShape& shape, const SetRound& round, std::uint32_t set) {
  const auto shift = [&](std::uint32_t row) {
    return shift_of(row_of_round(round, set, row), shape.rows * round.count);
  };
  std::vector<bool> wraps;
  for (std::uint32_t row = 0; row + 1 < shape.rows; ++row) wraps.push_back(shift(row + 1) < shift(row));
  return wraps;
}

LightSamples make_sets(const Light& light, const ShadowConfig& asked, const LocalFrame& frame, const SetShape& shape,
                       const SetRound& round) {
  ShadowConfig config = asked;
  config.light_sample_count = shape.size();
  config.sample_sets = round.count, config.interleave = false, config.rotate_sets = false;
  config.pattern = SamplePattern::kLowDiscrepancy;
  config.frame = round.first;
  LightSamples samples = make_light_samples(light, config, frame);
  return has_row_sets(light) ? make_row_sets(light, frame, shape, round, std::move(samples)) : samples;
}

}  // namespace halfshade
