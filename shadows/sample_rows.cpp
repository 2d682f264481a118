#include "shadows/sample_rows.h"

#include <algorithm>
#include <cmath>

#include "rasterizer/core/reuse.h"
#include "shadows/sample_patterns.h"

namespace halfshade {

SampleRows no_rows(SampleRows& rows, const LightFrame& frame) {
  SampleRows none;
  none.axis_x = vec3(frame.u), none.axis_y = vec3(frame.v);
  none.place = emptied(rows.place), none.row_offset = emptied(rows.row_offset);
  none.y = emptied(rows.y), none.offset = emptied(rows.offset);
  none.point_x = emptied(rows.point_x), none.point_y = emptied(rows.point_y), none.point_z = emptied(rows.point_z);
  none.valid = emptied(rows.valid), none.first = emptied(rows.first), none.runs = emptied(rows.runs);
  none.column_of = emptied(rows.column_of), none.row_of = emptied(rows.row_of);
  none.sample_of = emptied(rows.sample_of), none.height_of = emptied(rows.height_of);
  return none;
}

namespace {

/// Rows of a rectangle: every row of every set has the same number of samples at one height.
void find_equal_runs(const LightSamples& light, SampleRows& rows) {
  std::uint32_t columns = 1;
  while (columns < light.count && light.st[columns].y == light.st[0].y) ++columns;
  if (light.count % columns != 0) return;
  for (std::size_t i = 0; i < light.st.size(); ++i) {
    if (light.st[i].y != light.st[i / columns * columns].y) return;
  }
  rows.rows = light.count / columns;
  for (std::uint32_t row = 0; row < rows.rows; ++row) rows.runs.push_back({row * columns, columns, 0});
  rows.columns = columns;
}

/// Rows of a disk (disk_rows), which differ in length; of a single set.
void find_disk_runs(const LightSamples& light, SampleRows& rows) {
  if (light.sets != 1) return;
  rows.rows = disk_row_count(light.count);
  for (std::uint32_t i = 0; i < light.count; ++i) {
    if (i == 0 || light.st[i].y != light.st[i - 1].y) rows.runs.push_back({i, 0, 0});
    rows.columns = std::max(rows.columns, ++rows.runs.back().count);
  }
  for (SampleRows::Run& r : rows.runs) r.column = static_cast<std::int32_t>(rows.columns - r.count) / 2;
}

/// Row heights and shifts as the samples themselves have them: the mean of a row takes out most of their rounding.
void add_row(std::span<const vec3> row, std::int32_t column, const KernelSamples& samples, const LightFrame& frame,
             SampleRows& rows) {
  dvec3 sum(0.0);
  for (const vec3& p : row) sum += frame.to_frame(dvec3(p));
  const double n = static_cast<double>(row.size());
  rows.y.push_back(static_cast<float>(sum.y / n));
  rows.offset.push_back(static_cast<float>(column + 0.5 * (n - 1.0) - sum.x / n * double{rows.scale}));
  for (std::size_t i = 0; i < row.size(); ++i) {
    const double x = (column + static_cast<double>(i) - double{rows.offset.back()}) / double{rows.scale};
    const dvec3 place = dvec3(samples.center) + x * dvec3(rows.axis_x) + double{rows.y.back()} * dvec3(rows.axis_y);
    const dvec3 error = glm::abs(place - dvec3(row[i]));
    rows.deviation = std::max(rows.deviation, static_cast<float>(std::max({error.x, error.y, error.z}) * 1.001));
  }
}

/// The lines of a set: its words beyond the first.
void add_further_words(SampleRows& rows) {
  const std::size_t first = rows.y.size() - rows.rows;
  for (std::uint32_t line = rows.rows; line < rows.lines; ++line) {
    const std::size_t row = first + line % rows.rows;
    rows.y.push_back(rows.y[row]);
    rows.offset.push_back(rows.offset[row] - static_cast<float>(line / rows.rows * SampleRows::kWord));
  }
}

/// Where the samples of each line are.
void find_lines(SampleRows& rows) {
  constexpr auto kWord = static_cast<std::int32_t>(SampleRows::kWord);
  for (std::uint32_t line = 0; line < rows.lines; ++line) {
    const SampleRows::Run& r = rows.runs[line % rows.rows];
    const std::int32_t first = r.column - static_cast<std::int32_t>(line / rows.rows) * kWord, low = std::max(first, 0),
                       end = std::min(first + static_cast<std::int32_t>(r.count), kWord);
    rows.valid.push_back(low >= end ? 0 : (~0u << low) & (~0u >> (kWord - end)));
    rows.first.push_back(static_cast<std::int32_t>(r.first) - first);
  }
}

/// Bounds of the rows' places from their heights; false where the rows do not rise evenly enough to be worth it.
bool space_rows(SampleRows& rows, std::uint32_t sets) {
  const double pitch = rows.rows > 1 ? (double{rows.y[rows.rows - 1]} - double{rows.y[0]}) / (rows.rows - 1.0) : 1.0;
  if (!(pitch > 1e-7)) return false;
  double least = 1e30, most = -1e30, spread = 0.0;
  for (std::uint32_t set = 0; set < sets; ++set) {
    double first = 1e30, last = -1e30;
    for (std::uint32_t row = 0; row < rows.rows; ++row) {
      const double offset = row - double{rows.y[std::size_t{set} * rows.lines + row]} / pitch;
      first = std::min(first, offset), last = std::max(last, offset);
    }
    rows.row_offset.push_back(static_cast<float>(0.5 * (first + last)));
    least = std::min(least, first), most = std::max(most, last), spread = std::max(spread, last - first);
  }
  rows.row_scale = static_cast<float>(1.0 / pitch);
  rows.least_row_offset = static_cast<float>(least), rows.most_row_offset = static_cast<float>(most);
  rows.row_spread = static_cast<float>(spread);
  if (spread < 1e-3) {
    for (const float y : rows.y) rows.place.push_back(y * rows.row_scale);
  }
  return most - least < 2.0;
}

/// The rows that the samples form; false where they form none.
bool find_rows(const LightSamples& light, const KernelSamples& samples, const LightFrame& frame, SampleRows& rows) {
  if (light.st.empty() || !light.outline.empty()) return false;
  light.st_key.disk ? find_disk_runs(light, rows) : find_equal_runs(light, rows);
  if (rows.rows == 0 || rows.rows != rows.runs.size() || rows.rows > SampleRows::kMaxRows ||
      rows.columns > SampleRows::kMaxColumns)
    return false;
  rows.lines = rows.rows * ((rows.columns + SampleRows::kWord - 1) / SampleRows::kWord);
  const auto longest = std::max_element(rows.runs.begin(), rows.runs.end(),
                                        [](const auto& a, const auto& b) { return a.count < b.count; });
  const dvec3 first = frame.to_frame(dvec3(samples.points[longest->first])),
              last = frame.to_frame(dvec3(samples.points[longest->first + longest->count - 1]));
  const double pitch = longest->count > 1 ? (last.x - first.x) / (longest->count - 1.0) : 1.0;
  if (!(pitch > 1e-7)) return false;
  rows.scale = static_cast<float>(1.0 / pitch);
  for (std::uint32_t set = 0; set < samples.sets; ++set) {
    for (const SampleRows::Run& r : rows.runs)
      add_row(samples.set_points(set).subspan(r.first, r.count), r.column, samples, frame, rows);
    const auto offsets = std::span(rows.offset).last(rows.rows);
    const auto [least, most] = std::minmax_element(offsets.begin(), offsets.end());
    rows.least_offset = set == 0 ? *least : std::min(rows.least_offset, *least);
    rows.most_offset = set == 0 ? *most : std::max(rows.most_offset, *most);
    add_further_words(rows);
  }
  find_lines(rows);
  if (!space_rows(rows, samples.sets)) return false;
  rows.stride = samples.padded;
  rows.make_room_for_points(samples.points.size());
  for (std::size_t i = 0; i < samples.points.size(); ++i) rows.set_point(i, samples.points[i]);
  for (const float y : rows.y) rows.reach_y = std::max(rows.reach_y, std::fabs(y));
  // Not a rectangle's rows after all (a skewed light, rows along another axis): those are samples anywhere.
  return rows.deviation * rows.scale <= 0.01f;
}

}  // namespace

void SampleRows::make_room_for_points(std::size_t count) {
  for (auto* values : {&point_x, &point_y, &point_z}) values->resize(kRoom + count + 48);
}

SampleRows find_sample_rows(const LightSamples& light, const KernelSamples& samples, const LightFrame& frame,
                            SampleRows reuse) {
  SampleRows rows = no_rows(reuse, frame);
  if (!find_rows(light, samples, frame, rows)) {
    rows = no_rows(rows, frame);
    sort_samples_anywhere(samples, frame, rows);
  }
  for (const vec3& p : samples.points) {
    const vec3 place(frame.to_frame(dvec3(p)));
    rows.low = glm::min(rows.low, place - 1e-6f), rows.high = glm::max(rows.high, place + 1e-6f);
  }
  return rows;
}

}  // namespace halfshade
