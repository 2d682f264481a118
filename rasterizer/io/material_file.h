// MTL files: checked line by line, then read by tinyobjloader.
#pragma once

#include <string>
#include <string_view>

#include "halfshade/scene.h"
#include "rasterizer/io/text_lines.h"

namespace halfshade {

struct MtlMaterial {
  Material material;                                  // maps not set yet
  FileReference color_file, alpha_file, filter_file;  // map_Kd, map_d and map_Tf
};

/// Materials in file order. Numbers must be finite and in range; unknown keywords are ignored; texture options that
/// change the picture are reported in `warnings` and have no effect. A material with map_Tf and neither d nor Tr has
/// opacity 0: the map says what passes.
/// Throws Error{kBadInput} with "name:line: what, value, allowed range"; with `lenient` such lines become warnings.
std::vector<MtlMaterial> parse_mtl(std::string_view text, const std::string& name, bool lenient,
                                   std::vector<std::string>& warnings);

}  // namespace halfshade
