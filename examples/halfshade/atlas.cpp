// halfshade atlas: the scenes that break shadow methods, each method's answer beside the truth, and the number under
// it.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "atlas_measure.h"
#include "atlas_terminator.h"
#include "halfshade/error.h"
#include "options_json.h"
#include "output_files.h"
#include "pipeline.h"
#include "progress.h"
#include "rasterizer/core/parallel.h"
#include "rasterizer/core/stopwatch.h"
#include "rasterizer/io/atomic_file.h"
#include "rasterizer/io/flip.h"
#include "rasterizer/io/image.h"
#include "shadows/solver.h"
#include "stats_json.h"

namespace halfshade {
namespace {

using nlohmann::ordered_json;

constexpr const char* kSchema = "halfshade.atlas/1";
constexpr AtlasSize kFull{96, 256, 3000}, kQuick{32, 32, 300};

struct AtlasOptions {
  std::string output = "out/atlas", command_line;
  std::vector<std::string> entries;
  int threads = 0;
  bool quick = false, quiet = false;
};

/// Pictures of one entry, named after it and what they show.
class Pictures {
 public:
  Pictures(const std::string& directory, const std::string& entry, std::uint32_t width, std::uint32_t repeat)
      : directory_(directory), entry_(entry), width_(width), repeat_(repeat) {}

  /// Values from `low` to `high` as grey; returns the path below the output directory.
  std::string grey(const std::string& what, const VPicture& values, float low, float high) const {
    std::vector<float> shown;
    for (const float v : repeated(values)) shown.push_back((v - low) / (high - low));
    return write(what, 1, shown);
  }

  /// White where equal, red where `a` is lighter than `b`, blue where it is darker; full colour at `range`.
  std::string difference(const std::string& what, const VPicture& a, const VPicture& b, float range) const {
    VPicture signed_difference;
    for (std::size_t i = 0; i < a.size(); ++i) signed_difference.push_back((a[i] - b[i]) / range);
    std::vector<float> shown;
    for (float d : repeated(signed_difference)) {
      d = std::clamp(d, -1.0f, 1.0f);
      const float pale = 1.0f - std::fabs(d);
      shown.insert(shown.end(), {d > 0.0f ? 1.0f : pale, pale, d < 0.0f ? 1.0f : pale});
    }
    return write(what, 3, shown);
  }

  double flip(const VPicture& a, const VPicture& b) const {
    const VPicture shown_a = repeated(a), shown_b = repeated(b);
    return mean_flip_of_grey(shown_a, shown_b, width_, static_cast<std::uint32_t>(shown_a.size() / width_));
  }

 private:
  VPicture repeated(const VPicture& values) const {
    VPicture result;
    for (std::size_t row = 0; row * width_ < values.size(); ++row) {
      for (std::uint32_t k = 0; k < repeat_; ++k) {
        const auto begin = values.begin() + static_cast<std::ptrdiff_t>(row * width_);
        result.insert(result.end(), begin, begin + width_);
      }
    }
    return result;
  }

  std::string write(const std::string& what, std::uint32_t channels, const std::vector<float>& values) const {
    const std::string name = fmt::format("images/{}-{}.png", entry_, file_name(what));
    const auto height = static_cast<std::uint32_t>(values.size() / (std::size_t{width_} * channels));
    write_png(std::filesystem::path(directory_) / name, width_, height, channels, values, false, 8, {});
    return name;
  }

  std::string directory_, entry_;
  std::uint32_t width_, repeat_;
};

/// Errors of a picture, and the two pictures that show it.
ordered_json shown_json(const Pictures& pictures, const std::string& id, const VPicture& v, const VPicture& truth,
                        float low, float high, float range) {
  const Deviation d = deviation(v, truth);
  return {{"rmse", d.rmse},
          {"max", d.max},
          {"mean", d.mean},
          {"flip", pictures.flip(v, truth)},
          {"image", pictures.grey(id, v, low, high)},
          {"error_image", pictures.difference(id + "-error", v, truth, range)}};
}

ordered_json answer_json(const AtlasEntry& entry, const AtlasContender& contender, const AtlasAnswer& answer,
                         const AtlasMeasures& measures, const Pictures& pictures) {
  ordered_json json = {{"id", contender.id},
                       {"method", contender.textbook ? "textbook" : name_of(contender.config.method)},
                       {"light_samples", contender.config.light_sample_count},
                       {"pattern", name_of(contender.config.pattern)},
                       {"options", contender.textbook ? ordered_json::object() : options_json(contender.config)},
                       {"promises_exactness", !contender.textbook && promises_exactness(contender.config)},
                       {"why", contender.why}};
  if (!answer.refused.empty()) {
    json["refused"] = answer.refused;
    return json;
  }
  json["ms"] = answer.ms;
  if (answer.easy_ms > 0.0) json["ms_of_easy"] = answer.easy_ms;
  json["bytes"] = answer.bytes;
  if (answer.easy_bytes > 0) json["bytes_of_easy"] = answer.easy_bytes;
  if (answer.has_masks) json["wrong_bits"] = answer.wrong_bits, json["bits"] = answer.bits;
  json.update(
      shown_json(pictures, contender.id, answer.visibility, measures.truth, entry.low, entry.high, entry.error_range));
  if (entry.temporal) {
    json["unreasoned_flips"] = answer.unreasoned;
    json["flips_asked"] = answer.reasons_asked;
    json["flicker"] = answer.flicker;
    json["error_image"] = pictures.difference(contender.id + "-error", answer.change,
                                              VPicture(answer.change.size(), 0.0f), entry.error_range);
    json["flips_per_frame"] = answer.flips_per_frame;
  }
  if (entry.curve_frame) {
    const auto begin = answer.visibility.begin() + static_cast<std::ptrdiff_t>(*entry.curve_frame * entry.width);
    json["curve"] = VPicture(begin, begin + entry.width);
  }
  json["details"] = ordered_json::object();
  for (const auto& [name, value] : answer.details) json["details"][name] = value;
  return json;
}

ordered_json entry_json(const AtlasEntry& entry, const AtlasMeasures& measures, const std::string& directory) {
  const Pictures pictures(directory, entry.id, entry.width, entry.repeat);
  ordered_json json = {{"id", entry.id},
                       {"title", entry.title},
                       {"what", entry.what},
                       {"parameters", entry.parameters},
                       {"truth_is", entry.truth_is},
                       {"width", measures.width},
                       {"height", measures.height * entry.repeat},
                       {"across", entry.across},
                       {"down", entry.down},
                       {"shown_low", entry.low},
                       {"shown_high", entry.high},
                       {"error_range", entry.error_range},
                       {"temporal", entry.temporal},
                       {"image", pictures.grey("truth", measures.truth, entry.low, entry.high)}};
  if (entry.temporal) {
    json["flicker"] = measures.truth_flicker;
    json["error_image"] = pictures.difference("truth-error", measures.truth_change,
                                              VPicture(measures.truth_change.size(), 0.0f), entry.error_range);
    json["flips_per_frame"] = measures.truth_flips_per_frame;
  }
  if (entry.curve_frame) {
    const auto begin = measures.truth.begin() + static_cast<std::ptrdiff_t>(*entry.curve_frame * entry.width);
    json["curve"] = {{"begin", entry.curve_begin},
                     {"step", entry.curve_step},
                     {"frame", *entry.curve_frame},
                     {"truth", VPicture(begin, begin + entry.width)}};
  }
  json["contenders"] = ordered_json::array();
  for (std::size_t c = 0; c < entry.contenders.size(); ++c) {
    json["contenders"].push_back(answer_json(entry, entry.contenders[c], measures.answers[c], measures, pictures));
  }
  return json;
}

ordered_json terminator_json(const Terminator& terminator, const std::string& directory) {
  constexpr float kErrorRange = 0.25f;
  const Pictures pictures(directory, "terminator", terminator.side, 1);
  ordered_json json = {{"id", "terminator"},
                       {"title", terminator.title},
                       {"what", terminator.what},
                       {"parameters", {{"facets", {16, 8}}}},
                       {"truth_is", terminator.truth_is},
                       {"width", terminator.side},
                       {"height", terminator.side},
                       {"across", "x"},
                       {"down", "y"},
                       {"shown_low", 0.0f},
                       {"shown_high", 1.0f},
                       {"error_range", kErrorRange},
                       {"temporal", false},
                       {"image", pictures.grey("truth", terminator.truth, 0.0f, 1.0f)},
                       {"contenders", ordered_json::array()}};
  for (const TerminatorPicture& picture : terminator.pictures) {
    ordered_json answer = {{"id", picture.id},
                           {"method", "shading"},
                           {"options", ordered_json::object()},
                           {"promises_exactness", false},
                           {"why", picture.why},
                           {"lit_facing_away", picture.lit_facing_away},
                           {"facing_away", picture.facing_away},
                           {"details", ordered_json::object()}};
    answer.update(shown_json(pictures, picture.id, picture.shade, terminator.truth, 0.0f, 1.0f, kErrorRange));
    json["contenders"].push_back(answer);
  }
  return json;
}

/// Those that were asked for, all if none were. Throws Error{kUsage} with the known names.
std::vector<AtlasEntry> chosen_entries(const AtlasOptions& options, bool& terminator) {
  std::vector<AtlasEntry> all = atlas_entries(options.quick ? kQuick : kFull);
  std::string known = "terminator";
  for (const AtlasEntry& entry : all) known += ", " + entry.id;
  const auto asked = [&](const std::string& id) {
    return options.entries.empty() ||
           std::find(options.entries.begin(), options.entries.end(), id) != options.entries.end();
  };
  for (const std::string& name : options.entries) {
    const bool is_known =
        name == "terminator" || std::any_of(all.begin(), all.end(), [&](const AtlasEntry& e) { return e.id == name; });
    if (!is_known) usage_error(fmt::format("entry '{}' is not one of: {}", name, known));
  }
  terminator = asked("terminator");
  std::erase_if(all, [&](const AtlasEntry& entry) { return !asked(entry.id); });
  return all;
}

/// Prints one line per entry: who broke, and how badly.
void print_entry(const ordered_json& entry) {
  std::uint64_t wrong = 0, exact = 0;
  std::string worst;
  double largest = 0.0;
  for (const ordered_json& answer : entry.at("contenders")) {
    if (answer.contains("refused")) continue;
    if (answer.at("promises_exactness").get<bool>()) ++exact, wrong += answer.value("wrong_bits", std::uint64_t{0});
    if (answer.at("max").get<double>() > largest) largest = answer.at("max"), worst = answer.at("id");
  }
  fmt::print("{:<18} {} wrong bits in {} exact answers; largest error {:.3f}, {}\n", entry.at("id").get<std::string>(),
             wrong, exact, largest, worst.empty() ? "nobody" : worst);
}

std::uint64_t wrong_bits_of_exact(const ordered_json& entries) {
  std::uint64_t wrong = 0;
  for (const ordered_json& entry : entries) {
    for (const ordered_json& answer : entry.at("contenders")) {
      if (answer.at("promises_exactness").get<bool>()) wrong += answer.value("wrong_bits", std::uint64_t{1});
    }
  }
  return wrong;
}

int run(const AtlasOptions& options) {
  bool terminator = false;
  const std::vector<AtlasEntry> entries = chosen_entries(options, terminator);
  make_directory(std::filesystem::path(options.output) / "images");
  ordered_json atlas = {
      {"schema", kSchema},
      {"version", HALFSHADE_VERSION},
      {"command", options.command_line},
      {"machine", machine_json()},
      {"settings", {{"quick", options.quick}, {"threads", concurrency()}, {"simd_target", simd_target()}}},
      {"entries", ordered_json::array()}};
  Progress progress("atlas", options.quiet);
  const double count = static_cast<double>(entries.size()) + (terminator ? 1.0 : 0.0);
  Stopwatch watch;
  for (std::size_t k = 0; k < entries.size(); ++k) {
    const AtlasMeasures measures = measure_entry(
        entries[k], [&](double done) { return progress((static_cast<double>(k) + done) / count, entries[k].title); });
    atlas["entries"].push_back(entry_json(entries[k], measures, options.output));
    atlas["entries"].back()["seconds"] = watch.lap() * 1e-3;
    print_entry(atlas["entries"].back());
  }
  if (terminator) {
    const std::uint32_t side = options.quick ? 96 : 256;
    atlas["entries"].push_back(terminator_json(make_terminator(side), options.output));
    atlas["entries"].back()["seconds"] = watch.lap() * 1e-3;
    print_entry(atlas["entries"].back());
  }
  if (stop_signal() != 0) throw Error(ErrorCode::kCancelled, "cancelled");
  write_file_atomically(std::filesystem::path(options.output) / "atlas.json", atlas.dump(1) + "\n");
  fmt::print("written            {}/atlas.json, images/\n", options.output);
  return wrong_bits_of_exact(atlas.at("entries")) == 0 ? kOk : kDifferent;
}

}  // namespace

void add_atlas(CLI::App& app, const std::string& command_line, int& exit_code) {
  CLI::App* verb = app.add_subcommand("atlas", "The scenes that break shadow methods, every method beside the truth");
  auto o = std::make_shared<AtlasOptions>();
  o->command_line = command_line;
  verb->add_option("entries", o->entries, "Entries by name (default: all)");
  verb->add_option("-o,--output", o->output, "Directory for atlas.json and images")->capture_default_str();
  verb->add_flag("--quick", o->quick, "Small pictures and few frames: seconds");
  verb->add_option("--threads", o->threads, "Threads (0 = all cores)")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  verb->add_flag("-q,--quiet", o->quiet, "No progress");
  verb->footer("Exit code 1 if a method that promises exactness has a wrong bit.");
  verb->callback([o, &exit_code] { run_in_arena(o->threads, [&] { exit_code = run(*o); }); });
}

}  // namespace halfshade
