// Blockers that come in pieces: what has to be known of them beforehand, and the bucket files they are sorted into
// (Laine and Aila 2005, section 3.3, "coarse blocker sorting": linear time, out of core).
#pragma once

#include <cstdio>
#include <filesystem>
#include <memory>

#include "halfshade/stream.h"
#include "shadows/blocker_buckets.h"
#include "shadows/receivers.h"

namespace halfshade {

/// One round through a stream: box, number of triangles, areas.
struct StreamScan {
  dvec3 low{0.0}, high{0.0};
  std::uint64_t triangles = 0, translucent = 0, largest_piece = 0;
  std::vector<std::uint64_t> areas;  // [exponent + 2200] of AreaBuckets::size_of in world units

  /// The frame that make_local_frame gives for all positions and `extra`.
  LocalFrame frame(std::span<const dvec3> extra) const;
  /// Histogram of the areas in that frame. `buckets` 0 is one bucket.
  AreaBuckets buckets(const LocalFrame& frame, std::uint32_t buckets) const;
};

/// Throws Error{kBadInput} for an empty scene or a position that is not finite, Error{kLimit} beyond 2^32 - 1
/// triangles.
StreamScan scan_stream(SceneStream& stream);

/// Bucket files: opaque blockers by area, then alpha-tested ones by area. Files are unlinked as soon as they are open.
class BlockerFiles {
 public:
  /// Throws Error{kOutput} when no file can be made in `directory` (empty = the system's for temporary files).
  BlockerFiles(const std::filesystem::path& directory, const AreaBuckets& areas, std::uint32_t buckets);

  /// Sorts in the triangles of a piece that block light; `first` is the number of its first one.
  void add(const LatticeMesh& piece, std::uint32_t first);
  /// take(mesh, numbers): all blockers in pieces, largest areas first. `scene` has the materials and maps; its geometry
  /// is overwritten.
  void read(Scene& scene,
            const std::function<void(const LatticeMesh& mesh, std::span<const std::uint32_t> numbers)>& take);

  std::uint64_t bytes() const { return bytes_; }
  std::uint64_t blockers() const { return blockers_; }

  static constexpr std::size_t kPerPiece = 65536;  // blockers read at once

 private:
  struct Close {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  using File = std::unique_ptr<std::FILE, Close>;

  std::FILE* file(std::size_t index);

  std::filesystem::path directory_;
  AreaBuckets areas_;
  std::uint32_t buckets_;
  std::vector<File> files_;  // [alpha-tested][bucket]; null = empty
  std::uint64_t bytes_ = 0, blockers_ = 0;
};

/// Masks of `receivers` in parts of about equal size: take(first, masks) for receivers first, first + 1 ...
/// Stats add up. Progress is config.progress.
void cast_from_files(BlockerFiles& files, Scene& scene, const ReceiverArray& receivers, const Light& light,
                     const LightSamples& samples, const ShadowConfig& config, std::size_t parts,
                     const std::function<void(std::size_t first, const VisibilityMasks& masks)>& take,
                     ShadowStats& stats);

/// Upper bound of the bytes per receiver that cast_from_files needs for the part it works on: receiver arrays,
/// hierarchy and masks, these twice, as working copy and as result.
double most_bytes_per_receiver(std::uint32_t samples);

/// Parts so that receivers * most_bytes_per_receiver / parts <= max_bytes; 1 for max_bytes 0.
std::size_t parts_for(std::size_t receivers, std::uint32_t samples, std::uint64_t max_bytes);

}  // namespace halfshade
