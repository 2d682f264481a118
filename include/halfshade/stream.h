// Scenes that are never whole in memory: triangles come in pieces, as often as they are asked for.
//
// Method hpc needs no structure over the blockers, so its memory depends on the receivers and light samples only
// (Laine and Aila 2005). Blockers are sorted coarsely by area into files on disk (section 3.3) and read back in pieces.
#pragma once

#include <filesystem>

#include "halfshade/shadows.h"

namespace halfshade {

/// Triangles are numbered in the order in which they come; the same in every round.
struct SceneStream {
  Scene piece;  // materials and maps of the whole scene from the start; its geometry is that of the last piece
  /// Starts again with the first piece.
  std::function<void()> rewind;
  /// Replaces the geometry of `piece` (positions, triangles and all that belongs to triangles) by the next one and
  /// leaves materials and maps alone. False at the end. Throws Error. uvs and normals are empty in all pieces or in
  /// none.
  std::function<bool(Scene& piece)> next;
};

struct StreamOptions {
  std::filesystem::path directory;  // of the files, which have no names and vanish with the process; empty = system's
  std::uint64_t max_bytes = 0;      // receivers are split into parts so that the masks fit into this; 0 = one part
};

/// solve_shadows by method hpc for a scene that comes in pieces: the same masks. `config.method` counts for nothing.
/// The scene is read twice, its blockers once more per part of the receivers. Translucent triangles block nothing.
/// Throws Error{kUsage}, Error{kBadInput} as solve_shadows does, Error{kOutput} when a file cannot be written, and
/// what the stream throws.
HALFSHADE_API void solve_shadows(SceneStream& scene, std::span<const Receiver> receivers, const Light& light,
                                 const ShadowConfig& config, const StreamOptions& options, VisibilityMasks& masks,
                                 ShadowStats* stats = nullptr);

}  // namespace halfshade
