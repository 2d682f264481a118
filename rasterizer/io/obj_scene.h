// Wavefront OBJ + MTL + textures as a Scene.
#pragma once

#include <filesystem>

#include "halfshade/scene.h"

namespace halfshade {

struct ObjLoadOptions {
  bool lenient = false;         // skip wrong faces and count them, instead of refusing the file
  bool strict = false;          // a missing material library, material or texture is an error
  bool allow_any_path = false;  // libraries and textures may lie outside the OBJ's directory
  std::uint64_t max_file_bytes = std::uint64_t{2} << 30;     // of the OBJ and of each MTL
  std::uint64_t max_texture_bytes = std::uint64_t{1} << 30;  // of each decoded texture, and of all together
};

struct ObjLoadReport {
  std::vector<std::string> warnings;
  std::vector<std::string> missing;       // libraries, materials and textures that were not found
  std::uint64_t faces = 0;                // as written, before cutting into triangles
  std::uint64_t skipped_faces = 0;        // wrong ones, lenient only
  std::uint64_t crossed_faces = 0;        // polygons that cross themselves or have no area
  std::uint64_t zero_area_triangles = 0;  // kept in the scene
  std::uint64_t welded_vertices = 0;      // v lines whose position had appeared before
};

/// Faces are cut into triangles, bit-equal positions welded, groups ignored. Triangle order is the file's.
/// Fallbacks for what is missing: no library or unknown material -> the last material, "default"; no map_Kd file -> Kd;
/// no map_d file -> opaque; no map_Tf file -> Tf. map_d takes the alpha channel if the picture has one, else its
/// luminance. Throws Error{kBadInput} (message with file, line, value and allowed range) or Error{kLimit}.
Scene load_obj(const std::filesystem::path& file, const ObjLoadOptions& options, ObjLoadReport& report);

struct ObjGeometry;

/// Materials and textures alone: those that `used` names (material_names, libraries; triangle_materials has each
/// material that some triangle uses). Scene::triangle_materials of the result says what became of these.
Scene load_obj_materials(const std::filesystem::path& file, const ObjLoadOptions& options, ObjGeometry used,
                         ObjLoadReport& report);

}  // namespace halfshade
