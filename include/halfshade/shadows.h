// Exact visibility of area lights: one bit for every (receiver, light sample).
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "halfshade/error.h"
#include "halfshade/light.h"
#include "halfshade/methods.h"
#include "halfshade/scene.h"

namespace halfshade {

/// How light samples are spread over the light's area (docs/sampling.md).
enum class SamplePattern {
  kRows,            // rows of equal height share v, each row shifted by its own lattice offset
  kUniform,         // cell centres, row by row: of k * k samples, i is in column i mod k of row i / k
  kStratified,      // one jittered sample per cell
  kLowDiscrepancy,  // scrambled (0,2)-sequence; nested: the first samples of a larger number are those of a smaller one
  kPoissonDisk,     // no two samples near each other (measured on the torus); nested as well
};

/// Defaults here, set by designated initialisers. A member that belongs to one method is ignored by the others.
struct ShadowConfig {
  ShadowMethod method = ShadowMethod::kExact;  // how shadows are found
  std::uint32_t light_sample_count = 256;      // 1..4096; point lights always use 1, explicit samples their own number
  SamplePattern pattern = SamplePattern::kRows;  // where the samples lie on the light
  std::uint32_t sample_sets = 1;                 // 1..256 different sets, chosen per receiver by hash(pixel, seed)
  /// 16 sets, chosen by (x mod 4, y mod 4) of the receiver's place in the picture instead of by hash (Keller and
  /// Heidrich 2001; Forest, Barthe, Paulin 2009, figure 5); by number mod 16 for explicit receivers. sample_sets counts
  /// for nothing then.
  bool interleave = false;
  bool rotate_sets = false;  // disk and sphere lights: the sets are rotated copies of a single one
  std::uint32_t seed = 0;    // same seed, same bits, on every platform
  std::uint32_t grid_resolution =
      0;  // afsm: cells per axis of the light view, 16..2048; 0 = chosen from the number of receivers
  bool back_face_casters = true;  // afsm: skip front faces of meshes certified closed; changes no bit
  /// Called now and then on the calling thread with the share done, 0..1; returning false stops the work: the call
  /// throws Error{kCancelled} and everything may be used again. May be empty.
  std::function<bool(double done)> progress = nullptr;
  /// Temporal jitter: set k of frame f is element f + k of the pattern's sequence of sets, so every frame shows each
  /// receiver other samples. Point lights and explicit samples are the same in every frame. 0 .. 2^25 - 1.
  std::uint32_t frame = 0;
  AliasFreeOptions afsm = {};        // methods afsm, afsm-lut
  PenumbraCastingOptions hpc = {};   // method hpc
  GearsOptions gears = {};           // method gears
  ShadowVolumeOptions stsv = {};     // method stsv
  ShadowMapOptions shadow_map = {};  // methods with depth maps
  RaytraceOptions raytrace = {};     // method raytrace
};

/// Blocked masks of all receivers: bit i of a receiver's words is set where light sample i is hidden.
struct HALFSHADE_API VisibilityMasks {
  std::size_t receiver_count = 0;      // as many as were asked for
  std::uint32_t sample_count = 0;      // per receiver
  std::size_t words_per_receiver = 0;  // sample_count / 64, rounded up
  std::vector<std::uint64_t> words;    // [receiver][word], row-major; bits past sample_count are zero

  /// Room for that many receivers and samples, nothing blocked.
  void reset(std::size_t receivers, std::uint32_t samples);
  /// The words of one receiver.
  std::span<const std::uint64_t> mask(std::size_t receiver) const {
    return {words.data() + receiver * words_per_receiver, words_per_receiver};
  }
  /// Is this sample hidden from this receiver?
  bool blocked(std::size_t receiver, std::uint32_t sample) const {
    return (words[receiver * words_per_receiver + sample / 64] >> (sample % 64)) & 1;
  }
  std::uint32_t blocked_count(std::size_t receiver) const;  // number of hidden samples
  /// Fraction of samples not hidden, in [0, 1].
  float visibility(std::size_t receiver) const {
    return 1.0f - static_cast<float>(blocked_count(receiver)) / static_cast<float>(sample_count);
  }
  /// XXH3-128 over receiver count, sample count (both 64-bit) and the words, as 32 hexadecimal digits.
  std::string hash() const;
};

/// Counters and times of one solve. Milliseconds are wall time.
struct ShadowStats {
  double build_ms = 0.0;                                // what a static scene keeps: certificates, tree
  double index_ms = 0.0;                                // receivers into the light view's lists
  double cull_ms = 0.0;                                 // influence regions of the blockers
  double test_ms = 0.0;                                 // blockers against receivers and samples
  std::uint64_t receivers = 0, triangles = 0;           // that were asked about, that may block
  std::uint64_t pairs_tested = 0;                       // (blocker, receiver) pairs that reached the kernel
  std::uint64_t pairs_sampled = 0;                      // of these, tested sample by sample
  std::uint64_t pairs_necessary = 0;                    // of these, added at least one blocked bit
  std::uint64_t sample_tests = 0;                       // (blocker, receiver, sample) tests by the float filter
  std::uint64_t exact_fallbacks = 0;                    // of these, handed to the exact predicate
  std::uint64_t lists_occupied = 0, lists_longest = 0;  // light-view cells with receivers; most receivers in one
  std::uint64_t certified_blockers = 0;                // triangles of closed meshes that cast by their back faces alone
  std::uint64_t leaves_listed = 0, leaves_tested = 0;  // exact: per cluster; per receiver
  std::uint64_t clusters_lit = 0;                      // exact: clusters proved lit by an empty list
  std::uint64_t clusters_by_sample = 0;                // exact: clusters solved sample by sample, which was cheaper
  std::uint64_t everywhere_blockers = 0;               // triangles without a bounded influence region
  std::uint64_t bytes = 0;                             // working memory of the method, without masks
  /// What only one method counts or assumes: "hpc.penumbra_volumes", 1234. In the order they were noted.
  std::vector<std::pair<std::string, double>> details;

  /// What was noted under that name, if anything was.
  std::optional<double> detail(const std::string& name) const {
    for (const auto& [key, value] : details) {
      if (key == name) return value;
    }
    return std::nullopt;
  }
};

/// A surface point that asks for the light.
struct Receiver {
  dvec3 position_world{0.0};       // finite
  std::uint32_t triangle = kNone;  // the triangle it lies on, which never blocks it; kNone if none
};

/// Answers `blocks(triangle, receiver, sample)` for every receiver and every sample of `light`; masks in receiver
/// order. Positions are rounded to the lattice of the scene's local frame first (docs/decisions/0001); the answer is
/// the one of exact arithmetic on the rounded points. Receivers behind a one-sided light are marked blocked in every
/// sample. Throws Error{kUsage} for a configuration out of range or a method that yields no masks (methods.h),
/// Error{kBadInput} for positions that are not finite, indices out of range and arrays of the wrong length, naming the
/// first. Runs in the calling thread's TBB arena. Distinct calls may run concurrently.
HALFSHADE_API void solve_shadows(const Scene& scene, std::span<const Receiver> receivers, const Light& light,
                                 const ShadowConfig& config, VisibilityMasks& masks, ShadowStats* stats = nullptr);

/// The fraction of the light that each receiver sees, in [0, 1], by any method; masks are kept nowhere. The same
/// errors and threads as solve_shadows; receivers behind a one-sided light see nothing.
HALFSHADE_API void solve_visibility(const Scene& scene, std::span<const Receiver> receivers, const Light& light,
                                    const ShadowConfig& config, std::vector<float>& visibility,
                                    ShadowStats* stats = nullptr);

}  // namespace halfshade
