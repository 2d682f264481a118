// Scenes in pieces: built-in ones, and any scene that is in memory.
#pragma once

#include <memory>
#include <string_view>

#include "halfshade/light.h"
#include "halfshade/stream.h"

namespace halfshade {

struct StreamedScene {
  SceneStream stream;
  View view;
};

/// The pieces are runs of at most `triangles_per_piece` triangles.
SceneStream stream_of_scene(std::shared_ptr<const Scene> scene, std::size_t triangles_per_piece);

/// The same triangles in the same order as make_builtin_scene. `grass` is made piece by piece, of any size; the others
/// are made whole and handed out in pieces. Throws Error{kUsage}.
StreamedScene stream_builtin_scene(std::string_view name, std::uint32_t size, std::size_t triangles_per_piece);

}  // namespace halfshade
