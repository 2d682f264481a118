// The chart's file (schema "halfshade.chart/1", docs/files.md): kept up to date while the chart is made, and read again
// by a run that goes on with it.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>

namespace halfshade {

class ChartFile {
 public:
  /// Reads `directory`/chart.json if it is there and not `fresh`. `head` holds what is written before subjects and
  /// points; its "settings" must be those of the file. Throws Error{kUsage} if they are not, Error{kBadInput} for a
  /// damaged file.
  ChartFile(const std::filesystem::path& directory, const nlohmann::ordered_json& head, bool fresh);

  /// Drops the points of a scene and light whose inputs are others than those of the file.
  void expect_inputs(const std::string& scene, const std::string& light, const std::string& inputs);
  bool has_subject(const std::string& scene, const std::string& light) const;
  /// Replaces the description of (scene, light).
  void set_subject(const nlohmann::ordered_json& subject);
  /// The point of that id, or null; valid until the next add_point.
  nlohmann::ordered_json* find_point(const std::string& scene, const std::string& light, const std::string& id);
  /// Replaces the point of the same scene, light and id.
  void add_point(const nlohmann::ordered_json& point);

  /// Atomic: chart.json.
  void save() const;
  /// Atomic: chart.csv, one line per point.
  void save_table() const;

 private:
  std::filesystem::path directory_;
  nlohmann::ordered_json content_;
};

}  // namespace halfshade
