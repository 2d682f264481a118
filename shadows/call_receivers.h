// The receivers of one call, on the lattice: read once for all of its lights.
#pragma once

#include "halfshade/shadow_solver.h"
#include "shadows/receivers.h"
#include "shadows/scene_store.h"

namespace halfshade {

/// Parallel arrays, one entry per receiver of the caller.
struct CallReceivers {
  std::vector<vec3> position;         // on the lattice, lifted
  std::vector<vec3> normal;           // unit; zero where the caller gave none
  std::vector<std::uint32_t> own;     // number in the scene's arrays, or kNone
  std::vector<std::uint32_t> number;  // sets of light samples are chosen by it
  std::vector<std::uint8_t> quad;     // the same for interleaved sets
  std::vector<std::uint8_t> absent;   // background of a G-buffer: nothing asks for light
  bool has_normals = false;

  std::size_t size() const { return position.size(); }
  void resize(std::size_t count);
};

/// Throw Error{kBadInput} naming the first receiver that is wrong, Error{kUsage} for views of different lengths.
void read_receivers(const ShadowScene::Impl& scene, const ReceiverView& view, CallReceivers& receivers);
void read_receivers(const ShadowScene::Impl& scene, const GBuffer& gbuffer, CallReceivers& receivers);

/// Those that the light can reach, and where each receiver of the call is among them.
struct LitReceivers {
  ReceiverArray array;               // `sample` = number of the receiver in the call
  std::vector<std::uint32_t> place;  // [receiver of the call] -> entry of `array`, or kNone
  std::vector<std::uint32_t> counts, offsets;
};

/// In the order of the call.
void select_lit(const CallReceivers& receivers, const LightSamples& samples, std::uint32_t seed, LitReceivers& lit);

}  // namespace halfshade
