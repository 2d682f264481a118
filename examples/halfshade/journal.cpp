#include "journal.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "halfshade/error.h"
#include "input_hashes.h"
#include "progress.h"
#include "rasterizer/core/stopwatch.h"
#include "shadows/solver.h"

namespace halfshade {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kFirstRows = 8;
/// Every band builds the method's structures again: that may take up to a tenth of its time.
constexpr double kLeastWork = 10.0;

void add_stats(const ShadowStats& more, ShadowStats& sum) {
  for (const auto member :
       {&ShadowStats::build_ms, &ShadowStats::index_ms, &ShadowStats::cull_ms, &ShadowStats::test_ms})
    sum.*member += more.*member;
  for (const auto member : {&ShadowStats::receivers, &ShadowStats::pairs_tested, &ShadowStats::pairs_sampled,
                            &ShadowStats::pairs_necessary, &ShadowStats::sample_tests, &ShadowStats::exact_fallbacks,
                            &ShadowStats::lists_occupied, &ShadowStats::leaves_listed, &ShadowStats::leaves_tested,
                            &ShadowStats::clusters_lit, &ShadowStats::clusters_by_sample})
    sum.*member += more.*member;
  for (const auto member : {&ShadowStats::triangles, &ShadowStats::lists_longest, &ShadowStats::certified_blockers,
                            &ShadowStats::everywhere_blockers, &ShadowStats::bytes})
    sum.*member = std::max(sum.*member, more.*member);
}

void copy_masks(const VisibilityMasks& from, std::size_t first_receiver, VisibilityMasks& to) {
  std::copy(from.words.begin(), from.words.end(),
            to.words.begin() + static_cast<std::ptrdiff_t>(first_receiver * to.words_per_receiver));
}

/// Solves the rows of every light, keeps them in the journal, puts them into the picture. Milliseconds that the method
/// needed to get ready.
double solve_band(Render& render, const Journal& journal, const PartRange& rows,
                  const std::function<bool(double)>& progress, Part part) {
  part.directory = journal.band(rows);
  begin_part(part.directory);
  double ready_ms = 0.0;
  for (std::size_t l = 0; l < part.lights.size(); ++l) {
    LightResult& whole = render.lights[l];
    const auto [first, last] = receivers_in_rows(render, whole.receivers, rows);
    ShadowConfig config = shadow_config(render.options);
    config.progress = [&](double done) {
      return progress((static_cast<double>(l) + done) / static_cast<double>(part.lights.size()));
    };
    VisibilityMasks masks;
    ShadowStats stats;
    Stopwatch watch;
    solve_masks(render.mesh, slice(whole.receivers, first, last), render.source.view.lights[l], whole.samples, config,
                masks, stats, &render.exact);
    PartLight& light = part.lights[l];
    light.shadow_ms = watch.lap();
    light.range = rows;
    light.receivers_hash = receivers_hash(render.gbuffer, whole.receivers, first, last);
    write_part_masks(part, l, masks, light);
    copy_masks(masks, first, whole.masks);
    whole.shadow_ms += light.shadow_ms;
    add_stats(stats, whole.stats);
    ready_ms += stats.build_ms;
  }
  write_manifest(part);
  return ready_ms;
}

/// The manifest that every band of this picture has in common.
Part describe_bands(const Render& render) {
  Part part = describe_part(render, render.options, PartSplit::kCrop);
  for (std::size_t l = 0; l < part.lights.size(); ++l) {
    part.lights[l].whole = pixel_rows(render);
    part.lights[l].samples_hash = samples_hash(std::span(&render.lights[l].samples, 1));
  }
  part.directory = "this render";
  return part;
}

/// Rows for the next band, after one of `rows` took `ms`.
std::uint64_t next_rows(std::uint64_t rows, double ms, double wanted_ms) {
  const double factor = std::clamp(wanted_ms / std::max(ms, 0.01), 0.25, 4.0);
  return std::max<std::uint64_t>(1, static_cast<std::uint64_t>(static_cast<double>(rows) * factor));
}

}  // namespace

Journal::Journal(const fs::path& directory) : directory_(directory) {
  std::error_code error;
  fs::create_directories(directory_, error);
  if (error) throw Error(ErrorCode::kOutput, fmt::format("{}: {}", directory_.string(), error.message()));
  lock_ = ::open((directory_ / "lock").c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
  if (lock_ < 0 || ::flock(lock_, LOCK_EX | LOCK_NB) != 0) {
    const int reason = errno;
    if (lock_ >= 0) ::close(lock_);
    throw Error(ErrorCode::kOutput,
                fmt::format("{}: {}", directory_.string(),
                            reason == EWOULDBLOCK ? "another process works on it" : std::strerror(reason)));
  }
  for (const fs::directory_entry& entry : fs::directory_iterator(directory_)) {
    if (entry.is_directory() && !fs::exists(entry.path() / "part.json")) fs::remove_all(entry.path(), error);
  }
}

Journal::~Journal() { ::close(lock_); }

std::vector<Part> Journal::bands(const Part& like) const {
  std::vector<Part> found;
  for (const fs::directory_entry& entry : fs::directory_iterator(directory_)) {
    if (!entry.is_directory()) continue;
    found.push_back(read_manifest(entry.path()));
    require_same_render(found.back(), like);
  }
  return found;
}

fs::path Journal::band(const PartRange& rows) const {
  return directory_ / fmt::format("rows_{:05}_{:05}", rows.begin, rows.end);
}

void Journal::remove() const {
  std::error_code error;
  // Manifests first: killed here, nothing may look finished that is not.
  for (const fs::directory_entry& entry : fs::directory_iterator(directory_))
    fs::remove(entry.path() / "part.json", error);
  fs::remove_all(directory_, error);
  if (error) throw Error(ErrorCode::kOutput, fmt::format("{}: {}", directory_.string(), error.message()));
}

void paste_rows(Render& render, const Part& part) {
  for (std::size_t l = 0; l < part.lights.size(); ++l) {
    const PartLight& light = part.lights[l];
    LightResult& whole = render.lights[l];
    const auto [first, last] = receivers_in_rows(render, whole.receivers, light.range);
    const std::string hash = receivers_hash(render.gbuffer, whole.receivers, first, last);
    if (light.receivers != last - first || light.samples != whole.samples.count || light.receivers_hash != hash) {
      throw Error(
          ErrorCode::kBadInput,
          fmt::format("{}: light '{}': masks of {} receivers with hash {}, here rows {}..{} have {} with hash {}",
                      part.directory.string(), light.name, light.receivers, light.receivers_hash, light.range.begin,
                      light.range.end, last - first, hash));
    }
    VisibilityMasks masks;
    read_part_masks(part, light, masks);
    copy_masks(masks, first, whole.masks);
  }
}

void solve_in_bands(Render& render, const Journal& journal) {
  const std::vector<Light>& lights = render.source.view.lights;
  for (const Light& light : lights) {
    LightResult& result = add_light(render, light);
    result.masks.reset(result.receivers.size(), result.samples.count);
  }
  const Part like = describe_bands(render);
  const std::vector<Part> kept = journal.bands(like);
  const PartRange whole = pixel_rows(render);
  std::uint64_t done = 0;
  for (const Part& part : kept) {
    paste_rows(render, part);
    done += part.lights[0].range.size();
  }
  if (done > 0) fmt::print(stderr, "halfshade: going on after {} of {} rows\n", done, whole.size());
  Progress progress("shadows", render.options.quiet);
  std::uint64_t rows = kFirstRows;
  for (PartRange gap : gaps_of(kept, 0, whole)) {
    while (gap.size() > 0) {
      const PartRange band{gap.begin, std::min(gap.begin + rows, gap.end)};
      Stopwatch watch;
      const double ready_ms = solve_band(
          render, journal, band,
          [&](double share) {
            return progress((static_cast<double>(done) + share * static_cast<double>(band.size())) /
                            static_cast<double>(whole.size()));
          },
          like);
      done += band.size();
      gap.begin = band.end;
      rows = next_rows(band.size(), watch.lap(), std::max(render.options.band_seconds * 1e3, kLeastWork * ready_ms));
    }
  }
  for (std::size_t l = 0; l < lights.size(); ++l) {
    visibility_of(render.lights[l].masks, render.lights[l].receiver_visibility);
    finish_light(render, lights[l], render.lights[l]);
  }
}

}  // namespace halfshade
