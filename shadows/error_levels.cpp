#include "shadows/error_levels.h"

#include <algorithm>
#include <cmath>

#include "rasterizer/core/parallel.h"
#include "rasterizer/core/stopwatch.h"
#include "shadows/level_engine.h"
#include "shadows/opaque_mesh.h"
#include "shadows/receiver_request.h"
#include "shadows/solver.h"
#include "shadows/space_curve.h"

namespace halfshade {
namespace {

constexpr std::uint32_t kWindow = 8;  // receivers before and behind, in Morton order, that a receiver is judged with
constexpr std::uint32_t kGroup = 32;  // receivers that one certificate is tried for

// The estimate (docs/max_error.md, "How the factors were chosen").
constexpr double kUnseenSamples = 8.0;    // that a feature no sample has met may be worth
constexpr double kSamplesPerGoal = 16.0;  // of the first set, over 1 / goal
constexpr double kRowDeviations = 3.0;    // standard deviations that are allowed for: rows
constexpr double kDeviations = 4.0;       // the same for samples anywhere, whose neighbours are not rounded evenly

/// Sets of round `index`. A round costs about as much for its receivers as for its samples, so the first set is large
/// enough for nearly all; those of each further round are twice as large until sets can be no larger.
SetShape shape_of(std::uint32_t index, double max_error) {
  SetShape shape{16, 32};
  while (shape.size() < 4096 && (shape.size() * max_error < kSamplesPerGoal || index > 0)) {
    if (shape.size() * max_error >= kSamplesPerGoal) --index;
    shape.rows == 64 ? shape.columns = 64 : shape.rows *= 2;
  }
  return shape;
}

/// All receivers, in Morton order: with it the errors in docs/max_error.md were measured, and neighbours along it are
/// more various than along Hilbert's curve. Rounds are weighted by the inverse of their variance.
struct Progression {
  std::vector<std::uint32_t> order;
  std::vector<std::uint32_t> rounds, samples, visible;  // that were asked; samples that are visible
  std::vector<double> weight, weighted, weighted_sq;    // sums over rounds of w, w V, w V^2
  std::vector<std::uint8_t> open;
};

void start(const ReceiverArray& receivers, Progression& p) {
  p.order = order_along<MortonCurve>(receivers.position, [](std::uint32_t) { return true; });
  const std::size_t count = p.order.size();
  p.rounds.assign(count, 0), p.samples.assign(count, 0), p.visible.assign(count, 0), p.open.assign(count, 1);
  p.weight.assign(count, 0.0), p.weighted.assign(count, 0.0), p.weighted_sq.assign(count, 0.0);
}

bool sees_all_or_nothing(const Progression& p, std::size_t place) {
  return p.visible[place] == 0 || p.visible[place] == p.samples[place];
}

double visibility_at(const Progression& p, std::size_t place) {
  if (sees_all_or_nothing(p, place)) return p.visible[place] == 0 ? 0.0 : 1.0;
  return p.weighted[place] / p.weight[place];
}

/// What the receivers around a place have in common: an outline that passes between the samples of one shows in some
/// of the others.
bool constant_around(const Progression& p, std::size_t place) {
  const std::size_t first = place - std::min<std::size_t>(place, kWindow),
                    last = std::min(p.order.size() - 1, place + kWindow);
  const bool dark = p.visible[place] == 0;
  for (std::size_t i = first; i <= last; ++i) {
    if (p.visible[i] != (dark ? 0 : p.samples[i])) return false;
  }
  return true;
}

/// Of the mean of all rounds, from what was made of each; more where they lie farther apart than that allows.
double deviation_at(const Progression& p, std::size_t place) {
  const double mean = p.weighted[place] / p.weight[place], rounds = p.rounds[place];
  const double apart = rounds > 1.0 ? (p.weighted_sq[place] - mean * p.weighted[place]) / (rounds - 1.0) : 0.0;
  return std::sqrt(std::max(1.0, apart) / p.weight[place]);
}

double estimate_error(const Progression& p, std::size_t place, double deviations) {
  const double unseen = kUnseenSamples / p.samples[place];
  return constant_around(p, place) ? unseen : std::max(unseen, deviations * deviation_at(p, place));
}

/// How rough the pictures of a place are: its own, or those around it if they are rougher on average. What lies between
/// the samples of one receiver is met by some of the others', as often as it is wide.
double roughness_around(std::span<const std::uint32_t> places, std::span<const SetAnswer> answers, std::size_t k) {
  double sum = 0.0, count = 0.0;
  const auto add = [&](std::size_t i) { sum += answers[i].roughness, count += 1.0; };
  for (std::size_t i = k; i > 0 && places[i - 1] + kWindow >= places[k]; --i) add(i - 1);
  for (std::size_t i = k; i < places.size() && places[i] <= places[k] + kWindow; ++i) add(i);
  return std::max({1.0, static_cast<double>(answers[k].roughness), sum / count});
}

/// A round's sets for the open receivers at `places`.
void ask_sets(LevelEngine& engine, const SetRound& round, const SetShape& shape, std::span<const std::uint32_t> places,
              Progression& p, ErrorLevel& level) {
  std::vector<std::uint32_t> which;
  for (const std::uint32_t place : places) which.push_back(p.order[place]);
  std::vector<SetAnswer> answers;
  engine.solve_round(shape, round, which, answers);
  const std::uint32_t samples = shape.size() * round.count;
  parallel_ranges(places.size(), 1024, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k != end; ++k) {
      const std::uint32_t place = places[k];
      const double visibility = static_cast<double>(answers[k].visible) / samples;
      const double weight = 12.0 * samples * samples / roughness_around(places, answers, k);
      p.weight[place] += weight, p.weighted[place] += weight * visibility;
      p.weighted_sq[place] += weight * visibility * visibility;
      p.visible[place] += answers[k].visible, p.samples[place] += samples, ++p.rounds[place];
    }
  });
  level.samples += places.size() * std::uint64_t{samples};
}

/// Groups of neighbours that all see everything, or all nothing: can that be proved for the whole light?
void prove_groups(const LevelEngine& engine, std::uint32_t set_size, Progression& p, AdaptiveVisibility& result,
                  ErrorLevel& level) {
  const std::size_t groups = (p.order.size() + kGroup - 1) / kGroup;
  std::vector<std::uint8_t> proved(groups, 0);
  parallel_ranges(groups, 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t g = begin; g != end; ++g) {
      const std::size_t first = g * kGroup, count = std::min<std::size_t>(p.order.size() - first, kGroup);
      const auto seen = std::span(p.visible).subspan(first, count);
      const auto all = [&](std::uint32_t v) { return std::count(seen.begin(), seen.end(), v) == std::ssize(seen); };
      const auto which = std::span(p.order).subspan(first, count);
      if (all(0)) proved[g] = engine.all_dark(which);
      if (all(set_size)) proved[g] = engine.all_lit(which);
    }
  });
  for (std::size_t place = 0; place < p.order.size(); ++place) {
    if (proved[place / kGroup] == 0 || p.open[place] == 0) continue;
    p.open[place] = 0;
    result.evidence[p.order[place]] = ErrorEvidence::kProof;
    ++(p.visible[place] == 0 ? result.proved_umbra : result.proved_lit), ++level.proved;
  }
}

/// Closes the receivers whose estimate keeps the goal. Samples anywhere must agree with a second set of theirs.
void settle(std::span<const std::uint32_t> places, bool rows, double max_error, bool last, Progression& p,
            AdaptiveVisibility& result, ErrorLevel& level) {
  std::vector<double> estimates(places.size(), 0.0);
  parallel_ranges(places.size(), 1024, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k != end; ++k) {
      if (p.open[places[k]] != 0) estimates[k] = estimate_error(p, places[k], rows ? kRowDeviations : kDeviations);
    }
  });
  for (std::size_t k = 0; k < places.size(); ++k) {
    if (p.open[places[k]] == 0) continue;
    const std::uint32_t receiver = p.order[places[k]];
    result.bound[receiver] = static_cast<float>(estimates[k]);
    if ((rows || p.rounds[places[k]] > 1) && estimates[k] <= max_error) {
      p.open[places[k]] = 0, ++level.settled;
    } else {
      level.largest_bound = std::max(level.largest_bound, estimates[k]);
      if (last) result.evidence[receiver] = ErrorEvidence::kExhausted, ++result.exhausted;
    }
  }
}

void finish(const Progression& p, AdaptiveVisibility& result) {
  for (std::size_t place = 0; place < p.order.size(); ++place) {
    const std::uint32_t receiver = p.order[place];
    result.visibility[receiver] = static_cast<float>(visibility_at(p, place));
    result.samples[receiver] = p.samples[place];
    result.samples_asked += result.samples[receiver];
    result.bound_kept = std::max(result.bound_kept, static_cast<double>(result.bound[receiver]));
  }
}

void reset(std::size_t count, double max_error, AdaptiveVisibility& result) {
  result = {};
  result.max_error = max_error;
  result.visibility.assign(count, 0.0f), result.bound.assign(count, 0.0f);
  result.samples.assign(count, 0), result.evidence.assign(count, ErrorEvidence::kEstimate);
}

/// Lights that are their samples: the answer for them is the answer.
void solve_all_samples(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                       const ShadowConfig& config, AdaptiveVisibility& result, ShadowStats& stats) {
  Stopwatch watch;
  const LightSamples samples = make_sets(light, config, mesh.frame, {}, {});
  VisibilityMasks masks;
  solve_masks(mesh, receivers, light, samples, config, masks, stats);
  visibility_of(masks, result.visibility);
  const std::uint64_t asked = receivers.size() * std::uint64_t{samples.count};
  result.samples.assign(receivers.size(), samples.count);
  result.evidence.assign(receivers.size(), ErrorEvidence::kProof);
  result.samples_asked = asked, result.set_size = samples.count, result.pattern = "all";
  result.levels = {{samples.count, receivers.size(), receivers.size(), 0, asked, watch.lap() - stats.build_ms, 0.0}};
  for (const float v : result.visibility) result.proved_lit += v == 1.0f, result.proved_umbra += v == 0.0f;
}

}  // namespace

void check_max_error(double max_error) {
  if (max_error >= kSmallestMaxError && max_error <= kLargestMaxError) return;
  throw Error(ErrorCode::kUsage,
              "largest error of visibility: " + std::to_string(max_error) + " is not in 1/4096..1/4");
}

void solve_to_error(const LatticeMesh& scene_mesh, const ReceiverArray& receivers, const Light& light,
                    const ShadowConfig& asked, double max_error, AdaptiveVisibility& result, ShadowStats& stats) {
  const FpEnvironment environment;
  check_max_error(max_error);
  const OpaqueMesh opaque(scene_mesh);
  ShadowConfig config = asked;
  config.method = ShadowMethod::kExact, config.interleave = false, config.sample_sets = 1, config.frame = 0;
  stats = {};
  stats.receivers = receivers.size(), stats.triangles = opaque.get().triangles.size();
  reset(receivers.size(), max_error, result);
  if (light.shape == LightShape::kPoint || light.shape == LightShape::kSamples) {
    solve_all_samples(opaque.get(), receivers, light, config, result, stats);
    return;
  }
  Stopwatch watch;
  LevelEngine engine(opaque.get(), receivers, light, config, stats);
  result.set_size = shape_of(0, max_error).size(), result.pattern = engine.uses_rows() ? "rows" : "low-discrepancy";
  Progression p;
  start(receivers, p);
  std::uint32_t samples = 0;
  watch.lap();
  for (const SetRound& round : kSetRounds) {
    std::vector<std::uint32_t> places;
    for (std::uint32_t i = 0; i < p.order.size(); ++i) {
      if (p.open[i] != 0) places.push_back(i);
    }
    if (places.empty()) break;
    const SetShape shape = shape_of(round.index, max_error);
    ErrorLevel level;
    samples += round.count * shape.size();
    level.samples_per_receiver = samples, level.receivers = places.size();
    ask_sets(engine, round, shape, places, p, level);
    if (round.index == 0) prove_groups(engine, shape.size(), p, result, level);
    settle(places, engine.uses_rows(), max_error, round.index + 1 == std::size(kSetRounds), p, result, level);
    level.ms = watch.lap();
    result.levels.push_back(level);
  }
  finish(p, result);
}

void solve_to_error(const Scene& scene, std::span<const Receiver> receivers, const Light& light,
                    const ShadowConfig& asked, double max_error, AdaptiveVisibility& result, ShadowStats* stats) {
  const FpEnvironment environment;
  check_max_error(max_error);
  ShadowConfig config = asked;
  config.sample_sets = 1, config.interleave = false;
  const LocalFrame frame = make_local_frame(scene.positions, receiver_reach(receivers, light));
  const ReceiverRequest q = make_receiver_request(frame, receivers, light, config);
  AdaptiveVisibility solved;
  ShadowStats own;
  solve_to_error(make_lattice_mesh(scene, frame), q.receivers, light, config, max_error, solved,
                 stats != nullptr ? *stats : own);
  reset(receivers.size(), max_error, result);
  for (std::size_t i = 0; i < q.receivers.size(); ++i) {
    const std::uint32_t to = q.receivers.sample[i];
    result.visibility[to] = solved.visibility[i], result.bound[to] = solved.bound[i];
    result.samples[to] = solved.samples[i], result.evidence[to] = solved.evidence[i];
  }
  for (const std::uint32_t i : q.unlit) result.evidence[i] = ErrorEvidence::kProof;
  result.levels = std::move(solved.levels), result.bound_kept = solved.bound_kept;
  result.proved_lit = solved.proved_lit, result.proved_umbra = solved.proved_umbra + q.unlit.size();
  result.exhausted = solved.exhausted, result.samples_asked = solved.samples_asked;
  result.pattern = std::move(solved.pattern), result.set_size = solved.set_size;
}

}  // namespace halfshade
