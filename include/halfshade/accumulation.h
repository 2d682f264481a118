// Averages over frames: every frame asks with other light samples, and the answers are counted in integers.
//
// The paper's temporal jittering (Sintorn, Eisemann, Assarsson 2008, section 4.2): while neither the scene nor the
// camera moves, the mean over frames converges to the visibility of the whole light. Sums of integers do not depend on
// the order of their terms, so frames may come in any order, from any number of accumulators, and give the same bits.
#pragma once

#include <utility>

#include "halfshade/shadows.h"

namespace halfshade {

/// Counts of visible samples and of samples asked, one pair per entry: a pixel, a pixel's subsample or a receiver, as
/// the caller numbers them. Distinct accumulators may be used concurrently, one may not.
class HALFSHADE_API VisibilityAccumulator {
 public:
  explicit VisibilityAccumulator(std::size_t entries = 0) : visible_(entries, 0), total_(entries, 0) {}
  /// Counts that were kept elsewhere. Throws Error{kBadInput} unless both have the same length and visible <= total.
  VisibilityAccumulator(std::vector<std::uint32_t> visible, std::vector<std::uint32_t> total);

  std::size_t size() const { return visible_.size(); }
  std::span<const std::uint32_t> visible() const { return visible_; }
  std::span<const std::uint32_t> total() const { return total_; }

  /// Adds one frame: receiver i of `masks` is entry entries[i]; no entry occurs twice. Throws Error{kUsage} when the
  /// lengths differ or an entry is out of range, Error{kLimit} when a count would exceed 32 bits; nothing is added
  /// then.
  void add(std::span<const std::uint32_t> entries, const VisibilityMasks& masks);
  /// The same for receiver i = entry i.
  void add(const VisibilityMasks& masks);
  /// Adds `sample_count` hidden samples to each of `entries`: surfaces that face away from the light in this frame.
  void add_hidden(std::span<const std::uint32_t> entries, std::uint32_t sample_count);
  /// Adds the counts of another accumulator of the same size. Throws as add.
  void merge(const VisibilityAccumulator& other);

  /// Mean over everything added, in [0, 1]; 0 for an entry that was never asked.
  double visibility(std::size_t entry) const {
    return total_[entry] == 0 ? 0.0 : static_cast<double>(visible_[entry]) / total_[entry];
  }

  bool operator==(const VisibilityAccumulator&) const = default;

 private:
  void check_entries(std::span<const std::uint32_t> entries) const;
  void reserve_samples(std::uint64_t more);

  std::vector<std::uint32_t> visible_, total_;  // [entry]
  std::uint64_t most_ = 0;                      // no entry's total is larger
};

/// How far two averages lie apart.
struct HALFSHADE_API VisibilityError {
  double rmse = 0.0, worst = 0.0;  // root of the mean square, and largest, of |visibility a - visibility b|
  std::uint64_t count = 0;         // entries compared

  /// The error over the entries of both.
  void merge(const VisibilityError& other);
};

/// Over those of `entries` that both were asked for, in their order. Throws Error{kUsage} when sizes differ or an entry
/// is out of range.
HALFSHADE_API VisibilityError visibility_error(const VisibilityAccumulator& a, const VisibilityAccumulator& b,
                                               std::span<const std::uint32_t> entries);

/// Sums of colour values over frames in units of 2^-20, so that they do not depend on the order either. For pictures
/// whose camera moves from frame to frame by fractions of a pixel, where visibility alone cannot be averaged.
class HALFSHADE_API ColorAccumulator {
 public:
  explicit ColorAccumulator(std::size_t values = 0) : sums_(values, 0) {}
  /// Sums that were kept elsewhere.
  ColorAccumulator(std::vector<std::uint64_t> sums, std::uint32_t frames) : sums_(std::move(sums)), frames_(frames) {}

  std::size_t size() const { return sums_.size(); }
  std::span<const std::uint64_t> sums() const { return sums_; }
  std::uint32_t frames() const { return frames_; }

  /// Adds one frame of size() values, each clamped to [0, 65536]; NaN counts as 0. Throws Error{kUsage} for another
  /// length, Error{kLimit} beyond 2^25 frames.
  void add(std::span<const float> values);
  void merge(const ColorAccumulator& other);
  /// Mean of a value over the frames added; 0 if there are none.
  float mean(std::size_t value) const {
    return frames_ == 0 ? 0.0f : static_cast<float>(static_cast<double>(sums_[value]) * 0x1p-20 / frames_);
  }

  bool operator==(const ColorAccumulator&) const = default;

 private:
  void reserve_frames(std::uint32_t more);

  std::vector<std::uint64_t> sums_;
  std::uint32_t frames_ = 0;
};

/// The exponent p of error = constant * frames^p that fits best (least squares in logarithms; error[i] belongs to
/// frames[i]; values that are not positive are left out). Random sampling gives -0.5. NaN with fewer than two values.
HALFSHADE_API double convergence_exponent(std::span<const double> frames, std::span<const double> error);

}  // namespace halfshade
