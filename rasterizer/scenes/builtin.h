// Built-in procedural scenes: `builtin:NAME` or `builtin:NAME:SIZE` on the command line.
#pragma once

#include <string>
#include <string_view>

#include "halfshade/light.h"
#include "halfshade/scene.h"

namespace halfshade {

struct BuiltinScene {
  Scene scene;
  View view;
};

struct BuiltinInfo {
  std::string_view name;          // "columns"
  std::string_view description;   // one line
  std::string_view size_meaning;  // what SIZE scales, with its default
};

std::span<const BuiltinInfo> builtin_scenes();

/// `size` 0 means the scene's default. The same (name, size) gives the same bits on every platform.
/// Throws Error{kUsage} for an unknown name (the message lists the known ones) or a size out of range.
BuiltinScene make_builtin_scene(std::string_view name, std::uint32_t size = 0);

}  // namespace halfshade
