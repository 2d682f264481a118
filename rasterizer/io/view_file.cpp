#include "rasterizer/io/view_file.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "halfshade/error.h"
#include "rasterizer/io/emission_file.h"
#include "rasterizer/io/input_file.h"

namespace halfshade {
namespace {

using nlohmann::json;
using nlohmann::ordered_json;

constexpr std::size_t kMostSamples = 4096;
constexpr std::size_t kMostCorners = 64;  // of a polygon; that it is flat and convex is checked where it is used
constexpr int kDeepest = 32;  // arrays and objects inside each other; the format needs 5, and messages recurse
constexpr std::uint64_t kMostFileBytes = std::uint64_t{16} << 20;
constexpr const char* kShapeNames[] = {"point",   "rectangle", "disk",    "sphere",
                                       "samples", "ellipsoid", "polygon", "sun"};  // by LightShape

/// A value of the file together with where it is, for messages.
class Node {
 public:
  Node(const json& value, std::string file, std::string pointer)
      : value_(value), file_(std::move(file)), pointer_(std::move(pointer)) {}

  Error error(const std::string& what) const {
    return Error(ErrorCode::kBadInput, fmt::format("{}: {}: {}", file_, pointer_.empty() ? "/" : pointer_, what));
  }
  /// "value, allowed range".
  Error refuse(const std::string& allowed) const {
    return error(fmt::format("{}, allowed {}", in_quotes(value_.dump(-1, ' ', true)), allowed));
  }

  void require_keys(std::initializer_list<std::string_view> known) const {
    if (!value_.is_object()) throw refuse("an object");
    for (const auto& [key, unused] : value_.items()) {
      if (std::find(known.begin(), known.end(), key) != known.end()) continue;
      throw error(fmt::format("unknown key {}, allowed {}", in_quotes(key), fmt::join(known, ", ")));
    }
  }

  bool has(const char* key) const { return value_.contains(key); }
  Node at(const char* key) const {
    if (!has(key)) throw error(fmt::format("key '{}' is missing", key));
    return {value_.at(key), file_, fmt::format("{}/{}", pointer_, key)};
  }
  Node at(std::size_t index) const { return {value_.at(index), file_, fmt::format("{}/{}", pointer_, index)}; }
  std::size_t size() const { return value_.size(); }
  bool is_text() const { return value_.is_string(); }
  bool is_number() const { return value_.is_number(); }

  void require_array(const char* what) const {
    if (!value_.is_array()) throw refuse(what);
  }
  // Finite and within float range, so that no later product of three overflows.
  double number() const {
    if (!value_.is_number() || std::fabs(value_.get<double>()) > 0x1.fffffep127)
      throw refuse("a number within +-3.4e38");
    return value_.get<double>();
  }
  double positive() const {
    if (number() <= 0.0) throw refuse("a number > 0");
    return number();
  }
  dvec3 vector() const {
    require_array("three numbers");
    if (size() != 3) throw refuse("three numbers");
    return {at(std::size_t{0}).number(), at(1).number(), at(2).number()};
  }
  dvec3 nonzero_vector() const {
    if (vector() == dvec3(0.0)) throw refuse("a vector that is not zero");
    return vector();
  }
  bool boolean() const {
    if (!value_.is_boolean()) throw refuse("true or false");
    return value_.get<bool>();
  }
  /// A file named by the value, relative to the view file and inside its directory (as textures of an OBJ).
  std::filesystem::path file() const {
    const std::filesystem::path directory = std::filesystem::path(file_).parent_path();
    try {
      return AssetRoot(directory, false).resolve(directory, text());
    } catch (const Error& reason) {
      throw error(reason.what());
    }
  }
  std::string text() const {
    if (!value_.is_string()) throw refuse("a string");
    return value_.get<std::string>();
  }

 private:
  const json& value_;
  std::string file_, pointer_;
};

// Scaled first, so that neither huge nor tiny vectors are taken for parallel ones.
bool are_parallel(const dvec3& a, const dvec3& b) {
  const auto scaled = [](const dvec3& v) { return v / std::max({std::fabs(v.x), std::fabs(v.y), std::fabs(v.z)}); };
  return glm::cross(scaled(a), scaled(b)) == dvec3(0.0);
}

Camera read_camera(const Node& node) {
  node.require_keys({"eye", "target", "up", "fov_y_deg"});
  Camera camera;
  camera.eye = node.at("eye").vector();
  camera.target = node.at("target").vector();
  if (node.has("up")) camera.up = node.at("up").nonzero_vector();
  if (node.has("fov_y_deg")) camera.fov_y_deg = node.at("fov_y_deg").positive();
  if (camera.fov_y_deg >= 180.0) throw node.at("fov_y_deg").refuse("a number between 0 and 180");
  if (camera.eye == camera.target) throw node.at("target").refuse("a point other than the eye");
  if (are_parallel(camera.target - camera.eye, camera.up)) {
    throw node.error("'up' is parallel to the direction from eye to target");
  }
  return camera;
}

void read_emission(const Node& node, Light& light) {
  if (node.is_text() && light.shape == LightShape::kRectangle) {
    light.emission_image = load_emission_image(node.file());
    light.emission_image.name = node.text();
    return;
  }
  const dvec3 emission = node.is_number() ? dvec3(node.number()) : node.vector();
  if (emission.x < 0.0 || emission.y < 0.0 || emission.z < 0.0) throw node.refuse("numbers >= 0");
  light.emission = vec3(emission);
}

LightShape read_shape(const Node& node) {
  const std::string type = node.text();
  const auto found = std::find(std::begin(kShapeNames), std::end(kShapeNames), type);
  if (found == std::end(kShapeNames)) throw node.refuse(fmt::format("one of {}", fmt::join(kShapeNames, ", ")));
  return static_cast<LightShape>(found - std::begin(kShapeNames));
}

std::vector<dvec3> read_points(const Node& node, std::size_t fewest, std::size_t most) {
  node.require_array("an array of points");
  if (node.size() < fewest || node.size() > most) {
    throw node.error(fmt::format("{} points, allowed {}..{}", node.size(), fewest, most));
  }
  std::vector<dvec3> points;
  for (std::size_t i = 0; i < node.size(); ++i) points.push_back(node.at(i).vector());
  return points;
}

std::array<dvec3, 3> read_axes(const Node& node) {
  node.require_array("three vectors");
  if (node.size() != 3) throw node.refuse("three vectors");
  return {node.at(std::size_t{0}).nonzero_vector(), node.at(1).nonzero_vector(), node.at(2).nonzero_vector()};
}

void read_rectangle(const Node& node, Light& light) {
  light.center = node.at("center").vector();
  light.u = node.at("u").nonzero_vector();
  light.v = node.at("v").nonzero_vector();
  if (are_parallel(light.u, light.v)) throw node.at("v").refuse("a vector that is not parallel to u");
}

void read_geometry(const Node& node, Light& light) {
  switch (light.shape) {
    case LightShape::kPoint:
      node.require_keys({"name", "type", "emission", "position"});
      light.center = node.at("position").vector();
      break;
    case LightShape::kRectangle:
      node.require_keys({"name", "type", "emission", "two_sided", "center", "u", "v"});
      read_rectangle(node, light);
      break;
    case LightShape::kDisk:
      node.require_keys({"name", "type", "emission", "two_sided", "center", "normal", "radius"});
      light.center = node.at("center").vector();
      light.normal = node.at("normal").nonzero_vector();
      light.radius = node.at("radius").positive();
      break;
    case LightShape::kSphere:
      node.require_keys({"name", "type", "emission", "center", "radius"});
      light.center = node.at("center").vector();
      light.radius = node.at("radius").positive();
      break;
    case LightShape::kSamples:
      node.require_keys({"name", "type", "emission", "points"});
      light.points = read_points(node.at("points"), 1, kMostSamples);
      break;
    case LightShape::kEllipsoid:
      node.require_keys({"name", "type", "emission", "center", "axes"});
      light.center = node.at("center").vector();
      light.axes = read_axes(node.at("axes"));
      break;
    case LightShape::kPolygon:
      node.require_keys({"name", "type", "emission", "two_sided", "vertices"});
      light.points = read_points(node.at("vertices"), 3, kMostCorners);
      break;
    case LightShape::kSun:
      node.require_keys({"name", "type", "emission", "direction", "angular_diameter_deg"});
      light.normal = node.at("direction").nonzero_vector();
      if (node.has("angular_diameter_deg")) light.angular_diameter_deg = node.at("angular_diameter_deg").positive();
      if (light.angular_diameter_deg > 60.0) throw node.at("angular_diameter_deg").refuse("a number above 0, up to 60");
      break;
  }
}

// The name becomes part of channel and file names.
std::string read_name(const Node& node) {
  const std::string name = node.text();
  const auto is_bad = [](char c) { return static_cast<unsigned char>(c) < ' ' || c == '/' || c == '\\'; };
  if (name.empty() || name.size() > 64 || std::any_of(name.begin(), name.end(), is_bad)) {
    throw node.refuse("1..64 characters without slashes and control characters");
  }
  return name;
}

Light read_light(const Node& node) {
  Light light;
  light.shape = read_shape(node.at("type"));
  read_geometry(node, light);
  if (node.has("name")) light.name = read_name(node.at("name"));
  if (node.has("two_sided")) light.two_sided = node.at("two_sided").boolean();
  if (node.has("emission")) read_emission(node.at("emission"), light);
  return light;
}

View read_view(const Node& root) {
  root.require_keys({"camera", "lights"});
  View view;
  view.camera = read_camera(root.at("camera"));
  const Node lights = root.at("lights");
  lights.require_array("an array of lights");
  for (std::size_t i = 0; i < lights.size(); ++i) {
    Light light = read_light(lights.at(i));
    const auto has_name = [&](const Light& other) { return other.name == light.name; };
    if (std::any_of(view.lights.begin(), view.lights.end(), has_name)) {
      throw lights.at(i).error(fmt::format("second light with the name {}", in_quotes(light.name)));
    }
    view.lights.push_back(std::move(light));
  }
  return view;
}

template <class Vector>
ordered_json to_array(const Vector& v) {
  return ordered_json::array({v.x, v.y, v.z});
}

ordered_json to_object(const Light& light) {
  ordered_json object;
  object["name"] = light.name;
  object["type"] = kShapeNames[static_cast<std::size_t>(light.shape)];
  const bool is_flat =
      light.shape == LightShape::kRectangle || light.shape == LightShape::kDisk || light.shape == LightShape::kPolygon;
  if (light.shape == LightShape::kPoint) {
    object["position"] = to_array(light.center);
  } else if (light.shape == LightShape::kSamples || light.shape == LightShape::kPolygon) {
    const char* key = light.shape == LightShape::kPolygon ? "vertices" : "points";
    for (const dvec3& point : light.points) object[key].push_back(to_array(point));
  } else if (light.shape == LightShape::kSun) {
    object["direction"] = to_array(light.normal);
    object["angular_diameter_deg"] = light.angular_diameter_deg;
  } else {
    object["center"] = to_array(light.center);
  }
  if (light.shape == LightShape::kRectangle) object["u"] = to_array(light.u), object["v"] = to_array(light.v);
  if (light.shape == LightShape::kEllipsoid) {
    for (const dvec3& axis : light.axes) object["axes"].push_back(to_array(axis));
  }
  if (light.shape == LightShape::kDisk) object["normal"] = to_array(light.normal);
  if (light.shape == LightShape::kDisk || light.shape == LightShape::kSphere) object["radius"] = light.radius;
  if (is_flat) object["two_sided"] = light.two_sided;
  if (light.emission_image.empty()) {
    object["emission"] = to_array(light.emission);
  } else {
    object["emission"] = light.emission_image.name;
  }
  return object;
}

}  // namespace

View load_view(const std::filesystem::path& file) {
  const std::string text = read_regular_file(file, kMostFileBytes);
  const auto check_depth = [&](int depth, json::parse_event_t, const json&) {
    if (depth <= kDeepest) return true;
    throw Error(ErrorCode::kBadInput, fmt::format("{}: nested more than {} deep", file.string(), kDeepest));
  };
  json document;
  try {
    document = json::parse(text, check_depth);
  } catch (const json::exception& error) {
    throw Error(ErrorCode::kBadInput, fmt::format("{}: not JSON: {}", file.string(), error.what()));
  }
  return read_view(Node(document, file.string(), ""));
}

std::string view_to_json(const View& view) {
  ordered_json document;
  document["camera"] = {{"eye", to_array(view.camera.eye)},
                        {"target", to_array(view.camera.target)},
                        {"up", to_array(view.camera.up)},
                        {"fov_y_deg", view.camera.fov_y_deg}};
  document["lights"] = ordered_json::array();
  for (const Light& light : view.lights) document["lights"].push_back(to_object(light));
  return document.dump(1) + "\n";
}

}  // namespace halfshade
