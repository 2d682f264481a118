// A second truth, for opaque triangles: 128-bit integers and nothing else. It shares the rounded points with the
// project, but neither its predicate nor a filter, a box or an order of evaluation.
#pragma once

#include "rasterizer/core/parallel.h"
#include "shadows/receiver_request.h"
#include "support/lit_scene.h"

namespace halfshade::test {

__extension__ using Wide = __int128;

struct Units {
  Wide x, y, z;  // multiples of 2^-38, |differences| < 2^40
};

inline Units in_units(const vec3& p) {
  const auto exact = [](float v) { return static_cast<Wide>(static_cast<double>(v) * 0x1p38); };
  return {exact(p.x), exact(p.y), exact(p.z)};
}
inline Units operator-(const Units& a, const Units& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Units cross(const Units& a, const Units& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline Wide dot(const Units& a, const Units& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

/// The contract, word for word: r and l strictly on opposite sides of the plane, and the line through them passes all
/// three edges on one side or on the edge itself.
class IntegerTriangle {
 public:
  IntegerTriangle(const std::array<vec3, 3>& corners, const Units& r)
      : a_(in_units(corners[0])), b_(in_units(corners[1])), c_(in_units(corners[2])), r_(r) {
    normal_ = cross(b_ - a_, c_ - a_);
    side_of_r_ = dot(normal_, r - a_);
    past_ab_ = cross(a_ - r, b_ - r);
    past_bc_ = cross(b_ - r, c_ - r);
    past_ca_ = cross(c_ - r, a_ - r);
  }

  bool blocks(const Units& l) const {
    const Wide side_of_l = dot(normal_, l - a_);
    if (!((side_of_r_ < 0 && side_of_l > 0) || (side_of_r_ > 0 && side_of_l < 0))) return false;
    const Units d = l - r_;
    const Wide ab = dot(past_ab_, d), bc = dot(past_bc_, d), ca = dot(past_ca_, d);
    return (ab >= 0 && bc >= 0 && ca >= 0) || (ab <= 0 && bc <= 0 && ca <= 0);
  }

 private:
  Units a_, b_, c_, r_, normal_, past_ab_, past_bc_, past_ca_;
  Wide side_of_r_;
};

/// Masks of what solve_shadows was asked, triangle by triangle and sample by sample. Opaque scenes only.
inline VisibilityMasks integer_masks(const Scene& scene, const std::vector<Receiver>& receivers, const Light& light,
                                     const ShadowConfig& config) {
  const LocalFrame frame = make_local_frame(scene.positions, receiver_reach(receivers, light));
  const ReceiverRequest q = make_receiver_request(frame, receivers, light, config);
  const LatticeMesh mesh = make_lattice_mesh(scene, frame);
  VisibilityMasks solved, masks;
  solved.reset(q.receivers.size(), q.samples.count);
  parallel_ranges(q.receivers.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) {
      std::vector<Units> samples;
      for (const vec3& l : q.samples.set(q.receivers.set[i])) samples.push_back(in_units(l));
      const Units r = in_units(q.receivers.position[i]);
      for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
        if (t == q.receivers.triangle[i]) continue;
        const IntegerTriangle triangle(mesh.corners(t), r);
        for (std::size_t s = 0; s < samples.size(); ++s) {
          if (triangle.blocks(samples[s]))
            solved.words[i * solved.words_per_receiver + s / 64] |= std::uint64_t{1} << (s % 64);
        }
      }
    }
  });
  spread_masks(q, solved, receivers.size(), masks);
  return masks;
}

/// Wrong bits of the oracle and all exact methods together against integers; perforated scenes against the oracle.
inline std::uint64_t wrong_against_integers(const Scene& scene, const std::vector<Receiver>& receivers,
                                            const Light& light, const ShadowConfig& config) {
  const VisibilityMasks oracle = solve(scene, receivers, light, config, ShadowMethod::kOracle);
  const VisibilityMasks truth = scene.alpha_maps.empty() ? integer_masks(scene, receivers, light, config) : oracle;
  std::uint64_t wrong = wrong_bits(truth, oracle);
  for (const ShadowMethod method : exact_methods()) {
    wrong += wrong_bits(truth, solve(scene, receivers, light, config, method));
  }
  return wrong;
}

}  // namespace halfshade::test
