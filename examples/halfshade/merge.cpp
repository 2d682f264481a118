// halfshade merge: parts of a render into what one run gives, bit by bit.
#include <fmt/format.h>

#include "frames_part.h"
#include "halfshade/error.h"
#include "input_hashes.h"
#include "journal.h"
#include "shadows/solver.h"

namespace halfshade {
namespace {

struct MergeOptions : RenderOptions {
  std::vector<std::string> parts;
};

std::vector<Part> read_parts(const std::vector<std::string>& directories) {
  std::vector<Part> parts;
  for (const std::string& directory : directories) {
    parts.push_back(read_manifest(directory));
    require_same_render(parts[0], parts.back());
  }
  require_complete(parts);
  return parts;
}

/// The options that the parts were made with. Scene and view may have moved: they are checked by their content.
void take_options(const Part& part, MergeOptions& options) {
  if (options.scene.empty()) options.scene = part.scene;
  if (options.view_file.empty()) options.view_file = part.view;
  options.arguments = part.arguments;
  restore_arguments(part.arguments, options);
}

/// Puts the bits of some of the samples to their places.
void insert_samples(const VisibilityMasks& from, std::uint64_t first_sample, VisibilityMasks& to) {
  for (std::size_t r = 0; r < from.receiver_count; ++r) {
    std::uint64_t* const words = to.words.data() + r * to.words_per_receiver;
    for (std::size_t w = 0; w < from.words_per_receiver; ++w) {
      const std::uint64_t bits = from.mask(r)[w], at = first_sample + w * 64, shift = at % 64;
      words[at / 64] |= bits << shift;
      if (shift != 0 && (bits >> (64 - shift)) != 0) words[at / 64 + 1] |= bits >> (64 - shift);
    }
  }
}

void require_counts(const Part& part, const PartLight& light, const LightResult& whole, std::uint64_t samples) {
  if (light.receivers == whole.receivers.size() && light.samples == samples) return;
  throw Error(ErrorCode::kBadInput,
              fmt::format("{}: light '{}': masks of {} receivers with {} samples, allowed are {} with {}",
                          part.directory.string(), light.name, light.receivers, light.samples, whole.receivers.size(),
                          samples));
}

/// Parts of splits `samples` and `blockers`, which have masks of all receivers.
void combine_masks(Render& render, const Part& part) {
  for (std::size_t l = 0; l < part.lights.size(); ++l) {
    const PartLight& light = part.lights[l];
    LightResult& whole = render.lights[l];
    const bool by_samples = part.split == PartSplit::kSamples;
    require_counts(part, light, whole, by_samples ? light.range.size() : whole.samples.count);
    VisibilityMasks masks;
    read_part_masks(part, light, masks);
    if (by_samples) {
      insert_samples(masks, light.range.begin, whole.masks);
    } else {
      for (std::size_t i = 0; i < masks.words.size(); ++i) whole.masks.words[i] |= masks.words[i];
    }
  }
}

/// What parts of this split and scene have in common.
Part describe_whole(const Render& render, PartSplit split) {
  Part like = describe_part(render, render.options, split);
  like.directory = "this scene";
  for (std::size_t l = 0; l < like.lights.size(); ++l) {
    const LightResult& light = render.lights[l];
    const std::size_t count = light.receivers.size();
    like.lights[l].whole = pixel_rows(render);
    if (split == PartSplit::kSamples) like.lights[l].whole = {0, light.samples.count};
    if (split == PartSplit::kBlockers) like.lights[l].whole = {0, render.mesh.triangles.size()};
    like.lights[l].samples_hash = samples_hash(std::span(&light.samples, 1));
    like.lights[l].receivers_hash = receivers_hash(render.gbuffer, light.receivers, 0, count);
  }
  return like;
}

int merge(MergeOptions options) {
  const std::vector<Part> parts = read_parts(options.parts);
  take_options(parts[0], options);
  check_render_options(options);
  if (parts[0].split == PartSplit::kFrames) return merge_frames(options, parts);
  Render render;
  render.options = options;
  open_pipeline(options, 0.0, render);
  for (const Light& light : render.source.view.lights) {
    LightResult& result = add_light(render, light);
    result.masks.reset(result.receivers.size(), result.samples.count);
  }
  require_same_render(parts[0], describe_whole(render, parts[0].split));
  for (const Part& part : parts) {
    part.split == PartSplit::kCrop ? paste_rows(render, part) : combine_masks(render, part);
    for (std::size_t l = 0; l < part.lights.size(); ++l) render.lights[l].shadow_ms += part.lights[l].shadow_ms;
  }
  for (std::size_t l = 0; l < render.lights.size(); ++l) {
    visibility_of(render.lights[l].masks, render.lights[l].receiver_visibility);
    finish_light(render, render.source.view.lights[l], render.lights[l]);
  }
  return finish_render(render);
}

}  // namespace

void add_merge(CLI::App& app, const std::string& command_line, int& exit_code) {
  CLI::App* verb = app.add_subcommand("merge", "Put the parts of 'render --part' together: the bits of one run");
  auto o = std::make_shared<MergeOptions>();
  o->scene.clear();
  verb->add_option("parts", o->parts, "Directories written by render --part, in any order")->required();
  verb->add_option("-o,--output", o->output, "Picture to write: .png or .exr");
  verb->add_option("--json", o->json, "Statistics as JSON to this file, or - for standard output");
  verb->add_option("--dump", o->dump, "Write receivers, samples, triangles and masks into this directory");
  verb->add_option("--verify", o->verify_percent, "Check this percentage of the receivers with the oracle")
      ->capture_default_str();
  verb->add_option("--scene", o->scene, "Where the scene is now (default: as the parts name it)");
  verb->add_option("--view", o->view_file, "Where its view file is now");
  verb->add_option("--threads", o->threads, "Threads (0 = all cores)")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  verb->callback([o, &exit_code, command_line] {
    o->command_line = command_line;
    o->quiet = true;
    run_in_arena(o->threads, [&] { exit_code = merge(*o); });
  });
}

}  // namespace halfshade
