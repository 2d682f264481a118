#include "shadows/hierarchical_penumbra_casting.h"

#include <algorithm>
#include <bit>

#include "rasterizer/core/parallel.h"
#include "rasterizer/core/stopwatch.h"
#include "shadows/blocker_buckets.h"
#include "shadows/penumbra_kernel.h"
#include "shadows/penumbra_volume.h"
#include "shadows/receiver_hierarchy.h"
#include "shadows/solver.h"

namespace halfshade {
namespace {

constexpr std::size_t kBlockersPerChunk = 256;
constexpr std::size_t kChunksPerRound = 16;  // bounds the memory of prepared blockers
constexpr std::size_t kMostParts = 64;       // about: a part is a branch of the top of the hierarchy
constexpr std::uint32_t kLeastPart = 1000;   // receivers

using PlaneSet = PenumbraVolume::PlaneSet;

struct CastCounters {
  std::uint64_t nodes_visited = 0, plane_tests = 0, leaves_tested = 0, light_volumes = 0, group_volumes = 0,
                rebuilds = 0, in_light_plane = 0;
  double rebuild_ms = 0.0;
  KernelCounters kernel;

  void add(const CastCounters& o) {
    nodes_visited += o.nodes_visited, plane_tests += o.plane_tests, leaves_tested += o.leaves_tested;
    light_volumes += o.light_volumes, group_volumes += o.group_volumes, rebuilds += o.rebuilds;
    in_light_plane += o.in_light_plane, rebuild_ms += o.rebuild_ms;
    kernel.add(o.kernel);
  }
};

/// The light's side of a solve, the same for all parts.
struct CastLight {
  KernelSamples samples;
  LightHull hull;
  std::vector<LightHull> groups;
  std::uint32_t kernel_groups_per_group = 2;
  std::size_t group_words = 1;  // 64 groups each

  std::uint32_t group_count() const { return static_cast<std::uint32_t>(groups.size()); }
};

/// A blocker as all parts use it.
struct PreparedBlocker {
  Blocker blocker;
  AlphaTriangle alpha;
  PenumbraVolume volume;
};

struct ActiveGroup {
  std::uint32_t group;
  PlaneSet planes;  // of the group's volume; all ones before there is one
};

/// A part of the receivers, with a hierarchy of its own.
class ReceiverPart {
 public:
  ReceiverPart(const ReceiverArray& receivers, std::span<const std::uint32_t> members, const CastLight& light,
               const PenumbraCastingOptions& options)
      : options_(options), light_(light), pool_(light.samples.padded / 64) {
    hierarchy_.order.assign(members.begin(), members.end());
    build_receiver_hierarchy(receivers.position, rules(), hierarchy_);
    source_ = hierarchy_.order;
    kernel_ = gather_receivers(receivers, source_, 0);
    kernel_.words = light.samples.padded / 64;
    kernel_.mask_at.assign(source_.size(), nullptr);
    if (!options.masks_on_demand) {
      for (std::uint64_t*& mask : kernel_.mask_at) mask = pool_.take();
    }
    clear_umbra();
  }

  bool in_umbra() const { return live_ == 0; }
  MaskPool& pool() { return pool_; }
  const CastCounters& counters() const { return counters_; }
  std::uint32_t depth() const { return hierarchy_.depth; }
  std::uint64_t bytes() const {
    return pool_.bytes() + hierarchy_.bytes() + kernel_.x.capacity() * 25 + kernel_.mask_at.capacity() * 8 +
           source_.capacity() * 4 + group_umbra_.capacity() * 8 + full_umbra_.capacity();
  }

  /// PROCESS-BLOCKER-OPTIMIZED of figure 3, from the part's root; `planes` are those still active there.
  void cast(const PreparedBlocker& blocker, PlaneSet planes) {
    if (in_umbra()) return;
    if (wants_rebuild()) rebuild();
    blocker_ = &blocker;
    volumes_made_ = false;
    if (!options_.lazy_volumes) make_volumes();
    active_.clear();
    for (std::uint32_t k = 0; k < light_.group_count(); ++k) active_.push_back({k, ~PlaneSet{0}});
    visit(0, planes, 0, active_.size());
  }

  void write_masks(VisibilityMasks& masks) const {
    const std::size_t words = masks.words_per_receiver;
    const std::vector<std::uint64_t>& valid = light_.samples.valid;
    for (const std::uint32_t r : umbra_) std::copy(valid.begin(), valid.end(), masks.words.begin() + r * words);
    for (std::size_t i = 0; i < source_.size(); ++i) {
      const std::span<std::uint64_t> mask(masks.words.data() + source_[i] * words, words);
      if (kernel_.open[i] == 0) {
        std::copy(valid.begin(), valid.end(), mask.begin());
      } else if (kernel_.mask_at[i] != nullptr) {
        restore_sample_order(light_.samples, kernel_.set[i], {kernel_.mask_at[i], words}, mask);
      }
    }
  }

 private:
  bool wants_rebuild() const {
    const auto share = static_cast<double>(finished_) / static_cast<double>(source_.size());
    return options_.umbra_bits && options_.rebuild < 1.0f && finished_ > 0 && share >= double{options_.rebuild};
  }

  HierarchyRules rules() const { return {options_.leaf, 1000, options_.weigh_split}; }

  void clear_umbra() {
    live_ = static_cast<std::uint32_t>(source_.size());
    finished_ = 0;
    group_umbra_.assign(hierarchy_.nodes.size() * light_.group_words, 0);
    full_umbra_.assign(hierarchy_.nodes.size(), 0);
  }

  /// Line 29: receivers in umbra leave the hierarchy, the rest gets a new one.
  void rebuild() {
    Stopwatch watch;
    std::vector<vec3> points;
    for (std::size_t i = 0; i < source_.size(); ++i) points.emplace_back(kernel_.x[i], kernel_.y[i], kernel_.z[i]);
    hierarchy_.order.clear();
    for (std::uint32_t i = 0; i < source_.size(); ++i) {
      if (kernel_.open[i] != 0) {
        hierarchy_.order.push_back(i);
        continue;
      }
      umbra_.push_back(source_[i]);
      if (kernel_.mask_at[i] != nullptr) pool_.release(kernel_.mask_at[i]);
    }
    build_receiver_hierarchy(points, rules(), hierarchy_);
    permute(kernel_.x), permute(kernel_.y), permute(kernel_.z);
    permute(kernel_.own), permute(kernel_.set), permute(kernel_.mask_at), permute(source_);
    kernel_.count = source_.size();
    kernel_.open.assign(source_.size() + KernelReceivers::kLanePadding, ~0u);
    clear_umbra();
    restore_umbra(0);
    ++counters_.rebuilds;
    counters_.rebuild_ms += watch.lap();
  }

  /// Into the order of the new hierarchy; padding, where there is any, stays.
  template <class T>
  void permute(std::vector<T>& values) const {
    const std::size_t padding = values.size() - source_.size();
    std::vector<T> moved;
    moved.reserve(hierarchy_.order.size() + padding);
    for (const std::uint32_t i : hierarchy_.order) moved.push_back(values[i]);
    moved.resize(hierarchy_.order.size() + padding, T{});
    values = std::move(moved);
  }

  std::uint64_t* umbra_of(std::uint32_t node) { return group_umbra_.data() + node * light_.group_words; }

  void make_volumes() {
    volumes_made_ = true;
    volumes_.resize(light_.group_count());
    for (std::size_t k = 0; k < volumes_.size(); ++k) {
      make_penumbra_volume(light_.groups[k], blocker_->blocker.corner, volumes_[k]);
    }
    counters_.group_volumes += volumes_.size();
  }

  /// INTERSECTS of figure 3 (optimisation B).
  bool enters(const PenumbraVolume& volume, const ReceiverHierarchy::Node& node, PlaneSet& planes) {
    PlaneSet left = planes & volume.all();
    if (!meets(volume, node.low, node.high, left, counters_.plane_tests)) return false;
    if (options_.plane_sets) planes = left;
    return true;
  }

  /// Lines 37 to 45: appends the groups that the blocker can matter to in this node.
  void collect_active(std::uint32_t number, std::size_t first, std::size_t last) {
    const ReceiverHierarchy::Node& node = hierarchy_.nodes[number];
    const std::uint64_t* umbra = umbra_of(number);
    for (std::size_t i = first; i < last; ++i) {
      ActiveGroup active = active_[i];
      if (options_.umbra_bits && ((umbra[active.group / 64] >> (active.group % 64)) & 1) != 0) continue;
      if (volumes_made_ && !enters(volumes_[active.group], node, active.planes)) continue;
      active_.push_back(active);
    }
  }

  /// PROCESS-RECURSIVE; active_[first, last) are the groups active above. True where umbra bits may have changed.
  bool visit(std::uint32_t number, PlaneSet planes, std::size_t first, std::size_t last) {
    ++counters_.nodes_visited;
    const ReceiverHierarchy::Node& node = hierarchy_.nodes[number];
    if (options_.umbra_bits && full_umbra_[number] != 0) return false;
    if (!enters(blocker_->volume, node, planes)) return false;
    const std::size_t begin = active_.size();
    collect_active(number, first, last);
    const std::size_t end = active_.size();
    bool changed = false;
    if (begin != end && node.is_leaf()) {
      changed = visit_leaf(number, begin, end);
    } else if (begin != end) {
      const std::uint32_t right = node.right;
      changed = visit(number + 1, planes, begin, end);
      changed = visit(right, planes, begin, end) || changed;
      if (changed && options_.umbra_bits) join_umbra(number, right);
    }
    active_.resize(begin);
    return changed;
  }

  bool visit_leaf(std::uint32_t number, std::size_t begin, std::size_t end) {
    const ReceiverHierarchy::Node& node = hierarchy_.nodes[number];
    std::array<std::uint64_t, 4> kernel_groups{};  // 4096 samples are 256 groups of the kernel
    const std::uint32_t per_group = light_.kernel_groups_per_group, count = light_.samples.padded / 16;
    for (std::size_t i = begin; i < end; ++i) {
      const std::uint32_t from = active_[i].group * per_group, to = std::min(count, from + per_group);
      for (std::uint32_t g = from; g < to; ++g) kernel_groups[g / 64] |= std::uint64_t{1} << (g % 64);
    }
    ++counters_.leaves_tested;
    std::uint32_t finished = 0;
    const LeafResult result =
        cast_on_leaf(blocker_->blocker, light_.samples, kernel_groups.data(), node.begin, node.end,
                     options_.masks_on_demand, kernel_, pool_, finished, counters_.kernel);
    // A single group is the whole light: its volume would say nothing new.
    if (result.met && !volumes_made_ && light_.group_count() > 1) make_volumes();
    live_ -= finished;
    finished_ += finished;
    if (result.added && options_.umbra_bits) sum_up_leaf(number);
    return result.added;
  }

  /// Lines 72 and 77 to 80: a group is in umbra where no receiver of the leaf has a sample of it left.
  void sum_up_leaf(std::uint32_t number) {
    const ReceiverHierarchy::Node& node = hierarchy_.nodes[number];
    const std::vector<std::uint64_t>& valid = light_.samples.valid;
    std::array<std::uint64_t, 64> left{};  // samples that some receiver sees
    bool full = true;
    for (std::size_t i = node.begin; i < node.end; ++i) {
      if (kernel_.open[i] == 0) continue;
      if (kernel_.mask_at[i] == nullptr) return;
      full = false;
      for (std::size_t w = 0; w < kernel_.words; ++w) left[w] |= valid[w] & ~kernel_.mask_at[i][w];
    }
    full_umbra_[number] = full;
    const std::uint32_t size = light_.kernel_groups_per_group * KernelSamples::kGroup;
    for (std::uint32_t k = 0; k < light_.group_count(); ++k) {
      bool open = false;
      const std::uint32_t end = std::min(light_.samples.padded, (k + 1) * size);
      for (std::uint32_t s = k * size; s < end && !open; s += 16) open = ((left[s / 64] >> (s % 64)) & 0xffff) != 0;
      if (!open) umbra_of(number)[k / 64] |= std::uint64_t{1} << (k % 64);
    }
  }

  /// Lines 50 to 54.
  void join_umbra(std::uint32_t number, std::uint32_t right) {
    for (std::size_t w = 0; w < light_.group_words; ++w) {
      umbra_of(number)[w] = umbra_of(number + 1)[w] & umbra_of(right)[w];
    }
    full_umbra_[number] = full_umbra_[number + 1] & full_umbra_[right];
  }

  void restore_umbra(std::uint32_t number) {
    if (hierarchy_.nodes.empty()) return;
    const ReceiverHierarchy::Node& node = hierarchy_.nodes[number];
    if (node.is_leaf()) return sum_up_leaf(number);
    restore_umbra(number + 1);
    restore_umbra(node.right);
    join_umbra(number, node.right);
  }

  const PenumbraCastingOptions& options_;
  const CastLight& light_;
  ReceiverHierarchy hierarchy_;
  KernelReceivers kernel_;             // in the hierarchy's order
  std::vector<std::uint32_t> source_;  // [receiver of kernel_] -> receiver of the whole
  std::vector<std::uint32_t> umbra_;   // receivers of the whole that left in full umbra
  MaskPool pool_;
  std::uint32_t live_ = 0, finished_ = 0;   // receivers of the hierarchy that see some sample, or none any more
  std::vector<std::uint64_t> group_umbra_;  // [node][group_words]
  std::vector<std::uint8_t> full_umbra_;    // [node]
  CastCounters counters_;

  const PreparedBlocker* blocker_ = nullptr;
  bool volumes_made_ = false;
  std::vector<PenumbraVolume> volumes_;  // [group]
  std::vector<ActiveGroup> active_;      // lists of the nodes on the way down, one behind the other
};

/// The top of the hierarchy: its leaves are the parts.
ReceiverHierarchy make_top(const ReceiverArray& receivers) {
  ReceiverHierarchy top;
  for (std::uint32_t i = 0; i < receivers.size(); ++i) top.order.push_back(i);
  const auto part = std::max(kLeastPart, static_cast<std::uint32_t>(receivers.size() / kMostParts));
  build_receiver_hierarchy(receivers.position, {part, part, false}, top);
  return top;
}

struct PartHit {
  std::uint32_t blocker;  // of the round
  PlaneSet planes;
};

/// Some blockers of a round: what they reach at the top of the hierarchy.
struct Chunk {
  std::vector<std::vector<PartHit>> hits;  // [part]
  CastCounters counters;
};

CastLight make_cast_light(const Light& light, const LightSamples& samples, const PenumbraCastingOptions& options) {
  CastLight cast;
  const LightBound bound = make_light_bound(light, samples);
  cast.samples = make_kernel_samples(samples, bound);
  cast.hull = make_light_hull(bound, samples, cast.samples);
  cast.groups = make_group_hulls(samples, cast.samples, options.group);
  cast.kernel_groups_per_group = options.group / KernelSamples::kGroup;
  cast.group_words = (cast.groups.size() + 63) / 64;
  return cast;
}

/// C1: a blocker that lies in the plane of all samples blocks none of them.
bool lies_in_plane_of(const std::array<vec3, 3>& t, std::span<const vec3> points) {
  return std::all_of(points.begin(), points.end(), [&](const vec3& p) { return orient3d(t[0], t[1], t[2], p) == 0; });
}

void require(bool condition, const std::string& message) {
  if (!condition) throw Error(ErrorCode::kUsage, message);
}

}  // namespace

void check_penumbra_casting(const PenumbraCastingOptions& o) {
  require(o.group >= 16 && o.group <= 4096 && o.group % 16 == 0,
          "hpc.group: " + std::to_string(o.group) + " is not a multiple of 16 in 16..4096");
  require(o.leaf >= 1 && o.leaf <= 1024, "hpc.leaf: " + std::to_string(o.leaf) + " is not in 1..1024");
  require(o.area_buckets <= 256, "hpc.buckets: " + std::to_string(o.area_buckets) + " is not in 0..256");
  require(o.rebuild >= 0.0f && o.rebuild <= 1.0f, "hpc.rebuild: " + std::to_string(o.rebuild) + " is not in 0..1");
}

struct PenumbraCaster::State {
  PenumbraCastingOptions options;
  std::span<const vec3> all_samples;
  CastLight light;
  ReceiverHierarchy top;
  std::vector<std::uint32_t> part_of_node;  // [node of top], for leaves
  std::vector<std::unique_ptr<ReceiverPart>> parts;
  std::vector<PreparedBlocker> blockers;  // of the round
  std::vector<Chunk> chunks;
  std::uint64_t most_masks = 0;
  double build_ms = 0.0, prepare_ms = 0.0, cast_ms = 0.0;

  void prepare(const LatticeMesh& mesh, std::uint32_t triangle, std::uint32_t number, PreparedBlocker& out) const {
    out.blocker = make_blocker(mesh, light.samples, triangle);
    out.blocker.triangle = number;
    if (out.blocker.perforated) out.alpha = make_alpha_triangle(mesh, triangle);
    out.blocker.alpha = &out.alpha;
    make_penumbra_volume(light.hull, out.blocker.corner, out.volume);
  }

  void visit_top(std::uint32_t number, std::uint32_t blocker, PlaneSet planes, Chunk& chunk) const {
    const ReceiverHierarchy::Node& node = top.nodes[number];
    ++chunk.counters.nodes_visited;
    PlaneSet left = planes;
    if (!meets(blockers[blocker].volume, node.low, node.high, left, chunk.counters.plane_tests)) return;
    if (options.plane_sets) planes = left;
    if (!node.is_leaf()) {
      visit_top(number + 1, blocker, planes, chunk);
      visit_top(node.right, blocker, planes, chunk);
    } else if (!parts[part_of_node[number]]->in_umbra()) {
      chunk.hits[part_of_node[number]].push_back({blocker, planes});
    }
  }

  void run_chunk(const LatticeMesh& mesh, std::span<const std::uint32_t> order, std::span<const std::uint32_t> numbers,
                 std::size_t first, Chunk& chunk) {
    for (auto& hits : chunk.hits) hits.clear();
    for (std::size_t i = 0; i < order.size(); ++i) {
      PreparedBlocker& blocker = blockers[first + i];
      prepare(mesh, order[i], numbers.empty() ? order[i] : numbers[order[i]], blocker);
      ++chunk.counters.light_volumes;
      if (blocker.volume.count == 0 && lies_in_plane_of(blocker.blocker.corner, all_samples)) {
        ++chunk.counters.in_light_plane;
        continue;
      }
      visit_top(0, static_cast<std::uint32_t>(first + i), blocker.volume.all(), chunk);
    }
  }

  void run_round(const LatticeMesh& mesh, std::span<const std::uint32_t> order,
                 std::span<const std::uint32_t> numbers) {
    Stopwatch watch;
    const std::size_t count = (order.size() + kBlockersPerChunk - 1) / kBlockersPerChunk;
    parallel_tasks(count, [&](std::size_t c) {
      const std::size_t first = c * kBlockersPerChunk;
      run_chunk(mesh, order.subspan(first, std::min(kBlockersPerChunk, order.size() - first)), numbers, first,
                chunks[c]);
    });
    prepare_ms += watch.lap();
    parallel_tasks(parts.size(), [&](std::size_t p) {
      for (std::size_t c = 0; c < count; ++c) {
        for (const PartHit& hit : chunks[c].hits[p]) parts[p]->cast(blockers[hit.blocker], hit.planes);
      }
    });
    cast_ms += watch.lap();
    std::uint64_t masks = 0;
    for (const auto& part : parts) masks += part->pool().take_peak();
    most_masks = std::max(most_masks, masks);
  }
};

PenumbraCaster::PenumbraCaster(const ReceiverArray& receivers, const Light& light, const LightSamples& samples,
                               const ShadowConfig& config)
    : state_(std::make_unique<State>()) {
  check_penumbra_casting(config.hpc);
  State& s = *state_;
  Stopwatch watch;
  s.options = config.hpc;
  s.all_samples = samples.points;
  s.light = make_cast_light(light, samples, config.hpc);
  s.top = make_top(receivers);
  s.part_of_node.assign(s.top.nodes.size(), kNone);
  std::vector<std::uint32_t> leaves;
  for (std::uint32_t n = 0; n < s.top.nodes.size(); ++n) {
    if (!s.top.nodes[n].is_leaf()) continue;
    s.part_of_node[n] = static_cast<std::uint32_t>(leaves.size());
    leaves.push_back(n);
  }
  s.parts.resize(leaves.size());
  parallel_tasks(leaves.size(), [&](std::size_t p) {
    const ReceiverHierarchy::Node& node = s.top.nodes[leaves[p]];
    s.parts[p] = std::make_unique<ReceiverPart>(
        receivers, std::span(s.top.order).subspan(node.begin, node.end - node.begin), s.light, s.options);
  });
  s.blockers.resize(kBlockersPerChunk * kChunksPerRound);
  s.chunks.resize(kChunksPerRound);
  for (Chunk& chunk : s.chunks) chunk.hits.resize(leaves.size());
  s.build_ms += watch.lap();
}

PenumbraCaster::~PenumbraCaster() = default;

void PenumbraCaster::cast(const LatticeMesh& mesh, std::span<const std::uint32_t> order,
                          std::span<const std::uint32_t> numbers,
                          const std::function<void(std::size_t done)>& progress) {
  if (state_->parts.empty()) return;
  const std::size_t round = state_->blockers.size();
  for (std::size_t first = 0; first < order.size(); first += round) {
    if (progress) progress(first);
    state_->run_round(mesh, order.subspan(first, std::min(round, order.size() - first)), numbers);
  }
}

void PenumbraCaster::write_masks(VisibilityMasks& masks) const {
  parallel_tasks(state_->parts.size(), [&](std::size_t p) { state_->parts[p]->write_masks(masks); });
}

void PenumbraCaster::write_stats(ShadowStats& stats) const {
  const State& s = *state_;
  CastCounters total;
  std::uint64_t bytes = s.top.bytes() + s.blockers.size() * sizeof(PreparedBlocker);
  std::uint32_t depth = 0;
  for (const Chunk& chunk : s.chunks) {
    total.add(chunk.counters);
    for (const auto& hits : chunk.hits) bytes += hits.capacity() * sizeof(PartHit);
  }
  for (const auto& part : s.parts) {
    total.add(part->counters());
    bytes += part->bytes();
    depth = std::max(depth, part->depth());
  }
  stats.index_ms += s.build_ms;
  stats.cull_ms += s.prepare_ms;
  stats.test_ms += s.cast_ms;
  stats.bytes = std::max(stats.bytes, bytes);
  add_to_stats(total.kernel, stats);
  const auto note = [&](const char* name, double value) { stats.details.emplace_back(name, value); };
  note("hpc.parts", static_cast<double>(s.parts.size()));
  note("hpc.hierarchy_depth", static_cast<double>(s.top.depth + depth));
  note("hpc.groups", s.light.group_count());
  note("hpc.light_volumes", static_cast<double>(total.light_volumes));
  note("hpc.group_volumes", static_cast<double>(total.group_volumes));
  note("hpc.nodes_visited", static_cast<double>(total.nodes_visited));
  note("hpc.plane_tests", static_cast<double>(total.plane_tests));
  note("hpc.leaves_tested", static_cast<double>(total.leaves_tested));
  note("hpc.hierarchy_rebuilds", static_cast<double>(total.rebuilds));
  note("hpc.rebuild_ms", total.rebuild_ms);
  note("hpc.blockers_in_light_plane", static_cast<double>(total.in_light_plane));
  note("hpc.peak_masks", static_cast<double>(s.most_masks));
  note("hpc.peak_mask_bytes", static_cast<double>(s.most_masks * (s.light.samples.padded / 8)));
}

void solve_hierarchical_penumbra_casting(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                                         const LightSamples& samples, const ShadowConfig& config,
                                         VisibilityMasks& masks, ShadowStats& stats) {
  check_penumbra_casting(config.hpc);
  masks.reset(receivers.size(), samples.count);
  Stopwatch watch;
  const std::vector<std::uint32_t> order = casting_order(mesh, config.hpc.area_buckets);
  const double sort_ms = watch.lap();
  PenumbraCaster caster(receivers, light, samples, config);
  caster.cast(mesh, order, {}, [&](std::size_t done) {
    report_progress(config, static_cast<double>(done) / static_cast<double>(order.size()));
  });
  watch.lap();
  caster.write_masks(masks);
  caster.write_stats(stats);
  stats.test_ms += watch.lap();
  stats.build_ms += sort_ms;
  stats.details.emplace_back("hpc.sort_ms", sort_ms);
}

}  // namespace halfshade
