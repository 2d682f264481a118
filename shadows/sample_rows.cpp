#include "shadows/sample_rows.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "rasterizer/core/reuse.h"
#include "shadows/sample_patterns.h"

namespace halfshade {
namespace {

/// No rows, and the memory of those that there were.
SampleRows no_rows(SampleRows& rows, const LightFrame& frame) {
  SampleRows none;
  none.axis_x = vec3(frame.u), none.axis_y = vec3(frame.v);
  none.place = emptied(rows.place), none.y = emptied(rows.y), none.offset = emptied(rows.offset);
  none.point_x = emptied(rows.point_x), none.point_y = emptied(rows.point_y), none.point_z = emptied(rows.point_z);
  none.valid = emptied(rows.valid), none.first = emptied(rows.first), none.runs = emptied(rows.runs);
  none.column_of = emptied(rows.column_of), none.row_of = emptied(rows.row_of);
  none.sample_of = emptied(rows.sample_of), none.height_of = emptied(rows.height_of);
  return none;
}

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
  double least = 1e30, most = -1e30;
  for (std::uint32_t set = 0; set < sets; ++set) {
    for (std::uint32_t row = 0; row < rows.rows; ++row) {
      const double offset = row - double{rows.y[std::size_t{set} * rows.lines + row]} / pitch;
      least = std::min(least, offset), most = std::max(most, offset);
    }
  }
  rows.row_scale = static_cast<float>(1.0 / pitch);
  rows.least_row_offset = static_cast<float>(least), rows.most_row_offset = static_cast<float>(most);
  if (sets == 1 && most - least < 1e-3) {
    for (const float y : rows.y) rows.place.push_back(y * rows.row_scale);
  }
  return most - least < 2.0;
}

/// Points of the lattice line by line, with room on both sides for what reads whole vectors.
template <class Point>
void store_points(std::size_t count, const Point& point, SampleRows& rows) {
  for (auto* values : {&rows.point_x, &rows.point_y, &rows.point_z}) values->resize(SampleRows::kRoom);
  for (std::size_t i = 0; i < count; ++i) {
    const vec3& p = point(i);
    rows.point_x.push_back(p.x), rows.point_y.push_back(p.y), rows.point_z.push_back(p.z);
  }
  for (auto* values : {&rows.point_x, &rows.point_y, &rows.point_z}) values->resize(values->size() + 48);
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
  store_points(samples.points.size(), [&](std::size_t i) { return samples.points[i]; }, rows);
  for (const float y : rows.y) rows.reach_y = std::max(rows.reach_y, std::fabs(y));
  // Not a rectangle's rows after all (a skewed light, rows along another axis): those are samples anywhere.
  return rows.deviation * rows.scale <= 0.01f;
}

/// Rows of about as many samples as there are rows, a word each where that is possible.
void divide_into_rows(std::uint32_t count, SampleRows& rows) {
  constexpr std::uint32_t kWord = SampleRows::kWord;
  rows.rows = static_cast<std::uint32_t>(std::ceil(std::sqrt(static_cast<double>(count))));
  if ((count + kWord - 1) / kWord <= SampleRows::kMaxRows) rows.rows = std::max(rows.rows, (count + kWord - 1) / kWord);
  for (std::uint32_t row = 0; row < rows.rows; ++row) {
    const std::uint32_t first = row * count / rows.rows, end = (row + 1) * count / rows.rows;
    rows.runs.push_back({first, end - first, 0});
    rows.columns = std::max(rows.columns, end - first);
  }
  rows.lines = rows.rows * ((rows.columns + kWord - 1) / kWord);
  rows.stride = rows.lines * kWord;
}

/// Columns or rows per unit of length; not so many for small lights that nothing would be known to the nearest one.
float cells_per_length(std::uint32_t cells, double length) {
  constexpr double kMost = 1000.0;
  return static_cast<float>(std::min(cells / std::max(length, 1e-9), kMost));
}

/// One set into the lines, by the places of its samples.
template <class Place>
void sort_set(std::uint32_t count, std::uint32_t set, const Place& place, SampleRows& rows) {
  std::array<std::uint16_t, SampleRows::kMaxLines * SampleRows::kWord> order;
  const auto end = order.begin() + count;
  std::iota(order.begin(), end, std::uint16_t{0});
  std::sort(order.begin(), end, [&](auto a, auto b) { return place[a].y < place[b].y; });
  std::uint16_t* const sample_of = rows.sample_of.data() + std::size_t{set} * rows.stride;
  for (std::uint32_t row = 0; row < rows.rows; ++row) {
    const SampleRows::Run& r = rows.runs[row];
    std::sort(order.begin() + r.first, order.begin() + r.first + r.count,
              [&](auto a, auto b) { return place[a].x < place[b].x; });
    for (std::uint32_t i = 0; i < r.count; ++i) sample_of[rows.slot(row, i)] = order[r.first + i];
  }
}

/// Which slots of the lines hold samples.
void fill_lines(SampleRows& rows) {
  constexpr std::uint32_t kWord = SampleRows::kWord;
  for (std::uint32_t line = 0; line < rows.lines; ++line) {
    const std::uint32_t from = line / rows.rows * kWord, count = rows.runs[line % rows.rows].count;
    rows.valid.push_back(count <= from ? 0 : ~0u >> (kWord - std::min(count - from, kWord)));
    rows.first.push_back(static_cast<std::int32_t>(line * kWord));
  }
}

/// The places of a set's samples, and how far off they are by column and row.
void place_set(std::span<const dvec3> place, std::span<const vec3> points, const vec3& center, std::uint32_t set,
               SampleRows& rows) {
  for (std::uint32_t row = 0; row < rows.rows; ++row) {
    for (std::uint32_t i = 0; i < rows.runs[row].count; ++i) {
      const std::size_t at = std::size_t{set} * rows.stride + rows.slot(row, i);
      const std::uint16_t sample = rows.sample_of[at];
      const dvec2 p = dvec2(place[sample]) * dvec2(rows.scale, rows.row_scale);
      rows.column_of[at] = static_cast<float>(p.x), rows.row_of[at] = static_cast<float>(p.y);
      rows.least_offset = std::min(rows.least_offset, static_cast<float>(i - p.x));
      rows.most_offset = std::max(rows.most_offset, static_cast<float>(i - p.x));
      rows.least_row_offset = std::min(rows.least_row_offset, static_cast<float>(row - p.y));
      rows.most_row_offset = std::max(rows.most_row_offset, static_cast<float>(row - p.y));
      const dvec3 error = glm::abs(dvec3(center) + double{rows.column_of[at]} / double{rows.scale} * dvec3(rows.axis_x) +
                                   double{rows.row_of[at]} / double{rows.row_scale} * dvec3(rows.axis_y) -
                                   dvec3(points[sample]));
      rows.deviation = std::max(rows.deviation, static_cast<float>(std::max({error.x, error.y, error.z}) * 1.001));
    }
  }
}

/// Samples of a plane that form no rows.
void sort_samples(const KernelSamples& samples, const LightFrame& frame, SampleRows& rows) {
  rows.anywhere = true;
  divide_into_rows(samples.count, rows);
  fill_lines(rows);
  std::vector<dvec3> place;
  dvec3 low(HUGE_VAL), high(-HUGE_VAL);
  for (const vec3& p : samples.points) {
    place.push_back(frame.to_frame(dvec3(p)));
    low = glm::min(low, place.back()), high = glm::max(high, place.back());
  }
  rows.scale = cells_per_length(rows.columns, high.x - low.x);
  rows.row_scale = cells_per_length(rows.rows, high.y - low.y);
  rows.reach_y = static_cast<float>(std::max(std::fabs(low.y), std::fabs(high.y)));
  rows.least_offset = rows.least_row_offset = 1e30f, rows.most_offset = rows.most_row_offset = -1e30f;
  const std::size_t size = std::size_t{samples.sets} * rows.stride;
  rows.sample_of.assign(size, 0), rows.column_of.assign(size, 0.0f), rows.row_of.assign(size, 0.0f);
  for (std::uint32_t set = 0; set < samples.sets; ++set) {
    const auto of_set = std::span<const dvec3>(place).subspan(std::size_t{set} * samples.padded, samples.padded);
    sort_set(samples.count, set, of_set, rows);
    place_set(of_set, samples.set_points(set), samples.center, set, rows);
  }
  store_points(size, [&](std::size_t i) {
    return samples.set_points(static_cast<std::uint32_t>(i / rows.stride))[rows.sample_of[i]];
  }, rows);
}

}  // namespace

SampleRows find_sample_rows(const LightSamples& light, const KernelSamples& samples, const LightFrame& frame,
                            SampleRows reuse) {
  SampleRows rows = no_rows(reuse, frame);
  if (!find_rows(light, samples, frame, rows)) {
    rows = no_rows(rows, frame);
    sort_samples(samples, frame, rows);
  }
  for (const vec3& p : samples.points) {
    const vec3 place(frame.to_frame(dvec3(p)));
    rows.low = glm::min(rows.low, place - 1e-6f), rows.high = glm::max(rows.high, place + 1e-6f);
  }
  return rows;
}

SampleCloud make_sample_cloud(const KernelSamples& samples, const LightFrame& frame, SampleCloud reuse) {
  SampleCloud cloud;
  cloud.place = emptied(reuse.place);
  for (const vec3& p : samples.points) {
    const vec3 place(frame.to_frame(dvec3(p)));
    cloud.place.push_back(place);
    cloud.low = glm::min(cloud.low, place - 1e-6f), cloud.high = glm::max(cloud.high, place + 1e-6f);
  }
  return cloud;
}

void arrange_cloud(const SampleCloud& cloud, const KernelSamples& samples, const LightFrame& frame, const vec3& from,
                   std::span<const std::uint8_t> wanted, SampleRows& rows) {
  rows = no_rows(rows, frame);
  rows.anywhere = true;
  divide_into_rows(samples.count, rows);
  fill_lines(rows);
  const std::size_t size = std::size_t{samples.sets} * rows.stride;
  for (auto* values : {&rows.column_of, &rows.row_of, &rows.height_of}) values->resize(size);
  rows.sample_of.resize(size);
  for (auto* values : {&rows.point_x, &rows.point_y, &rows.point_z}) values->resize(SampleRows::kRoom + size + 48);
  rows.low = cloud.low, rows.high = cloud.high;
  std::array<vec2, SampleRows::kMaxLines * SampleRows::kWord> seen;
  vec2 low(1e30f), high(-1e30f);
  const auto of_set = [&](std::uint32_t set) { return cloud.place.data() + std::size_t{set} * samples.padded; };
  const auto see = [&](const vec3& l) { return vec2(l) + (vec2(l) - vec2(from)) * (l.z / (from.z - l.z)); };
  for (const std::uint32_t set : wanted) {
    for (std::uint32_t i = 0; i < samples.count; ++i)
      low = glm::min(low, see(of_set(set)[i])), high = glm::max(high, see(of_set(set)[i]));
  }
  rows.scale = cells_per_length(rows.columns, high.x - low.x);
  rows.row_scale = cells_per_length(rows.rows, high.y - low.y);
  for (const std::uint32_t set : wanted) {
    for (std::uint32_t i = 0; i < samples.count; ++i) seen[i] = see(of_set(set)[i]);
    sort_set(samples.count, set, seen, rows);
    for (std::uint32_t row = 0; row < rows.rows; ++row) {
      for (std::uint32_t i = 0; i < rows.runs[row].count; ++i) {
        const std::size_t at = std::size_t{set} * rows.stride + rows.slot(row, i);
        const vec3 place = of_set(set)[rows.sample_of[at]], point = samples.set_points(set)[rows.sample_of[at]];
        rows.column_of[at] = place.x * rows.scale, rows.row_of[at] = place.y * rows.row_scale;
        rows.height_of[at] = place.z;
        rows.point_x[SampleRows::kRoom + at] = point.x, rows.point_y[SampleRows::kRoom + at] = point.y;
        rows.point_z[SampleRows::kRoom + at] = point.z;
      }
    }
  }
}

}  // namespace halfshade
