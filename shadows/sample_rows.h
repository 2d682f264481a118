// Light samples that form rows: the structure that lets a receiver see the light as a picture of a few dozen words, one
// bit a sample.
#pragma once

#include "shadows/blocker_tree.h"

namespace halfshade {

/// The samples of a rectangle or a disk as rows of equally spaced columns. In the light's frame (x, y along its edges,
/// lengths of the lattice) the sample in column i of row j lies at x = (i - offset[j]) / scale, y = y[j], up to
/// `deviation`. A row need not have a sample in every column.
///
/// The picture has a word of 32 columns per line. Where there are more, a row takes several lines: line b * rows + j
/// holds the columns from 32 b on of row j, and `offset` is less by 32 b there.
///
/// Samples anywhere take the cells of a picture of more cells than samples, each one near to its place. These are kept
/// one by one; the offsets bound how far any of them is off its cell.
struct SampleRows {
  static constexpr std::uint32_t kWord = 32, kMaxColumns = 64, kMaxRows = 96;
  static constexpr std::uint32_t kMaxLines = kMaxRows * (kMaxColumns / kWord);
  static constexpr std::size_t kRoom = 32;  // of point_x, ... before the first set
  std::uint32_t rows = 0, columns = 0, lines = 0;
  vec3 axis_x{1, 0, 0}, axis_y{0, 1, 0};
  vec3 low{1e30f}, high{-1e30f};  // around the samples of all sets in the light's frame, rounded outwards
  float scale = 1.0f;             // columns per unit of length
  float least_offset = 0.0f, most_offset = 0.0f;  // over all rows (not lines)
  /// Row j lies between (j - most_row_offset) / row_scale and (j - least_row_offset) / row_scale, in all sets.
  float row_scale = 1.0f, least_row_offset = 0.0f, most_row_offset = 0.0f;
  /// Where the rows of each set are evenly spaced: line l of a set lies at row place[set][l] of a picture in which y is
  /// row_scale y, and that is row j - row_offset[set], up to `row_spread`. Else none.
  std::vector<float> place, row_offset;
  float row_spread = 0.0f;
  float reach_y = 0.0f;                          // max |y|
  float deviation = 0.0f;                        // max |coordinate| between a sample and its place by the formula above
  std::vector<float> y, offset;                  // [set][line]; not for samples anywhere
  std::vector<std::uint32_t> valid;              // [line]: bits of real samples; anywhere: [set][line]
  std::vector<std::int32_t> first;               // [line]: bit i is sample first + i of the set
  std::uint32_t stride = 0;                      // of a set in the arrays that follow
  std::vector<float> point_x, point_y, point_z;  // [set][stride] the samples themselves, lattice, behind kRoom others;
                                                 // with room for 48 more to be read
  bool anywhere = false;
  std::vector<float> column_of, row_of;  // anywhere: [set][stride] places in columns and rows from the centre
  std::vector<float> height_of;          // of a cloud: [set][stride] z in lengths
  std::vector<std::uint16_t> sample_of;  // anywhere: [set][stride] their numbers

  /// Consecutive samples of a set.
  struct Run {
    std::uint32_t first = 0, count = 0;
    std::int32_t column = 0;  // of the first one
  };
  std::vector<Run> runs;  // [row]

  std::uint32_t valid_of(std::size_t set, std::uint32_t line) const {
    return valid[(anywhere ? set * lines : 0) + line];
  }
  /// The line that holds a cell, and for samples anywhere the cell's place in the arrays of a set.
  std::uint32_t line_of(std::uint32_t row, std::uint32_t column) const { return column / kWord * rows + row; }
  std::size_t slot(std::uint32_t row, std::uint32_t column) const {
    return std::size_t{line_of(row, column)} * kWord + column % kWord;
  }
  bool holds(std::size_t set, std::uint32_t row, std::uint32_t column) const {
    return (valid_of(set, line_of(row, column)) >> column % kWord & 1) != 0;
  }
  void make_room_for_points(std::size_t count);
  /// Memory for arrange_cloud: so many sets of so many cells.
  void reserve_cells(std::size_t sets, std::size_t cells);
  void set_point(std::size_t at, const vec3& p) {
    point_x[kRoom + at] = p.x, point_y[kRoom + at] = p.y, point_z[kRoom + at] = p.z;
  }
  /// Can outlines of groups of triangles be drawn into it?
  bool has_outlines() const { return anywhere || !place.empty(); }
  /// The coordinates (one of point_x, ...) of a line's samples, by bit.
  const float* line_points(const std::vector<float>& points, std::size_t set, std::uint32_t line) const {
    return points.data() + kRoom + set * stride + first[line];
  }
};

/// No rows, and the memory of those that there were.
SampleRows no_rows(SampleRows& rows, const LightFrame& frame);

/// SampleRows::stride of so many samples anywhere.
std::size_t cells_anywhere(std::uint32_t count, std::uint32_t sets);

/// Samples of a plane that form no rows into `rows`, which are empty.
void sort_samples_anywhere(const KernelSamples& samples, const LightFrame& frame, SampleRows& rows);

/// Samples that lie in no plane, in a frame of the light: [set][KernelSamples::padded].
struct SampleCloud {
  std::vector<vec3> place;
  vec3 low{1e30f}, high{-1e30f};  // around all of them, rounded outwards
};

/// Rows where the samples of a flat light have them; else they are taken for samples anywhere.
/// `samples` must be in sample order (make_kernel_samples with SampleOrder::kAsGiven).
/// `reuse` gives its memory.
SampleRows find_sample_rows(const LightSamples& light, const KernelSamples& samples, const LightFrame& frame,
                            SampleRows reuse = {});

/// `reuse` gives its memory.
SampleCloud make_sample_cloud(const KernelSamples& samples, const LightFrame& frame, SampleCloud reuse = {});

/// A cloud as samples anywhere, sorted by where they are seen before the plane z = 0 from `from`, which lies above all
/// of them: their numbers, unprojected places and points for the sets that `wanted` names. Where each receiver sees
/// them, and so offsets, `deviation` and `reach_y`, is up to the packets (packet_anywhere-inl.h).
void arrange_cloud(const SampleCloud& cloud, const KernelSamples& samples, const LightFrame& frame, const vec3& from,
                   std::span<const std::uint8_t> wanted, SampleRows& rows);

}  // namespace halfshade
