#include "chart_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <sstream>

#include "halfshade/error.h"
#include "rasterizer/io/atomic_file.h"

namespace halfshade {
namespace {

using nlohmann::ordered_json;

constexpr const char* kSchema = "halfshade.chart/1";

bool is_of(const ordered_json& entry, const std::string& scene, const std::string& light) {
  return entry.at("scene") == scene && entry.at("light") == light;
}

/// A field of a comma-separated table (RFC 4180): numbers as they are, text in quotes.
std::string field(const ordered_json& value) {
  if (value.is_null()) return "";
  if (!value.is_string()) return value.dump();
  std::string text(1, '"');
  for (const char c : value.get<std::string>()) text.append(c == '"' ? 2 : 1, c);
  text.push_back('"');
  return text;
}

/// Columns of the table, and where their values stand in a point.
struct Column {
  const char *name, *pointer;
};
constexpr Column kColumns[] = {{"scene", "/scene"},
                               {"light", "/light"},
                               {"id", "/id"},
                               {"method", "/method"},
                               {"parameter", "/parameter"},
                               {"label", "/label"},
                               {"light_samples", "/light_samples"},
                               {"status", "/status"},
                               {"reason", "/reason"},
                               {"promises_exactness", "/promises_exactness"},
                               {"receivers", "/receivers"},
                               {"shadow_ms", "/shadow_ms"},
                               {"shadow_ms_min", "/shadow_ms_min"},
                               {"shadow_ms_max", "/shadow_ms_max"},
                               {"build_ms", "/build_ms"},
                               {"bytes", "/bytes"},
                               {"wrong_bits", "/against_exact/wrong_bits"},
                               {"bits", "/against_exact/bits"},
                               {"wrong_receivers", "/against_exact/wrong_receivers"},
                               {"method_rmse", "/against_exact/rmse"},
                               {"method_max", "/against_exact/max"},
                               {"method_mean", "/against_exact/mean"},
                               {"rmse", "/against_reference/rmse"},
                               {"max", "/against_reference/max"},
                               {"mean", "/against_reference/mean"},
                               {"share_over_one_sample", "/against_reference/share_over_one_sample"},
                               {"flip", "/against_reference/flip"},
                               {"image", "/image"}};

std::string table_of(const ordered_json& points) {
  std::string table;
  for (const Column& column : kColumns) table += fmt::format("{}{}", &column == kColumns ? "" : ",", column.name);
  for (const ordered_json& point : points) {
    table += "\r\n";
    for (const Column& column : kColumns) {
      if (&column != kColumns) table += ",";
      const ordered_json::json_pointer at(column.pointer);
      if (point.contains(at)) table += field(point.at(at));
    }
  }
  return table + "\r\n";
}

ordered_json read(const std::filesystem::path& path) {
  std::ifstream stream(path, std::ios::binary);
  std::stringstream text;
  text << stream.rdbuf();
  ordered_json json = ordered_json::parse(text.str(), nullptr, false);
  if (!json.is_object() || json.value("schema", "") != kSchema || !json.contains("settings") ||
      !json.contains("subjects") || !json.contains("points")) {
    throw Error(ErrorCode::kBadInput, fmt::format("{}: not a chart ({}); --fresh replaces it", path.string(), kSchema));
  }
  return json;
}

}  // namespace

ChartFile::ChartFile(const std::filesystem::path& directory, const ordered_json& head, bool fresh)
    : directory_(directory) {
  content_ = {{"schema", kSchema}};
  content_.update(head);
  content_["subjects"] = ordered_json::array();
  content_["points"] = ordered_json::array();
  const std::filesystem::path path = directory / "chart.json";
  if (fresh || !std::filesystem::exists(path)) return;
  const ordered_json old = read(path);
  for (const auto& [name, value] : content_["settings"].items()) {
    if (old["settings"].value(name, ordered_json()) == value) continue;
    throw Error(ErrorCode::kUsage,
                fmt::format("{} was made with other settings ('{}' was {}, is {}): --fresh replaces it, --output DIR "
                            "keeps it",
                            path.string(), name, old["settings"].value(name, ordered_json()).dump(), value.dump()));
  }
  content_["subjects"] = old["subjects"];
  content_["points"] = old["points"];
}

void ChartFile::expect_inputs(const std::string& scene, const std::string& light, const std::string& inputs) {
  const auto is_stale = [&](const ordered_json& subject) {
    return is_of(subject, scene, light) && subject.at("inputs") != inputs;
  };
  ordered_json& subjects = content_["subjects"];
  if (std::none_of(subjects.begin(), subjects.end(), is_stale)) return;
  const auto drop = [](ordered_json& list, const auto& matches) {
    ordered_json kept = ordered_json::array();
    for (const ordered_json& entry : list) {
      if (!matches(entry)) kept.push_back(entry);
    }
    list = kept;
  };
  drop(subjects, is_stale);
  drop(content_["points"], [&](const ordered_json& point) { return is_of(point, scene, light); });
}

bool ChartFile::has_subject(const std::string& scene, const std::string& light) const {
  const ordered_json& subjects = content_["subjects"];
  return std::any_of(subjects.begin(), subjects.end(),
                     [&](const ordered_json& subject) { return is_of(subject, scene, light); });
}

void ChartFile::set_subject(const ordered_json& subject) {
  for (ordered_json& old : content_["subjects"]) {
    if (!is_of(old, subject.at("scene"), subject.at("light"))) continue;
    old = subject;
    return;
  }
  content_["subjects"].push_back(subject);
}

ordered_json* ChartFile::find_point(const std::string& scene, const std::string& light, const std::string& id) {
  for (ordered_json& point : content_["points"]) {
    if (is_of(point, scene, light) && point.at("id") == id) return &point;
  }
  return nullptr;
}

void ChartFile::add_point(const ordered_json& point) {
  ordered_json* old = find_point(point.at("scene"), point.at("light"), point.at("id"));
  if (old != nullptr) {
    *old = point;
  } else {
    content_["points"].push_back(point);
  }
}

void ChartFile::save() const { write_file_atomically(directory_ / "chart.json", content_.dump(1) + "\n"); }

void ChartFile::save_table() const { write_file_atomically(directory_ / "chart.csv", table_of(content_["points"])); }

}  // namespace halfshade
