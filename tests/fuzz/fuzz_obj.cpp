// OBJ text, read in three ways that must agree; then onto the lattice.
#include "fuzz/fuzz_target.h"
#include "rasterizer/core/mesh.h"
#include "rasterizer/io/obj_scene.h"
#include "rasterizer/io/obj_stream.h"

namespace halfshade::fuzz {
namespace {

using Corners = std::array<dvec3, 3>;

std::vector<Corners> corners_of(const Scene& scene) {
  std::vector<Corners> result;
  for (const auto& t : scene.triangles) {
    for (const std::uint32_t p : t) require(p < scene.positions.size(), "indices are in range");
    result.push_back({scene.positions[t[0]], scene.positions[t[1]], scene.positions[t[2]]});
  }
  return result;
}

void check_arrays(const Scene& scene) {
  const std::size_t count = scene.triangles.size();
  require(scene.triangle_materials.size() == count, "a material per triangle");
  for (const std::uint32_t m : scene.triangle_materials) require(m < scene.materials.size(), "materials are in range");
  require(scene.triangle_uvs.empty() || scene.triangle_uvs.size() == count, "uvs for all triangles or none");
  require(scene.triangle_normals.empty() || scene.triangle_normals.size() == count, "normals for all or none");
}

struct Whole {
  Scene scene;
  ObjLoadReport report;
  Refusal refusal;
};

Whole load(const std::filesystem::path& file, bool lenient) {
  Whole whole;
  whole.refusal = refusal_of([&] { whole.scene = load_obj(file, {.lenient = lenient}, whole.report); });
  if (!whole.refusal.refused) check_arrays(whole.scene);
  return whole;
}

/// All pieces together, as corners.
struct Streamed {
  std::vector<Corners> corners;
  std::vector<std::string> materials;  // [triangle]
  std::vector<std::array<vec2, 3>> uvs;
  Refusal refusal;
};

Streamed stream(const std::filesystem::path& file, std::size_t chunk_bytes) {
  Streamed all;
  all.refusal = refusal_of([&] {
    ObjLoadReport report;
    SceneStream scene = stream_obj(file, {}, report, chunk_bytes);
    for (scene.rewind(); scene.next(scene.piece);) {
      check_arrays(scene.piece);
      for (const Corners& c : corners_of(scene.piece)) all.corners.push_back(c);
      for (const std::uint32_t m : scene.piece.triangle_materials) {
        all.materials.push_back(scene.piece.materials[m].name);
      }
      all.uvs.insert(all.uvs.end(), scene.piece.triangle_uvs.begin(), scene.piece.triangle_uvs.end());
    }
  });
  return all;
}

void check_stream(const Streamed& streamed, const Whole& whole) {
  require(streamed.refusal.refused == whole.refusal.refused, "the stream refuses what the whole file is refused for");
  if (whole.refusal.refused) return;
  require(streamed.corners == corners_of(whole.scene), "the stream has the file's triangles");
  require(streamed.uvs == whole.scene.triangle_uvs, "the stream has the file's uvs");
  for (std::size_t t = 0; t < streamed.materials.size(); ++t) {
    require(streamed.materials[t] == whole.scene.materials[whole.scene.triangle_materials[t]].name,
            "the stream has the file's materials");
  }
}

void check_lattice(const Scene& scene) {
  const Refusal refusal = refusal_of([&] {
    const LatticeMesh mesh = make_lattice_mesh(scene, make_local_frame(scene.positions, {}));
    for (const vec3& p : mesh.positions) {
      for (int axis = 0; axis < 3; ++axis) {
        require(std::fabs(p[axis]) <= 1.0f, "the local frame holds the scene");
        require(std::ldexp(static_cast<double>(lattice_units(p[axis])), -kLatticeBits) == p[axis], "on the lattice");
      }
    }
  });
  require(!refusal.refused, "what was read fits into a local frame: " + refusal.message);
}

}  // namespace

void fuzz_obj(Bytes input) {
  const auto file = write_file("input.obj", as_text(input));
  const Whole strict = load(file, false), lenient = load(file, true);
  if (strict.refusal.refused) {
    require(strict.refusal.message.find("input.obj") != std::string::npos, "messages name the file");
  } else {
    require(!lenient.refusal.refused, "lenient reading takes what strict reading takes");
    require(strict.scene.positions == lenient.scene.positions && strict.scene.triangles == lenient.scene.triangles,
            "strict and lenient reading agree");
    check_lattice(strict.scene);
  }
  check_stream(stream(file, 64), strict);
}

}  // namespace halfshade::fuzz
