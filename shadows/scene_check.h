// Scenes and receivers as a caller hands them over: every index and number that later code relies on.
#pragma once

#include "halfshade/shadows.h"

namespace halfshade {

/// Throws Error{kBadInput} naming the first position that is not finite, index out of range, array of the wrong length,
/// texture coordinate outside +-2^30 or map without pixels. Reads everything once.
void check_scene(const Scene& scene);

/// Own triangles are kNone or in the scene. Throws Error{kBadInput} naming the receiver.
void check_own_triangles(std::span<const Receiver> receivers, std::size_t triangles);

}  // namespace halfshade
