// The exact engine: a packet of receivers, one in each vector lane, sees the light as a picture of rows of samples, and
// triangles are rasterized into all of the packet's pictures at once. Samples too near to an edge for the error bounds
// go to the exact predicate.
//
// What is decided once for the whole packet: which leaves, which of a leaf's triangles (16 at a time), which rows.
#include "shadows/packet_kernel.h"
#include "rasterizer/core/stopwatch.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "shadows/packet_kernel.cpp"
#include <hwy/foreach_target.h>

#include "shadows/cluster_beams-inl.h"
#include "shadows/packet_singles-inl.h"

HWY_BEFORE_NAMESPACE();
namespace halfshade {
namespace HWY_NAMESPACE {

/// A packet at work on its receivers.
class PacketSolver {
 public:
  PacketSolver(const ExactScene& scene, const ReceiverBox& cluster, KernelReceivers& receivers, ExactScratch& scratch)
      : scene_(scene),
        rows_(*scene.rows),
        cluster_(cluster),
        receivers_(receivers),
        scratch_(scratch),
        counters_(scratch.counters),
        outline_(scene, packet_, scratch),
        singles_(scene, packet_, changed_lines_, counters_) {}

  HWY_INLINE void Solve(std::size_t first, std::size_t count) {
    if (!Begin(first, count)) return;
    const std::size_t lanes = hn::Lanes(Tag());
    const float* const low[3] = {scratch_.low[0].data(), scratch_.low[1].data(), scratch_.low[2].data()};
    const float* const high[3] = {scratch_.high[0].data(), scratch_.high[1].data(), scratch_.high[2].data()};
    bool any = false;
    PictureRanges ranges;
    for (std::size_t i = 0; i < scratch_.group.size(); i += lanes) {
      for (std::uint64_t bits = BoxesOverOpenSamples(rows_, low, high, i, packet_, 0, ranges); bits != 0;
           bits &= bits - 1) {
        const std::size_t at = i + static_cast<std::size_t>(std::countr_zero(bits));
        if (!RasterizeGroup(scene_.fit->nodes[scratch_.group[at]], scratch_.groups[at])) continue;
        any = true;
        const bool is_open = FindOpenPart();
        scratch_.gain[scratch_.group[at]] += gain_;
        if (!is_open) {
          StoreMasks();
          return;
        }
      }
    }
    if (any) StoreMasks();
  }

 private:
  bool Begin(std::size_t first, std::size_t count);
  void FindPlaces();
  bool FindOpenPart();
  bool RasterizeGroup(const BlockerTree::Node& group, GroupView& view);
  bool RasterizePatch(const BlockerTree::Node& group, const GroupView& view, const std::uint16_t* patch,
                      std::uint32_t leaves, bool& added);
  void FindTurns(const GroupView& view, std::uint32_t leaves, std::uint16_t* patch);
  void SettlePatch(const BlockerTree::Node& group, const std::uint16_t* patch, std::uint32_t leaves, std::uint32_t line,
                   const std::uint32_t* doubtful, std::uint32_t* blocked);
  const LeafView& ViewLeaf(const BlockerTree::Node& group, std::uint32_t k);
  void StoreMasks();
  void StoreSamplesAnywhere();
  void StoreRows();

  HWY_NOINLINE UintVec WindSamples(std::uint32_t line, std::uint32_t asked, UintVec& doubtful) const;

  const ExactScene& scene_;
  const SampleRows& rows_;
  const ReceiverBox& cluster_;
  KernelReceivers& receivers_;
  ExactScratch& scratch_;
  KernelCounters& counters_;
  Packet packet_;
  LineSet changed_lines_;
  float gain_ = 0.0f;                    // of the group at work
  PictureRanges leaf_ranges_;            // of the group at work
  LeafView views_[BlockerTree::kWidth];  // of its leaves
  std::uint32_t viewed_ = 0;             // those that are there
  GroupOutline outline_;                 // of the patch at work
  SingleTriangles singles_;
};

/// Positions, boxes and pictures; all samples are open.
bool PacketSolver::Begin(std::size_t first, std::size_t count) {
  const Tag d;
  const UintTag du;
  packet_.receivers = &receivers_, packet_.first = first, packet_.count = count;
  packet_.set = receivers_.set.data() + first;
  packet_.has_one_set =
      std::all_of(packet_.set, packet_.set + count, [&](std::uint8_t s) { return s == packet_.set[0]; });
  static_cast<ReceiverBox&>(packet_) = ReceiverBox();
  for (std::size_t i = 0; i < count; ++i) packet_.add(scene_.frame, packet_.at(i));
  packet_.position = {hn::LoadU(d, &receivers_.x[first]), hn::LoadU(d, &receivers_.y[first]),
                      hn::LoadU(d, &receivers_.z[first])};
  packet_.own = hn::LoadU(du, &receivers_.own[first]);
  packet_.to_center = Subtract(Splat(scene_.samples->center), packet_.position);
  const Vec3 from_center = Subtract(packet_.position, Splat(scene_.samples->center));
  packet_.column = Dot(from_center, Splat(rows_.axis_x * rows_.scale));
  packet_.row = Dot(from_center, Splat(rows_.axis_y * rows_.row_scale));
  packet_.height = Dot(from_center, Splat(vec3(scene_.frame.n)));
  packet_.place_error = hn::Mul(hn::Set(d, 5.0f), Norm1(from_center));
  packet_.height_error = hn::Add(hn::Div(packet_.place_error, packet_.height), hn::Set(d, 14.0f));
  FindPlaces();
  const auto in_packet = hn::RebindMask(du, hn::FirstN(d, count));
  for (std::uint32_t line = 0; line < rows_.lines; ++line)
    hn::Store(rows_.anywhere ? hn::Load(du, scratch_.places.valid[line])
                             : hn::IfThenElseZero(in_packet, hn::Set(du, rows_.valid[line])),
              du, packet_.open[line]);
  for (std::uint64_t& word : changed_lines_.bits) word = ~std::uint64_t{0};
  outline_.Begin();
  singles_.Begin();
  return FindOpenPart();
}

/// Where the receivers see their samples.
void PacketSolver::FindPlaces() {
  const Tag d;
  packet_.lines = &scratch_.lines, packet_.places = &scratch_.places;
  float reach = scene_.samples->reach;
  if (rows_.anywhere) {
    PlaceSamples(rows_, scene_.cloud != nullptr, packet_, scratch_.places);
  } else {
    scratch_.lines.place(rows_, packet_.set, packet_.count, packet_.has_one_set);
  }
  if (scene_.cloud != nullptr) {
    BoundPlaces(*scene_.cloud, packet_, scratch_.places, scratch_.rows);
    packet_.shaft.floor = scene_.cloud->low.z;
    const float columns = static_cast<float>(rows_.columns) + std::max(-rows_.least_offset, rows_.most_offset);
    reach = columns / rows_.scale + rows_.reach_y;
  }
  packet_.distance = hn::Add(NormMax(packet_.to_center), hn::Set(d, reach + rows_.deviation / kDeterminantError));
}

/// What some receiver has open, after lines changed; false where nothing is.
bool PacketSolver::FindOpenPart() {
  std::uint32_t columns[2] = {0, 0}, first = ~0u, last = 0;
  gain_ = 0.0f;
  for (std::uint32_t line = 0; line < rows_.lines; ++line) {
    if (changed_lines_.has(line)) {
      std::uint32_t all = 0;
      for (std::size_t k = 0; k < hn::Lanes(Tag()); ++k) all |= packet_.open[line][k];
      gain_ += static_cast<float>(1 + std::popcount(packet_.any_open[line] & ~all));
      packet_.any_open[line] = all;
    }
    if (packet_.any_open[line] == 0) continue;
    columns[line / rows_.rows] |= packet_.any_open[line];
    first = std::min(first, line % rows_.rows), last = std::max(last, line % rows_.rows);
  }
  changed_lines_ = LineSet();
  const std::uint64_t all = columns[0] | std::uint64_t{columns[1]} << 32;
  if (all == 0) return false;
  const float pad = ProjectionPad(packet_.shaft.low[2]) + rows_.deviation;
  packet_.open_low[0] = static_cast<float>(std::countr_zero(all)) - rows_.most_offset;
  packet_.open_low[1] = static_cast<float>(first) - rows_.most_row_offset;
  packet_.open_high[0] = static_cast<float>(63 - std::countl_zero(all)) - rows_.least_offset;
  packet_.open_high[1] = static_cast<float>(last) - rows_.least_row_offset;
  packet_.shaft.light = {packet_.open_low[0] / rows_.scale - pad, packet_.open_low[1] / rows_.row_scale - pad,
                         packet_.open_high[0] / rows_.scale + pad, packet_.open_high[1] / rows_.row_scale + pad};
  return true;
}

/// Up to 16 leaves; true where samples were blocked.
bool PacketSolver::RasterizeGroup(const BlockerTree::Node& group, GroupView& view) {
  if (view.known && view.is_empty) return false;
  const float* const low[3] = {group.low[0], group.low[1], group.low[2]};
  const float* const high[3] = {group.high[0], group.high[1], group.high[2]};
  std::uint32_t leaves = 0;
  for (std::size_t i = 0; i < group.count; i += hn::Lanes(Tag())) {
    leaves |= static_cast<std::uint32_t>(BoxesOverOpenSamples(rows_, low, high, i, packet_, i, leaf_ranges_)) << i;
  }
  leaves &= (1u << group.count) - 1;
  if (leaves == 0) return false;
  if (!view.known) ViewGroup(scene_, group, cluster_, scratch_, view);
  scratch_.leaves_tested += static_cast<std::uint64_t>(std::popcount(leaves));
  viewed_ = 0;
  bool added = false;
  std::uint16_t patch[BlockerTree::kWidth];
  FindTurns(view, leaves, patch);
  int in_patch = 0;
  for (std::uint32_t rest = leaves; rest != 0; rest &= rest - 1)
    in_patch += std::popcount(patch[std::countr_zero(rest)]);
  const bool patched = rows_.has_outlines() && in_patch >= 3 && RasterizePatch(group, view, patch, leaves, added);
  for (std::uint32_t rest = leaves; rest != 0; rest &= rest - 1) {
    const auto k = static_cast<std::uint32_t>(std::countr_zero(rest));
    std::uint32_t wanted = view.patch[k] | view.turns[k] | view.single[k];
    if (patched) wanted &= ~patch[k];
    if (wanted == 0) continue;
    const std::uint32_t leaf = group.first_leaf() + k;
    counters_.pairs_tested += scene_.tree->leaves[leaf].count * packet_.count;
    added |= singles_.Rasterize(leaf, ViewLeaf(group, k), wanted);
  }
  return added;
}

/// From which side each receiver sees the triangles that turn. Those of `leaves` for which that is certain for everyone
/// join the patch, which is returned.
void PacketSolver::FindTurns(const GroupView& view, std::uint32_t leaves, std::uint16_t* patch) {
  const Tag d;
  const LaneMask everyone = hn::FirstN(d, packet_.count);
  std::copy_n(view.patch, BlockerTree::kWidth, patch);
  std::uint32_t* const facing = scratch_.facing.data() + view.facing;
  for (const TurningTriangle& t : std::span(scratch_.turning).subspan(view.first_triangle, view.triangles)) {
    const std::uint32_t leaf = t.place / BlockerTree::kWidth;
    facing[t.place] = 0;
    if ((leaves >> leaf & 1) == 0) continue;
    const Vec3 to_corner = Subtract(Splat(t.corner), packet_.position);
    const Vec side = Dot(Splat(t.normal), to_corner), error = hn::Mul(hn::Set(d, t.side_error), Norm1(to_corner));
    if (!hn::AllFalse(d, hn::And(everyone, hn::Le(hn::Abs(side), error)))) continue;
    patch[leaf] |= static_cast<std::uint16_t>(1u << t.place % BlockerTree::kWidth);
    const auto above = static_cast<std::uint32_t>(Bits(hn::Gt(side, hn::Zero(d))));
    facing[t.place] = (t.samples_above ? above << 16 : 0) | (t.samples_below ? ~above & 0xffff : 0);
  }
}

/// Leaf `k` of the group, looked at once.
const LeafView& PacketSolver::ViewLeaf(const BlockerTree::Node& group, std::uint32_t k) {
  LeafView& view = views_[k];
  if ((viewed_ >> k & 1) != 0) return view;
  viewed_ |= 1u << k;
  const std::uint32_t leaf = group.first_leaf() + k, count = scene_.tree->leaves[leaf].count;
  view.above = view.below = view.bounded = view.active = view.kept = 0;
  for (std::size_t i = 0; i < count; i += hn::Lanes(Tag())) ViewTriangles(scene_, leaf, i, packet_, view);
  return view;
}

/// Doubtful samples of a line by the exact predicate: does a triangle of the patch block them?
void PacketSolver::SettlePatch(const BlockerTree::Node& group, const std::uint16_t* patch, std::uint32_t leaves,
                               std::uint32_t line, const std::uint32_t* doubtful, std::uint32_t* blocked) {
  const auto row = static_cast<std::int32_t>(line % rows_.rows);
  const auto within = [&](const PictureRanges& ranges, std::size_t i, std::int32_t column) {
    return row >= ranges.row[0][i] && row <= ranges.row[1][i] && column >= ranges.column[0][i] &&
           column <= ranges.column[1][i];
  };
  for (std::size_t lane = 0; lane < packet_.count; ++lane) {
    if (doubtful[lane] == 0) continue;
    const LinePoints points(rows_, packet_, lane, line);
    for (std::uint32_t rest = doubtful[lane]; rest != 0; rest &= rest - 1) {
      const auto bit = static_cast<std::size_t>(std::countr_zero(rest));
      const auto column = static_cast<std::int32_t>(line / rows_.rows * SampleRows::kWord + bit);
      bool is_blocked = false;
      for (std::uint32_t some = leaves; some != 0 && !is_blocked; some &= some - 1) {
        const auto k = static_cast<std::uint32_t>(std::countr_zero(some));
        if (patch[k] == 0 || !within(leaf_ranges_, k, column)) continue;
        const BlockerTree::Leaf& leaf = scene_.tree->leaves[group.first_leaf() + k];
        const LeafView& seen = ViewLeaf(group, k);
        for (std::uint32_t t = patch[k] & seen.active; t != 0 && !is_blocked; t &= t - 1) {
          const auto i = static_cast<std::size_t>(std::countr_zero(t));
          if (!within(seen.ranges, i, column)) continue;
          ++counters_.exact_fallbacks;
          is_blocked =
              blocks(leaf.corner_at(0, i), leaf.corner_at(1, i), leaf.corner_at(2, i), packet_.at(lane), points[bit]);
        }
      }
      blocked[lane] |= std::uint32_t{is_blocked} << bit;
    }
  }
}

/// `asked` samples of a line as WindLine gives them.
UintVec PacketSolver::WindSamples(std::uint32_t line, std::uint32_t asked, UintVec& doubtful) const {
  const UintTag du;
  UintVec blocked = hn::Zero(du);
  doubtful = blocked;
  for (; asked != 0; asked &= asked - 1) {
    const UintVec bit = hn::Set(du, asked & (0u - asked));
    LaneMask unsure;
    const LaneMask hidden =
        outline_.WindSample(line * SampleRows::kWord + static_cast<std::size_t>(std::countr_zero(asked)), unsure);
    blocked = hn::Or(blocked, hn::IfThenElseZero(hn::RebindMask(du, hidden), bit));
    doubtful = hn::Or(doubtful, hn::IfThenElseZero(hn::RebindMask(du, unsure), bit));
  }
  return blocked;
}

/// The group's patch into all pictures; false where its triangles must be taken one by one.
bool PacketSolver::RasterizePatch(const BlockerTree::Node& group, const GroupView& view, const std::uint16_t* patch,
                                  std::uint32_t leaves, bool& added) {
  const UintTag du;
  if (!outline_.Collect(view)) return false;
  if (outline_.empty()) return true;
  rows_.anywhere ? outline_.SetAnywhere() : outline_.Set();
  LineSet lines;
  std::uint32_t asked[kMaxLines];  // of samples anywhere: those that the patch may hide
  for (std::uint32_t rest = leaves; rest != 0; rest &= rest - 1) {
    const auto k = static_cast<std::size_t>(std::countr_zero(rest));
    if (patch[k] == 0) continue;
    PictureRange(rows_, leaf_ranges_, k).for_open_lines(rows_, packet_, [&](std::uint32_t line, std::uint32_t open) {
      asked[line] = lines.has(line) ? asked[line] | open : open;
      lines.add(line);
      return false;
    });
  }
  ++counters_.pairs_sampled;
  bool any = false;
  lines.for_each([&](std::uint32_t line) HWY_ATTR {
    const UintVec open = hn::Load(du, packet_.open[line]);
    UintVec doubtful;
    ++counters_.sample_tests;
    UintVec blocked = rows_.anywhere ? WindSamples(line, asked[line], doubtful) : outline_.WindLine(line, doubtful);
    blocked = hn::And(blocked, open);
    doubtful = hn::And(doubtful, open);
    if (!hn::AllTrue(du, hn::Eq(doubtful, hn::Zero(du)))) {
      alignas(HWY_MAX_BYTES) std::uint32_t in_doubt[kMaxLanes], does[kMaxLanes];
      hn::Store(doubtful, du, in_doubt), hn::Store(hn::AndNot(doubtful, blocked), du, does);
      SettlePatch(group, patch, leaves, line, in_doubt, does);
      blocked = hn::Load(du, does);
    }
    if (hn::AllTrue(du, hn::Eq(blocked, hn::Zero(du)))) return;
    hn::Store(hn::AndNot(blocked, open), du, packet_.open[line]);
    changed_lines_.add(line);
    any = true;
  });
  counters_.pairs_necessary += any;
  added |= any;
  return true;
}

void PacketSolver::StoreMasks() { rows_.anywhere ? StoreSamplesAnywhere() : StoreRows(); }

void PacketSolver::StoreSamplesAnywhere() {
  for (std::size_t lane = 0; lane < packet_.count; ++lane) {
    std::uint64_t* const mask = receivers_.mask(packet_.first + lane);
    for (std::uint32_t line = 0; line < rows_.lines; ++line) {
      const std::uint16_t* const sample =
          rows_.sample_of.data() + packet_.set[lane] * rows_.stride + line * SampleRows::kWord;
      for (std::uint32_t blocked = rows_.valid_of(packet_.set[lane], line) & ~packet_.open[line][lane]; blocked != 0;
           blocked &= blocked - 1) {
        const std::uint16_t s = sample[std::countr_zero(blocked)];
        mask[s / 64] |= std::uint64_t{1} << s % 64;
      }
    }
  }
}

/// The lines of all receivers at once into words of 32 samples, and these into the masks.
void PacketSolver::StoreRows() {
  const UintTag du;
  constexpr std::size_t kMostWords = SampleRows::kMaxLines;
  alignas(HWY_MAX_BYTES) std::uint32_t words[kMostWords + 1][kMaxLanes];
  const std::size_t count = 2 * receivers_.words;
  for (std::size_t w = 0; w <= count; ++w) hn::Store(hn::Zero(du), du, words[w]);
  for (std::uint32_t line = 0; line < rows_.lines; ++line) {
    UintVec blocked = hn::AndNot(hn::Load(du, packet_.open[line]), hn::Set(du, rows_.valid[line]));
    if (hn::AllTrue(du, hn::Eq(blocked, hn::Zero(du)))) continue;
    const std::int32_t first = rows_.first[line];
    if (first < 0) blocked = hn::ShiftRightSame(blocked, -first);  // columns before the row's first sample
    const std::size_t at = static_cast<std::size_t>(std::max(first, 0));
    const auto shift = static_cast<int>(at % 32);
    const auto add = [&](std::size_t w, UintVec bits)
                         HWY_ATTR { hn::Store(hn::Or(hn::Load(du, words[w]), bits), du, words[w]); };
    add(at / 32, hn::ShiftLeftSame(blocked, shift));
    if (shift != 0) add(at / 32 + 1, hn::ShiftRightSame(blocked, 32 - shift));
  }
  for (std::size_t lane = 0; lane < packet_.count; ++lane) {
    std::uint64_t* const mask = receivers_.mask(packet_.first + lane);
    for (std::size_t w = 0; w < receivers_.words; ++w)
      mask[w] |= words[2 * w][lane] | std::uint64_t{words[2 * w + 1][lane]} << 32;
  }
}

/// A cloud's samples as the middle of the receivers sees them.
void ArrangeCloud(const ExactScene& scene, const ReceiverBox& box, std::span<const std::uint8_t> sets,
                  ExactScratch& scratch) {
  bool is_wanted[256] = {};
  scratch.wanted.clear();
  for (const std::uint8_t set : sets) {
    if (!is_wanted[set]) scratch.wanted.push_back(set);
    is_wanted[set] = true;
  }
  vec3 middle;
  for (int k = 0; k < 3; ++k) middle[k] = 0.5f * (box.shaft.low[k] + box.shaft.high[k]);
  arrange_cloud(*scene.cloud, *scene.samples, scene.frame, middle, scratch.wanted, scratch.rows);
}

/// The cluster packet by packet.
void SolveByPackets(const ExactScene& given, const ReceiverBox& cluster, std::size_t begin, std::size_t end,
                    KernelReceivers& receivers, ExactScratch& scratch) {
  ExactScene scene = given;
  const std::size_t lanes = hn::Lanes(Tag());
  scratch.own_places.clear();
  const std::vector<std::uint32_t>& place = scene.tree->place;
  for (std::size_t i = begin; i < end; ++i) {
    if (receivers.own[i] < place.size() && (i == begin || receivers.own[i] != receivers.own[i - 1]))
      scratch.own_places.push_back(place[receivers.own[i]]);
  }
  std::sort(scratch.own_places.begin(), scratch.own_places.end());
  if (scene.cloud != nullptr) {
    ArrangeCloud(scene, cluster, std::span(receivers.set).subspan(begin, end - begin), scratch);
    scene.rows = &scratch.rows;
  }
  if (scratch.groups.size() < scratch.group.size()) scratch.groups.resize(scratch.group.size());
  for (GroupView& view : scratch.groups) view.known = false;
  scratch.net_edges.count = 0;
  scratch.facing.clear(), scratch.turning.clear();
  PacketSolver solver(scene, cluster, receivers, scratch);
  for (std::size_t i = begin; i < end; i += lanes) solver.Solve(i, std::min(lanes, end - i));
}

/// Receivers [begin, end) and their shaft to the light.
ReceiverBox BoxOf(const ExactScene& scene, std::size_t begin, std::size_t end, const KernelReceivers& receivers) {
  ReceiverBox box;
  for (std::size_t i = begin; i < end; ++i) box.add(scene.frame, {receivers.x[i], receivers.y[i], receivers.z[i]});
  box.shaft = ShaftToLight(scene, box.shaft);
  return box;
}

/// The median of the boxes of the groups in scratch, along their longest side.
float UsualExtent(ExactScratch& scratch) {
  std::vector<float>& extent = scratch.old_bound;
  extent.assign(scratch.group.size(), 0.0f);
  for (int k = 0; k < 3; ++k) {
    for (std::size_t i = 0; i < extent.size(); ++i)
      extent[i] = std::max(extent[i], scratch.high[k][i] - scratch.low[k][i]);
  }
  const auto middle = extent.begin() + static_cast<std::ptrdiff_t>(extent.size() / 2);
  std::nth_element(extent.begin(), middle, extent.end());
  return *middle;
}

/// Are receivers so far from each other, against the light and the groups that they meet, that what one sees tells
/// little about the others? In a picture of usual size hardly any are, but probes are, and the points of small
/// pictures.
bool AreScattered(const Shaft& shaft, std::size_t count, ExactScratch& scratch) {
  constexpr std::size_t kFewGroups = 16;
  constexpr float kWide = 1.0f, kFarApart = 0.15f;  // the box, and the distance between neighbours, in lights + groups
  if (count == 1 || scratch.group.size() < kFewGroups) return false;
  float extent = 0.0f;
  for (int k = 0; k < 3; ++k) extent = std::max(extent, shaft.high[k] - shaft.low[k]);
  const float light = std::max(shaft.light.high_u - shaft.light.low_u, shaft.light.high_v - shaft.light.low_v);
  const float share = std::min(kWide, kFarApart * std::sqrt(static_cast<float>(count)));
  return extent > share * light && extent > share * (light + UsualExtent(scratch));
}

void SolveCluster(const ExactScene& scene, std::size_t begin, std::size_t end, KernelReceivers& receivers,
                  ExactScratch& scratch) {
  const ReceiverBox cluster = BoxOf(scene, begin, end, receivers);
  CollectGroups(*scene.fit, cluster.shaft, scratch);
  if (scratch.group.empty()) {
    ++scratch.clusters_lit;
    return;
  }
  if (AreScattered(cluster.shaft, end - begin, scratch)) {
    const std::size_t middle = begin + (end - begin) / 2;
    SolveCluster(scene, begin, middle, receivers, scratch);
    SolveCluster(scene, middle, end, receivers, scratch);
    return;
  }
  scratch.leaves_listed += scratch.group.size();
  scratch.gain.resize(scene.fit->nodes.size());  // of a thread that nobody expected
  SortGroups(cluster.shaft, scratch);
  const BeamChoice::Cluster work{end - begin, scratch.group.size(), scene.samples->count};
  const bool takes_beams = scene.tiles != nullptr && scratch.choice.takes_beams(work, scene.beams);
  Stopwatch watch;
  if (takes_beams) {
    BeamSolver(scene, cluster, receivers, scratch).Solve(begin, end);
    ++scratch.clusters_by_sample;
  } else {
    SolveByPackets(scene, cluster, begin, end, receivers, scratch);
  }
  scratch.choice.took(work, takes_beams, watch.lap());
}

}  // namespace HWY_NAMESPACE
}  // namespace halfshade
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace halfshade {

void PictureLines::place(const SampleRows& rows, const std::uint8_t* set, std::size_t count, bool alike) {
  if (alike && placed == set[0]) return;
  for (std::uint32_t line = 0; line < rows.lines; ++line) {
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const std::size_t at = std::size_t{set[std::min(lane, count - 1)]} * rows.lines + line;
      y[line][lane] = rows.y[at], offset[line][lane] = rows.offset[at] + 0.5f,
      rest[line][lane] = 31.5f - rows.offset[at];
      row_place[line][lane] = rows.place.empty() ? 0.0f : rows.place[at];
    }
  }
  for (std::size_t lane = 0; lane < kLanes; ++lane) row_offset[lane] = rows.row_offset[set[std::min(lane, count - 1)]];
  placed = alike ? set[0] : kMixed;
}

HWY_EXPORT(SolveCluster);

void solve_cluster(const ExactScene& scene, std::size_t begin, std::size_t end, KernelReceivers& receivers,
                   ExactScratch& scratch) {
  HWY_DYNAMIC_DISPATCH(SolveCluster)(scene, begin, end, receivers, scratch);
}

}  // namespace halfshade
#endif
