#include "shadows/thin_features.h"

#include <bit>
#include <cmath>

#include "shadows/solver.h"

namespace halfshade {
namespace {

using Rows = std::array<std::uint64_t, kProbeSide>;

/// Bits of `row` in runs of ones of at least `shortest`; beyond both ends all is one.
std::uint64_t in_long_runs(std::uint64_t row, std::uint32_t shortest) {
  std::uint64_t starts = row;  // eroded: bit i stays where bits i .. i + shortest - 1 are set
  for (std::uint32_t k = 1; k < shortest; ++k) starts &= row >> k | ~(~std::uint64_t{0} >> k);
  std::uint64_t full = starts;
  for (std::uint32_t k = 1; k < shortest; ++k) full |= starts << k;
  // A run from the first column may have begun outside.
  const auto first = static_cast<std::uint32_t>(std::countr_one(row));
  return full | (first >= 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << first) - 1);
}

std::uint64_t in_short_runs(std::uint64_t row, std::uint32_t shortest) {
  return (row & ~in_long_runs(row, shortest)) | (~row & ~in_long_runs(~row, shortest));
}

Rows transposed(const Rows& rows) {
  Rows columns{};
  for (std::uint32_t j = 0; j < kProbeSide; ++j) {
    for (std::uint32_t i = 0; i < kProbeSide; ++i) columns[i] |= (rows[j] >> i & 1) << j;
  }
  return columns;
}

bool has_area(const Light& light) { return light.shape != LightShape::kPoint && light.shape != LightShape::kSamples; }

/// Every n-th of those that see some light.
ReceiverArray choose_probes(const ReceiverArray& receivers, std::span<const float> visibility, std::size_t count) {
  std::vector<std::size_t> candidates;
  for (std::size_t i = 0; i < receivers.size(); ++i) {
    if (visibility[i] > 0.0f) candidates.push_back(i);
  }
  count = std::min(count, candidates.size());
  ReceiverArray probes;
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t i = candidates[(2 * k + 1) * candidates.size() / (2 * count)];
    probes.push_back(receivers.position[i], receivers.normal[i], receivers.triangle[i], receivers.sample[i], 0);
  }
  return probes;
}

}  // namespace

std::uint32_t cells_in_short_runs(std::span<const std::uint64_t, kProbeSide> blocked, std::uint32_t shortest) {
  Rows rows;
  std::copy(blocked.begin(), blocked.end(), rows.begin());
  Rows columns = transposed(rows);
  for (std::uint64_t& row : rows) row = in_short_runs(row, shortest);
  for (std::uint64_t& column : columns) column = in_short_runs(column, shortest);
  columns = transposed(columns);
  int count = 0;
  for (std::uint32_t j = 0; j < kProbeSide; ++j) count += std::popcount(rows[j] | columns[j]);
  return static_cast<std::uint32_t>(count);
}

ThinFeatures find_thin_features(const LatticeMesh& mesh, const ReceiverArray& receivers,
                                std::span<const float> visibility, const Light& light, const ShadowConfig& config,
                                std::size_t probes, KeptExact& kept) {
  ThinFeatures found;
  const auto spacing =  // between the samples in use, in cells; a run is short when it is shorter
      static_cast<std::uint32_t>(std::floor(kProbeSide / std::sqrt(static_cast<double>(config.light_sample_count))));
  if (!has_area(light) || spacing < 2 || spacing >= kProbeSide) return found;
  const ReceiverArray chosen = choose_probes(receivers, visibility, probes);
  if (chosen.size() == 0) return found;
  ShadowConfig fine = config;
  fine.method = kept.has_tree ? ShadowMethod::kExact : ShadowMethod::kAliasFreeShadowMap;
  fine.light_sample_count = kProbeSide * kProbeSide;
  fine.pattern = SamplePattern::kUniform;
  fine.sample_sets = 1;
  fine.interleave = fine.rotate_sets = false;
  fine.back_face_casters = fine.afsm.silhouettes = false;
  const LightSamples samples = make_light_samples(light, fine, mesh.frame);
  VisibilityMasks masks;
  ShadowStats stats;
  solve_masks(mesh, chosen, light, samples, fine, masks, stats, &kept);
  found.probes = chosen.size();
  std::uint64_t cells = 0;
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    const std::uint32_t thin = cells_in_short_runs(masks.mask(i).first<kProbeSide>(), spacing);
    cells += thin;
    found.seeing += thin >= spacing * spacing;
  }
  found.share_of_light =
      static_cast<double>(cells) / (double{kProbeSide} * kProbeSide * static_cast<double>(chosen.size()));
  return found;
}

}  // namespace halfshade
