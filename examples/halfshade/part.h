// A part of a render: the masks of some rows of the picture, of some light samples, or of what some of the blockers
// hide; or the counts of some frames. Parts that fill the whole merge to what one run gives, bit by bit (docs/farm.md).
//
// On disk a part is a directory with `part.json`, the manifest, written last, and one file per light that it names.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace halfshade {

enum class PartSplit { kCrop, kFrames, kSamples, kBlockers };

/// Half-open, of what the split divides: rows of pixels, frames, samples of a light, triangles.
struct PartRange {
  std::uint64_t begin = 0, end = 0;

  std::uint64_t size() const { return end - begin; }
  bool operator==(const PartRange&) const = default;
};

/// What a part holds of one light.
struct PartLight {
  std::string name, file;       // `file` in the part's directory
  PartRange range, whole;       // of all parts together
  std::string samples_hash;     // of all samples of the light
  std::string receivers_hash;   // of the receivers that `file` has masks of; empty for frames
  std::string content_hash;     // mask hash, or hash of the counts
  std::uint64_t receivers = 0;  // masks in `file`
  std::uint32_t samples = 0;    // bits per mask
  double shadow_ms = 0.0;
};

struct Part {
  std::filesystem::path directory;  // not in the manifest
  PartSplit split = PartSplit::kCrop;
  std::string version, scene, view;    // program; scene and view file as they were named
  std::vector<std::string> arguments;  // options that decide the result, as on the command line
  std::string scene_hash, view_hash;
  bool jitter_camera = false;  // frames
  std::vector<PartLight> lights;
};

/// "crop", "frames", "samples", "blockers"; throws Error{kUsage} listing the names.
PartSplit part_split_from_name(const std::string& name);
const char* name_of(PartSplit split);

/// "2/4": the second of four. Throws Error{kUsage}.
struct PartNumber {
  std::uint32_t index = 0, count = 1;  // index from 0
};
PartNumber parse_part_number(const std::string& text);
/// The share of `whole` in units of `unit`, which divides its size; parts differ by one unit at most.
PartRange share_of(const PartRange& whole, PartNumber number, std::uint64_t unit = 1);

/// Removes an older manifest, so that the part is incomplete until write_manifest. Throws Error{kOutput}.
void begin_part(const std::filesystem::path& directory);
/// Atomic. Throws Error{kOutput}.
void write_manifest(const Part& part);
/// Throws Error{kBadInput} naming the manifest and the member that is missing or wrong.
Part read_manifest(const std::filesystem::path& directory);

/// Throws Error{kBadInput} unless both come from the same render: program, scene, view, options, light samples.
void require_same_render(const Part& a, const Part& b);
/// Throws Error{kBadInput} naming the first gap or overlap, unless the parts fill the whole of every light. They must
/// come from the same render.
void require_complete(std::span<const Part> parts);
/// What of `whole` no part holds, in order. Throws Error{kBadInput} for overlaps.
std::vector<PartRange> gaps_of(std::span<const Part> parts, std::size_t light, const PartRange& whole);

}  // namespace halfshade
