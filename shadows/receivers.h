// The points that ask for light, made once and shared by every method, the oracle and the rivals.
#pragma once

#include <algorithm>

#include "halfshade/shadow_solver.h"
#include "rasterizer/core/mesh.h"
#include "rasterizer/gbuffer.h"
#include "shadows/light_samples.h"

namespace halfshade {

/// Parallel arrays, one entry per receiver, in increasing sample index of the picture.
struct ReceiverArray {
  std::vector<vec3> position;           // on the lattice
  std::vector<vec3> normal;             // unit, geometric, on the camera's side
  std::vector<std::uint32_t> triangle;  // own triangle, never a blocker of this receiver; kNone if none
  std::vector<std::uint32_t> sample;    // entry of the G-buffer it came from
  std::vector<std::uint8_t> set;        // which set of light samples it uses

  std::size_t size() const { return position.size(); }
  void resize(std::size_t count);
  void reserve(std::size_t count);
  void push_back(const vec3& p, const vec3& n, std::uint32_t own, std::uint32_t from, std::uint8_t light_set);
};

/// Distance by which a receiver is lifted off its triangle along the geometric normal: 4 ulp of a coordinate of size 1,
/// 2^-21 of the frame (stability.md b8), but no more than 2^-18 of the scene where far lights make the scene small in
/// its frame.
inline constexpr double kReceiverOffset = kReceiverLift, kReceiverOffsetOfScene = kReceiverLiftOfScene;

/// `reach` is GBuffer::reach.
inline double default_lift(double reach) { return std::min(kReceiverOffset, kReceiverOffsetOfScene * reach); }

/// Lifted and snapped.
inline vec3 lifted_receiver(const dvec3& position, const vec3& normal, double reach) {
  return snap_to_lattice(position + dvec3(normal) * default_lift(reach));
}

/// Does the receiver lie at or behind a one-sided light?
inline bool behind_light(const vec3& position, const LightSamples& samples) {
  return samples.one_sided && glm::dot(dvec3(position) - samples.center, samples.axis_n) <= 0.0;
}

/// Does the light send nothing to this receiver whatever blocks it? True where every sample lies at or below the
/// receiver's tangent plane, or the receiver lies at or behind a one-sided light. A pure function of rounded inputs.
bool faces_away(const vec3& position, const vec3& normal, const LightSamples& samples, std::uint32_t set);

/// Set of light samples that the receiver at pixel sample (x, y) of the whole picture uses with interleaved sets.
inline std::uint32_t interleaved_set(std::uint32_t x, std::uint32_t y) { return y % 4 * 4 + x % 4; }

/// The same with sets chosen by hash; `index` numbers the pixel samples of the whole picture.
std::uint32_t receiver_set(std::uint32_t index, std::uint32_t seed, std::uint32_t sets);

/// Receivers of all visible samples that do not face away from the light, in picture order.
ReceiverArray make_receivers(const GBuffer& gbuffer, const LightSamples& samples, std::uint32_t seed);

}  // namespace halfshade
