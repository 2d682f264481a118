// The rival, and method raytrace: every (receiver, light sample) segment as an occlusion ray of Embree 3, in its
// fastest ways.
#pragma once

#include <cmath>
#include <memory>
#include <string>

#include "halfshade/shadows.h"
#include "shadows/receivers.h"

namespace halfshade {

enum class BuildQuality { kLow, kMedium, kHigh };

/// What goes into one packet: samples of one receiver in their order, samples of one receiver in square blocks of the
/// light (grids of k x k samples only), or the same sample of neighbouring receivers.
enum class PacketOrder { kSamples, kSampleBlocks, kReceivers };

struct EmbreeMode {
  int width = 16;  // rays per call: 1, 4, 8, 16
  PacketOrder order = PacketOrder::kSamples;
  bool coherent = true;  // RTC_INTERSECT_CONTEXT_FLAG_COHERENT
  bool robust = false;   // RTC_SCENE_FLAG_ROBUST
  BuildQuality quality = BuildQuality::kMedium;

  std::string name() const;
};

/// All modes that make sense for `sample_count` samples.
std::vector<EmbreeMode> embree_modes(std::uint32_t sample_count);

/// The one that is fastest on most scenes (docs/performance.md): 16 samples of one receiver per packet, in square
/// blocks of the light where the number of samples allows.
EmbreeMode best_embree_mode(std::uint32_t sample_count, bool robust);

/// One scene with its trees, and one light's receivers and samples, all of which must outlive this.
///
/// Rays start at the receiver (tnear 0) and end just before the sample (tfar 1 - 2^-20). The receiver's own triangle is
/// not excluded: receivers are lifted off it (all but a few, see bench/README.md), and a filter callback for every hit
/// would only slow Embree down. Alpha-tested triangles are a geometry of their own with an occlusion filter that looks
/// up the nearest texel.
class EmbreeRays {
 public:
  EmbreeRays(const LatticeMesh& mesh, const ReceiverArray& receivers, const LightSamples& samples, int threads);
  ~EmbreeRays();

  /// Milliseconds to build the tree that `mode` needs; built on the first call. Embree uses `threads` threads.
  double build_ms(const EmbreeMode& mode);

  /// Traces all samples of receivers `order[0]`, `order[1]` ... and sets their blocked bits; `masks` holds all
  /// receivers and zeros. Runs in the calling thread's TBB arena. Requires build_ms(mode) before.
  void trace(const EmbreeMode& mode, std::span<const std::uint32_t> order, VisibilityMasks& masks) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// The texel of a repeated texture, in float as a user of rays would look it up.
inline std::uint32_t wrap_texel(float texel, std::uint32_t size) {
  const auto m = static_cast<int>(std::floor(texel)) % static_cast<int>(size);
  return static_cast<std::uint32_t>(m < 0 ? m + static_cast<int>(size) : m);
}

/// Is Embree part of this program?
bool embree_available();

}  // namespace halfshade
