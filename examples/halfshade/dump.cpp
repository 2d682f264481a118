#include "dump.h"

#include <fmt/format.h>

#include <fstream>

#include "halfshade/error.h"
#include "mask_file.h"
#include "rasterizer/io/atomic_file.h"
#include "rasterizer/io/npy.h"
#include "shadows/opaque_mesh.h"

namespace halfshade {
namespace {

namespace fs = std::filesystem;

std::vector<double> flatten(std::span<const vec3> points) {
  std::vector<double> values;
  values.reserve(points.size() * 3);
  for (const vec3& p : points) values.insert(values.end(), {p.x, p.y, p.z});
  return values;
}

template <class T>
void write_array(const fs::path& directory, const char* name, const char* dtype, std::vector<std::size_t> shape,
                 const std::vector<T>& values) {
  write_npy(directory / name, dtype, shape, values.data());
}

void write_triangles(const fs::path& directory, const LatticeMesh& mesh) {
  std::vector<vec3> corners;
  corners.reserve(mesh.triangles.size() * 3);
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    for (const vec3& p : mesh.corners(t)) corners.push_back(p);
  }
  write_array(directory, "triangles.npy", "f8", {mesh.triangles.size(), 3, 3}, flatten(corners));
}

/// Texture coordinates, texture number per triangle, the textures; only for scenes with alpha-tested triangles.
void write_alpha(const fs::path& directory, const LatticeMesh& mesh, nlohmann::ordered_json& about) {
  const Scene& scene = *mesh.scene;
  if (scene.alpha_maps.empty() || scene.triangle_uvs.empty()) return;
  std::vector<float> uvs;
  std::vector<std::int32_t> map_of_triangle;
  std::vector<float> cutoffs(scene.alpha_maps.size(), 0.5f);
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    for (const vec2& uv : scene.triangle_uvs[t]) uvs.insert(uvs.end(), {uv.x, uv.y});
    const std::uint32_t map = mesh.alpha_map(t);
    map_of_triangle.push_back(map == kNone ? -1 : static_cast<std::int32_t>(map));
    if (map != kNone) cutoffs[map] = scene.materials[scene.triangle_materials[t]].alpha_cutoff;
  }
  write_array(directory, "triangle_uvs.npy", "f4", {mesh.triangles.size(), 3, 2}, uvs);
  write_array(directory, "triangle_alpha.npy", "i4", {mesh.triangles.size()}, map_of_triangle);
  for (std::size_t k = 0; k < scene.alpha_maps.size(); ++k) {
    const AlphaMap& map = scene.alpha_maps[k];
    write_array(directory, fmt::format("alpha_{}.npy", k).c_str(), "u1", {map.height, map.width}, map.alpha);
  }
  about["alpha_cutoffs"] = cutoffs;
}

void write_lighting(const fs::path& directory, const LightSamples& samples, const DumpLighting& lighting,
                    nlohmann::ordered_json& about) {
  const PixelWindow& w = lighting.window;
  about["window"] = {w.x0, w.x1, w.y0, w.y1};
  write_array(directory, "picture_rest.npy", "f4", {w.height(), w.width(), 3}, lighting.rest);
  write_array(directory, "receiver_response.npy", "f4", {lighting.response.size(), 3}, lighting.response);
  if (!samples.st.empty()) write_array(directory, "light_st.npy", "f8", {samples.sets, samples.count, 2}, samples.st);
}

NpyArray read_array(const fs::path& directory, const std::string& name, const std::vector<std::size_t>& shape) {
  NpyArray array = read_npy(directory / name);
  bool fits = array.shape.size() == shape.size();
  for (std::size_t k = 0; fits && k < shape.size(); ++k) fits = shape[k] == 0 || shape[k] == array.shape[k];
  if (fits) return array;
  throw Error(ErrorCode::kBadInput,
              fmt::format("{}: the array's shape is ({}), expected ({}) (0 = any)", (directory / name).string(),
                          fmt::join(array.shape, ", "), fmt::join(shape, ", ")));
}

/// Lattice points; anything off the lattice is not a dump of ours.
std::vector<vec3> read_points(const fs::path& directory, const std::string& name,
                              const std::vector<std::size_t>& shape) {
  const NpyArray array = read_array(directory, name, shape);
  const std::span<const double> values = array.as<double>();
  std::vector<vec3> points(values.size() / 3);
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double x = values[i];
    if (!(x >= -2.0 && x <= 2.0) || static_cast<double>(snap_to_lattice(x)) != x) {
      throw Error(ErrorCode::kBadInput, fmt::format("{}: value {} at {} is not on the lattice of 2^-38 in [-2, 2]",
                                                    (directory / name).string(), x, i));
    }
    points[i / 3][static_cast<int>(i % 3)] = static_cast<float>(x);
  }
  return points;
}

template <class T>
std::vector<T> read_values(const fs::path& directory, const std::string& name, const std::vector<std::size_t>& shape) {
  const NpyArray array = read_array(directory, name, shape);
  const std::span<const T> values = array.as<T>();
  return {values.begin(), values.end()};
}

nlohmann::ordered_json read_about(const fs::path& directory) {
  std::ifstream file(directory / "dump.json");
  if (!file) throw Error(ErrorCode::kBadInput, fmt::format("{}: cannot be opened", (directory / "dump.json").string()));
  try {
    return nlohmann::ordered_json::parse(file);
  } catch (const nlohmann::json::exception& e) {
    throw Error(ErrorCode::kBadInput, fmt::format("{}: {}", (directory / "dump.json").string(), e.what()));
  }
}

void read_alpha(const fs::path& directory, Dump& dump) {
  const std::size_t triangles = dump.mesh.triangles.size();
  dump.scene.triangle_materials.assign(triangles, 0);
  dump.scene.materials.resize(1);
  if (!fs::exists(directory / "triangle_alpha.npy")) return;
  const auto uvs = read_values<float>(directory, "triangle_uvs.npy", {triangles, 3, 2});
  const auto map_of_triangle = read_values<std::int32_t>(directory, "triangle_alpha.npy", {triangles});
  const auto cutoffs = dump.about.at("alpha_cutoffs").get<std::vector<float>>();
  for (std::size_t k = 0; k < cutoffs.size(); ++k) {
    const std::string name = fmt::format("alpha_{}.npy", k);
    const NpyArray texels = read_array(directory, name, {0, 0});
    const auto values = texels.as<std::uint8_t>();
    dump.scene.alpha_maps.push_back({name,
                                     static_cast<std::uint32_t>(texels.shape[1]),
                                     static_cast<std::uint32_t>(texels.shape[0]),
                                     {values.begin(), values.end()}});
    Material material;
    material.alpha_map = static_cast<std::uint32_t>(k);
    material.alpha_cutoff = cutoffs[k];
    dump.scene.materials.push_back(material);
  }
  for (std::size_t t = 0; t < triangles; ++t) {
    if (map_of_triangle[t] < -1 || map_of_triangle[t] >= static_cast<std::int32_t>(cutoffs.size())) {
      throw Error(ErrorCode::kBadInput, fmt::format("triangle_alpha.npy: texture {} of triangle {} is not in -1..{}",
                                                    map_of_triangle[t], t, static_cast<int>(cutoffs.size()) - 1));
    }
    dump.scene.triangle_materials[t] = static_cast<std::uint32_t>(map_of_triangle[t] + 1);
    const float* p = &uvs[t * 6];
    dump.scene.triangle_uvs.push_back({vec2(p[0], p[1]), vec2(p[2], p[3]), vec2(p[4], p[5])});
  }
}

}  // namespace

void write_dump(const fs::path& directory, const LatticeMesh& scene_mesh, const ReceiverArray& receivers,
                const std::vector<std::uint32_t>& receiver_pixels, const LightSamples& samples,
                const VisibilityMasks& masks, const DumpLighting& lighting, nlohmann::ordered_json about) {
  const OpaqueMesh opaque(scene_mesh);
  const LatticeMesh& mesh = opaque.get();
  std::error_code error;
  fs::create_directories(directory, error);
  if (error) throw Error(ErrorCode::kOutput, fmt::format("{}: {}", directory.string(), error.message()));
  fs::remove(directory / "dump.json", error);  // written last: a dump with it is complete
  const std::size_t count = receivers.size();
  write_array(directory, "receivers.npy", "f8", {count, 3}, flatten(receivers.position));
  write_array(directory, "receiver_normals.npy", "f4", {count, 3}, receivers.normal);
  write_array(directory, "receiver_pixels.npy", "u4", {count}, receiver_pixels);
  write_array(directory, "receiver_triangles.npy", "u4", {count}, receivers.triangle);
  write_array(directory, "receiver_sets.npy", "u1", {count}, receivers.set);
  write_array(directory, "light_samples.npy", "f8", {samples.sets, samples.count, 3}, flatten(samples.points));
  write_masks(directory / "masks.npy", masks);
  write_triangles(directory, mesh);
  write_alpha(directory, mesh, about);
  write_lighting(directory, samples, lighting, about);
  const LocalFrame& frame = mesh.frame;
  const dvec3 center = frame.center();
  about["frame"] = {{"center", {center.x, center.y, center.z}},
                    {"box_min", {frame.box_min.x, frame.box_min.y, frame.box_min.z}},
                    {"half_extent", {frame.half_extent.x, frame.half_extent.y, frame.half_extent.z}},
                    {"scale", frame.scale}};
  about["counts"] = {
      {"receivers", count}, {"triangles", mesh.triangles.size()}, {"samples", samples.count}, {"sets", samples.sets}};
  if (opaque.translucent() > 0) about["counts"]["translucent_triangles"] = opaque.translucent();
  about["mask_hash"] = masks.hash();
  write_file_atomically(directory / "dump.json", about.dump(2) + "\n");
}

void read_dump(const fs::path& directory, Dump& dump) {
  dump.about = read_about(directory);
  dump.mesh.positions = read_points(directory, "triangles.npy", {0, 3, 3});
  dump.mesh.triangles.resize(dump.mesh.positions.size() / 3);
  for (std::uint32_t t = 0; t < dump.mesh.triangles.size(); ++t) dump.mesh.triangles[t] = {3 * t, 3 * t + 1, 3 * t + 2};
  try {
    read_alpha(directory, dump);
  } catch (const nlohmann::json::exception& e) {
    throw Error(ErrorCode::kBadInput, fmt::format("{}: {}", (directory / "dump.json").string(), e.what()));
  }
  dump.mesh.scene = &dump.scene;
  dump.receivers.position = read_points(directory, "receivers.npy", {0, 3});
  const std::size_t count = dump.receivers.size();
  dump.receivers.triangle = read_values<std::uint32_t>(directory, "receiver_triangles.npy", {count});
  dump.receivers.set = read_values<std::uint8_t>(directory, "receiver_sets.npy", {count});
  dump.receivers.sample = read_values<std::uint32_t>(directory, "receiver_pixels.npy", {count});
  dump.samples.points = read_points(directory, "light_samples.npy", {0, 0, 3});
  const NpyArray samples = read_npy(directory / "light_samples.npy");
  dump.samples.sets = static_cast<std::uint32_t>(samples.shape[0]);
  dump.samples.count = static_cast<std::uint32_t>(samples.shape[1]);
  for (const std::uint8_t set : dump.receivers.set) {
    if (set >= dump.samples.sets) {
      throw Error(ErrorCode::kBadInput,
                  fmt::format("receiver_sets.npy: set {} is not in 0..{}", set, dump.samples.sets - 1));
    }
  }
  read_masks(directory / "masks.npy", count, dump.samples.count, dump.masks);
}

DumpLighting read_lighting(const fs::path& directory, Dump& dump) {
  if (!fs::exists(directory / "light_st.npy")) {
    throw Error(ErrorCode::kBadInput,
                fmt::format("{}: light_st.npy is missing: the light has no pattern, or the dump is older than relight",
                            directory.string()));
  }
  DumpLighting lighting;
  PixelWindow& w = lighting.window;
  try {
    const auto window = dump.about.at("window").get<std::array<std::uint32_t, 4>>();
    w = {window[0], window[1], window[2], window[3]};
  } catch (const nlohmann::json::exception& e) {
    throw Error(ErrorCode::kBadInput, fmt::format("{}: {}", (directory / "dump.json").string(), e.what()));
  }
  if (w.x0 >= w.x1 || w.y0 >= w.y1 || w.x1 > 16384 || w.y1 > 16384) {
    throw Error(ErrorCode::kBadInput,
                fmt::format("{}: /window is not x0 < x1, y0 < y1 within 16384", (directory / "dump.json").string()));
  }
  const auto rest = read_values<float>(directory, "picture_rest.npy", {w.height(), w.width(), 3});
  const auto response = read_values<float>(directory, "receiver_response.npy", {dump.receivers.size(), 3});
  const auto st = read_values<double>(directory, "light_st.npy", {dump.samples.sets, dump.samples.count, 2});
  for (std::size_t i = 0; i < rest.size(); i += 3) lighting.rest.emplace_back(rest[i], rest[i + 1], rest[i + 2]);
  for (std::size_t i = 0; i < response.size(); i += 3) {
    lighting.response.emplace_back(response[i], response[i + 1], response[i + 2]);
  }
  for (std::size_t i = 0; i < st.size(); i += 2) {
    if (!(st[i] >= 0.0 && st[i] < 1.0 && st[i + 1] >= 0.0 && st[i + 1] < 1.0)) {
      throw Error(ErrorCode::kBadInput, fmt::format("light_st.npy: sample {} is not in [0, 1)", i / 2));
    }
    dump.samples.st.emplace_back(st[i], st[i + 1]);
  }
  return lighting;
}

}  // namespace halfshade
