// A ray caster on Embree that takes its shadows from halfshade: primary hits by Embree, soft shadows once by Embree's
// own shadow rays (every way it offers) and once by halfshade, for the same points, light and light samples. Prints
// the times and how many bits differ; writes both pictures side by side.
//
//   embree_host [SCENE [SIZE [OUT.png]]]      SCENE: built-in name or path of an OBJ; default: demo 512 embree_host.png
#include <tbb/parallel_for.h>

#include <bit>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "embree_host_rays.h"
#include "halfshade/halfshade.h"
#include "rasterizer/io/image.h"
#include "rasterizer/io/obj_scene.h"
#include "rasterizer/io/view_file.h"
#include "rasterizer/scenes/builtin.h"

using namespace embree_host;

namespace {

double milliseconds(const auto& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

void load(const std::string& name, Host& host) {
  if (name.ends_with(".obj")) {
    ObjLoadReport report;
    host.scene = load_obj(name, {}, report);
    const View view = load_view(name.substr(0, name.size() - 4) + ".view.json");
    host.camera = view.camera, host.light = view.lights.at(0);
  } else {
    BuiltinScene builtin = make_builtin_scene(name);
    host.scene = std::move(builtin.scene);
    host.camera = builtin.view.camera, host.light = builtin.view.lights.at(0);
  }
  if (host.light.shape != LightShape::kRectangle) throw Error(ErrorCode::kBadInput, "the first light is no rectangle");
  dvec3 low = host.scene.positions.at(0), high = low;
  for (const dvec3& p : host.scene.positions) low = glm::min(low, p), high = glm::max(high, p);
  host.epsilon = 1e-5 * glm::length(high - low);
  for (const dvec3& p : host.scene.positions) host.vertices.emplace_back(p);
  for (std::uint32_t i = 0; i < kSamples; ++i) {  // SamplePattern::kUniform: cell centres, row by row
    const double s = (i % kSide + 0.5) / kSide - 0.5, t = (i / kSide + 0.5) / kSide - 0.5;
    host.samples.emplace_back(host.light.center + host.light.u * s + host.light.v * t);
  }
}

void build_tree(Host& host) {
  host.device = rtcNewDevice(nullptr);
  host.tree = rtcNewScene(host.device);
  rtcSetSceneFlags(host.tree, RTC_SCENE_FLAG_ROBUST);
  RTCGeometry geometry = rtcNewGeometry(host.device, RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* vertices = static_cast<vec3*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                                              sizeof(vec3), host.vertices.size()));
  std::copy(host.vertices.begin(), host.vertices.end(), vertices);
  auto* corners = static_cast<std::array<std::uint32_t, 3>*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(std::uint32_t), host.scene.triangles.size()));
  std::copy(host.scene.triangles.begin(), host.scene.triangles.end(), corners);
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(host.tree, geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(host.tree);
}

/// One ray per pixel. Points are found from the barycentric coordinates, in double: more precise than origin + t * d.
void cast_primary_rays(Host& host) {
  const Camera& c = host.camera;
  const dvec3 forward = glm::normalize(c.target - c.eye), right = glm::normalize(glm::cross(forward, c.up));
  const dvec3 up = glm::cross(right, forward);
  const double slope = 2.0 * std::tan(c.fov_y_deg * 0.5 * 3.14159265358979 / 180.0) / host.size;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  for (std::uint32_t pixel = 0; pixel < host.size * host.size; ++pixel) {
    const double x = (pixel % host.size + 0.5 - host.size * 0.5) * slope;
    const double y = (host.size * 0.5 - pixel / host.size - 0.5) * slope;
    const vec3 eye(c.eye), d(forward + right * x + up * y);
    RTCRayHit ray{};
    ray.ray = {eye.x, eye.y, eye.z, 0.0f, d.x, d.y, d.z, 0.0f, INFINITY, ~0u, 0, 0};
    ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    rtcIntersect1(host.tree, &context, &ray);
    if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) continue;
    const auto& t = host.scene.triangles[ray.hit.primID];
    const dvec3 p0(host.vertices[t[0]]), p1(host.vertices[t[1]]), p2(host.vertices[t[2]]);
    dvec3 normal = glm::normalize(glm::cross(p1 - p0, p2 - p0));
    if (glm::dot(normal, c.eye - p0) < 0.0) normal = -normal;
    const dvec3 point = p0 + (p1 - p0) * double{ray.hit.u} + (p2 - p0) * double{ray.hit.v} + normal * host.epsilon;
    if (glm::dot(normal, host.light.center - point) <= 0.0) continue;  // the host lights nothing from behind
    if (!host.light.two_sided && glm::dot(glm::cross(host.light.u, host.light.v), point - host.light.center) <= 0.0)
      continue;
    host.hits.pixel.push_back(pixel);
    host.hits.triangle.push_back(ray.hit.primID);
    host.hits.position.push_back(dvec3(vec3(point)));  // Embree's rays start at floats, so both start there
    host.hits.normal.push_back(normal);
  }
}

/// The host's own shadows: the best of its ways, and its masks. Each way is timed twice.
double trace_shadows(const Host& host, Masks& masks) {
  double best = INFINITY;
  for (const Way& way : kWays) {
    double time = INFINITY;
    for (int round = 0; round < 2; ++round) {
      masks.assign(host.hits.pixel.size() * (kSamples / 64), 0);
      time = std::min(time, milliseconds([&] {
                        tbb::parallel_for(tbb::blocked_range<std::size_t>(0, host.hits.pixel.size(), 64),
                                          [&](const auto& range) {
                                            RTCIntersectContext context;
                                            rtcInitIntersectContext(&context);
                                            context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
                                            for (std::size_t hit = range.begin(); hit != range.end(); ++hit)
                                              way.trace(host, hit, context, masks);
                                          });
                      }));
    }
    std::printf("  %-14s %9.1f ms\n", way.name, time);
    best = std::min(best, time);
  }
  return best;
}

/// The same question to halfshade. Returns the milliseconds of the second call: nothing but shadows of a known scene.
double ask_halfshade(const Host& host, Masks& masks) {
  ShadowScene scene;
  MeshView mesh;
  mesh.positions = host.vertices;
  mesh.triangles = host.scene.triangles;
  scene.add_mesh(mesh);
  scene.extend(host.light);
  std::printf("  %-14s %9.1f ms\n", "scene", milliseconds([&] { scene.commit(); }));
  const std::vector<std::uint32_t> first_mesh(host.hits.pixel.size(), 0);
  ReceiverView receivers;
  receivers.positions = host.hits.position;
  receivers.meshes = first_mesh;
  receivers.triangles = host.hits.triangle;
  masks.assign(host.hits.pixel.size() * (kSamples / 64), 0);
  ShadowOutput output;
  output.masks = masks;
  const ShadowSolver solver({.light_sample_count = kSamples, .pattern = SamplePattern::kUniform});
  Workspace workspace;
  const auto solve = [&] { solver.solve(scene, receivers, host.light, workspace, output); };
  std::printf("  %-14s %9.1f ms\n", "first call", milliseconds(solve));
  const double time = std::min(milliseconds(solve), milliseconds(solve));
  std::printf("  %-14s %9.1f ms\n", "later calls", time);
  return time;
}

/// Draws the hits into columns x0 .. of a picture that is twice as wide as it is high.
void shade(const Host& host, const Masks& masks, std::uint32_t x0, std::vector<float>& picture) {
  for (std::size_t i = 0; i < host.hits.pixel.size(); ++i) {
    int blocked = 0;
    for (std::size_t w = 0; w < kSamples / 64; ++w) blocked += std::popcount(masks[i * (kSamples / 64) + w]);
    const double cosine = glm::dot(host.hits.normal[i], glm::normalize(host.light.center - host.hits.position[i]));
    const double value = 0.02 + 0.8 * cosine * (1.0 - static_cast<double>(blocked) / kSamples);
    const std::uint32_t x = x0 + host.hits.pixel[i] % host.size, y = host.hits.pixel[i] / host.size;
    picture[std::size_t{y} * 2 * host.size + x] = static_cast<float>(value);
  }
}

}  // namespace

int main(int argc, char** argv) try {
  Host host;
  load(argc > 1 ? argv[1] : "demo", host);
  if (argc > 2) host.size = static_cast<std::uint32_t>(std::clamp(std::atoi(argv[2]), 1, 4096));
  std::printf("%zu triangles; tree by Embree %.1f ms\n", host.scene.triangles.size(),
              milliseconds([&] { build_tree(host); }));
  cast_primary_rays(host);
  std::printf("%zu points under %u light samples; shadow rays of Embree, best of 2:\n", host.hits.pixel.size(),
              kSamples);
  Masks traced, ours;
  const double embree_ms = trace_shadows(host, traced);
  std::printf("halfshade:\n");
  const double our_ms = ask_halfshade(host, ours);

  std::uint64_t differing = 0;
  for (std::size_t i = 0; i < ours.size(); ++i)
    differing += static_cast<std::uint64_t>(std::popcount(ours[i] ^ traced[i]));
  const double bits = static_cast<double>(host.hits.pixel.size()) * kSamples;
  std::printf("Embree's best / halfshade: %.2f; %llu of %.0f bits differ (%.2f per million)\n", embree_ms / our_ms,
              static_cast<unsigned long long>(differing), bits, 1e6 * static_cast<double>(differing) / bits);

  std::vector<float> picture(std::size_t{2} * host.size * host.size, 0.0f);
  shade(host, traced, 0, picture);
  shade(host, ours, host.size, picture);
  const char* name = argc > 3 ? argv[3] : "embree_host.png";
  write_png(name, 2 * host.size, host.size, 1, picture, true, 8, {{"left", "Embree"}, {"right", "halfshade"}});
  rtcReleaseScene(host.tree);
  rtcReleaseDevice(host.device);
  return static_cast<double>(differing) <= 1e-4 * bits ? 0 : 1;
} catch (const std::exception& error) {
  std::fprintf(stderr, "embree_host: %s\n", error.what());
  return 3;
}
