// Where a scene comes from: an OBJ file with its view beside it, or a built-in scene.
#pragma once

#include <string>

#include "halfshade/light.h"
#include "halfshade/stream.h"
#include "rasterizer/io/obj_scene.h"

namespace halfshade {

struct SceneSource {
  Scene scene;
  View view;
  ObjLoadReport report;
  bool view_was_made_up = false;  // no view file: camera and light were fitted to the scene
};

/// `name` is "builtin:NAME", "builtin:NAME:SIZE" or a path; `view_file` overrides the view. Throws Error.
SceneSource load_scene(const std::string& name, const std::string& view_file, const ObjLoadOptions& options);

/// A camera that sees the box and a square light above it, for scenes that come without a view.
View fitted_view(const dvec3& low, const dvec3& high);

/// Gives the suns among the lights their place over the scene's box. load_scene does it by itself.
void place_suns(View& view, const dvec3& low, const dvec3& high);

/// The same scenes in pieces.
struct StreamSource {
  SceneStream stream;
  View view;
  ObjLoadReport report;
  bool needs_view = false;  // there is none: to be fitted to the scene's box
};
StreamSource open_stream(const std::string& name, const std::string& view_file, const ObjLoadOptions& options,
                         std::size_t triangles_per_piece);

/// XXH3-128 over geometry, uvs, materials and textures, as 32 hexadecimal digits.
std::string scene_hash(const Scene& scene);

}  // namespace halfshade
