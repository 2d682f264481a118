// Light samples that form rows: the structure that lets one vector hold a whole light (sample i of every row in one
// lane).
#pragma once

#include "shadows/blocker_tree.h"

namespace halfshade {

/// The samples of a rectangle as rows of equally spaced columns. In the light's frame (x, y along its edges, lengths of
/// the lattice) sample i of row j lies at x = (i - offset[j]) / scale, y = y[j], up to `deviation`.
struct SampleRows {
  static constexpr std::uint32_t kMaxColumns = 32, kMaxRows = 32;
  std::uint32_t rows = 0, columns = 0;
  std::uint32_t padded = 0;  // rows rounded up to a multiple of 16; the padding holds no samples
  vec3 axis_x{1, 0, 0}, axis_y{0, 1, 0};
  float scale = 1.0f;  // columns per unit of length
  float least_offset = 0.0f, most_offset = 0.0f;
  float reach_y = 0.0f;                          // max |y|
  float deviation = 0.0f;                        // max |coordinate| between a sample and its place by the formula above
  std::vector<float> y, offset;                  // [set][padded]
  std::vector<float> point_x, point_y, point_z;  // [set][KernelSamples::padded] the samples themselves, lattice; with
                                                 // room for 16 more to be read
  std::vector<std::uint32_t> valid;              // [padded]: bits of real samples

  bool empty() const { return rows == 0; }
};

/// Empty where the samples have no such rows: other shapes, patterns without rows, more than 32 columns or rows.
/// `samples` must be in sample order (make_kernel_samples with SampleOrder::kAsGiven).
SampleRows find_sample_rows(const LightSamples& light, const KernelSamples& samples, const LightFrame& frame);

}  // namespace halfshade
