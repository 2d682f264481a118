// Receivers with normals, as the command line makes them: a small picture of a scene under one light.
#pragma once

#include "rasterizer/rasterizer.h"
#include "shadows/solver.h"

namespace halfshade::test {

/// Refers to the scene, which must outlive it.
struct LitPicture {
  LatticeMesh mesh;
  Light light;
  LightSamples samples;
  ReceiverArray receivers;
};

inline LitPicture make_lit_picture(const Scene& scene, const Camera& camera, const Light& light,
                                   const ShadowConfig& config, std::uint32_t side = 48) {
  LitPicture picture;
  const std::vector<dvec3> reach = light_extent(light);
  picture.mesh = make_lattice_mesh(scene, make_local_frame(scene.positions, reach));
  picture.light = light;
  RasterConfig raster;
  raster.width = raster.height = side;
  GBuffer gbuffer;
  rasterize(picture.mesh, camera, raster, gbuffer);
  picture.samples = make_light_samples(light, config, picture.mesh.frame);
  picture.receivers = make_receivers(gbuffer, picture.samples, config.seed);
  return picture;
}

inline std::vector<float> visibility_by(const LitPicture& picture, ShadowConfig config, ShadowMethod method,
                                        ShadowStats* stats = nullptr) {
  config.method = method;
  std::vector<float> visibility;
  ShadowStats own;
  solve_visibility(picture.mesh, picture.receivers, picture.light, picture.samples, config, visibility,
                   stats != nullptr ? *stats : own);
  return visibility;
}

}  // namespace halfshade::test
