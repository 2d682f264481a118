// Asks every contender of an atlas entry, frame by frame, and measures how far each is from the truth.
#pragma once

#include "atlas_entry.h"

namespace halfshade {

using VPicture = std::vector<float>;  // [row][column]

/// What one contender answered.
struct AtlasAnswer {
  VPicture visibility;  // of all frames, one below the other
  VPicture change;      // temporal entries: |v(t-1) - 2 v(t) + v(t+1)|; first and last row 0
  bool has_masks = false;
  std::uint64_t wrong_bits = 0, bits = 0;           // against the oracle with the same light samples
  std::uint64_t unreasoned = 0, reasons_asked = 0;  // temporal: see below
  std::vector<std::uint64_t> flips_per_frame;  // changed bits, or values of V without masks, since the frame before
  double flicker = 0.0;                        // mean of `change` over all frames but the first and last
  double ms = 0.0, easy_ms = 0.0;              // of all frames; medians where an entry has an easy form
  std::uint64_t bytes = 0, easy_bytes = 0;     // working memory, largest of all frames
  std::vector<std::pair<std::string, double>> details;  // of the last frame (ShadowStats)
  std::string refused;                                  // why the method gave no answer
};

/// `unreasoned` counts mask bits that changed from one frame to the next although the oracle's bit did not, of
/// `reasons_asked` bits; for methods without masks, values of V that changed although no bit of the oracle did, of
/// all values.
struct AtlasMeasures {
  std::uint32_t width = 0, height = 0;
  VPicture truth, truth_change;
  double truth_flicker = 0.0;
  std::vector<std::uint64_t> truth_flips_per_frame;
  std::vector<AtlasAnswer> answers;  // in the order of AtlasEntry::contenders
};

/// `progress` gets the share done, 0..1, and returns false to stop (then Error{kCancelled}).
AtlasMeasures measure_entry(const AtlasEntry& entry, const std::function<bool(double)>& progress);

/// Root mean square, largest and mean of a - b.
struct Deviation {
  double rmse = 0.0, max = 0.0, mean = 0.0;
};
Deviation deviation(const VPicture& a, const VPicture& b);

}  // namespace halfshade
