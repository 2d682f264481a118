#include "shadows/light_maps.h"

#include <algorithm>
#include <cmath>

#include "rasterizer/clip.h"
#include "rasterizer/core/parallel.h"

namespace halfshade {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr std::size_t kReceiversPerPart = 16384;
/// A single map would spend its lexels badly beyond this slope (63 degrees off the axis).
constexpr double kWidestSlope = 2.0;
/// The picture's centre must stay within 8192 px of its corner (clip.h), less what the border and rounding add.
constexpr double kFarthestCenterPx = 8000.0;
/// Maps are not made narrower than this slope: lexels would shrink to nothing around a single receiver.
constexpr double kNarrowestMap = 1e-3;
/// Lexels added on each side, so that rounding leaves nobody outside.
constexpr double kBorderPx = 1.5;

/// Slopes of receivers within one map.
struct SlopeBox {
  dvec2 low{HUGE_VAL}, high{-HUGE_VAL};
  bool empty() const { return low.x > high.x; }
  void add(const dvec2& s) { low = glm::min(low, s), high = glm::max(high, s); }
  void add(const SlopeBox& o) { low = glm::min(low, o.low), high = glm::max(high, o.high); }
};

/// Face k looks along axis k / 2, backwards if k is odd. The other two axes keep their order; mirrored pictures do no
/// harm.
CameraFrame face_frame(const MapAxes& axes, const dvec3& eye, std::size_t face) {
  const std::array<dvec3, 3> a = {axes.z, axes.x, axes.y};
  CameraFrame frame;
  frame.eye = eye;
  frame.forward = face % 2 == 0 ? a[face / 2] : -a[face / 2];
  frame.right = a[(face / 2 + 1) % 3];
  frame.up = a[(face / 2 + 2) % 3];
  return frame;
}

/// The face of the cube that d points through, or kNone nearer than the near plane.
std::uint32_t cube_face(const MapAxes& axes, const dvec3& d) {
  const std::array<double, 3> a = {glm::dot(d, axes.z), glm::dot(d, axes.x), glm::dot(d, axes.y)};
  std::size_t best = 0;
  for (std::size_t k = 1; k < 3; ++k) {
    if (std::fabs(a[k]) > std::fabs(a[best])) best = k;
  }
  if (!(std::fabs(a[best]) > kNearPlane)) return kNone;
  return static_cast<std::uint32_t>(2 * best + (a[best] < 0.0));
}

dvec2 slopes(const CameraFrame& frame, const dvec3& d) {
  const double w = glm::dot(d, frame.forward);
  return {glm::dot(d, frame.right) / w, glm::dot(d, frame.up) / w};
}

/// visit(part, direction from the eye) for every receiver of the request, parts in parallel.
template <class Visit>
void for_each_direction(const ReceiverArray& receivers, const MapRequest& request, const Visit& visit) {
  const std::size_t count = request.receivers.size();
  parallel_tasks((count + kReceiversPerPart - 1) / kReceiversPerPart, [&](std::size_t part) {
    const std::size_t end = std::min(count, (part + 1) * kReceiversPerPart);
    for (std::size_t i = part * kReceiversPerPart; i != end; ++i) {
      visit(part, dvec3(receivers.position[request.receivers[i]]) - request.eye);
    }
  });
}

std::size_t part_count(const MapRequest& request) {
  return (request.receivers.size() + kReceiversPerPart - 1) / kReceiversPerPart;
}

/// Slopes of all receivers in the single map along the axis; false when it cannot hold them.
bool fit_single(const ReceiverArray& receivers, const MapRequest& request, SlopeBox& box) {
  const CameraFrame frame = face_frame(request.axes, request.eye, 0);
  std::vector<SlopeBox> boxes(part_count(request));
  std::vector<std::uint8_t> outside(boxes.size(), 0);
  for_each_direction(receivers, request, [&](std::size_t part, const dvec3& d) {
    const double w = glm::dot(d, frame.forward);
    if (!(w > kNearPlane)) return void(outside[part] = 1);
    boxes[part].add(slopes(frame, d));
  });
  for (const SlopeBox& b : boxes) box.add(b);
  const double widest = std::max({-box.low.x, -box.low.y, box.high.x, box.high.y});
  return std::find(outside.begin(), outside.end(), 1) == outside.end() && widest <= kWidestSlope;
}

std::array<SlopeBox, 6> fit_cube(const ReceiverArray& receivers, const MapRequest& request) {
  std::array<CameraFrame, 6> frames;
  for (std::size_t k = 0; k < 6; ++k) frames[k] = face_frame(request.axes, request.eye, k);
  std::vector<std::array<SlopeBox, 6>> boxes(part_count(request));
  for_each_direction(receivers, request, [&](std::size_t part, const dvec3& d) {
    const std::uint32_t face = cube_face(request.axes, d);
    if (face != kNone) boxes[part][face].add(slopes(frames[face], d));
  });
  std::array<SlopeBox, 6> all;
  for (const auto& part : boxes) {
    for (std::size_t k = 0; k < 6; ++k) all[k].add(part[k]);
  }
  return all;
}

/// Square lexels over the slopes and the margin around them.
void frame_map(const MapRequest& request, std::size_t face, SlopeBox box, DepthMap& map) {
  box.low -= request.margin, box.high += request.margin;
  const dvec2 extent = box.high - box.low;
  const double widest = std::max({-box.low.x, -box.low.y, box.high.x, box.high.y});
  const double border = kBorderPx + std::min(request.border, request.resolution / 4);
  const double inner = request.resolution - 2.0 * border;
  map.camera = face_frame(request.axes, request.eye, face);
  map.camera.focal_px = inner / std::max({extent.x, extent.y, kNarrowestMap});
  if (widest > 0.0) map.camera.focal_px = std::min(map.camera.focal_px, kFarthestCenterPx / widest);
  const auto side = [&](double slopes_across) {
    const double lexels = std::ceil(slopes_across * map.camera.focal_px + 2.0 * border);
    return static_cast<std::uint32_t>(std::clamp(lexels, 1.0, static_cast<double>(request.resolution)));
  };
  map.width = side(extent.x);
  map.height = side(extent.y);
  map.camera.center_x_px = border - box.low.x * map.camera.focal_px;
  map.camera.center_y_px = border + box.high.y * map.camera.focal_px;
}

}  // namespace

MapAxes make_map_axes(const LightSamples& samples, const ReceiverArray& receivers) {
  if (samples.flat) return {samples.axis_u, samples.axis_v, samples.axis_n};
  dvec3 sum(0.0);
  for (const vec3& p : receivers.position) {
    const dvec3 d = dvec3(p) - samples.center;
    const double length = glm::length(d);
    if (length > 0.0) sum += d / length;
  }
  MapAxes axes;
  if (!(glm::length(sum) > 1e-6 * static_cast<double>(receivers.size()))) return axes;
  axes.z = glm::normalize(sum);
  const dvec3 a = glm::abs(axes.z);
  const dvec3 other = a.x <= a.y && a.x <= a.z ? dvec3(1, 0, 0) : (a.y <= a.z ? dvec3(0, 1, 0) : dvec3(0, 0, 1));
  axes.x = glm::normalize(glm::cross(other, axes.z));
  axes.y = glm::cross(axes.z, axes.x);
  return axes;
}

const DepthMap* LightMaps::map_of(const dvec3& p) const {
  const std::uint32_t face = cube ? cube_face(axes, p - eye) : 0;
  return face == kNone || faces[face].empty() ? nullptr : &faces[face];
}

std::uint64_t LightMaps::maps() const {
  return static_cast<std::uint64_t>(
      std::count_if(faces.begin(), faces.end(), [](const DepthMap& m) { return !m.empty(); }));
}

std::uint64_t LightMaps::lexels() const {
  std::uint64_t count = 0;
  for (const DepthMap& map : faces) count += std::uint64_t{map.width} * map.height * map.layers.size();
  return count;
}

void make_light_maps(const LatticeMesh& mesh, const ReceiverArray& receivers, const MapRequest& request,
                     LightMaps& maps) {
  maps.eye = request.eye;
  maps.axes = request.axes;
  std::array<SlopeBox, 6> boxes;
  maps.cube = !fit_single(receivers, request, boxes[0]);
  if (maps.cube) boxes = fit_cube(receivers, request);
  for (std::size_t k = 0; k < 6; ++k) {
    maps.faces[k].width = maps.faces[k].height = 0;
    if (boxes[k].empty()) continue;
    frame_map(request, k, boxes[k], maps.faces[k]);
    draw_depth_map(mesh, request.layers, maps.faces[k]);
  }
}

void make_center_maps(const LatticeMesh& mesh, const ReceiverArray& receivers, const LightSamples& samples,
                      std::uint32_t border, const ShadowMapOptions& options, LightMaps& maps, ShadowStats& stats) {
  const std::vector<std::uint32_t> all = all_receivers(receivers);
  make_light_maps(mesh, receivers,
                  {.eye = samples.center,
                   .axes = make_map_axes(samples, receivers),
                   .border = border,
                   .resolution = options.resolution,
                   .receivers = all},
                  maps);
  note_maps(maps, stats);
}

std::optional<MapReceiver> place_in_maps(const LightMaps& maps, const ReceiverArray& receivers, std::size_t i,
                                         const ShadowMapOptions& options) {
  const DepthMap* map = maps.map_of(dvec3(receivers.position[i]));
  if (map == nullptr) return std::nullopt;
  return place_in_map(*map, receivers.position[i], receivers.normal[i], options);
}

std::vector<std::uint32_t> all_receivers(const ReceiverArray& receivers) {
  std::vector<std::uint32_t> all(receivers.size());
  for (std::uint32_t i = 0; i < all.size(); ++i) all[i] = i;
  return all;
}

std::vector<std::uint32_t> receivers_of_set(const ReceiverArray& receivers, std::uint32_t set) {
  std::vector<std::uint32_t> some;
  for (std::uint32_t i = 0; i < receivers.size(); ++i) {
    if (receivers.set[i] == set) some.push_back(i);
  }
  return some;
}

double equivalent_radius(const Light& light) {
  const auto mean_square = [](std::span<const dvec3> points, const dvec3& center) {
    double sum = 0.0;
    for (const dvec3& p : points) sum += glm::dot(p - center, p - center) / static_cast<double>(points.size());
    return sum;
  };
  switch (light.shape) {
    case LightShape::kDisk:
    case LightShape::kSphere:
      return light.radius;
    case LightShape::kRectangle:
      return std::sqrt(glm::length(glm::cross(light.u, light.v)) / kPi);
    case LightShape::kPolygon: {
      dvec3 twice(0.0);
      for (std::size_t i = 2; i < light.points.size(); ++i) {
        twice += glm::cross(light.points[i - 1] - light.points[0], light.points[i] - light.points[0]);
      }
      return std::sqrt(glm::length(twice) / (2.0 * kPi));
    }
    case LightShape::kEllipsoid:
      return std::sqrt(mean_square(light.axes, dvec3(0.0)));
    case LightShape::kSamples: {
      dvec3 low = light.points[0], high = low;
      for (const dvec3& p : light.points) low = glm::min(low, p), high = glm::max(high, p);
      return std::sqrt(mean_square(light.points, (low + high) * 0.5));
    }
    default:
      return 0.0;
  }
}

std::string assumptions_of_equivalent_light(const Light& light) {
  static constexpr const char* kNames[] = {"point",   "rectangle", "disk",    "sphere",
                                           "samples", "ellipsoid", "polygon", "sun"};
  const std::string radius = short_number(equivalent_radius(light));
  if (light.shape == LightShape::kDisk || light.shape == LightShape::kSphere) {
    return "a sphere of the light's radius " + radius;
  }
  return "a sphere of radius " + radius + " in place of the " + kNames[static_cast<std::size_t>(light.shape)];
}

namespace {

/// Largest 1/w of the first layers.
double nearest_inverse_w(const LightMaps& maps) {
  float largest = 0.0f;
  for (const DepthMap& map : maps.faces) {
    if (!map.empty()) largest = std::max(largest, *std::max_element(map.layers[0].begin(), map.layers[0].end()));
  }
  return double{largest};
}

std::uint64_t count_before(const LightMaps& maps, double plane) {
  std::uint64_t count = 0;
  for (const DepthMap& map : maps.faces) {
    if (map.empty()) continue;
    count += static_cast<std::uint64_t>(std::count_if(map.layers[0].begin(), map.layers[0].end(),
                                                      [plane](float inverse_w) { return inverse_w * plane > 1.0; }));
  }
  return count;
}

}  // namespace

SearchMaps make_search_maps(const LatticeMesh& mesh, const ReceiverArray& receivers, const LightSamples& samples,
                            double radius, double plane, std::uint32_t layers, const ShadowMapOptions& options) {
  SearchMaps search;
  const std::vector<std::uint32_t> all = all_receivers(receivers);
  MapRequest request{.eye = samples.center,
                     .axes = make_map_axes(samples, receivers),
                     .margin = radius > 0.0 ? 1.0 : 0.0,
                     .resolution = std::max(16u, options.resolution / 4),
                     .receivers = all};
  search.plane = plane;
  if (!(plane > 0.0)) {
    make_light_maps(mesh, receivers, request, search.maps);
    // A lexel's centre may miss the nearest point; a surface seen twice as coarsely is not much nearer.
    search.plane = std::max(0.9 / nearest_inverse_w(search.maps), radius);
  }
  request.margin = radius / search.plane;
  request.resolution = options.resolution;
  request.layers = layers;
  make_light_maps(mesh, receivers, request, search.maps);
  search.before_plane = count_before(search.maps, search.plane * (1.0 - 1e-6));
  return search;
}

void note_maps(const LightMaps& maps, ShadowStats& stats) {
  stats.details.emplace_back("map.maps", static_cast<double>(maps.maps()));
  stats.details.emplace_back("map.lexels", static_cast<double>(maps.lexels()));
  stats.bytes += maps.bytes();
}

}  // namespace halfshade
