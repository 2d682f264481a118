#include "rasterizer/io/obj_stream.h"

#include <algorithm>
#include <memory>

#include <fmt/format.h>

#include "halfshade/error.h"
#include "rasterizer/core/parallel.h"
#include "rasterizer/io/input_file.h"
#include "rasterizer/io/obj_parser.h"

namespace halfshade {
namespace {

/// A text file in chunks of whole lines; a line that ends in a backslash stays with the next.
class LineChunks {
 public:
  LineChunks(const std::filesystem::path& file, std::size_t chunk_bytes) : chunk_bytes_(chunk_bytes), file_(file) {}

  /// Valid until the next call. False at the end.
  bool next(std::string_view& lines) {
    text_.erase(0, used_);
    for (std::size_t cut = 0;;) {
      const std::size_t kept = text_.size();
      text_.resize(kept + chunk_bytes_);
      text_.resize(kept + file_.read(text_.data() + kept, chunk_bytes_));
      const bool at_end = text_.size() == kept;
      cut = at_end ? text_.size() : last_line_end();
      // A line longer than any that is allowed goes to the parser, which says so.
      if (cut == 0 && text_.size() > 2 * TextLines::kLongestLine) cut = text_.size();
      if (cut == 0 && !at_end) continue;
      used_ = cut;
      lines = std::string_view(text_).substr(0, cut);
      return cut != 0;
    }
  }

 private:
  /// Behind the last line that is certainly complete; 0 if there is none.
  std::size_t last_line_end() const {
    for (std::size_t i = text_.size(); i-- > 0;) {
      const bool ends = text_[i] == '\n' || (text_[i] == '\r' && i + 1 < text_.size() && text_[i + 1] != '\n');
      if (!ends) continue;
      const std::size_t last = i > 0 && text_[i] == '\n' && text_[i - 1] == '\r' ? i - 1 : i;
      if (last > 0 && text_[last - 1] == '\\') continue;
      return i + 1;
    }
    return 0;
  }

  std::size_t chunk_bytes_;
  RegularFile file_;
  std::string text_;
  std::size_t used_ = 0;
};

/// One reading of the file.
class Reading {
 public:
  Reading(const std::filesystem::path& file, std::size_t chunk_bytes, bool lenient)
      : chunks_(file, chunk_bytes), parser_(file.string(), lenient) {}

  /// The triangles of the next chunk that has any.
  bool next() {
    const FpEnvironment environment;
    parser_.drop_triangles();
    std::string_view lines;
    while (parser_.geometry().triangles.empty()) {
      if (!chunks_.next(lines)) return false;
      parser_.parse(lines);
    }
    return true;
  }
  ObjPieceParser& parser() { return parser_; }

 private:
  LineChunks chunks_;
  ObjPieceParser parser_;
};

/// What the first reading finds out.
struct ObjFacts {
  bool uvs = false, normals = false;
  dvec3 low{0.0}, high{0.0};               // of all v lines, used or not, as the local frame depends on them
  std::vector<std::uint32_t> material_of;  // [name as used; the last one stands for none] -> Scene::materials
};

template <class T>
void pad(std::vector<T>& values, bool wanted, std::size_t count) {
  if (wanted) values.resize(count, T{});
}

void move_piece(ObjGeometry& from, const ObjFacts& facts, Scene& piece) {
  const std::size_t count = from.triangles.size();
  piece.triangles = std::move(from.triangles);
  piece.triangle_uvs = std::move(from.triangle_uvs);
  piece.triangle_normals = std::move(from.triangle_normals);
  pad(piece.triangle_uvs, facts.uvs, count);
  pad(piece.triangle_normals, facts.normals, count);
  piece.triangle_materials.clear();
  for (const std::uint32_t m : from.triangle_materials) {
    piece.triangle_materials.push_back(facts.material_of[m == kNone ? facts.material_of.size() - 1 : m]);
  }
  std::vector<std::uint32_t> used;
  for (const auto& t : piece.triangles) used.insert(used.end(), t.begin(), t.end());
  std::sort(used.begin(), used.end());
  used.erase(std::unique(used.begin(), used.end()), used.end());
  piece.positions.clear();
  for (const std::uint32_t p : used) piece.positions.push_back(from.positions[p]);
  piece.positions.insert(piece.positions.end(), {facts.low, facts.high});
  for (auto& t : piece.triangles) {
    for (std::uint32_t& corner : t) {
      corner = static_cast<std::uint32_t>(std::lower_bound(used.begin(), used.end(), corner) - used.begin());
    }
  }
}

/// Which materials are used, by name number; the last entry stands for triangles without one.
std::vector<bool> read_all(Reading& reading, const std::filesystem::path& file, ObjFacts& facts) {
  ObjGeometry& g = reading.parser().geometry();
  std::vector<bool> used(1, false);
  bool any = false;
  while (reading.next()) {
    any = true;
    facts.uvs = facts.uvs || !g.triangle_uvs.empty();
    facts.normals = facts.normals || !g.triangle_normals.empty();
    used.resize(std::max(used.size(), g.material_names.size() + 1), false);
    for (const std::uint32_t m : g.triangle_materials) used[m == kNone ? 0 : m + 1] = true;
  }
  reading.parser().finish();
  if (!any) {
    throw Error(ErrorCode::kBadInput, fmt::format("{}: no geometry: {} vertices, {} faces, {} of them skipped",
                                                  file.string(), g.vertices, g.faces, g.skipped_faces));
  }
  facts.low = facts.high = g.positions[0];
  for (const dvec3& p : g.positions) facts.low = glm::min(facts.low, p), facts.high = glm::max(facts.high, p);
  used.resize(g.material_names.size() + 1, false);
  std::rotate(used.begin(), used.begin() + 1, used.end());
  return used;
}

}  // namespace

SceneStream stream_obj(const std::filesystem::path& file, const ObjLoadOptions& options, ObjLoadReport& report,
                       std::size_t chunk_bytes) {
  auto facts = std::make_shared<ObjFacts>();
  SceneStream stream;
  {
    Reading reading(file, chunk_bytes, options.lenient);
    const std::vector<bool> used = read_all(reading, file, *facts);
    ObjGeometry names = std::move(reading.parser().geometry());
    names.triangles.clear(), names.triangle_materials.clear();
    for (std::uint32_t m = 0; m < used.size(); ++m) {
      if (used[m]) names.triangle_materials.push_back(m + 1 == used.size() ? kNone : m);
    }
    stream.piece = load_obj_materials(file, options, std::move(names), report);
    facts->material_of.assign(used.size(), 0);
    std::size_t k = 0;
    for (std::uint32_t m = 0; m < used.size(); ++m) {
      if (used[m]) facts->material_of[m] = stream.piece.triangle_materials[k++];
    }
    stream.piece.positions = {};
    stream.piece.triangle_materials = {};
  }
  auto reading = std::make_shared<std::unique_ptr<Reading>>();
  stream.rewind = [=] { *reading = std::make_unique<Reading>(file, chunk_bytes, options.lenient); };
  stream.next = [=](Scene& piece) {
    if (*reading == nullptr || !(*reading)->next()) {
      reading->reset();
      return false;
    }
    move_piece((*reading)->parser().geometry(), *facts, piece);
    return true;
  };
  return stream;
}

}  // namespace halfshade
