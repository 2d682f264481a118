// How long does the rasterizer take per picture, for few and for many small triangles?
#include <fmt/format.h>

#include <CLI/CLI.hpp>

#include "harness.h"
#include "rasterizer/rasterizer.h"
#include "rasterizer/scenes/builtin.h"

namespace halfshade::bench {
namespace {

void run(const std::vector<std::uint32_t>& blade_counts, std::uint32_t size, int repeat, int threads) {
  const nlohmann::ordered_json conditions = run_conditions(threads);
  fmt::print("{}, {} threads, {}, sources {}; {}x{} pixels, median of {}\n", conditions["cpu"].get<std::string>(),
             threads, conditions["simd_target"].get<std::string>(), conditions["commit"].get<std::string>(), size, size,
             repeat);
  fmt::print("{:<24} {:>10} {:>10} {:<16} {:>12} {:>10} {:>12}\n", "scene", "triangles", "raster_ms", "(min..max)",
             "Mtriangles/s", "Mpixel/s", "tile entries");
  for (const std::uint32_t blades : blade_counts) {
    const BuiltinScene builtin = make_builtin_scene("grass", blades);
    const LatticeMesh mesh = make_lattice_mesh(builtin.scene, make_local_frame(builtin.scene.positions, {}));
    RasterConfig config;
    config.width = config.height = size;
    GBuffer gbuffer;
    RasterStats stats;
    rasterize(mesh, builtin.view.camera, config, gbuffer, &stats);  // memory is allocated before the clock runs
    const Timing t =
        measure_interleaved({[&] { rasterize(mesh, builtin.view.camera, config, gbuffer, &stats); }}, repeat)[0];
    fmt::print("{:<24} {:>10} {:>10.1f} {:<16} {:>12.1f} {:>10.1f} {:>12}\n", fmt::format("builtin:grass:{}", blades),
               mesh.triangles.size(), t.median(), fmt::format("({:.1f}..{:.1f})", t.min(), t.max()),
               static_cast<double>(mesh.triangles.size()) / t.median() * 1e-3,
               static_cast<double>(size) * size / t.median() * 1e-3, stats.tile_entries);
  }
}

}  // namespace
}  // namespace halfshade::bench

int main(int argc, char** argv) {
  CLI::App app("Time of the rasterizer on lawns of different sizes.", "halfshade_raster_bench");
  std::vector<std::uint32_t> blades = {20000, 200000};
  std::uint32_t size = 1024;
  int threads = 0, repeat = 9;
  app.add_option("--blades", blades, "Sizes of builtin:grass (5 triangles each)")
      ->delimiter(',')
      ->capture_default_str();
  app.add_option("--size", size, "Side of the square picture in pixels")
      ->check(CLI::Range(1, 16384))
      ->capture_default_str();
  app.add_option("--threads", threads, "Threads (0 = all cores)")->check(CLI::Range(0, 1024))->capture_default_str();
  app.add_option("--repeat", repeat, "Repetitions")->check(CLI::Range(1, 1000))->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  return halfshade::bench::run_on_threads("halfshade_raster_bench", threads,
                                          [&](int count) { halfshade::bench::run(blades, size, repeat, count); });
}
