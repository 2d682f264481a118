// Which way is the cheaper one for a cluster: packets (packet_kernel.cpp) or beams (cluster_beams-inl.h).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace halfshade {

enum class Beams { kWhereCheaper, kNever, kAlways };

/// Learns on each thread from what the last clusters took: neighbouring ones are alike. Masks are the same bits either
/// way, so that it may go by the clock. Few receivers always go by packets, and nothing is learned from them: for each
/// of them both ways take many times longer. An estimate that is not renewed falls until its way is tried again.
class BeamChoice {
 public:
  /// A cluster of `receivers` that may meet `groups` of blockers, before a light of `samples`.
  struct Cluster {
    std::size_t receivers, groups, samples;
  };

  bool takes_beams(const Cluster& c, Beams beams) const {
    if (beams != Beams::kWhereCheaper) return beams == Beams::kAlways;
    return c.receivers >= kLeastReceivers && packet_ms_ * packet_work(c) > beam_ms_ * beam_work(c);
  }
  void took(const Cluster& c, bool beams, double ms) {
    if (c.receivers < kLeastReceivers) return;
    const auto learn = [](double& per_work, double now) {
      per_work = per_work == 0.0 ? now : per_work + 0.3 * (now - per_work);
    };
    if (beams) {
      learn(beam_ms_, ms / beam_work(c));
      packet_ms_ *= 0.995;
    } else {
      learn(packet_ms_, ms / packet_work(c));
      beam_ms_ *= 0.995;
    }
    beam_ms_ = std::max(beam_ms_, kLeastBeamMs);
  }

 private:
  static constexpr std::size_t kLeastReceivers = 64;

  // Fitted to what 12,400 clusters of 11 scenes took either way, before lights of 5, 15 and 40 %.
  static double packet_work(const Cluster& c) {
    return static_cast<double>(c.receivers) * std::pow(static_cast<double>(c.groups) + 4.0, 0.7);
  }
  static double beam_work(const Cluster& c) {
    return static_cast<double>(c.receivers * c.samples) * std::pow(static_cast<double>(c.groups) + 4.0, 0.25);
  }

  static constexpr double kLeastBeamMs = 7e-6;  // with vectors of 16 at 2.6 GHz; on others beams are tried more often
  double packet_ms_ = 0.0, beam_ms_ = kLeastBeamMs;
};

}  // namespace halfshade
