#include "shadows/level_engine.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "rasterizer/core/parallel.h"
#include "rasterizer/core/stopwatch.h"
#include "shadows/exact_kernel.h"
#include "shadows/light_view.h"
#include "shadows/shaft.h"
#include "shadows/solver.h"

namespace halfshade {

/// One set as the row kernel takes it.
struct RowSetup {
  KernelSamples kernel;
  SampleRows rows;
};

namespace {

constexpr std::size_t kCluster = 64;  // receivers that share a list of leaves
constexpr std::uint32_t kSetsAtOnce = 16;
constexpr double kGrazing = 1e-5;  // as in exact_engine.cpp: nearer to the light's plane the row kernel is not used
constexpr double kAround = 1.0 + 1e-5;  // corners of the light's region are moved outwards by this factor

/// [set][place in which]
ReceiverArray selection(const ReceiverArray& receivers, std::span<const std::uint32_t> which, std::uint32_t sets) {
  ReceiverArray part;
  for (std::uint32_t set = 0; set < sets; ++set) {
    for (const std::uint32_t i : which) {
      part.push_back(receivers.position[i], receivers.normal[i], receivers.triangle[i], receivers.sample[i],
                     static_cast<std::uint8_t>(set));
    }
  }
  return part;
}

/// Corners around the light: those of its rectangle, or of the box around a light of another shape.
std::vector<vec3> region_corners(const Light& light, const LightSamples& samples, const LocalFrame& frame) {
  std::vector<vec3> corners;
  const auto add = [&](const dvec3& offset) {
    corners.push_back(snap_to_lattice(samples.center + frame.to_local_vector(offset * kAround)));
  };
  if (has_row_sets(light)) {
    for (int i = 0; i < 4; ++i) add(light.u * (i & 1 ? 0.5 : -0.5) + light.v * (i & 2 ? 0.5 : -0.5));
  }
  return corners;
}

/// Rows of the mask of `side` x `side` samples; `cell_of` says where a sample lies, or is empty for rows.
SetAnswer read_mask(std::span<const std::uint64_t> mask, std::uint32_t side, std::span<const std::uint32_t> cell_of) {
  std::array<std::uint64_t, 64> rows{};
  SetAnswer answer;
  answer.visible = side * side;
  for (std::uint32_t w = 0; w < mask.size(); ++w) {
    answer.visible -= static_cast<std::uint32_t>(std::popcount(mask[w]));
    if (!cell_of.empty()) {
      for (std::uint64_t bits = mask[w]; bits != 0; bits &= bits - 1) {
        const std::uint32_t cell = cell_of[64 * w + static_cast<std::uint32_t>(std::countr_zero(bits))];
        rows[cell / side] |= std::uint64_t{1} << cell % side;
      }
    } else {
      for (std::uint32_t bit = 0; bit < 64; bit += side) {
        rows[(64 * w + bit) / side] = mask[w] >> bit & ~std::uint64_t{0} >> (64 - side);
      }
    }
  }
  for (std::uint32_t j = 0; j < side; ++j) {
    const std::uint64_t across = (rows[j] ^ rows[j] >> 1) & ~std::uint64_t{0} >> (65 - side);
    answer.boundary += static_cast<std::uint32_t>(std::popcount(across));
    if (j + 1 < side) answer.boundary += static_cast<std::uint32_t>(std::popcount(rows[j] ^ rows[j + 1]));
  }
  return answer;
}

/// The whole light in the frame, not only its samples, so that an empty list proves receivers lit.
SampleRectangles light_rectangle(std::span<const vec3> corners, const LightFrame& frame) {
  SampleRectangles r;
  for (const vec3& p : corners) {
    const vec2 q(frame.to_frame(dvec3(p)));
    r.whole_low = glm::min(r.whole_low, q - 1e-7f), r.whole_high = glm::max(r.whole_high, q + 1e-7f);
  }
  r.thickness = 1e-6f;
  return r;
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
                         const ShadowConfig& config, std::uint32_t side, ShadowStats& stats)
    : mesh_(mesh), receivers_(receivers), light_(light), config_(config), side_(side), stats_(stats) {
  const LightSamples first = make_sets(light, config, mesh.frame, side, 0);
  rows_ = has_row_sets(light) && first.flat && !mesh.triangles.empty();
  if (!rows_) return;
  corners_ = region_corners(light, first, mesh.frame);
  Stopwatch watch;
  build_blocker_tree(mesh, tree_);
  KernelSamples kernel = make_kernel_samples(first, make_light_bound(light, first), SampleOrder::kAsGiven);
  rows_ = !find_sample_rows(first, kernel, {dvec3(kernel.center), first.axis_u, first.axis_v, first.axis_n}).empty();
  if (!rows_) return;
  certify(mesh, receivers, config, closed_, kernel, stats);
  closed_usable_ = kernel.closed_usable;
  stats.build_ms += watch.lap();
}

void LevelEngine::solve_sets(std::uint32_t first, std::uint32_t end, std::span<const std::uint32_t> which,
                             std::vector<SetAnswer>& answers) {
  if (mesh_.triangles.empty()) {
    answers.assign(which.size() * (end - first), {set_size(), 0, true});
    return;
  }
  answers.assign(which.size() * (end - first), {});
  for (std::uint32_t set = first; set < end;) {
    const std::uint32_t count = rows_ && set < kTiltedSets ? 1 : std::min(end - set, kSetsAtOnce);
    const LightSamples samples = make_sets(light_, config_, mesh_.frame, side_, set, count);
    const auto part = std::span(answers).subspan(which.size() * (set - first), which.size() * count);
    rows_ ? solve_rows(samples, which, part) : solve_generally(samples, which, part);
    set += count;
  }
}

void LevelEngine::prepare_samples(const LightSamples& samples, RowSetup& setup) {
  setup.kernel = make_kernel_samples(samples, make_light_bound(light_, samples), SampleOrder::kAsGiven);
  if (closed_usable_.empty()) return;
  use_certificate(closed_, setup.kernel);
  for (std::size_t c = 0; c < closed_usable_.size(); ++c) setup.kernel.closed_usable[c] &= closed_usable_[c];
}

void LevelEngine::solve_rows(const LightSamples& samples, std::span<const std::uint32_t> which,
                             std::span<SetAnswer> answers) {
  RowSetup setup;
  prepare_samples(samples, setup);
  const LightFrame front{dvec3(setup.kernel.center), samples.axis_u, samples.axis_v, samples.axis_n};
  setup.rows = find_sample_rows(samples, setup.kernel, front);
  if (setup.rows.empty()) {
    solve_generally(samples, which, answers);
    return;
  }
  std::array<std::vector<std::uint32_t>, 3> places;  // of `which`: in front, behind, in the light's plane
  for (std::uint32_t k = 0; k < which.size(); ++k) {
    const double z = front.to_frame(dvec3(receivers_.position[which[k]])).z;
    places[z > kGrazing ? 0 : (z < -kGrazing ? 1 : 2)].push_back(k);
  }
  for (std::size_t side = 0; side < 3; ++side) {
    if (places[side].empty()) continue;
    std::vector<std::uint32_t> part;
    for (const std::uint32_t k : places[side]) part.push_back(which[k]);
    std::vector<SetAnswer> found(part.size() * samples.sets);
    if (side == 2) {
      solve_generally(samples, part, found);
    } else if (side == 1 && samples.one_sided) {
      continue;  // sees nothing
    } else {
      solve_row_side(setup, side == 0 ? front : LightFrame{front.origin, front.u, front.v, -front.n}, part, found);
    }
    for (std::size_t i = 0; i < found.size(); ++i) {
      answers[i / part.size() * which.size() + places[side][i % part.size()]] = found[i];
    }
  }
}

void LevelEngine::solve_row_side(const RowSetup& setup, const LightFrame& frame, std::span<const std::uint32_t> which,
                                 std::span<SetAnswer> answers) {
  Stopwatch watch;
  refit_blocker_tree(mesh_, setup.kernel, frame, tree_);
  frame_ = frame;
  const SampleRectangles rectangles = light_rectangle(corners_, frame);
  stats_.cull_ms += watch.lap();
  const ExactScene scene{&tree_, &setup.kernel, &rectangles, &setup.rows, frame};
  constexpr std::size_t kPerTask = kCluster * 16;
  const std::size_t words = setup.kernel.padded / 64, pieces = (which.size() + kPerTask - 1) / kPerTask;
  const std::size_t tasks = pieces * setup.kernel.sets;  // a task has one set
  std::vector<ShadowStats> counted(tasks);
  parallel_tasks(tasks, [&](std::size_t t) {
    const std::size_t first = t % pieces * kPerTask, count = std::min(which.size() - first, kPerTask);
    const std::size_t set = t / pieces;
    const std::vector<std::uint32_t> order(which.begin() + static_cast<std::ptrdiff_t>(first),
                                           which.begin() + static_cast<std::ptrdiff_t>(first + count));
    KernelReceivers kernel = gather_receivers(receivers_, order, words);
    std::fill(kernel.set.begin(), kernel.set.end(), static_cast<std::uint8_t>(set));
    auto scratch = std::make_unique<ExactScratch>();
    for (std::size_t begin = 0; begin < count; begin += kCluster) {
      const std::size_t end = std::min(count, begin + kCluster);
      const std::uint64_t lit_before = scratch->clusters_lit;
      solve_packets(scene, begin, end, kernel, *scratch);
      for (std::size_t i = begin; i < end; ++i) {
        SetAnswer& answer = answers[set * which.size() + first + i] = read_mask({kernel.mask(i), words}, side_, {});
        answer.lit = scratch->clusters_lit != lit_before;
      }
    }
    add_to_stats(scratch->counters, counted[t]);
    counted[t].leaves_listed = scratch->leaves_listed, counted[t].leaves_tested = scratch->leaves_tested;
    counted[t].clusters_lit = scratch->clusters_lit;
  });
  for (const ShadowStats& s : counted) {
    stats_.pairs_tested += s.pairs_tested, stats_.pairs_sampled += s.pairs_sampled;
    stats_.pairs_necessary += s.pairs_necessary, stats_.sample_tests += s.sample_tests;
    stats_.exact_fallbacks += s.exact_fallbacks, stats_.leaves_listed += s.leaves_listed;
    stats_.leaves_tested += s.leaves_tested, stats_.clusters_lit += s.clusters_lit;
  }
  stats_.bytes = std::max<std::uint64_t>(stats_.bytes, tree_.bytes());
  stats_.test_ms += watch.lap();
}

void LevelEngine::solve_generally(const LightSamples& samples, std::span<const std::uint32_t> which,
                                  std::span<SetAnswer> answers) {
  const ReceiverArray part = selection(receivers_, which, samples.sets);
  ShadowConfig config = config_;
  config.method = ShadowMethod::kExact;
  VisibilityMasks masks;
  ShadowStats own;
  solve_masks(mesh_, part, light_, samples, config, masks, own);
  stats_.build_ms += own.build_ms, stats_.index_ms += own.index_ms;
  stats_.cull_ms += own.cull_ms, stats_.test_ms += own.test_ms;
  stats_.sample_tests += own.sample_tests, stats_.exact_fallbacks += own.exact_fallbacks;
  if (samples.count != set_size()) {  // a point, or a light made of samples: the answer itself
    for (std::size_t i = 0; i < answers.size(); ++i) answers[i].visible = samples.count - masks.blocked_count(i);
    return;
  }
  std::vector<std::uint32_t> cell_of;  // [set][sample]
  for (const dvec2& st : samples.st) {
    cell_of.push_back(static_cast<std::uint32_t>(st.y * side_) * side_ + static_cast<std::uint32_t>(st.x * side_));
  }
  if (has_row_sets(light_)) cell_of.clear();
  parallel_ranges(answers.size(), 1024, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) {
      const std::size_t set = i / which.size();
      const auto cells = std::span(cell_of).subspan(cell_of.empty() ? 0 : set * samples.count);
      answers[i] = read_mask(masks.mask(i), side_, cells.first(cell_of.empty() ? 0 : samples.count));
    }
  });
}

bool LevelEngine::all_lit(std::span<const std::uint32_t> which) const {
  if (!rows_ || which.empty() || tree_.blockers.empty()) return false;
  Box box, box_in_frame, light_in_frame;
  for (const std::uint32_t i : which) {
    box.add(receivers_.position[i]);
    box_in_frame.add(vec3(frame_.to_frame(dvec3(receivers_.position[i]))));
  }
  for (const vec3& l : corners_) light_in_frame.add(vec3(frame_.to_frame(dvec3(l))));
  for (Box* b : {&box_in_frame, &light_in_frame}) b->low -= 1e-6f, b->high += 1e-6f;
  const Shaft shaft(box_in_frame, light_in_frame);
  std::vector<vec3> from;
  for (int i = 0; i < 8; ++i) {
    from.emplace_back(i & 1 ? box.high.x : box.low.x, i & 2 ? box.high.y : box.low.y, i & 4 ? box.high.z : box.low.z);
  }
  std::vector<std::uint32_t> stack = {0};
  while (!stack.empty()) {
    const BlockerTree::Node& node = tree_.nodes[stack.back()];
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
  if (!rows_ || which.empty() || tree_.blockers.empty()) return false;
  Box box;
  for (const std::uint32_t i : which) box.add(receivers_.position[i]);
  const dvec3 from = frame_.to_frame((dvec3(box.low) + dvec3(box.high)) * 0.5);
  const dvec3 to = frame_.to_frame((dvec3(corners_[0]) + dvec3(corners_[3])) * 0.5);
  std::vector<std::uint32_t> stack = {0};
  while (!stack.empty()) {
    const BlockerTree::Node& node = tree_.nodes[stack.back()];
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
