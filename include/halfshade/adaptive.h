// Visibility of a whole area light to a given error: as many samples per receiver as it takes (docs/max_error.md).
//
// Visibility here is the fraction of the light's area that a receiver sees, not of some samples of it. Receivers are
// proved lit or dark where a certificate says so; the others get sets of samples until an estimate of their error is
// below the goal.
#pragma once

#include "halfshade/shadows.h"

namespace halfshade {

/// Why a receiver got no more samples.
enum class ErrorEvidence : std::uint8_t {
  kProof,      // the whole light is visible, or hidden: a certificate, error 0
  kEstimate,   // the estimate of the error is below the goal
  kExhausted,  // the largest number of samples was reached; the estimate is above the goal
};

/// One round: every receiver that was still open got sets of samples.
struct ErrorLevel {
  std::uint32_t samples_per_receiver = 0;  // all that such a receiver has now
  std::uint64_t receivers = 0;             // that were asked in this round
  std::uint64_t proved = 0, settled = 0;   // of these: by certificate, by estimate
  std::uint64_t samples = 0;               // asked in this round
  double ms = 0.0;                         // wall time of the round
  double largest_bound = 0.0;              // among the receivers that stay open; 0 if none does
};

/// Visibility of the whole light, how far it can be trusted, and what it cost.
struct AdaptiveVisibility {
  std::vector<float> visibility;        // [receiver], 0..1
  std::vector<float> bound;             // [receiver] error kept: 0 where proved, else the estimate
  std::vector<std::uint32_t> samples;   // [receiver] that were asked
  std::vector<ErrorEvidence> evidence;  // [receiver]
  std::vector<ErrorLevel> levels;       // the rounds, in order
  double max_error = 0.0;               // the goal
  double bound_kept = 0.0;              // largest of `bound`
  std::uint64_t proved_lit = 0;         // receivers proved to see the whole light
  std::uint64_t proved_umbra = 0;       // and none of it
  std::uint64_t exhausted = 0;          // receivers that ran out of samples above the goal
  std::uint64_t samples_asked = 0;      // of all receivers and rounds
  std::string pattern;                  // "rows" or "low-discrepancy", or "all" where the light is made of samples
  std::uint32_t set_size = 0;           // samples of the first set; later ones are larger
};

/// Smallest goal that solve_to_error accepts.
inline constexpr double kSmallestMaxError = 1.0 / 4096.0;
/// Largest goal that solve_to_error accepts.
inline constexpr double kLargestMaxError = 0.25;

/// Visibility of `light` from each receiver, within `max_error` of that of the whole light: 0 error where `evidence` is
/// kProof, estimated otherwise. Of `config` only `seed`, `back_face_casters`, `grid_resolution` and `progress` count;
/// method, pattern and number of samples are chosen here. Equal inputs give equal bits for any number of threads.
/// Throws Error{kUsage} for a goal outside kSmallestMaxError..kLargestMaxError, otherwise as solve_shadows. Receivers
/// behind a one-sided light see nothing, with proof.
void solve_to_error(const Scene& scene, std::span<const Receiver> receivers, const Light& light,
                    const ShadowConfig& config, double max_error, AdaptiveVisibility& result,
                    ShadowStats* stats = nullptr);

}  // namespace halfshade
