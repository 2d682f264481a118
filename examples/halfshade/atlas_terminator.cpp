#include "atlas_terminator.h"

#include "rasterizer/bent_normals.h"
#include "rasterizer/rasterizer.h"
#include "rasterizer/scenes/hard_cases.h"
#include "rasterizer/shading.h"
#include "shadows/solver.h"

namespace halfshade {
namespace {

enum class Shading { kPlain, kBent, kPlainUnshadowed };

/// One picture of the sphere; counts what is lit on facets that face away, unless that is null.
std::vector<float> shade_sphere(std::uint32_t segments, std::uint32_t rings, Shading shading, std::uint32_t side,
                                TerminatorPicture* counts) {
  const Scene scene = cases::smooth_sphere(segments, rings);
  const Light light = cases::grazing_light();
  const LatticeMesh mesh = make_lattice_mesh(scene, make_local_frame(scene.positions, light_extent(light)));
  Camera camera;
  camera.eye = {0.0, 0.4, 6.0};
  camera.fov_y_deg = 20.0;
  GBuffer gbuffer;
  rasterize(mesh, camera, {side, side, {}}, gbuffer);
  std::vector<float> shade;
  if (shading == Shading::kBent) {
    shade = BentNormals(mesh).cosines(gbuffer, camera, light);
  } else {
    for (const vec3& response : light_response(gbuffer, mesh.frame, light)) shade.push_back(response.x);
  }
  if (shading != Shading::kPlainUnshadowed) {
    ShadowConfig config;
    const LightSamples samples = make_light_samples(light, config, mesh.frame);
    const ReceiverArray receivers = make_receivers(gbuffer, samples, config.seed);
    VisibilityMasks masks;
    ShadowStats stats;
    solve_masks(mesh, receivers, light, samples, config, masks, stats);
    std::vector<float> visibility(gbuffer.size(), 0.0f);
    for (std::size_t i = 0; i < receivers.size(); ++i) visibility[receivers.sample[i]] = masks.visibility(i);
    for (std::size_t i = 0; i < shade.size(); ++i) shade[i] *= visibility[i];
  }
  if (counts == nullptr) return shade;
  std::uint64_t lit = 0;
  for (std::size_t i = 0; i < gbuffer.size(); ++i) {
    if (gbuffer.triangle[i] == kNone) continue;
    const dvec3 a(mesh.corners(gbuffer.triangle[i])[0]), normal(gbuffer.geometric_normal[i]);
    if (glm::dot(normal, mesh.frame.to_local(light.center) - a) > 0.0) continue;
    ++counts->facing_away, lit += shade[i] > 0.0f;
  }
  counts->lit_facing_away =
      static_cast<double>(lit) / static_cast<double>(std::max<std::uint64_t>(1, counts->facing_away));
  return shade;
}

}  // namespace

Terminator make_terminator(std::uint32_t side) {
  Terminator result;
  result.title = "Terminator (A10)";
  result.what =
      "A sphere of 16 x 8 facets with the normals of the true sphere under a light from the side. Interpolated normals "
      "and the facets disagree about where the light sets.";
  result.truth_is = "the same sphere of 512 x 256 facets";
  result.side = side;
  result.truth = shade_sphere(512, 256, Shading::kPlain, side, nullptr);
  const auto add = [&](const char* id, Shading shading, const char* why) {
    TerminatorPicture picture;
    picture.id = id;
    picture.why = why;
    picture.shade = shade_sphere(16, 8, shading, side, &picture);
    result.pictures.push_back(std::move(picture));
  };
  add("smooth normals, no shadows", Shading::kPlainUnshadowed,
      "Without shadows facets that face away are lit by their interpolated normals.");
  add("smooth normals, exact shadows", Shading::kPlain,
      "Exact shadows black these facets out: the mesh shows as a saw along the terminator.");
  add("bent normals, exact shadows", Shading::kBent,
      "Cosines fade out before the facet turns away: black where it must be, and no step.");
  return result;
}

}  // namespace halfshade
