// What every verb that renders shares: options, scene, lattice mesh, G-buffer.
#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <optional>

#include "rasterizer/bent_normals.h"
#include "rasterizer/rasterizer.h"
#include "scene_source.h"
#include "shadows/exact_engine.h"
#include "shadows/panes.h"
#include "shadows/receivers.h"
#include "verbs.h"

namespace halfshade {

struct PipelineOptions {
  std::string scene = "builtin:demo", view_file, size = "512x512", crop, method = "exact", pattern = "rows",
              shading = "plain", simd;
  std::uint32_t spp = 1, light_samples = 256, sets = 1, seed = 0, grid = 0;
  int threads = 0;
  bool quiet = false, all_faces = false, interleave = false, rotate = false;
  std::vector<std::string> settings;  // "method.option=value"
  ObjLoadOptions load;
  std::string command_line;
  std::vector<std::string> arguments;  // deciding_arguments
};

/// Not to be copied or moved once opened: the mesh refers to the scene.
struct Pipeline {
  SceneSource source;
  RasterConfig raster;
  std::uint32_t subsamples = 1;  // per axis and pixel
  LatticeMesh mesh;
  Panes panes;      // translucent triangles of the mesh
  KeptExact exact;  // what method exact makes of the mesh, for all lights and frames
  GBuffer gbuffer;
  RasterStats raster_stats;
  std::optional<BentNormals> bent_normals;  // with --shading bent
  std::vector<std::vector<float>> cosines;  // [light][G-buffer entry], or empty for plain shading
  double load_ms = 0.0, frame_ms = 0.0, rasterize_ms = 0.0;
};

void add_pipeline_options(CLI::App& verb, PipelineOptions& options);

/// Options that were given to a parsed verb and decide its pictures, "--name value ...", without scene and view; those
/// of add_pipeline_options, in their order.
std::vector<std::string> deciding_arguments(const CLI::App& verb);

/// Puts them back into options. Throws Error{kBadInput} for what add_pipeline_options does not know.
void restore_arguments(const std::vector<std::string>& arguments, PipelineOptions& options);

/// The command that renders the same picture, without names of outputs: equal for every way to the same picture.
std::string picture_command(const PipelineOptions& options);

/// Checks the options, loads the scene, makes the mesh and the G-buffer; prints warnings to standard error.
/// `extra_bytes_per_sample` counts what the verb keeps per sample of the picture and light. Throws Error.
void open_pipeline(const PipelineOptions& options, double extra_bytes_per_sample, Pipeline& pipeline);

/// --size, --spp and --crop into pipeline.raster. Throws Error{kUsage}.
void read_size(const PipelineOptions& options, Pipeline& pipeline);

/// Makes the G-buffer for raster.subpixel_offset, and the cosines that belong to it.
void draw(const PipelineOptions& options, Pipeline& pipeline);

/// Throws Error{kUsage} for unknown names.
ShadowConfig shadow_config(const PipelineOptions& options);
nlohmann::ordered_json method_json(const PipelineOptions& options);

/// One light by the configured method: masks, where it yields them, and visibility per receiver; of the opaque
/// triangles. `kept` as for solve_masks.
void solve_light_by_method(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                           const LightSamples& samples, const ShadowConfig& config, VisibilityMasks& masks,
                           std::vector<float>& visibility, ShadowStats& stats, KeptExact* kept = nullptr);

/// body() in an arena of the asked number of threads.
void run_in_arena(int threads, const std::function<void()>& body);

[[noreturn]] void usage_error(const std::string& message);

}  // namespace halfshade
