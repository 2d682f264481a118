// The strict OBJ reader. Every index and number is checked against what came before it in the file.
//
// tinyobjloader reads only the materials. Its OBJ half was left out because it rounds coordinates wrongly (of 300,000
// printed doubles it got 51 % wrong in the last bits, and the masks are exact functions of those bits), accepts indices
// out of range, and counts a face's corners in 8 bits (version 2.0.0rc10).
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "halfshade/types.h"
#include "rasterizer/io/text_lines.h"

namespace halfshade {

struct ObjGeometry {
  std::vector<dvec3> positions;                         // bit-equal ones welded, in order of first appearance
  std::vector<std::array<std::uint32_t, 3>> triangles;  // [triangle] -> positions
  std::vector<std::uint32_t> triangle_materials;        // [triangle] -> material_names, or kNone
  std::vector<std::array<vec2, 3>> triangle_uvs;        // [triangle][corner], or empty
  std::vector<std::array<vec3, 3>> triangle_normals;    // [triangle][corner], unit or zero, or empty
  std::vector<std::string> material_names;              // as in usemtl, in order of first use
  std::vector<FileReference> libraries;                 // the rest of each mtllib line
  std::vector<std::string> warnings;
  std::uint64_t vertices = 0, faces = 0;  // as written
  std::uint64_t skipped_faces = 0, crossed_faces = 0, zero_area_triangles = 0;
};

/// `name` is the file in messages. With `lenient`, faces that are wrong or use a wrong v, vt or vn are skipped and
/// counted. Throws Error{kBadInput} with "name:line: what, value, allowed range".
ObjGeometry parse_obj(std::string_view text, const std::string& name, bool lenient);

/// The same for a text that comes in pieces of whole lines. What v, vt and vn lines hold stays in memory, as any face
/// may use it; triangles stay until they are dropped. Equal positions are not welded.
class ObjPieceParser {
 public:
  ObjPieceParser(const std::string& name, bool lenient);
  ~ObjPieceParser();
  /// Throws as parse_obj.
  void parse(std::string_view lines);
  /// After the last piece: totals and warnings.
  void finish();
  /// All positions so far; triangles since the last drop.
  ObjGeometry& geometry();
  void drop_triangles();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace halfshade
