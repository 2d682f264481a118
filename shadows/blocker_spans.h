// From blockers to runs of receivers: influence regions scan-converted onto the lists (Sintorn, Eisemann, Assarsson
// 2008, sections 3.2 and 4.1), less the tiles where a blocker cannot matter (section 4.3). Conservative throughout: a
// tile is left out only if the blocker certainly hides nothing from any of its receivers, or only what other blockers
// hide as well, so no option changes a bit.
#pragma once

#include "shadows/influence_region.h"
#include "shadows/silhouettes.h"

namespace halfshade {

/// Blockers as one view sees them.
struct BlockerView {
  const LatticeMesh* mesh = nullptr;
  const LightLists* lists = nullptr;
  const std::vector<dvec3>* positions = nullptr;  // of the mesh, in the view's coordinates
  const KernelSamples* samples = nullptr;         // the light's, with the certificates
  const LightFacing* facing = nullptr;
  const PenumbraStencils* stencils = nullptr;  // may be empty
  AliasFreeOptions options;
};

/// Spans of one part of the triangles, by row block.
struct PartSpans {
  std::vector<std::vector<BlockerSpan>> of_block;
  InfluenceRegion region;                      // scratch
  std::uint64_t everywhere = 0;                // triangles without a bounded region
  std::uint64_t cells = 0, tiles_skipped = 0;  // cells in regions; tiles left out of them
};

/// Where in the lists may each triangle of [begin, end) hide samples?
void find_spans(const BlockerView& view, std::size_t begin, std::size_t end, PartSpans& part);

/// Where is one sample enough (silhouettes.h)? Regions as seen from `one_sample` (view coordinates) alone.
void find_settled_spans(const BlockerView& view, const dvec3& one_sample, std::size_t begin, std::size_t end,
                        PartSpans& part);

}  // namespace halfshade
