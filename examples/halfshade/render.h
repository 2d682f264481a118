// One picture of a scene, from options to files: what render, its parts and journal, and merge share.
#pragma once

#include <optional>

#include "max_error.h"
#include "picture.h"
#include "pipeline.h"
#include "render_stream.h"
#include "shadows/thin_features.h"
#include "shortcuts.h"

namespace halfshade {

struct RenderOptions : PipelineOptions {
  std::string output, json, dump;
  double verify_percent = 0.0;
  std::uint32_t probes = 64;
  std::optional<std::string> max_error;
  double error_goal = 0.0;  // what max_error says; 0 = none
  bool stats = false, stream = false, measure_shortcuts = false;
  bool resume = false;  // journal.h
  double band_seconds = 1.0;
  std::string part, split = "crop";  // render_part.h
  std::uint32_t frames = 16;
  bool jitter_camera = false;
  StreamRenderOptions streamed;  // what only --stream knows
};

/// Results of one light.
struct LightResult {
  ReceiverArray receivers;
  LightSamples samples;
  VisibilityMasks masks;                   // empty for methods without masks
  std::vector<float> receiver_visibility;  // [receiver]
  ShadowStats stats;
  double samples_ms = 0.0, shadow_ms = 0.0, probe_ms = 0.0;
  ThinFeatures thin;                   // finer than the samples, as the probes see them
  std::vector<float> visibility;       // [G-buffer entry]
  std::vector<vec3> visible_emission;  // [G-buffer entry], with an emission image or translucent triangles
  std::vector<vec3> reaching;          // [receiver] through translucent triangles, if there are any
  std::uint64_t lit = 0, umbra = 0, penumbra = 0;
  std::uint64_t verified = 0, verified_bits = 0, wrong_bits = 0;
  double rms_error = 0.0, largest_error = 0.0;  // of visibility, over the verified receivers
  double mean_error = 0.0;                      // with its sign: positive is too light
  AdaptiveVisibility adaptive;                  // with --max-error, which needs no masks
  MaxErrorCheck check;                          // of it
  std::vector<Shortcut> shortcuts;              // with --stats or --measure-shortcuts
  std::uint64_t wrong_lights = 0;               // verified receivers whose transmitted light has a wrong bit
};

/// A picture in the making.
struct Render : Pipeline {
  RenderOptions options;
  std::vector<LightResult> lights;
  double resolve_ms = 0.0, write_ms = 0.0;
};

/// Throws Error{kUsage}.
void check_render_options(const RenderOptions& options);

/// Adds the samples and receivers of the next light to an opened pipeline.
LightResult& add_light(Render& render, const Light& light);

/// All that follows from masks and receiver_visibility: values per G-buffer entry, transmitted light, --verify.
void finish_light(Render& render, const Light& light, LightResult& result);

/// Writes picture, dump, summary and JSON; the exit code.
int finish_render(Render& render);

}  // namespace halfshade
