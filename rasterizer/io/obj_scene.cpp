#include "rasterizer/io/obj_scene.h"

#include <algorithm>
#include <unordered_map>
#include <unordered_set>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "halfshade/error.h"
#include "rasterizer/core/parallel.h"
#include "rasterizer/io/input_file.h"
#include "rasterizer/io/material_file.h"
#include "rasterizer/io/obj_parser.h"
#include "rasterizer/io/texture.h"

namespace halfshade {
namespace {

namespace fs = std::filesystem;

class ObjLoader {
 public:
  ObjLoader(const fs::path& file, const ObjLoadOptions& options, ObjLoadReport& report)
      : file_(file), options_(options), report_(report), root_(file.parent_path(), options.allow_any_path) {}

  Scene run(ObjGeometry geometry) {
    scene_.name = file_.stem().string();
    for (const FileReference& line : geometry.libraries) load_libraries(line);
    assign_materials(geometry);
    report_missing();
    textures_.load(scene_, options_.max_texture_bytes);
    bind_textures();
    scene_.positions = std::move(geometry.positions);
    scene_.triangles = std::move(geometry.triangles);
    scene_.triangle_uvs = std::move(geometry.triangle_uvs);
    scene_.triangle_normals = std::move(geometry.triangle_normals);
    return std::move(scene_);
  }

 private:
  struct MaterialMaps {
    std::uint32_t color = kNone, alpha = kNone, filter = kNone;  // requests to textures_
  };

  // What `reference`, on a line of `named_by`, stands for; kind is the keyword, for messages.
  fs::path resolve(const fs::path& named_by, const FileReference& reference, const char* kind) const {
    try {
      return root_.resolve(named_by.parent_path(), reference.name);
    } catch (const Error& error) {
      throw Error(error.code(), fmt::format("{}:{}: {} {}", named_by.string(), reference.line, kind, error.what()));
    }
  }

  // A file that is there but cannot be read is not missing: reading it gives the error.
  static bool is_missing(const fs::path& path) {
    std::error_code ignored;
    return fs::status(path, ignored).type() == fs::file_type::not_found;
  }

  // The line names one file that may hold blanks, or several files.
  void load_libraries(const FileReference& line) {
    const std::string& names = line.name;
    if (names.find_first_of(" \t") == std::string::npos || !is_missing(resolve(file_, line, "mtllib"))) {
      return load_library(line);
    }
    for (std::size_t begin = 0; begin != std::string::npos;) {
      const std::size_t end = names.find_first_of(" \t", begin);
      load_library({names.substr(begin, end - begin), line.line});
      begin = names.find_first_not_of(" \t", end);
    }
  }

  void load_library(const FileReference& reference) {
    const fs::path path = resolve(file_, reference, "mtllib");
    if (is_missing(path)) return add_missing("mtllib", reference.name);
    if (std::find(libraries_.begin(), libraries_.end(), path) != libraries_.end()) return;
    libraries_.push_back(path);
    const std::string text = read_regular_file(path, options_.max_file_bytes);
    for (MtlMaterial& entry : parse_mtl(text, path.string(), options_.lenient, report_.warnings)) {
      add_material(std::move(entry), path);
    }
  }

  void add_material(MtlMaterial entry, const fs::path& library) {
    const auto number = static_cast<std::uint32_t>(scene_.materials.size());
    if (!material_numbers_.try_emplace(entry.material.name, number).second) {
      report_.warnings.push_back(
          fmt::format("material {} is defined twice, the first counts", in_quotes(entry.material.name)));
      return;
    }
    scene_.materials.push_back(std::move(entry.material));
    const std::uint32_t color = request_texture(library, entry.color_file, TextureKind::kColor, "map_Kd");
    const std::uint32_t alpha = request_texture(library, entry.alpha_file, TextureKind::kAlpha, "map_d");
    maps_.push_back({color, alpha, request_texture(library, entry.filter_file, TextureKind::kColor, "map_Tf")});
  }

  std::uint32_t request_texture(const fs::path& library, const FileReference& reference, TextureKind kind,
                                const char* keyword) {
    if (reference.name.empty()) return kNone;
    const fs::path path = resolve(library, reference, keyword);
    if (!is_missing(path)) return textures_.request(path, kind);
    add_missing(keyword, reference.name);
    return kNone;
  }

  void assign_materials(const ObjGeometry& geometry) {
    std::vector<std::uint32_t> numbers;
    for (const std::string& name : geometry.material_names) {
      const auto found = material_numbers_.find(name);
      if (found == material_numbers_.end()) add_missing("material", name);
      numbers.push_back(found == material_numbers_.end() ? kNone : found->second);
    }
    const auto fallback = static_cast<std::uint32_t>(scene_.materials.size());
    bool uses_fallback = false;
    scene_.triangle_materials.reserve(geometry.triangle_materials.size());
    for (const std::uint32_t used : geometry.triangle_materials) {
      const std::uint32_t number = used == kNone ? kNone : numbers[used];
      uses_fallback = uses_fallback || number == kNone;
      scene_.triangle_materials.push_back(number == kNone ? fallback : number);
    }
    if (!uses_fallback) return;
    scene_.materials.emplace_back().name = "default";
    maps_.emplace_back();
  }

  void bind_textures() {
    for (std::size_t i = 0; i < scene_.materials.size(); ++i) {
      if (maps_[i].color != kNone) scene_.materials[i].color_map = textures_.color_map(maps_[i].color);
      if (maps_[i].alpha != kNone) scene_.materials[i].alpha_map = textures_.alpha_map(maps_[i].alpha);
      if (maps_[i].filter != kNone) scene_.materials[i].transmittance_map = textures_.color_map(maps_[i].filter);
    }
  }

  void add_missing(const char* kind, const std::string& name) {
    std::string what = fmt::format("{} {}", kind, in_quotes(name));
    if (known_missing_.insert(what).second) report_.missing.push_back(std::move(what));
  }

  void report_missing() {
    if (report_.missing.empty()) return;
    const std::string message = fmt::format("{}: not found: {}", file_.string(), fmt::join(report_.missing, ", "));
    if (options_.strict) throw Error(ErrorCode::kBadInput, message);
    report_.warnings.push_back(message);
  }

  const fs::path& file_;
  const ObjLoadOptions& options_;
  ObjLoadReport& report_;
  AssetRoot root_;
  Scene scene_;
  TextureSet textures_;
  std::vector<fs::path> libraries_;
  std::vector<MaterialMaps> maps_;  // [material]
  std::unordered_map<std::string, std::uint32_t> material_numbers_;
  std::unordered_set<std::string> known_missing_;  // what report_.missing has
};

void fill_report(ObjGeometry& geometry, ObjLoadReport& report) {
  report = {};
  report.warnings = std::move(geometry.warnings);
  report.faces = geometry.faces;
  report.skipped_faces = geometry.skipped_faces;
  report.crossed_faces = geometry.crossed_faces;
  report.zero_area_triangles = geometry.zero_area_triangles;
  report.welded_vertices = geometry.vertices - geometry.positions.size();
  const auto warn = [&](std::uint64_t count, const char* what) {
    if (count != 0) report.warnings.push_back(fmt::format("{} {}", count, what));
  };
  warn(geometry.skipped_faces, "wrong faces skipped");
  warn(geometry.crossed_faces, "polygons cross themselves or have no area");
}

ObjGeometry read_geometry(const fs::path& file, const ObjLoadOptions& options) {
  const std::string text = read_regular_file(file, options.max_file_bytes);
  return parse_obj(text, file.string(), options.lenient);
}

}  // namespace

Scene load_obj(const fs::path& file, const ObjLoadOptions& options, ObjLoadReport& report) {
  const FpEnvironment environment;
  ObjGeometry geometry = read_geometry(file, options);
  fill_report(geometry, report);
  if (geometry.triangles.empty()) {
    throw Error(ErrorCode::kBadInput,
                fmt::format("{}: no geometry: {} vertices, {} faces, {} of them skipped", file.string(),
                            geometry.vertices, geometry.faces, geometry.skipped_faces));
  }
  return ObjLoader(file, options, report).run(std::move(geometry));
}

Scene load_obj_materials(const fs::path& file, const ObjLoadOptions& options, ObjGeometry used, ObjLoadReport& report) {
  const FpEnvironment environment;
  fill_report(used, report);
  return ObjLoader(file, options, report).run(std::move(used));
}

}  // namespace halfshade
