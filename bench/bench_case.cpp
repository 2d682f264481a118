#include "bench_case.h"

#include <cmath>
#include <numeric>

#include "rasterizer/core/hash.h"
#include "rasterizer/core/parallel.h"
#include "rasterizer/core/stopwatch.h"
#include "rasterizer/rasterizer.h"
#include "shadows/oracle.h"

namespace halfshade::bench {
namespace {

std::vector<std::uint32_t> tile_order(const GBuffer& gbuffer, const ReceiverArray& receivers) {
  const auto key = [&](std::uint32_t r) {
    const std::uint32_t x = receivers.sample[r] % gbuffer.window.width(),
                        y = receivers.sample[r] / gbuffer.window.width();
    return std::array<std::uint32_t, 4>{y / 4, x / 4, y % 4, x % 4};
  };
  std::vector<std::uint32_t> order(receivers.size());
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) { return key(a) < key(b); });
  return order;
}

}  // namespace

double light_diagonal(const Light& light) {
  switch (light.shape) {
    case LightShape::kRectangle:
      return std::sqrt(glm::dot(light.u, light.u) + glm::dot(light.v, light.v));
    case LightShape::kDisk:
    case LightShape::kSphere:
      return 2.0 * light.radius;
    default:
      return 0.0;
  }
}

double box_diagonal(const Scene& scene) {
  dvec3 low = scene.positions.at(0), high = low;
  for (const dvec3& p : scene.positions) low = glm::min(low, p), high = glm::max(high, p);
  return glm::length(high - low);
}

void scale_light(Light& light, double factor) { light.u *= factor, light.v *= factor, light.radius *= factor; }

Case make_case(const std::string& name, const Scene& scene, const View& view, std::size_t light,
               const std::string& size, const ShadowConfig& config) {
  Case c;
  c.scene = name;
  c.light = view.lights[light];
  c.light_name = c.light.name;
  c.light_percent = 100.0 * light_diagonal(c.light) / box_diagonal(scene);
  std::vector<dvec3> reach;
  for (const Light& l : view.lights) {
    const std::vector<dvec3> extent = light_extent(l);
    reach.insert(reach.end(), extent.begin(), extent.end());
  }
  c.mesh = make_lattice_mesh(scene, make_local_frame(scene.positions, reach));
  RasterConfig raster;
  if (std::sscanf(size.c_str(), "%5ux%5u", &raster.width, &raster.height) != 2) {
    throw Error(ErrorCode::kUsage, "size '" + size + "' is not WIDTHxHEIGHT");
  }
  rasterize(c.mesh, view.camera, raster, c.gbuffer);
  c.mesh = opaque_part(c.mesh);  // ours and the rivals answer for the triangles that block
  c.samples = make_light_samples(c.light, config, c.mesh.frame);
  c.receivers = make_receivers(c.gbuffer, c.samples, config.seed);
  c.order = tile_order(c.gbuffer, c.receivers);
  return c;
}

OracleCheck check_with_oracle(const Case& c, const VisibilityMasks& masks, double percent, double seconds) {
  constexpr std::size_t kBatch = 64;
  std::vector<std::uint32_t> chosen(c.receivers.size());
  std::iota(chosen.begin(), chosen.end(), 0u);
  std::sort(chosen.begin(), chosen.end(),
            [](std::uint32_t a, std::uint32_t b) { return hash32(a, 0x5eed) < hash32(b, 0x5eed); });
  chosen.resize(static_cast<std::size_t>(std::ceil(static_cast<double>(chosen.size()) * percent * 0.01)));
  OracleCheck check;
  Stopwatch watch;
  for (double ms = 0.0; check.receivers < chosen.size() && ms < 1000.0 * seconds; ms += watch.lap()) {
    const std::size_t first = check.receivers, count = std::min(kBatch, chosen.size() - first);
    std::vector<std::uint64_t> wrong(count, 0);
    parallel_ranges(count, 1, [&](std::size_t begin, std::size_t end) {
      std::vector<std::uint64_t> truth(masks.words_per_receiver);
      for (std::size_t i = begin; i != end; ++i) {
        std::fill(truth.begin(), truth.end(), 0);
        oracle_mask(c.mesh, c.receivers, chosen[first + i], c.samples, truth);
        const auto mask = masks.mask(chosen[first + i]);
        for (std::size_t w = 0; w < truth.size(); ++w)
          wrong[i] += static_cast<std::uint64_t>(std::popcount(truth[w] ^ mask[w]));
      }
    });
    check.receivers += count;
    for (const std::uint64_t w : wrong) check.wrong_bits += w;
  }
  return check;
}

}  // namespace halfshade::bench
