// Hashes of what goes into a render: equal hashes on two machines mean that their masks belong together.
#pragma once

#include "halfshade/light.h"
#include "rasterizer/gbuffer.h"
#include "shadows/receivers.h"

namespace halfshade {

/// XXH3-128 as 32 hexadecimal digits.
std::string hash_of(std::string_view bytes);

/// Camera, and what the lights send; where their samples lie is in samples_hash.
std::string view_hash(const View& view);

/// Positions, sets and side of one light's samples, or of several frames of them.
std::string samples_hash(std::span<const LightSamples> frames);

/// Receivers [begin, end): positions, own triangles, sets, and places in the whole picture.
std::string receivers_hash(const GBuffer& gbuffer, const ReceiverArray& receivers, std::size_t begin, std::size_t end);

}  // namespace halfshade
