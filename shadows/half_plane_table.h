// Light samples on one side of a plane, looked up by the quantised plane (Sintorn, Eisemann, Assarsson 2008, section
// 4.2, after Eisemann and Decoret 2007). Approximate: a plane is replaced by the nearest one in the table, so samples
// near it can land on the wrong side (stability.md A4).
//
// Flat lights: the line in which the plane meets the light, by its direction's angle and its distance from the light's
// centre, size^2 entries. Volumetric lights: two angles and the distance, size^3 entries. Directions cover a half turn;
// the others are complements. An entry has a bit for each
// sample, any number of them: one table for 1024 samples is the paper's eight tables for 128 each, side by side. Every
// sample set has its own table.
#pragma once

#include "shadows/visibility_pair.h"

namespace halfshade {

class HalfPlaneTable {
 public:
  /// Throws Error{kLimit} beyond 2 GiB. Requires samples that are not all in one point.
  HalfPlaneTable(const LightSamples& light, const KernelSamples& samples, std::uint32_t size);

  /// Clears the bits (in the kernel's order) of the set's samples x with normal . (x - centre) + value < 0, about.
  void keep_side(const dvec3& normal, double value, std::uint32_t set, std::span<std::uint64_t> bits) const;

  std::uint64_t bytes() const { return masks_.size() * sizeof(std::uint64_t); }

 private:
  dvec3 direction(std::size_t index) const;
  void fill(const KernelSamples& samples, std::uint32_t set, std::size_t direction_index);

  std::uint32_t size_;
  bool flat_;
  dvec3 axis_u_, axis_v_, axis_n_;
  double radius_ = 0.0;         // of the ball around the centre that holds all samples
  std::size_t directions_ = 0;  // size or size^2
  std::size_t words_ = 0;
  std::vector<std::uint64_t> masks_;  // [set][direction][distance][word]
};

/// Blocks the samples that the table finds inside the planes through receiver and edges, and beyond the blocker's own
/// plane where that cuts the light. True where bits were added. The same bits on every instruction set.
bool block_by_table(const HalfPlaneTable& table, const Blocker& blocker, const KernelSamples& samples,
                    std::size_t receiver, KernelReceivers& receivers);

}  // namespace halfshade
