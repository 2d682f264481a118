// An OBJ file in pieces. Triangles are never whole in memory; v, vt and vn lines are, as any face may use them: 28
// bytes per v line, 12 per vt, 16 per vn.
#pragma once

#include "halfshade/stream.h"
#include "rasterizer/io/obj_scene.h"

namespace halfshade {

/// Reads the file once: it is checked as load_obj does, and its materials and textures are loaded;
/// options.max_file_bytes limits only the materials. The triangles are those of load_obj, in their order; a piece is
/// what `chunk_bytes` of the file hold, whole lines. Throws as load_obj.
SceneStream stream_obj(const std::filesystem::path& file, const ObjLoadOptions& options, ObjLoadReport& report,
                       std::size_t chunk_bytes = std::size_t{4} << 20);

}  // namespace halfshade
