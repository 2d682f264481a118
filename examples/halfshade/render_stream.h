// render --stream: the whole pipeline for a scene that is never whole in memory.
#pragma once

#include "pipeline.h"

namespace halfshade {

struct StreamRenderOptions : PipelineOptions {
  std::string output, json;
  std::string directory;         // of the bucket files; empty = the system's
  std::uint64_t max_mib = 0;     // memory that the forecast must stay within; 0 = no limit
  std::uint32_t piece = 262144;  // triangles at once, built-in scenes
  bool stats = false;
};

void render_stream(const StreamRenderOptions& options);

}  // namespace halfshade
