#include "shadows/raytrace/raytrace.h"

#include <algorithm>

#include "rasterizer/core/parallel.h"
#include "rasterizer/core/stopwatch.h"
#include "shadows/light_maps.h"
#include "shadows/opaque_mesh.h"
#include "shadows/raytrace/embree_rays.h"
#include "shadows/solver.h"

namespace halfshade {

void solve_raytrace(const LatticeMesh& mesh, const ReceiverArray& receivers, const LightSamples& samples,
                    const ShadowConfig& config, VisibilityMasks& masks, ShadowStats& stats) {
  if (!embree_available()) {
    throw Error(ErrorCode::kUsage, "method 'raytrace': built without Embree (3.x, found by CMake as 'embree')");
  }
  const FpEnvironment environment;
  const OpaqueMesh opaque(mesh);
  stats = {};
  stats.receivers = receivers.size();
  stats.triangles = mesh.triangles.size();
  Stopwatch watch;
  masks.reset(receivers.size(), samples.count);
  const EmbreeMode mode = best_embree_mode(samples.count, config.raytrace.robust);
  EmbreeRays embree(opaque.get(), receivers, samples, static_cast<int>(concurrency()));
  embree.build_ms(mode);
  stats.build_ms = watch.lap();
  constexpr std::size_t kRound = 16384;
  const std::vector<std::uint32_t> order = all_receivers(receivers);
  for (std::size_t first = 0; first < order.size(); first += kRound) {
    report_progress(config, static_cast<double>(first) / static_cast<double>(order.size()));
    embree.trace(mode, std::span(order).subspan(first, std::min(kRound, order.size() - first)), masks);
  }
  stats.test_ms = watch.lap();
  stats.sample_tests = std::uint64_t{samples.count} * receivers.size();
}

}  // namespace halfshade
