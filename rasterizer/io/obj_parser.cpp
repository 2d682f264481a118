#include "rasterizer/io/obj_parser.h"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <unordered_map>

#include <fmt/format.h>

#include "rasterizer/io/input_file.h"
#include "rasterizer/io/triangulate.h"

namespace halfshade {
namespace {

constexpr std::size_t kMostCorners = 65535;  // of one face
constexpr std::size_t kMostWarnings = 20;    // of one kind that are spelled out
constexpr double kLargest = 0x1.fffffep127;  // largest float: keeps every later product finite
constexpr double kLargestUv = 0x1p30;        // with a grid of 2^-32, texel arithmetic stays exact

// Positions by value: open addressing, as a map of nodes would cost more than all the parsing.
class PositionTable {
 public:
  PositionTable(std::vector<dvec3>& positions, bool weld) : positions_(positions), weld_(weld), slots_(1024, kNone) {}

  std::uint32_t insert(const dvec3& p) {
    if (!weld_) {
      positions_.push_back(p);
      return static_cast<std::uint32_t>(positions_.size() - 1);
    }
    if (positions_.size() * 2 > slots_.size()) grow();
    std::uint32_t& slot = slots_[find(p)];
    if (slot == kNone) {
      slot = static_cast<std::uint32_t>(positions_.size());
      positions_.push_back(p);
    }
    return slot;
  }

 private:
  static std::uint64_t hash(const dvec3& p) {
    std::uint64_t h = 0;
    for (int axis = 0; axis < 3; ++axis) {
      h = (h ^ std::bit_cast<std::uint64_t>(p[axis])) * 0x9e3779b97f4a7c15ull;
      h ^= h >> 29;
    }
    return h;
  }

  std::size_t find(const dvec3& p) const {
    const std::size_t mask = slots_.size() - 1;
    std::size_t i = hash(p) & mask;
    while (slots_[i] != kNone && positions_[slots_[i]] != p) i = (i + 1) & mask;
    return i;
  }

  void grow() {
    slots_.assign(slots_.size() * 2, kNone);
    for (std::uint32_t k = 0; k < positions_.size(); ++k) slots_[find(positions_[k])] = k;
  }

  std::vector<dvec3>& positions_;
  bool weld_;
  std::vector<std::uint32_t> slots_;  // power of two
};

// A coordinate as a float on the grid of 2^-32. Floats from 2^-9 up lie on it by themselves.
float snap_uv(double x) {
  if (std::fabs(x) >= 0x1p-9) return static_cast<float>(x);
  return static_cast<float>(std::nearbyint(x * 0x1p32) * 0x1p-32) + 0.0f;
}

vec3 unit_or_zero(dvec3 n) {
  const double size = std::max({std::fabs(n.x), std::fabs(n.y), std::fabs(n.z)});
  if (size == 0.0) return vec3(0.0f);
  n /= size;  // first, as squares of very small or large components would not stay in range
  return vec3(n / std::sqrt(glm::dot(n, n)));
}

class ObjParser {
 public:
  ObjParser(std::string_view text, const std::string& name, bool lenient, bool weld = true)
      : name_(name), lines_(text, name), lenient_(lenient), table_(out_.positions, weld) {}

  ObjGeometry run() {
    parse_lines();
    finish();
    return std::move(out_);
  }

  void parse_piece(std::string_view text) {
    lines_ = TextLines(text, name_, lines_.lines_read());
    parse_lines();
  }

  void finish() {
    out_.vertices = position_of_.size();
    const auto more = [&](std::uint64_t count, const char* what) {
      if (count > kMostWarnings)
        out_.warnings.push_back(fmt::format("{} more lines with {}", count - kMostWarnings, what));
    };
    more(tolerated_, "errors");
    more(unknown_, "unknown keywords");
  }

  ObjGeometry& geometry() { return out_; }

 private:
  void parse_lines() {
    std::string_view line;
    while (lines_.next(line)) parse_line(line);
  }

  struct Corner {
    std::uint32_t position, uv, normal;
  };

  void parse_line(std::string_view line) {
    Tokens tokens(line);
    const std::string_view keyword = tokens.next();
    if (keyword.empty()) return;
    if (keyword == "v") return parse_attribute(position_of_, tokens, 3, 8, [&] { return read_position(); });
    if (keyword == "vt") return parse_attribute(uvs_, tokens, 1, 3, [&] { return read_uv(); });
    if (keyword == "vn") return parse_attribute(normals_, tokens, 3, 3, [&] { return read_normal(); });
    if (keyword == "f" || keyword == "fo") return parse_face(tokens);
    if (keyword == "usemtl") return use_material(tokens.rest());
    if (keyword == "mtllib") return add_library(tokens.rest());
    if (!is_ignored(keyword)) note(unknown_, lines_.error("unknown keyword " + in_quotes(keyword) + " ignored").what());
  }

  // Grouping, smoothing, points, lines and free-form surfaces: legal, and of no use here.
  static bool is_ignored(std::string_view keyword) {
    for (const std::string_view known :
         {"g",     "o",        "s",        "mg",         "p",         "l",      "vp",     "lod",
          "bevel", "c_interp", "d_interp", "shadow_obj", "trace_obj", "usemap", "maplib", "cstype",
          "deg",   "bmat",     "step",     "curv",       "curv2",     "surf",   "parm",   "trim",
          "hole",  "scrv",     "sp",       "end",        "con",       "ctech",  "stech"}) {
      if (keyword == known) return true;
    }
    return false;
  }

  // Reads the numbers of a v, vt or vn line into numbers_, then appends read(). A wrong line of a lenient reading keeps
  // its place in the count, marked by the attribute's own "invalid".
  template <class Value, class Read>
  void parse_attribute(std::vector<Value>& values, Tokens& tokens, std::size_t least, std::size_t most,
                       const Read& read) {
    try {
      read_numbers(tokens, least, most);
      values.push_back(read());
    } catch (const Error& error) {
      tolerate(error);
      values.push_back(Value{});
    }
  }

  void read_numbers(Tokens& tokens, std::size_t least, std::size_t most) {
    number_count_ = 0;
    for (std::string_view token = tokens.next(); !token.empty(); token = tokens.next()) {
      if (number_count_ == most)
        throw lines_.error(fmt::format("more than {} numbers, from {} on", most, in_quotes(token)));
      double& x = numbers_[number_count_++];
      const NumberFault fault = parse_number(token, x);
      if (fault != NumberFault::kOk || std::fabs(x) > kLargest) {
        throw lines_.error(fmt::format("coordinate {} {}, allowed -3.4028235e38..3.4028235e38", in_quotes(token),
                                       describe(fault == NumberFault::kOk ? NumberFault::kTooLarge : fault)));
      }
      x += 0.0;  // -0 becomes +0, so that equal positions have equal bits
    }
    if (number_count_ < least) {
      throw lines_.error(fmt::format("{} numbers, allowed {}..{}", number_count_, least, most));
    }
  }

  // Extra numbers (weight, colour) have been checked and are not used. 1 + index, so that 0 stays "invalid".
  std::uint32_t read_position() { return 1 + table_.insert({numbers_[0], numbers_[1], numbers_[2]}); }

  struct Uv {
    vec2 value{0.0f};
    bool valid = false;
  };
  Uv read_uv() const {
    const double u = numbers_[0], v = number_count_ > 1 ? numbers_[1] : 0.0;
    for (const double x : {u, v}) {
      if (std::fabs(x) > kLargestUv) {
        throw lines_.error(fmt::format("texture coordinate {} is out of range, allowed -2^30..2^30", x));
      }
    }
    return {vec2(snap_uv(u), snap_uv(v)), true};
  }

  struct Normal {
    vec3 value{0.0f};
    bool valid = false;
  };
  Normal read_normal() const { return {unit_or_zero({numbers_[0], numbers_[1], numbers_[2]}), true}; }

  void parse_face(Tokens& tokens) {
    ++out_.faces;
    try {
      corners_.clear();
      for (std::string_view token = tokens.next(); !token.empty(); token = tokens.next()) {
        if (corners_.size() == kMostCorners)
          throw lines_.error(fmt::format("face with more than {} corners", kMostCorners));
        corners_.push_back(parse_corner(token));
      }
      if (corners_.size() < 3) {
        throw lines_.error(fmt::format("face with {} corners, allowed 3..{}", corners_.size(), kMostCorners));
      }
    } catch (const Error& error) {
      tolerate(error);
      ++out_.skipped_faces;
      return;
    }
    add_face();
  }

  // v, v/vt, v//vn or v/vt/vn
  Corner parse_corner(std::string_view token) const {
    std::array<std::string_view, 3> parts;
    std::string_view rest = token;
    std::size_t count = 0;
    for (bool more = true; more; ++count) {
      if (count == 3) throw lines_.error("face corner " + in_quotes(token) + " has more than 3 indices");
      const std::size_t slash = rest.find('/');
      more = slash != std::string_view::npos;
      parts[count] = rest.substr(0, slash);
      rest.remove_prefix(more ? slash + 1 : rest.size());
    }
    const std::uint32_t position = position_of_[parse_index(parts[0], "position", position_of_.size())];
    if (position == 0) throw lines_.error("face uses the wrong position in " + in_quotes(token));
    Corner corner{position - 1, kNone, kNone};
    if (!parts[1].empty()) corner.uv = parse_index(parts[1], "texture", uvs_.size());
    if (!parts[2].empty()) corner.normal = parse_index(parts[2], "normal", normals_.size());
    const bool valid =
        (corner.uv == kNone || uvs_[corner.uv].valid) && (corner.normal == kNone || normals_[corner.normal].valid);
    if (!valid) throw lines_.error("face uses a wrong texture coordinate or normal in " + in_quotes(token));
    return corner;
  }

  // 1 is the first, -1 the last one so far. 64-bit, because 4294967297 must not wrap to 1.
  std::uint32_t parse_index(std::string_view text, const char* what, std::size_t count) const {
    std::int64_t index = 0;
    const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), index);
    const bool is_integer = fault != std::errc::invalid_argument && end == text.data() + text.size();
    if (!is_integer) throw lines_.error(fmt::format("{} index {} is not an integer", what, in_quotes(text)));
    const auto limit = static_cast<std::int64_t>(count);
    if (fault != std::errc{} || index == 0 || index > limit || index < -limit) {
      const std::string allowed = limit == 0 ? "none yet" : fmt::format("1..{0} or -{0}..-1", limit);
      throw lines_.error(fmt::format("{} index {} is out of range, allowed {}", what, in_quotes(text), allowed));
    }
    return static_cast<std::uint32_t>(index > 0 ? index - 1 : limit + index);
  }

  void add_face() {
    if (out_.triangles.size() + corners_.size() > kNone) throw Error(ErrorCode::kLimit, "more than 2^32 - 1 triangles");
    local_.clear();
    if (corners_.size() == 3) {
      local_.push_back({0, 1, 2});
    } else {
      polygon_.clear();
      for (const Corner& corner : corners_) polygon_.push_back(out_.positions[corner.position]);
      if (!triangulate(polygon_, local_)) ++out_.crossed_faces;
    }
    for (const auto& triangle : local_)
      add_triangle({corners_[triangle[0]], corners_[triangle[1]], corners_[triangle[2]]});
  }

  void add_triangle(const std::array<Corner, 3>& corners) {
    const std::array<std::uint32_t, 3> t = {corners[0].position, corners[1].position, corners[2].position};
    const dvec3 a = out_.positions[t[0]], b = out_.positions[t[1]], c = out_.positions[t[2]];
    if (glm::cross(b - a, c - a) == dvec3(0.0)) ++out_.zero_area_triangles;
    append_corners(out_.triangle_uvs, {corners[0].uv, corners[1].uv, corners[2].uv}, uvs_);
    append_corners(out_.triangle_normals, {corners[0].normal, corners[1].normal, corners[2].normal}, normals_);
    out_.triangles.push_back(t);
    out_.triangle_materials.push_back(material_);
  }

  // The array stays empty until the first triangle that needs it.
  template <class Vector, class Attribute>
  void append_corners(std::vector<std::array<Vector, 3>>& target, const std::array<std::uint32_t, 3>& indices,
                      const std::vector<Attribute>& values) const {
    const bool used = indices[0] != kNone || indices[1] != kNone || indices[2] != kNone;
    if (!used && target.empty()) return;
    std::array<Vector, 3> corner{Vector(0.0f), Vector(0.0f), Vector(0.0f)};
    for (std::size_t k = 0; k < 3; ++k) {
      if (indices[k] != kNone) corner[k] = values[indices[k]].value;
    }
    if (target.empty()) target.resize(out_.triangles.size(), {Vector(0.0f), Vector(0.0f), Vector(0.0f)});
    target.push_back(corner);
  }

  void add_library(std::string_view names) {
    if (names.empty()) throw lines_.error("mtllib without a file name");
    out_.libraries.push_back({std::string(names), lines_.number()});
  }

  void use_material(std::string_view name) {
    const auto number = static_cast<std::uint32_t>(out_.material_names.size());
    const auto [entry, is_new] = material_numbers_.try_emplace(std::string(name), number);
    if (is_new) out_.material_names.emplace_back(name);
    material_ = entry->second;
  }

  void tolerate(const Error& error) {
    if (!lenient_) throw error;
    note(tolerated_, error.what());
  }

  void note(std::uint64_t& count, const char* text) {
    if (++count <= kMostWarnings) out_.warnings.emplace_back(text);
  }

  const std::string name_;
  TextLines lines_;
  bool lenient_;
  ObjGeometry out_;
  PositionTable table_;
  std::vector<std::uint32_t> position_of_;  // [v line] -> 1 + position, 0 = invalid
  std::vector<Uv> uvs_;                     // [vt line]
  std::vector<Normal> normals_;             // [vn line]
  std::array<double, 8> numbers_{};
  std::size_t number_count_ = 0;
  std::vector<Corner> corners_;
  std::vector<dvec3> polygon_;
  std::vector<std::array<std::uint32_t, 3>> local_;
  std::unordered_map<std::string, std::uint32_t> material_numbers_;
  std::uint32_t material_ = kNone;
  std::uint64_t tolerated_ = 0, unknown_ = 0;
};

}  // namespace

ObjGeometry parse_obj(std::string_view text, const std::string& name, bool lenient) {
  return ObjParser(text, name, lenient).run();
}

struct ObjPieceParser::State {
  State(const std::string& name, bool lenient) : parser({}, name, lenient, false) {}
  ObjParser parser;
};

ObjPieceParser::ObjPieceParser(const std::string& name, bool lenient)
    : state_(std::make_unique<State>(name, lenient)) {}
ObjPieceParser::~ObjPieceParser() = default;
void ObjPieceParser::parse(std::string_view lines) { state_->parser.parse_piece(lines); }
void ObjPieceParser::finish() { state_->parser.finish(); }
ObjGeometry& ObjPieceParser::geometry() { return state_->parser.geometry(); }

void ObjPieceParser::drop_triangles() {
  ObjGeometry& g = geometry();
  g.triangles.clear(), g.triangle_materials.clear(), g.triangle_uvs.clear(), g.triangle_normals.clear();
}

}  // namespace halfshade
