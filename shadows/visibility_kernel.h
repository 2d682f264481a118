// Hot loop of the looping-over-triangles methods: one blocker against a run of receivers and all their light samples.
//
// A segment r-l passes inside an edge a-b of the blocker where det(a-r, b-a, l-r), signed by the side of the plane on
// which r lies, is >= 0 (Sintorn, Eisemann, Assarsson 2008, sections 3.3 and 4.2: planes through receiver and edges).
// For a fixed receiver it is linear in l: m . (l - c) + d around the light's centre c. Receivers are the lanes of the
// first test (does the blocker hide any sample at all?); samples are the lanes of the second. Float signs within their
// error bound of zero go to the exact predicate, so the masks are those of exact arithmetic on every instruction set.
#pragma once

#include "halfshade/shadows.h"
#include "rasterizer/core/mesh.h"
#include "shadows/light_samples.h"

namespace halfshade {

struct LightBound;
struct ClosedComponents;
class HalfPlaneTable;

/// Light samples as the kernel reads them: offsets from the light's centre in an order that puts neighbours together,
/// in groups of 16 with a bounding box each. Bit i of a mask under construction is the i-th sample of this order.
struct KernelSamples {
  static constexpr std::uint32_t kGroup = 16;
  std::uint32_t count = 0;
  std::uint32_t padded = 0;  // count rounded up to a multiple of 64
  std::uint32_t sets = 1;
  vec3 center{0.0f};                             // on the lattice
  float reach = 0.0f;                            // max |coordinate| of an offset
  std::array<vec3, 3> half_axes{};               // parallelepiped around all offsets
  std::vector<std::uint32_t> order;              // [set][padded] -> sample index; the padding repeats the last sample
  std::vector<float> x, y, z;                    // [set][padded] offsets
  std::vector<vec3> points;                      // [set][padded] positions on the lattice
  std::uint32_t group_stride = 0;                // groups per set, rounded up to a multiple of 64
  std::vector<float> group_x, group_y, group_z;  // [set][group_stride] centres of the groups' boxes
  std::vector<float> half_x, half_y, half_z;     // [set][group_stride] half extents, rounded up
  std::vector<std::uint64_t> valid;              // [padded / 64]: bits of real samples

  const HalfPlaneTable* table = nullptr;     // afsm-lut: instead of plane tests; null = exact
  const ClosedComponents* closed = nullptr;  // certificate for back-face-only casters; null = both sides cast
  std::vector<std::uint8_t> closed_usable;   // [closed component] all samples lie outside its box

  std::span<const vec3> set_points(std::uint32_t set) const {
    return {points.data() + std::size_t{set} * padded, padded};
  }
};

enum class SampleOrder { kNeighboursTogether, kAsGiven };

/// `reuse` gives its memory.
KernelSamples make_kernel_samples(const LightSamples& samples, const LightBound& bound,
                                  SampleOrder order = SampleOrder::kNeighboursTogether, KernelSamples reuse = {});

/// Lets front faces of closed components be skipped where that is certified to change no bit.
void use_certificate(const ClosedComponents& closed, KernelSamples& samples);

/// Mask bits from the kernel's order of the set's samples to sample indices.
void restore_sample_order(const KernelSamples& samples, std::uint32_t set, std::span<const std::uint64_t> kernel_mask,
                          std::span<std::uint64_t> mask);

/// Receivers in the order of the lists, as parallel arrays with kLanePadding entries to spare at the end.
struct KernelReceivers {
  static constexpr std::size_t kLanePadding = 64;
  std::vector<float> x, y, z;
  std::vector<std::uint32_t> own;   // own triangle
  std::vector<std::uint32_t> open;  // all ones while some sample is not blocked yet, then zero
  std::vector<std::uint8_t> set;
  std::vector<std::uint64_t> masks;     // [receiver][words]
  std::vector<std::uint64_t*> mask_at;  // [receiver] -> words of its own, or empty: all of them lie in `masks`
  std::size_t words = 0;
  std::size_t count = 0;

  std::uint64_t* mask(std::size_t i) { return mask_at.empty() ? masks.data() + i * words : mask_at[i]; }
};

/// A blocker and the run of receivers that it may hide from the light.
struct BlockerSpan {
  std::uint32_t triangle, begin, end;
};

struct KernelCounters {
  std::uint64_t pairs_tested = 0, pairs_sampled = 0, pairs_necessary = 0, sample_tests = 0, exact_fallbacks = 0;
  void add(const KernelCounters& o);
};

void add_to_stats(const KernelCounters& counters, ShadowStats& stats);

struct Blocker;
struct ReceiverArray;

/// Receivers as the kernels read them, in the given order, nothing blocked yet.
KernelReceivers gather_receivers(const ReceiverArray& receivers, const std::vector<std::uint32_t>& order,
                                 std::size_t words);
/// The same into what an earlier call filled.
void gather_receivers(const ReceiverArray& receivers, const std::vector<std::uint32_t>& order, std::size_t words,
                      KernelReceivers& k);
/// The finished masks back into the order of the receivers, with samples in their own order.
void scatter_masks(const KernelReceivers& k, const KernelSamples& samples, const std::vector<std::uint32_t>& order,
                   VisibilityMasks& masks);

/// ORs into receivers.masks what the blockers hide. Spans must stay within receivers that no other call writes.
void test_blockers(const LatticeMesh& mesh, const KernelSamples& samples, std::span<const BlockerSpan> spans,
                   KernelReceivers& receivers, KernelCounters& counters);

/// The same with blockers prepared beforehand (visibility_pair.h), for those that meet many short runs: the `triangle`
/// of a span is an index into `blockers`.
void test_prepared_blockers(std::span<const Blocker> blockers, const KernelSamples& samples,
                            std::span<const BlockerSpan> spans, KernelReceivers& receivers, KernelCounters& counters);

/// Same contract in plain scalar code with the exact predicate alone.
void test_blockers_reference(const LatticeMesh& mesh, const KernelSamples& samples, std::span<const BlockerSpan> spans,
                             KernelReceivers& receivers, KernelCounters& counters);

}  // namespace halfshade
