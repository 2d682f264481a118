#include "shadows/error_levels.h"

#include <algorithm>
#include <cmath>

#include "rasterizer/core/parallel.h"
#include "rasterizer/core/stopwatch.h"
#include "shadows/level_engine.h"
#include "shadows/morton_order.h"
#include "shadows/opaque_mesh.h"
#include "shadows/receiver_request.h"
#include "shadows/solver.h"

namespace halfshade {
namespace {

constexpr std::uint32_t kSetsAfter[] = {1, 2, 4, 8, 16, 32};  // the level of each round
constexpr std::uint32_t kWindow = 8;  // receivers before and behind, in Morton order, that a receiver is judged with
constexpr std::uint32_t kGroup = 32;  // receivers that one certificate is tried for
/// Goals below this need the large sets from the start; above it, they would be too much for most receivers.
constexpr double kLargeSetsBelow = 1.0 / 64.0;

// The estimate. A sample next to the outline of what is hidden stands for a cell that is hidden in part: its error is
// that of a number in 0..1 rounded to 0 or 1, with a standard deviation of 0.29. Both factors are chosen by measurement
// (docs/max_error.md, "How the factors were chosen").
constexpr double kCellDeviation = 0.29;
constexpr double kDeviations = 4.0;  // that are allowed for
constexpr double kSpreadFactor = 1.5;
constexpr double kTwoSetsFactor = 2.0;  // two sets may be wrong by chance in the same way
constexpr double kUnseenSamples = 8.0;  // that a feature no sample has met may be worth

/// All receivers, in Morton order.
struct Progression {
  std::vector<std::uint32_t> order;
  std::vector<std::uint32_t> visible, boundary, sets;  // sums over sets; sets asked
  std::vector<std::uint64_t> squares;                  // sum over sets of visible^2
  std::vector<double> spread;                          // see spread_at
  std::vector<std::uint8_t> open;
};

void start(const ReceiverArray& receivers, Progression& p) {
  p.order = morton_order(receivers.position, [](std::uint32_t) { return true; });
  const std::size_t count = p.order.size();
  p.visible.assign(count, 0), p.boundary.assign(count, 0), p.sets.assign(count, 0);
  p.squares.assign(count, 0), p.spread.assign(count, 0.0), p.open.assign(count, 1);
}

double visibility_at(const Progression& p, std::size_t place, std::uint32_t set_size) {
  return p.visible[place] / (static_cast<double>(set_size) * p.sets[place]);
}

/// How far the mean is off to judge by how far the sets lie apart: their standard error, or the difference from the
/// mean `before` this level if that is larger.
double spread_at(const Progression& p, std::size_t place, double before, std::uint32_t set_size) {
  const double sets = p.sets[place], sum = p.visible[place];
  const double scatter = std::max(0.0, static_cast<double>(p.squares[place]) - sum * sum / sets);
  return std::max(std::sqrt(scatter * sets / (sets - 1.0)) / (sets * set_size),
                  std::fabs(visibility_at(p, place, set_size) - before));
}

/// What the receivers around a place have in common: an outline that passes between their samples shows in some of
/// them.
struct Surroundings {
  double boundary = 0.0, spread = 0.0;  // largest per set, largest of those at the same level
  bool constant = true;                 // all see all of the light, or all see nothing of it
};

Surroundings look_around(const Progression& p, std::size_t place, std::uint32_t set_size) {
  Surroundings s;
  const std::size_t first = place - std::min<std::size_t>(place, kWindow),
                    last = std::min(p.order.size() - 1, place + kWindow);
  const bool dark = p.visible[place] == 0;
  for (std::size_t i = first; i <= last; ++i) {
    s.constant = s.constant && p.visible[i] == (dark ? 0 : p.sets[i] * set_size);
    s.boundary = std::max(s.boundary, static_cast<double>(p.boundary[i]) / p.sets[i]);
    if (p.sets[i] == p.sets[place]) s.spread = std::max(s.spread, p.spread[i]);
  }
  return s;
}

double estimate_error(const Progression& p, std::size_t place, std::uint32_t set_size) {
  const Surroundings s = look_around(p, place, set_size);
  const double samples = static_cast<double>(set_size) * p.sets[place];
  if (p.sets[place] == 1) return 1.0 / std::sqrt(samples);  // a strip between two rows of the only set
  const double unseen = kUnseenSamples / samples;
  if (s.constant) return unseen;
  const double scatter = kDeviations * kCellDeviation * std::sqrt(std::max(s.boundary, 1.0) * p.sets[place]) / samples;
  return (p.sets[place] == 2 ? kTwoSetsFactor : 1.0) * std::max({unseen, scatter, kSpreadFactor * s.spread});
}

/// A round's sets for the open receivers at `places`. Those that a certificate finds lit are closed.
void ask_sets(LevelEngine& engine, std::span<const std::uint32_t> places, std::uint32_t first, std::uint32_t end,
              const ShadowConfig& config, Progression& p, AdaptiveVisibility& result, ErrorLevel& level) {
  std::vector<std::uint32_t> which;
  for (const std::uint32_t place : places) which.push_back(p.order[place]);
  std::vector<double> before(places.size(), 0.0);
  std::vector<std::uint8_t> lit(places.size(), 0);
  if (first > 0) {
    for (std::size_t k = 0; k < places.size(); ++k) before[k] = visibility_at(p, places[k], engine.set_size());
  }
  report_progress(config, static_cast<double>(first) / kSetsAfter[std::size(kSetsAfter) - 1]);
  std::vector<SetAnswer> answers;
  engine.solve_sets(first, end, which, answers);
  for (std::size_t i = 0; i < answers.size(); ++i) {
    const std::size_t k = i % places.size(), place = places[k];
    p.visible[place] += answers[i].visible, p.boundary[place] += answers[i].boundary;
    p.squares[place] += std::uint64_t{answers[i].visible} * answers[i].visible;
    ++p.sets[place];
    lit[k] |= static_cast<std::uint8_t>(answers[i].lit);
  }
  level.samples += answers.size() * engine.set_size();
  for (std::size_t k = 0; k < places.size(); ++k) {
    if (first > 0) p.spread[places[k]] = spread_at(p, places[k], before[k], engine.set_size());
    if (lit[k] == 0) continue;
    p.open[places[k]] = 0;
    result.evidence[p.order[places[k]]] = ErrorEvidence::kProof;
    ++result.proved_lit, ++level.proved;
  }
}

/// Groups of neighbours that all see everything, or all nothing: can that be proved for the whole light?
void prove_groups(const LevelEngine& engine, Progression& p, AdaptiveVisibility& result, ErrorLevel& level) {
  const std::size_t groups = (p.order.size() + kGroup - 1) / kGroup;
  std::vector<std::uint8_t> proved(groups, 0);
  parallel_ranges(groups, 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t g = begin; g != end; ++g) {
      const std::size_t first = g * kGroup, count = std::min<std::size_t>(p.order.size() - first, kGroup);
      const auto seen = std::span(p.visible).subspan(first, count);
      const auto all = [&](std::uint32_t v) { return std::count(seen.begin(), seen.end(), v) == std::ssize(seen); };
      const auto which = std::span(p.order).subspan(first, count);
      if (all(0)) proved[g] = engine.all_dark(which);
      if (all(engine.set_size())) proved[g] = engine.all_lit(which);
    }
  });
  for (std::size_t place = 0; place < p.order.size(); ++place) {
    if (proved[place / kGroup] == 0 || p.open[place] == 0) continue;
    p.open[place] = 0;
    result.evidence[p.order[place]] = ErrorEvidence::kProof;
    ++(p.visible[place] == 0 ? result.proved_umbra : result.proved_lit), ++level.proved;
  }
}

/// Closes the receivers whose estimate keeps the goal. All estimates first: they look at each other's state.
void settle(std::span<const std::uint32_t> places, std::uint32_t set_size, double max_error, bool last, Progression& p,
            AdaptiveVisibility& result, ErrorLevel& level) {
  std::vector<double> estimates(places.size(), 0.0);
  parallel_ranges(places.size(), 1024, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k != end; ++k) {
      if (p.open[places[k]] != 0) estimates[k] = estimate_error(p, places[k], set_size);
    }
  });
  for (std::size_t k = 0; k < places.size(); ++k) {
    if (p.open[places[k]] == 0) continue;
    const std::uint32_t receiver = p.order[places[k]];
    result.bound[receiver] = static_cast<float>(estimates[k]);
    if (p.sets[places[k]] > 1 && estimates[k] <= max_error) {
      p.open[places[k]] = 0, ++level.settled;
    } else {
      level.largest_bound = std::max(level.largest_bound, estimates[k]);
      if (last) result.evidence[receiver] = ErrorEvidence::kExhausted, ++result.exhausted;
    }
  }
}

void finish(const Progression& p, std::uint32_t set_size, AdaptiveVisibility& result) {
  for (std::size_t place = 0; place < p.order.size(); ++place) {
    const std::uint32_t receiver = p.order[place];
    result.visibility[receiver] = static_cast<float>(visibility_at(p, place, set_size));
    result.samples[receiver] = p.sets[place] * set_size;
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
  const LightSamples samples = make_sets(light, config, mesh.frame, 32, 0);
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
  LevelEngine engine(opaque.get(), receivers, light, config, max_error < kLargeSetsBelow ? 64 : 32, stats);
  result.set_size = engine.set_size(), result.pattern = engine.uses_rows() ? "tilted-rows" : "low-discrepancy";
  Progression p;
  start(receivers, p);
  watch.lap();
  std::uint32_t asked_sets = 0;
  for (const std::uint32_t sets : kSetsAfter) {
    std::vector<std::uint32_t> places;
    for (std::uint32_t i = 0; i < p.order.size(); ++i) {
      if (p.open[i] != 0) places.push_back(i);
    }
    if (places.empty()) break;
    const double build_before = stats.build_ms;
    ErrorLevel level;
    level.samples_per_receiver = sets * engine.set_size(), level.receivers = places.size();
    ask_sets(engine, places, asked_sets, sets, config, p, result, level);
    if (asked_sets == 0) prove_groups(engine, p, result, level);
    const bool last = sets == kSetsAfter[std::size(kSetsAfter) - 1];
    settle(places, engine.set_size(), max_error, last, p, result, level);
    level.ms = watch.lap() - (stats.build_ms - build_before);
    result.levels.push_back(level);
    asked_sets = sets;
  }
  finish(p, engine.set_size(), result);
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
