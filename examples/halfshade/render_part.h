// halfshade render --part: the masks of a part of the work, for `halfshade merge` (docs/farm.md); and what journal and
// merge need to make and read such parts.
#pragma once

#include "part.h"
#include "render.h"

namespace halfshade {

/// Whether --part, --resume and the other options go together. Throws Error{kUsage}.
void check_partial_options(const RenderOptions& options);

/// Renders the part that the options ask for and writes it into the directory `output`; the exit code.
int render_part(const RenderOptions& options);

/// The manifest of a part without content: program, scene, options, lights; no ranges, receivers or directory.
Part describe_part(const Pipeline& pipeline, const PipelineOptions& options, PartSplit split);

/// Rows of pixels of the picture or its crop.
PartRange pixel_rows(const Pipeline& pipeline);
/// The receivers in rows of pixels: [first, last).
std::pair<std::size_t, std::size_t> receivers_in_rows(const Pipeline& pipeline, const ReceiverArray& receivers,
                                                      const PartRange& rows);
ReceiverArray slice(const ReceiverArray& receivers, std::size_t begin, std::size_t end);

/// Writes the masks into the part's directory and notes file, hash and counts in `light`. Throws Error{kOutput}.
void write_part_masks(const Part& part, std::size_t number, const VisibilityMasks& masks, PartLight& light);
/// Throws Error{kBadInput} for masks that are not those of the manifest.
void read_part_masks(const Part& part, const PartLight& light, VisibilityMasks& masks);

}  // namespace halfshade
