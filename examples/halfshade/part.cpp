#include "part.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "halfshade/error.h"
#include "rasterizer/io/atomic_file.h"
#include "rasterizer/io/input_file.h"

namespace halfshade {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr const char* kSchema = "halfshade.part/1";
constexpr const char* kManifest = "part.json";
constexpr std::uint64_t kLongestManifest = 16u << 20;
constexpr std::uint32_t kMostParts = 1u << 20;

struct SplitName {
  const char* name;
  const char* units;  // what a range counts
};
constexpr SplitName kSplits[] = {
    {"crop", "rows"}, {"frames", "frames"}, {"samples", "light samples"}, {"blockers", "triangles"}};

const char* units_of(PartSplit split) { return kSplits[static_cast<std::size_t>(split)].units; }

[[noreturn]] void bad_input(const std::string& message) { throw Error(ErrorCode::kBadInput, message); }

std::string text_of(PartSplit split, const PartRange& range) {
  if (range.size() == 0) return fmt::format("no {}", units_of(split));
  return fmt::format("{} {}..{}", units_of(split), range.begin, range.end - 1);
}

ordered_json json_of(const PartRange& range) { return {range.begin, range.end}; }

ordered_json json_of(const PartLight& light) {
  return {{"name", light.name},
          {"file", light.file},
          {"range", json_of(light.range)},
          {"whole", json_of(light.whole)},
          {"samples_hash", light.samples_hash},
          {"receivers_hash", light.receivers_hash},
          {"content_hash", light.content_hash},
          {"receivers", light.receivers},
          {"samples", light.samples},
          {"shadow_ms", light.shadow_ms}};
}

PartRange range_from(const ordered_json& json, const char* key) {
  const auto ends = json.at(key).get<std::array<std::uint64_t, 2>>();
  if (ends[0] > ends[1]) throw std::invalid_argument(fmt::format("'{}' ends before it begins", key));
  return {ends[0], ends[1]};
}

PartLight light_from(const ordered_json& json) {
  PartLight light;
  json.at("name").get_to(light.name);
  json.at("file").get_to(light.file);
  light.range = range_from(json, "range");
  light.whole = range_from(json, "whole");
  json.at("samples_hash").get_to(light.samples_hash);
  json.at("receivers_hash").get_to(light.receivers_hash);
  json.at("content_hash").get_to(light.content_hash);
  json.at("receivers").get_to(light.receivers);
  json.at("samples").get_to(light.samples);
  json.at("shadow_ms").get_to(light.shadow_ms);
  if (light.range.size() > 0 && (light.range.begin < light.whole.begin || light.range.end > light.whole.end))
    throw std::invalid_argument("'range' lies outside 'whole'");
  if (light.file.empty() || light.file.find('/') != std::string::npos)
    throw std::invalid_argument(fmt::format("'file' is '{}', not a name in the part's directory", light.file));
  return light;
}

Part part_from(const ordered_json& json) {
  if (json.at("schema") != kSchema) throw std::invalid_argument(fmt::format("'schema' is not '{}'", kSchema));
  Part part;
  part.split = part_split_from_name(json.at("split").get<std::string>());
  json.at("version").get_to(part.version);
  json.at("scene").get_to(part.scene);
  json.at("view").get_to(part.view);
  json.at("arguments").get_to(part.arguments);
  json.at("scene_hash").get_to(part.scene_hash);
  json.at("view_hash").get_to(part.view_hash);
  json.at("jitter_camera").get_to(part.jitter_camera);
  for (const ordered_json& light : json.at("lights")) part.lights.push_back(light_from(light));
  if (part.lights.empty()) throw std::invalid_argument("'lights' is empty");
  return part;
}

/// Parts that hold something of a light, by the beginning of their ranges.
std::vector<const Part*> in_order(std::span<const Part> parts, std::size_t light) {
  std::vector<const Part*> order;
  for (const Part& part : parts) {
    if (part.lights[light].range.size() > 0) order.push_back(&part);
  }
  std::stable_sort(order.begin(), order.end(), [light](const Part* a, const Part* b) {
    return a->lights[light].range.begin < b->lights[light].range.begin;
  });
  return order;
}

}  // namespace

PartSplit part_split_from_name(const std::string& name) {
  std::string known;
  for (std::size_t i = 0; i < std::size(kSplits); ++i) {
    if (name == kSplits[i].name) return static_cast<PartSplit>(i);
    known += (known.empty() ? "" : ", ") + std::string(kSplits[i].name);
  }
  throw Error(ErrorCode::kUsage, fmt::format("split '{}' is not one of: {}", name, known));
}

const char* name_of(PartSplit split) { return kSplits[static_cast<std::size_t>(split)].name; }

PartNumber parse_part_number(const std::string& text) {
  unsigned index = 0, count = 0;
  int used = 0;
  if (std::sscanf(text.c_str(), "%9u/%9u%n", &index, &count, &used) != 2 || text[used] != '\0' || index < 1 ||
      index > count || count > kMostParts) {
    throw Error(ErrorCode::kUsage, fmt::format("--part '{}' is not i/n with 1 <= i <= n <= {}", text, kMostParts));
  }
  return {index - 1, count};
}

PartRange share_of(const PartRange& whole, PartNumber number, std::uint64_t unit) {
  const std::uint64_t units = whole.size() / unit;
  const auto edge = [&](std::uint64_t i) { return whole.begin + units * i / number.count * unit; };
  return {edge(number.index), edge(number.index + 1)};
}

void begin_part(const fs::path& directory) {
  std::error_code error;
  fs::create_directories(directory, error);
  if (!error) fs::remove(directory / kManifest, error);
  if (error) throw Error(ErrorCode::kOutput, fmt::format("{}: {}", directory.string(), error.message()));
}

void write_manifest(const Part& part) {
  ordered_json json = {{"schema", kSchema},
                       {"version", part.version},
                       {"split", name_of(part.split)},
                       {"scene", part.scene},
                       {"view", part.view},
                       {"arguments", part.arguments},
                       {"scene_hash", part.scene_hash},
                       {"view_hash", part.view_hash},
                       {"jitter_camera", part.jitter_camera},
                       {"lights", ordered_json::array()}};
  for (const PartLight& light : part.lights) json["lights"].push_back(json_of(light));
  write_file_atomically(part.directory / kManifest, json.dump(2) + "\n");
}

Part read_manifest(const fs::path& directory) {
  const fs::path file = directory / kManifest;
  if (fs::is_directory(directory) && !fs::exists(file))
    bad_input(fmt::format("{}: has no {}: no part, or one that was not finished", directory.string(), kManifest));
  try {
    Part part = part_from(ordered_json::parse(read_regular_file(file, kLongestManifest)));
    part.directory = directory;
    return part;
  } catch (const nlohmann::json::exception& e) {
    bad_input(fmt::format("{}: {}", file.string(), e.what()));
  } catch (const std::invalid_argument& e) {
    bad_input(fmt::format("{}: {}", file.string(), e.what()));
  } catch (const Error& e) {
    if (e.code() != ErrorCode::kUsage) throw;
    bad_input(fmt::format("{}: {}", file.string(), e.what()));
  }
}

void require_same_render(const Part& a, const Part& b) {
  const auto require = [&](const std::string& what, const std::string& of_a, const std::string& of_b) {
    if (of_a == of_b) return;
    bad_input(fmt::format("{} and {} are parts of different renders: {} '{}' and '{}'", a.directory.string(),
                          b.directory.string(), what, of_a, of_b));
  };
  require("program version", a.version, b.version);
  require("split", name_of(a.split), name_of(b.split));
  require("options", fmt::format("{}", fmt::join(a.arguments, " ")), fmt::format("{}", fmt::join(b.arguments, " ")));
  require("scene hash", a.scene_hash, b.scene_hash);
  require("view hash", a.view_hash, b.view_hash);
  require("--jitter-camera", fmt::format("{}", a.jitter_camera), fmt::format("{}", b.jitter_camera));
  require("number of lights", std::to_string(a.lights.size()), std::to_string(b.lights.size()));
  for (std::size_t l = 0; l < a.lights.size(); ++l) {
    const PartLight &of_a = a.lights[l], &of_b = b.lights[l];
    const std::string light = fmt::format(" of light '{}'", of_a.name);
    require("name of a light", of_a.name, of_b.name);
    require("light samples hash" + light, of_a.samples_hash, of_b.samples_hash);
    require("whole range" + light, text_of(a.split, of_a.whole), text_of(b.split, of_b.whole));
    if (a.split != PartSplit::kCrop) require("receivers hash" + light, of_a.receivers_hash, of_b.receivers_hash);
  }
}

std::vector<PartRange> gaps_of(std::span<const Part> parts, std::size_t light, const PartRange& whole) {
  std::vector<PartRange> gaps;
  const Part* before = nullptr;
  std::uint64_t at = whole.begin;
  for (const Part* part : in_order(parts, light)) {
    const PartRange& range = part->lights[light].range;
    if (range.begin < at) {
      bad_input(fmt::format("{} are in both {} and {}", text_of(part->split, {range.begin, std::min(range.end, at)}),
                            before->directory.string(), part->directory.string()));
    }
    if (range.begin > at) gaps.push_back({at, range.begin});
    at = range.end;
    before = part;
  }
  if (at < whole.end) gaps.push_back({at, whole.end});
  return gaps;
}

void require_complete(std::span<const Part> parts) {
  for (std::size_t l = 0; l < parts[0].lights.size(); ++l) {
    const PartLight& light = parts[0].lights[l];
    const std::vector<PartRange> gaps = gaps_of(parts, l, light.whole);
    if (gaps.empty()) continue;
    bad_input(fmt::format("{} of light '{}' are in none of the {} parts given", text_of(parts[0].split, gaps[0]),
                          light.name, parts.size()));
  }
}

}  // namespace halfshade
