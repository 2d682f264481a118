// Hot loop of the soft textured shadow volumes: volumes against tiles of receivers, and the light samples of every
// receiver inside one (Forest, Barthe, Paulin 2009, algorithm 1).
//
// Blocks of tiles list the volumes that their box meets, tiles shorten the list, receivers take the test of the four
// planes, 16 at a time or as many as the instruction set has lanes. All of these are conservative. What is left are
// pairs of a triangle and a receiver, whose samples are projected onto the triangle (sample_projection.h), lanes again:
// inside the outline? which texel? Where float cannot tell for certain the exact predicate and the exact texel decide,
// so the bits are those of every other exact method.
#pragma once

#include "shadows/receiver_tiles.h"
#include "shadows/sample_projection.h"

namespace halfshade {

/// A triangle that casts through volumes, ready for projection.
struct VolumeBlocker {
  Blocker blocker;
  AlphaTriangle alpha;
  CornerTexels texels;
  const OpacityBits* opacity = nullptr;  // null: opaque
};

/// Volumes as arrays of lanes, padded with volumes that no box meets.
struct VolumeLanes {
  static constexpr std::size_t kPadding = 64;
  std::array<std::vector<float>, 3> low, high;           // box, rounded outwards
  std::array<std::vector<float>, 4> nx, ny, nz, offset;  // planes: inside is n . p >= offset
  std::vector<std::int8_t> light_side;                   // SoftShadowVolume::light_side
  std::vector<std::uint32_t> blocker;                    // [volume] -> VolumeBlocker

  void add(const SoftShadowVolume& volume, std::uint32_t blocker_index);
  void pad();  // once, after the last one
  std::size_t size() const { return blocker.size(); }
};

/// What happens to the samples that a triangle hides from a receiver.
class VolumeSink {
 public:
  virtual ~VolumeSink() = default;
  /// Bit i stands for sample first + i of the kernel's order. Called once per crossing: a segment through an edge that
  /// two triangles share is reported for one of them (crossing.h). `place` is the receiver's in the order of the tiles.
  virtual void add(const VolumeBlocker& blocker, std::size_t place, const SampleProjection& projection,
                   std::size_t first, std::uint64_t bits) = 0;
};

struct VolumeScene {
  std::span<const VolumeBlocker> blockers;
  const VolumeLanes* volumes = nullptr;
  const KernelSamples* samples = nullptr;
  const ReceiverTiles* tiles = nullptr;
  bool use_textures = true;  // false: report crossings whatever the texture says
};

/// Scratch of one task, and what it counted.
struct VolumeScratch {
  std::vector<std::uint32_t> of_block, of_tile;
  KernelCounters counters;
  std::uint64_t volumes_listed = 0, receivers_tested = 0;
};

/// All volumes against block `block` of the tiles. Without a sink blocked samples are marked in the receivers' masks;
/// with one every crossing is handed to it instead, in the order of the blockers, and the masks stay as they are.
void solve_volume_block(const VolumeScene& scene, std::size_t block, KernelReceivers& receivers, VolumeSink* sink,
                        VolumeScratch& scratch);

}  // namespace halfshade
