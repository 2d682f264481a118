#include "shadows/level_engine.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "rasterizer/core/parallel.h"
#include "rasterizer/core/stopwatch.h"
#include "shadows/shaft.h"
#include "shadows/solver.h"

namespace halfshade {
namespace {

constexpr double kAround = 1.0 + 1e-5;  // corners of the light's region are moved outwards by this factor
/// Masks of so many words are held at once.
constexpr std::size_t kWordsAtOnce = std::size_t{1} << 22;
constexpr double kLatticeSlack = 0x1p-36;  // more than a sample may lie off the light's plane for being on the lattice
constexpr double kFarthest = 8.0;          // no two points of the lattice are so far from each other

/// Receivers `which`, all with set `set`, into memory that is kept from round to round.
void select(const ReceiverArray& receivers, std::span<const std::uint32_t> which, std::uint32_t set,
            ReceiverArray& part) {
  part.resize(which.size());
  parallel_ranges(which.size(), 8192, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k != end; ++k) {
      const std::uint32_t i = which[k];
      part.position[k] = receivers.position[i], part.normal[k] = receivers.normal[i];
      part.triangle[k] = receivers.triangle[i], part.sample[k] = receivers.sample[i];
      part.set[k] = static_cast<std::uint8_t>(set);
    }
  });
}

/// Corners around a rectangle.
std::vector<vec3> region_corners(const Light& light, const LightSamples& samples, const LocalFrame& frame) {
  std::vector<vec3> corners;
  for (int i = 0; i < 4; ++i) {
    const dvec3 offset = light.u * (i & 1 ? 0.5 : -0.5) + light.v * (i & 2 ? 0.5 : -0.5);
    corners.push_back(snap_to_lattice(samples.center + frame.to_local_vector(offset * kAround)));
  }
  return corners;
}

/// Around all sets of a light with these corners.
LightBound bound_of_sets(const Light& light, const LightSamples& samples, std::span<const vec3> corners) {
  LightSamples region = samples;
  region.points.assign(corners.begin(), corners.end());
  LightBound bound = make_light_bound(light, region);
  const std::array<dvec3, 3> axes = {samples.axis_u, samples.axis_v, samples.axis_n};
  for (std::size_t k = 0; k < 3; ++k) bound.half_axes[k] += axes[k] * kLatticeSlack;
  return bound;
}

float reach_of(const LightBound& bound) {
  dvec3 reach(0.0);
  for (const dvec3& axis : bound.half_axes) reach += glm::abs(axis);
  return static_cast<float>(std::max({reach.x, reach.y, reach.z}) * kAround);
}

/// Have the axes in the light's plane changed places?
bool is_turned(const LightFrame& from, const LightFrame& to) { return std::fabs(glm::dot(from.u, to.u)) < 0.5; }

/// Boxes in one frame from those in another that is turned by a right angle around the light's normal, either way.
void turn_boxes(const LightFrame& from, const LightFrame& to, BlockerFit& fit) {
  const double sign[2] = {glm::dot(to.u, from.v) < 0.0 ? -1.0 : 1.0, glm::dot(to.v, from.u) < 0.0 ? -1.0 : 1.0};
  const double off = std::max(glm::length(to.u - sign[0] * from.v), glm::length(to.v - sign[1] * from.u));
  const float pad = static_cast<float>(kFarthest * off) + 0x1p-21f;  // the latter for rounding
  for (BlockerTree::Node& node : fit.nodes) {
    for (std::uint32_t i = 0; i < BlockerTree::kWidth; ++i) {
      const float low[2] = {node.low[1][i], node.low[0][i]}, high[2] = {node.high[1][i], node.high[0][i]};
      for (int k = 0; k < 2; ++k) {
        node.low[k][i] = (sign[k] > 0.0 ? low[k] : -high[k]) - pad;
        node.high[k][i] = (sign[k] > 0.0 ? high[k] : -low[k]) + pad;
      }
    }
  }
}

/// Samples anywhere, one in each of `shape`'s cells: how many neighbouring cells differ.
SetAnswer read_cells(std::span<const std::uint64_t> blocked, const SetShape& shape,
                     std::span<const std::uint32_t> cell_of) {
  std::array<std::uint64_t, 64> rows{};
  SetAnswer answer;
  answer.visible = shape.size();
  for (std::uint32_t w = 0; w < blocked.size(); ++w) {
    answer.visible -= static_cast<std::uint32_t>(std::popcount(blocked[w]));
    for (std::uint64_t bits = blocked[w]; bits != 0; bits &= bits - 1) {
      const std::uint32_t cell = cell_of[64 * w + static_cast<std::uint32_t>(std::countr_zero(bits))];
      rows[cell / shape.columns] |= std::uint64_t{1} << cell % shape.columns;
    }
  }
  for (std::uint32_t j = 0; j < shape.rows; ++j) {
    const std::uint64_t across = (rows[j] ^ rows[j] >> 1) & ~std::uint64_t{0} >> (65 - shape.columns);
    answer.roughness += static_cast<std::uint32_t>(std::popcount(across));
    if (j + 1 < shape.rows) answer.roughness += static_cast<std::uint32_t>(std::popcount(rows[j] ^ rows[j + 1]));
  }
  return answer;
}

bool segment_meets(const dvec3& a, const dvec3& b, const BlockerTree::Node& node, std::uint32_t child) {
  double from = 0.0, to = 1.0;
  for (int k = 0; k < 3; ++k) {
    const double d = b[k] - a[k], low = node.low[k][child] - a[k], high = node.high[k][child] - a[k];
    if (std::fabs(d) < 1e-12) {
      if (low > 0.0 || high < 0.0) return false;
      continue;
    }
    from = std::max(from, std::min(low / d, high / d)), to = std::min(to, std::max(low / d, high / d));
  }
  return from <= to;
}

/// No segment from the box to the light meets the triangle: it lies on one side of the triangle's plane, or beyond one
/// of its edges. The determinants are linear in either end of the segment, so corners speak for all points.
bool hides_nothing(const LatticeMesh& mesh, std::uint32_t triangle, std::span<const vec3> from,
                   std::span<const vec3> light) {
  const std::array<vec3, 3> corner = mesh.corners(triangle);
  const auto side_of = [&](const vec3& p) { return orient3d(corner[0], corner[1], corner[2], p); };
  int low = 1, high = -1, light_low = 1, light_high = -1;
  for (const vec3& r : from) low = std::min(low, side_of(r)), high = std::max(high, side_of(r));
  for (const vec3& l : light)
    light_low = std::min(light_low, side_of(l)), light_high = std::max(light_high, side_of(l));
  if ((low >= 0 && light_low >= 0) || (high <= 0 && light_high <= 0)) return true;
  if (low != high) return false;  // receivers on both sides: no edge is oriented for all of them
  for (std::size_t k = 0; k < 3; ++k) {
    const auto beyond = [&](const vec3& r, const vec3& l) {
      return low * orient3d(corner[k], corner[(k + 1) % 3], l, r) < 0;
    };
    bool all = true;
    for (std::size_t i = 0; i < from.size() && all; ++i) {
      all = std::all_of(light.begin(), light.end(), [&](const vec3& l) { return beyond(from[i], l); });
    }
    if (all) return true;
  }
  return false;
}

/// For a fixed light point the receivers that a triangle hides it from are an intersection of half spaces, and so are
/// the light points hidden from a fixed receiver: corners of both regions speak for all points in them.
bool hides_all(const LatticeMesh& mesh, std::uint32_t triangle, const Box& box, std::span<const vec3> light) {
  const auto [a, b, c] = mesh.corners(triangle);
  for (int i = 0; i < 8; ++i) {
    const vec3 r(i & 1 ? box.high.x : box.low.x, i & 2 ? box.high.y : box.low.y, i & 4 ? box.high.z : box.low.z);
    for (const vec3& l : light) {
      if (!blocks(a, b, c, r, l)) return false;
    }
  }
  return true;
}

}  // namespace

LevelEngine::LevelEngine(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                         const ShadowConfig& config, ShadowStats& stats)
    : mesh_(mesh), receivers_(receivers), light_(light), config_(config), stats_(stats) {
  const LightSamples first = make_sets(light, config, mesh.frame, {}, {});
  rows_ = first.flat && has_row_sets(light);
  if (mesh.triangles.empty()) return;
  if (rows_) corners_ = region_corners(light, first, mesh.frame);
  Stopwatch watch;
  build_blocker_tree(mesh, tree_);
  if (config.back_face_casters) closed_ = find_closed_components(mesh);
  stats.build_ms += watch.lap();
}

/// Blockers are fitted to the light once: what they hold of it is true of all its sets, and their boxes turn with rows.
void LevelEngine::prepare(const LightSamples& samples) {
  if (corners_.empty()) {
    prepare_exact_light(light_, samples, kept_);
    return;
  }
  const bool first = !kept_.bound.flat;
  if (first) kept_.bound = bound_of_sets(light_, samples, corners_);
  const LightFrame before = kept_.front;
  prepare_exact_samples(samples, kept_);
  kept_.samples.reach = std::max(kept_.samples.reach, reach_of(kept_.bound));
  if (first || !is_turned(before, kept_.front)) return;
  for (ExactSide& side : kept_.sides) {
    if (side.fitted) turn_boxes(before, kept_.front, side.fit);
  }
}

/// Certificates that did not hold for some set or some receivers are not tried again: for that blockers would have to
/// be fitted anew.
void LevelEngine::give_up_withdrawn_certificates() {
  for (std::size_t c = 0; c < kept_.samples.closed_usable.size(); ++c) {
    if (kept_.samples.closed_usable[c] == 0) closed_.boxes[c] = {vec3(-kFarthest), vec3(kFarthest)};
  }
}

void LevelEngine::solve(const LightSamples& samples, const ReceiverArray& part) {
  const std::uint64_t certified = stats_.certified_blockers;
  const ExactBlockers blockers{mesh_, config_.back_face_casters ? &closed_ : nullptr, &tree_};
  solve_exact(blockers, part, light_, samples, config_, kept_, work_, masks_, stats_);
  give_up_withdrawn_certificates();
  if (certified != 0) stats_.certified_blockers = certified;  // counted with the first set
}

void LevelEngine::solve_round(const SetShape& shape, const SetRound& round, std::span<const std::uint32_t> which,
                              std::vector<SetAnswer>& answers) {
  answers.assign(which.size(), {});
  if (mesh_.triangles.empty()) answers.assign(which.size(), {shape.size() * round.count, 0});
  if (mesh_.triangles.empty() || which.empty()) return;
  const LightSamples samples = make_sets(light_, config_, mesh_.frame, shape, round);
  prepare(samples);
  std::vector<std::uint32_t> cell_of;  // [set][sample]
  for (const dvec2& st : samples.st) {
    cell_of.push_back(static_cast<std::uint32_t>(st.y * shape.rows) * shape.columns +
                      static_cast<std::uint32_t>(st.x * shape.columns));
  }
  const std::size_t at_once = std::max<std::size_t>(1, kWordsAtOnce / (shape.size() / 64));
  for (std::size_t begin = 0; begin < which.size(); begin += at_once) {
    const auto some = which.subspan(begin, std::min(at_once, which.size() - begin));
    for (std::uint32_t set = 0; set < round.count; ++set) {  // one by one: packets of a single set are faster
      select(receivers_, some, set, part_);
      solve(samples, part_);
      const RunMeter meter(rows_ ? shape : SetShape{}, round, set);
      const auto cells = std::span(cell_of).subspan(std::size_t{set} * samples.count, samples.count);
      parallel_ranges(some.size(), 1024, [&](std::size_t from, std::size_t to) {
        for (std::size_t i = from; i != to; ++i) {
          const auto mask = masks_.mask(i);
          const SetAnswer answer = rows_ ? meter.read(mask) : read_cells(mask, shape, cells);
          answers[begin + i].visible += answer.visible, answers[begin + i].roughness += answer.roughness;
        }
      });
    }
  }
}

/// What the last round left of the side of the light that all of `which` are on; null where there is nothing.
const ExactSide* LevelEngine::side_of(std::span<const std::uint32_t> which, LightFrame& frame) const {
  if (corners_.empty() || which.empty()) return nullptr;
  double low = HUGE_VAL, high = -HUGE_VAL;
  for (const std::uint32_t i : which) {
    const double z = kept_.front.to_frame(dvec3(receivers_.position[i])).z;
    low = std::min(low, z), high = std::max(high, z);
  }
  if (!(low > 0.0) && !(high < 0.0)) return nullptr;
  frame = kept_.front;
  if (high < 0.0) frame.n = -frame.n;
  const ExactSide& side = kept_.sides[low > 0.0 ? 0 : 1];
  return side.fitted && !tree_.leaves.empty() ? &side : nullptr;
}

bool LevelEngine::all_lit(std::span<const std::uint32_t> which) const {
  LightFrame frame;
  const ExactSide* side = side_of(which, frame);
  if (side == nullptr) return false;
  Box box, box_in_frame, light_in_frame;
  for (const std::uint32_t i : which) {
    box.add(receivers_.position[i]);
    box_in_frame.add(vec3(frame.to_frame(dvec3(receivers_.position[i]))));
  }
  for (const vec3& l : corners_) light_in_frame.add(vec3(frame.to_frame(dvec3(l))));
  for (Box* b : {&box_in_frame, &light_in_frame}) b->low -= 1e-6f, b->high += 1e-6f;
  const Shaft shaft(box_in_frame, light_in_frame);
  std::vector<vec3> from;
  for (int i = 0; i < 8; ++i) {
    from.emplace_back(i & 1 ? box.high.x : box.low.x, i & 2 ? box.high.y : box.low.y, i & 4 ? box.high.z : box.low.z);
  }
  std::vector<std::uint32_t> stack = {0};
  while (!stack.empty()) {
    const BlockerTree::Node& node = side->fit.nodes[stack.back()];
    stack.pop_back();
    for (std::uint32_t i = 0; i < node.count; ++i) {
      const Box child{{node.low[0][i], node.low[1][i], node.low[2][i]},
                      {node.high[0][i], node.high[1][i], node.high[2][i]}};
      if (!shaft.may_meet(child)) continue;
      if ((node.child[i] & BlockerTree::kLeafBit) == 0) {
        stack.push_back(node.child[i]);
        continue;
      }
      const BlockerTree::Leaf& leaf = tree_.leaves[node.child[i] & ~BlockerTree::kLeafBit];
      for (std::uint32_t lane = 0; lane < leaf.count; ++lane) {
        if (!hides_nothing(mesh_, leaf.triangle[lane], from, corners_)) return false;
      }
    }
  }
  return true;
}

bool LevelEngine::all_dark(std::span<const std::uint32_t> which) const {
  LightFrame frame;
  const ExactSide* side = side_of(which, frame);
  if (side == nullptr) return false;
  Box box;
  for (const std::uint32_t i : which) box.add(receivers_.position[i]);
  const dvec3 from = frame.to_frame((dvec3(box.low) + dvec3(box.high)) * 0.5);
  const dvec3 to = frame.to_frame((dvec3(corners_[0]) + dvec3(corners_[3])) * 0.5);
  std::vector<std::uint32_t> stack = {0};
  while (!stack.empty()) {
    const BlockerTree::Node& node = side->fit.nodes[stack.back()];
    stack.pop_back();
    for (std::uint32_t i = 0; i < node.count; ++i) {
      if (!segment_meets(from, to, node, i)) continue;
      if ((node.child[i] & BlockerTree::kLeafBit) == 0) {
        stack.push_back(node.child[i]);
        continue;
      }
      const BlockerTree::Leaf& leaf = tree_.leaves[node.child[i] & ~BlockerTree::kLeafBit];
      for (std::uint32_t lane = 0; lane < leaf.count; ++lane) {
        const std::uint32_t triangle = leaf.triangle[lane];
        if ((leaf.perforated >> lane) & 1 || !hides_all(mesh_, triangle, box, corners_)) continue;
        const auto is_own = [&](std::uint32_t r) { return receivers_.triangle[r] == triangle; };
        if (std::none_of(which.begin(), which.end(), is_own)) return true;
      }
    }
  }
  return false;
}

}  // namespace halfshade
