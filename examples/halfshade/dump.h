// Dumps: everything that is needed to check every mask bit with a program of one's own (docs/files.md).
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>

#include "rasterizer/core/mesh.h"
#include "shadows/receivers.h"

namespace halfshade {

/// What `halfshade relight` needs beyond masks: the picture is `rest` plus the sum over receivers of response times
/// weighted visibility.
struct DumpLighting {
  PixelWindow window;          // pixels that were rendered
  std::vector<vec3> rest;      // [window pixel] linear RGB without this light
  std::vector<vec3> response;  // [receiver] what its pixel gains per unit of visible emission
};

/// Writes receivers, light samples, triangles, masks and dump.json into `directory`, which is created. Translucent
/// triangles are written without area: they block nothing, and the masks do not know them.
/// `receiver_pixels` is y * width + x of each receiver's pixel. `about` goes into dump.json as it is.
void write_dump(const std::filesystem::path& directory, const LatticeMesh& mesh, const ReceiverArray& receivers,
                const std::vector<std::uint32_t>& receiver_pixels, const LightSamples& samples,
                const VisibilityMasks& masks, const DumpLighting& lighting, nlohmann::ordered_json about);

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

/// The arrays for relighting of a dump that read_dump has read; fills dump.samples.st. Throws Error{kBadInput}, also
/// for dumps of lights without (s, t).
DumpLighting read_lighting(const std::filesystem::path& directory, Dump& dump);

}  // namespace halfshade
