// Colour and opacity textures of a scene: every file is decoded once, however often it is used.
#pragma once

#include <filesystem>
#include <map>

#include "halfshade/scene.h"

namespace halfshade {

enum class TextureKind { kColor, kAlpha };

/// Collects what a scene needs, then loads it.
class TextureSet {
 public:
  /// `file` must be canonical. The result stands for the file in color_map() and alpha_map().
  std::uint32_t request(const std::filesystem::path& file, TextureKind kind);

  /// Appends the requested maps to the scene in order of first request. Throws Error{kBadInput} for a file that cannot
  /// be decoded completely, Error{kLimit} when one decoded picture, or all maps together, would exceed `max_bytes`.
  void load(Scene& scene, std::uint64_t max_bytes);

  /// After load(): index into Scene::color_maps, Scene::alpha_maps. The alpha map of a picture without an alpha channel
  /// is its luminance.
  std::uint32_t color_map(std::uint32_t request) const { return files_[request].color_map; }
  std::uint32_t alpha_map(std::uint32_t request) const { return files_[request].alpha_map; }

 private:
  struct File {
    std::filesystem::path path;
    bool wants_color = false, wants_alpha = false;
    std::uint32_t color_map = kNone, alpha_map = kNone;
  };
  std::vector<File> files_;
  std::map<std::filesystem::path, std::uint32_t> numbers_;
};

}  // namespace halfshade
