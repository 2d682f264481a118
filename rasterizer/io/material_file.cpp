#include "rasterizer/io/material_file.h"

#include <map>
#include <sstream>

#include <fmt/format.h>
#include <tiny_obj_loader.h>

#include "rasterizer/io/input_file.h"

namespace halfshade {
namespace {

// tinyobjloader sees one material at a time and only lines that have been checked and written anew: it carries some
// state from one material to the next, and reads "1,5" or "nan" as a number.
class MtlParser {
 public:
  MtlParser(std::string_view text, const std::string& name, bool lenient, std::vector<std::string>& warnings)
      : lines_(text, name), lenient_(lenient), warnings_(warnings) {}

  std::vector<MtlMaterial> run() {
    std::string_view line;
    while (lines_.next(line)) {
      try {
        parse_line(line);
      } catch (const Error& error) {
        if (!lenient_) throw;
        warnings_.emplace_back(error.what());
      }
    }
    flush();
    return std::move(materials_);
  }

 private:
  void parse_line(std::string_view line) {
    Tokens tokens(line);
    const std::string_view keyword = tokens.next();
    if (keyword == "newmtl") return start(tokens.rest());
    const bool is_color = keyword == "Kd" || keyword == "Tf" || keyword == "Kt";
    const bool is_opacity = keyword == "d" || keyword == "Tr";
    const bool is_map = keyword == "map_Kd" || keyword == "map_d" || keyword == "map_Tf";
    if (!is_color && !is_opacity && !is_map) return;
    if (!open_) throw lines_.error(in_quotes(keyword) + " before the first newmtl");
    if (is_color) return copy_numbers(keyword, tokens, 3, 1e6);
    if (is_opacity) return copy_numbers(keyword, tokens, 1, 1.0);
    (keyword == "map_Kd" ? color_line_ : keyword == "map_d" ? alpha_line_ : filter_line_) = lines_.number();
    // tinyobjloader does not know map_Tf; the place of map_Ks, which means nothing here, is free for it.
    block_ += fmt::format("{} {}\n", keyword == "map_Tf" ? "map_Ks" : keyword, tokens.rest());
  }

  void start(std::string_view name) {
    flush();
    if (name.empty()) throw lines_.error("newmtl without a name");
    open_ = true;
    name_ = name;
    has_diffuse_ = has_filter_ = has_opacity_ = false;
    block_ = "newmtl material\n";
  }

  void copy_numbers(std::string_view keyword, Tokens& tokens, std::size_t count, double largest) {
    std::vector<std::string_view> numbers;
    for (std::string_view token = tokens.next(); !token.empty(); token = tokens.next()) {
      double value = 0.0;
      const NumberFault fault = parse_number(token, value);
      if (fault != NumberFault::kOk || value < 0.0 || value > largest) {
        const char* what = fault == NumberFault::kOk ? "is out of range" : describe(fault);
        throw lines_.error(fmt::format("{} {} {}, allowed 0..{}", keyword, in_quotes(token), what, largest));
      }
      numbers.push_back(token);
    }
    if (numbers.size() != count && numbers.size() != 1) {
      throw lines_.error(
          fmt::format("{} with {} numbers, allowed 1{}", keyword, numbers.size(), count == 3 ? " or 3" : ""));
    }
    (keyword == "Kd" ? has_diffuse_ : count == 3 ? has_filter_ : has_opacity_) = true;
    block_ += keyword;
    for (std::size_t k = 0; k < count; ++k) block_ += fmt::format(" {}", numbers[numbers.size() == 1 ? 0 : k]);
    block_ += '\n';
  }

  void flush() {
    if (!open_) return;
    open_ = false;
    std::map<std::string, int> numbers;
    std::vector<tinyobj::material_t> read;
    std::string warning, error;
    std::istringstream stream(block_);
    tinyobj::LoadMtl(&numbers, &read, &stream, &warning, &error);
    if (read.size() != 1) throw lines_.error("material " + in_quotes(name_) + " cannot be read");
    if (!warning.empty()) warnings_.push_back("material " + in_quotes(name_) + ": both d and Tr given, d counts");
    materials_.push_back(convert(read[0]));
  }

  MtlMaterial convert(const tinyobj::material_t& read) {
    const auto rgb = [](const tinyobj::real_t(&c)[3]) { return vec3(c[0], c[1], c[2]); };
    MtlMaterial result;
    result.material.name = name_;
    if (has_diffuse_) result.material.diffuse = rgb(read.diffuse);
    result.material.opacity = static_cast<float>(read.dissolve);
    if (has_filter_) result.material.transmittance = rgb(read.transmittance);
    result.color_file = {read.diffuse_texname, color_line_};
    result.alpha_file = {read.alpha_texname, alpha_line_};
    result.filter_file = {read.specular_texname, filter_line_};
    if (!result.filter_file.name.empty() && !has_opacity_) result.material.opacity = 0.0f;
    warn_options("map_Kd", read.diffuse_texopt);
    warn_options("map_d", read.alpha_texopt);
    warn_options("map_Tf", read.specular_texopt);
    return result;
  }

  void warn_options(const char* map, const tinyobj::texture_option_t& option) {
    bool moved = option.clamp || option.brightness != 0 || option.contrast != 1;
    for (int k = 0; k < 3; ++k)
      moved = moved || option.origin_offset[k] != 0 || option.scale[k] != 1 || option.turbulence[k] != 0;
    if (moved)
      warnings_.push_back(
          fmt::format("material {}: options -clamp, -mm, -o, -s and -t of {} are ignored", in_quotes(name_), map));
  }

  TextLines lines_;
  bool lenient_;
  std::vector<std::string>& warnings_;
  std::vector<MtlMaterial> materials_;
  std::string name_, block_;  // the material being read, and its checked lines
  std::uint64_t color_line_ = 0, alpha_line_ = 0, filter_line_ = 0;
  bool open_ = false, has_diffuse_ = false, has_filter_ = false, has_opacity_ = false;
};

}  // namespace

std::vector<MtlMaterial> parse_mtl(std::string_view text, const std::string& name, bool lenient,
                                   std::vector<std::string>& warnings) {
  return MtlParser(text, name, lenient, warnings).run();
}

}  // namespace halfshade
