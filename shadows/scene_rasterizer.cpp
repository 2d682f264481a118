#include "rasterizer/core/parallel.h"
#include "rasterizer/rasterizer.h"
#include "shadows/scene_store.h"

namespace halfshade {

void rasterize(const ShadowScene& scene, const Camera& camera, const RasterConfig& config, GBuffer& gbuffer,
               const Execution& execution) {
  require_committed(scene.impl());
  run_call(execution, [&] {
    rasterize(scene.impl().mesh, camera, config, gbuffer);
    gbuffer.drawn = scene.impl().state();
  });
}

}  // namespace halfshade
