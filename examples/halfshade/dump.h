// Dumps: everything that is needed to check every mask bit with a program of one's own (docs/files.md).
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>

#include "rasterizer/core/mesh.h"
#include "shadows/receivers.h"

namespace halfshade {

/// Writes receivers, light samples, triangles, masks and dump.json into `directory`, which is created.
/// `receiver_pixels` is y * width + x of each receiver's pixel. `about` goes into dump.json as it is.
void write_dump(const std::filesystem::path& directory, const LatticeMesh& mesh, const ReceiverArray& receivers,
                const std::vector<std::uint32_t>& receiver_pixels, const LightSamples& samples,
                const VisibilityMasks& masks, nlohmann::ordered_json about);

/// A dump read back. `mesh.scene` points to `scene`, so a Dump is not copied.
struct Dump {
  Scene scene;
  LatticeMesh mesh;
  ReceiverArray receivers;
  LightSamples samples;
  VisibilityMasks masks;
  nlohmann::ordered_json about;
  Dump() = default;
  Dump(const Dump&) = delete;
  Dump& operator=(const Dump&) = delete;
};

/// Throws Error{kBadInput} naming the array whose shape, type or values are wrong.
void read_dump(const std::filesystem::path& directory, Dump& dump);

}  // namespace halfshade
