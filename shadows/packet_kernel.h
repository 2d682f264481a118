// Hot loop of the exact engine: one cluster of receivers against a tree of blockers (packet_kernel.cpp).
#pragma once

#include "shadows/beam_choice.h"
#include "shadows/sample_rows.h"

namespace halfshade {

struct ExactScene {
  const BlockerTree* tree = nullptr;
  const BlockerFit* fit = nullptr;  // of the tree, to the samples
  const KernelSamples* samples = nullptr;
  const KernelSamples* tiles = nullptr;  // the same, neighbours together; null: no beams
  const SampleRows* rows = nullptr;
  const SampleCloud* cloud = nullptr;  // of samples that lie in no plane: `rows` are made for each cluster
  LightFrame frame;
  Beams beams = Beams::kWhereCheaper;
};

/// Where the lines of the picture lie, [line][receiver of a packet].
struct PictureLines {
  static constexpr std::size_t kLanes = 16;
  static constexpr std::uint32_t kNothing = 0x100, kMixed = 0x101;
  alignas(64) float y[SampleRows::kMaxLines][kLanes], offset[SampleRows::kMaxLines][kLanes];
  alignas(64) float rest[SampleRows::kMaxLines][kLanes];       // 31 - offset; both plus the half that rounds upwards
  alignas(64) float row_place[SampleRows::kMaxLines][kLanes];  // SampleRows::place
  alignas(64) float row_offset[kLanes];                        // SampleRows::row_offset
  std::uint32_t placed = kNothing;                             // the set of all lanes; see above

  /// For receivers of these sets, which may be `alike`; lanes beyond `count` are like the last.
  void place(const SampleRows& rows, const std::uint8_t* set, std::size_t count, bool alike);
};

/// Where samples anywhere lie in the pictures of a packet, by SampleRows' arrays of a set.
struct PlacedSamples {
  struct alignas(64) Place {
    float column[PictureLines::kLanes], row[PictureLines::kLanes];
  };
  struct Bounds {
    float low_column, high_column, low_row, high_row;
  };
  const float *column = nullptr, *row = nullptr;  // of all receivers; or null, and:
  std::vector<Place> place;
  std::vector<Bounds> bounds;  // over all receivers
  // [line][receiver]: bits of its samples
  alignas(64) std::uint32_t valid[SampleRows::kMaxLines][PictureLines::kLanes];
};

/// What a cluster of receivers sees of a group (packet_kernel.cpp).
struct GroupView {
  bool known = false;     // looked at
  bool is_empty = false;  // nothing hides anything
  // Runs of ExactScratch::net_edges: `fixed` edges, then `turning` ones, which are those of triangles that turn; and of
  // ExactScratch::turning: these triangles.
  std::uint32_t first = 0, fixed = 0, turning = 0, first_triangle = 0, triangles = 0;
  // Triangles of each leaf, as bits: those that are seen from one side; plain ones that may be seen from either;
  // others.
  std::uint16_t patch[BlockerTree::kWidth], turns[BlockerTree::kWidth], single[BlockerTree::kWidth];
  std::uint32_t facing = 0;  // place in ExactScratch::facing, where edges turn
};

/// Edges of patches that do not cancel: numbers of their vertices in the group, these themselves, and for edges of
/// triangles that turn BlockerTree::Edge::left and right.
struct NetEdges {
  std::size_t count = 0;
  std::vector<std::uint16_t> vertex[2], triangle[2];
  std::vector<float> end[2][3];

  /// Room for so many edges; contents stay. Where memory runs out, the next call tries again: vertex[0] grows last.
  void reserve(std::size_t edges) {
    if (vertex[0].size() >= edges) return;
    for (auto& ends : end) {
      for (auto& axis : ends) axis.resize(edges);
    }
    triangle[0].resize(edges), triangle[1].resize(edges);
    vertex[1].resize(edges), vertex[0].resize(edges);
  }
};

/// A triangle that some receivers of a cluster may see from above and others from below.
struct TurningTriangle {
  vec3 corner, normal;
  float side_error;     // as in BlockerPlane
  std::uint16_t place;  // in the group: 16 x child + lane
  bool samples_above, samples_below;
};

/// Scratch of beams (cluster_beams-inl.h). A run is 16 receivers.
struct BeamScratch {
  static constexpr std::size_t kRuns = 16, kReceivers = 16 * kRuns;

  /// x / z, y / z, (x + y) / z and (x - y) / z: slopes between which a leaf is seen from the middle of some samples,
  /// and 1 / z of where it is nearest and farthest.
  static constexpr std::size_t kSlopes = 4;
  struct Slopes {
    std::vector<float> low[kSlopes], high[kSlopes], near, far;
    void resize(std::size_t count);
    void reserve(std::size_t count);
  };
  // Of the receivers, light's frame: x / z, y / z, z and 1 / z; slopes from the sample at work.
  alignas(64) float x[kReceivers], y[kReceivers], height[kReceivers], inverse[kReceivers], slope[2][kReceivers];
  alignas(64) float x_by_run[kReceivers], y_by_run[kReceivers], inverse_by_run[kReceivers];  // [receiver of a run][run]
  alignas(64) std::uint32_t own[kReceivers],
      leaf_to_skip[kReceivers];          // BlockerTree::place; a leaf that cannot block it
  alignas(64) float farthest[kRuns];     // greatest z of a run's receivers
  vec3 box_low[kRuns], box_high[kRuns];  // lattice
  std::uint16_t valid[kRuns];            // bits of receivers
  Slopes leaf_slopes;
  // Leaves that the samples at work may see before the cluster, their boxes, and whether their slopes are of corners.
  std::vector<std::uint32_t> leaf;
  std::vector<float> leaf_low[3], leaf_high[3];
  std::vector<std::uint8_t> is_tight;
  std::vector<std::uint16_t> blocked;  // [sample][run]: bits of receivers

  void reserve(std::size_t leaves, std::size_t samples);
  void clear_leaves();
  void add_leaf(const BlockerTree::Node& group, std::size_t child);
  /// Boxes that nothing meets up to full vectors; room for slopes.
  void pad_leaves();
};

/// Scratch of one thread, and what it counted.
struct ExactScratch {
  PictureLines lines;
  PlacedSamples places;
  SampleRows rows;                                    // of a cloud, as the cluster at work sees it
  std::vector<std::uint8_t> wanted;                   // sets of its receivers
  std::vector<std::uint32_t> stack, group;            // node stack; collected groups
  std::vector<float> low[3], high[3];                 // their boxes, light frame, padded to full vectors
  std::vector<std::pair<float, std::uint32_t>> keys;  // for sorting
  std::vector<std::uint32_t> old_group;               // what is being sorted
  std::vector<float> old_bound;
  std::vector<float> gain;                // [node] what a group hid of late from the receivers that met it, in samples
  std::vector<GroupView> groups;          // of those listed in `group`
  std::vector<std::uint32_t> own_places;  // BlockerTree::place of the receivers' own triangles
  NetEdges net_edges;
  std::vector<TurningTriangle> turning;
  // [triangle, kGroupSlots for none] of a group: receivers of the packet at work, as bits. From 16 on those that see it
  // from below, so that its outline is positive; from 0 on those that see it from above. All or none where a triangle
  // does not turn.
  std::vector<std::uint32_t> facing;
  BeamScratch beams;
  BeamChoice choice;
  KernelCounters counters;
  std::uint64_t leaves_listed = 0, leaves_tested = 0, clusters_lit = 0, clusters_by_sample = 0;
};

/// Solves receivers [begin, end), which should lie near each other, at most 256. All in front of the light (z > 0 in
/// its frame); samples must be in sample order.
void solve_cluster(const ExactScene& scene, std::size_t begin, std::size_t end, KernelReceivers& receivers,
                   ExactScratch& scratch);

}  // namespace halfshade
