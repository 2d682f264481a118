// Samples that form no rows as a picture all the same: each takes a cell of a grid, near to where it lies.
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "rasterizer/core/reuse.h"
#include "shadows/sample_rows.h"

namespace halfshade {
namespace {

/// More cells than samples, so that few lie far off their place; not for several sets, which would take different
/// cells. A word in each row where that is possible.
void divide_into_cells(std::uint32_t count, std::uint32_t sets, SampleRows& rows) {
  constexpr std::uint32_t kWord = SampleRows::kWord;
  const double cells = (sets == 1 ? 1.6 : 1.0) * count;
  const auto side = static_cast<std::uint32_t>(std::ceil(std::sqrt(cells)));
  rows.columns = std::min(side, cells <= kWord * SampleRows::kMaxRows ? kWord : SampleRows::kMaxColumns);
  rows.rows = std::min(static_cast<std::uint32_t>(std::ceil(cells / rows.columns)), SampleRows::kMaxRows);
  rows.lines = rows.rows * ((rows.columns + kWord - 1) / kWord);
  rows.stride = rows.lines * kWord;
}

/// Room for so many sets, without samples: cells lie where they belong.
void clear_cells(std::uint32_t sets, SampleRows& rows) {
  const std::size_t size = std::size_t{sets} * rows.stride;
  rows.valid.resize(std::size_t{sets} * rows.lines);
  for (std::uint32_t line = 0; line < rows.lines; ++line)
    rows.first.push_back(static_cast<std::int32_t>(line * SampleRows::kWord));
  rows.sample_of.resize(size), rows.column_of.resize(size), rows.row_of.resize(size);
  rows.make_room_for_points(size);
}

/// The rectangle of places into cells; not into so small ones, for small lights, that nothing would be known to the
/// nearest one.
void scale_cells(const dvec2& low, const dvec2& high, SampleRows& rows) {
  static constexpr double kMost = 1000.0;  // per length
  const auto scale = [](std::uint32_t cells, double length) {
    return static_cast<float>(std::min(cells / std::max(length, 1e-9), kMost));
  };
  rows.scale = scale(rows.columns, high.x - low.x), rows.row_scale = scale(rows.rows, high.y - low.y);
}

/// Where the samples of a set lie, as far as finding cells for them goes.
using SetPlaces = std::array<vec2, SampleRows::kMaxLines * SampleRows::kWord>;

/// The samples of a set into its cells, by their places: rows by y, no more to a row than it has cells, and columns by
/// x.
void sort_set(std::uint32_t count, std::uint32_t set, const SetPlaces& place, const dvec2& low, SampleRows& rows) {
  std::array<std::uint16_t, SampleRows::kMaxLines * SampleRows::kWord> order;
  std::iota(order.begin(), order.begin() + count, std::uint16_t{0});
  std::sort(order.begin(), order.begin() + count, [&](auto a, auto b) { return place[a].y < place[b].y; });
  const auto cell = [](double at, float scale, std::uint32_t cells) {
    return static_cast<std::uint32_t>(std::clamp(at * double{scale}, 0.0, cells - 1.0));
  };
  std::array<std::uint32_t, SampleRows::kMaxRows> in_row{};
  for (std::uint32_t i = 0; i < count; ++i) ++in_row[cell(place[i].y - low.y, rows.row_scale, rows.rows)];
  std::uint32_t excess = 0;
  const auto fill = [&](std::uint32_t& n) {
    n += excess;
    excess = n > rows.columns ? n - rows.columns : 0;
    n -= excess;
  };
  for (std::uint32_t row = 0; row < rows.rows; ++row) fill(in_row[row]);
  for (std::uint32_t row = rows.rows; row-- > 0;) fill(in_row[row]);
  std::fill_n(rows.valid.begin() + std::ptrdiff_t{set} * rows.lines, rows.lines, 0u);
  std::uint16_t* next = order.data();
  for (std::uint32_t row = 0; row < rows.rows; ++row) {
    const std::uint32_t n = in_row[row];
    std::sort(next, next + n, [&](auto a, auto b) { return place[a].x < place[b].x; });
    for (std::uint32_t i = 0, free = 0; i < n; ++i, ++next) {
      const std::uint32_t wanted = cell(place[*next].x - low.x, rows.scale, rows.columns);
      const std::uint32_t column = std::min(std::max(wanted, free), rows.columns - (n - i));
      free = column + 1;
      rows.valid[set * rows.lines + rows.line_of(row, column)] |= 1u << column % SampleRows::kWord;
      rows.sample_of[set * rows.stride + rows.slot(row, column)] = *next;
    }
  }
}

/// Puts each sample, and the middle of each cell without one, at its place.
template <class At>
void place_set(std::uint32_t set, const dvec2& low, std::span<const vec3> points, const At& place_at,
               SampleRows& rows) {
  for (std::uint32_t row = 0; row < rows.rows; ++row) {
    for (std::uint32_t column = 0; column < rows.columns; ++column) {
      const std::size_t at = set * rows.stride + rows.slot(row, column);
      if (rows.holds(set, row, column)) {
        place_at(at, row, column, rows.sample_of[at]);
        rows.set_point(at, points[rows.sample_of[at]]);
      } else {
        rows.column_of[at] = static_cast<float>(low.x * double{rows.scale} + column + 0.5);
        rows.row_of[at] = static_cast<float>(low.y * double{rows.row_scale} + row + 0.5);
      }
    }
  }
}

}  // namespace

std::size_t cells_anywhere(std::uint32_t count, std::uint32_t sets) {
  SampleRows rows;
  divide_into_cells(count, sets, rows);
  return rows.stride;
}

void SampleRows::reserve_cells(std::size_t sets, std::size_t cells) {
  for (auto* values : {&point_x, &point_y, &point_z}) values->reserve(kRoom + sets * cells + 48);
  for (auto* values : {&column_of, &row_of, &height_of}) values->reserve(sets * cells);
  sample_of.reserve(sets * cells);
  valid.reserve(sets * cells / kWord), first.reserve(cells / kWord);
}

void sort_samples_anywhere(const KernelSamples& samples, const LightFrame& frame, SampleRows& rows) {
  rows.anywhere = true;
  divide_into_cells(samples.count, samples.sets, rows);
  clear_cells(samples.sets, rows);
  const auto place_of = [&](const vec3& point) { return dvec2(frame.to_frame(dvec3(point))); };
  dvec2 low(HUGE_VAL), high(-HUGE_VAL);
  for (const vec3& p : samples.points) low = glm::min(low, place_of(p)), high = glm::max(high, place_of(p));
  scale_cells(low, high, rows);
  rows.reach_y = static_cast<float>(std::max(std::fabs(low.y), std::fabs(high.y)));
  rows.least_offset = rows.least_row_offset = 1e30f, rows.most_offset = rows.most_row_offset = -1e30f;
  SetPlaces places;
  for (std::uint32_t set = 0; set < samples.sets; ++set) {
    const std::span<const vec3> points = samples.set_points(set);
    for (std::uint32_t i = 0; i < samples.count; ++i) places[i] = vec2(place_of(points[i]));
    sort_set(samples.count, set, places, low, rows);
    place_set(
        set, low, points,
        [&](std::size_t at, std::uint32_t row, std::uint32_t column, std::uint16_t sample) {
          const dvec2 p = place_of(points[sample]) * dvec2(rows.scale, rows.row_scale);
          rows.column_of[at] = static_cast<float>(p.x), rows.row_of[at] = static_cast<float>(p.y);
          rows.least_offset = std::min(rows.least_offset, static_cast<float>(column - p.x));
          rows.most_offset = std::max(rows.most_offset, static_cast<float>(column - p.x));
          rows.least_row_offset = std::min(rows.least_row_offset, static_cast<float>(row - p.y));
          rows.most_row_offset = std::max(rows.most_row_offset, static_cast<float>(row - p.y));
          const dvec3 error =
              glm::abs(dvec3(samples.center) + double{rows.column_of[at]} / double{rows.scale} * dvec3(rows.axis_x) +
                       double{rows.row_of[at]} / double{rows.row_scale} * dvec3(rows.axis_y) - dvec3(points[sample]));
          rows.deviation = std::max(rows.deviation, static_cast<float>(std::max({error.x, error.y, error.z}) * 1.001));
        },
        rows);
  }
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
  rows.low = cloud.low, rows.high = cloud.high;
  divide_into_cells(samples.count, samples.sets, rows);
  clear_cells(samples.sets, rows);
  rows.height_of.resize(rows.column_of.size());
  const auto of_set = [&](std::uint32_t set) { return cloud.place.data() + std::size_t{set} * samples.padded; };
  const auto see = [&](const vec3& l) { return vec2(l) + (vec2(l) - vec2(from)) * (l.z / (from.z - l.z)); };
  vec2 low(1e30f), high(-1e30f);
  for (const std::uint32_t set : wanted) {
    for (std::uint32_t i = 0; i < samples.count; ++i) {
      const vec2 p = see(of_set(set)[i]);
      low = glm::min(low, p), high = glm::max(high, p);
    }
  }
  scale_cells(low, high, rows);
  SetPlaces places;
  for (const std::uint32_t set : wanted) {
    for (std::uint32_t i = 0; i < samples.count; ++i) places[i] = see(of_set(set)[i]);
    std::fill_n(rows.height_of.begin() + std::ptrdiff_t{set} * rows.stride, rows.stride, 0.0f);
    sort_set(samples.count, set, places, low, rows);
    place_set(
        set, low, samples.set_points(set),
        [&](std::size_t at, std::uint32_t, std::uint32_t, std::uint16_t sample) {
          const vec3 place = of_set(set)[sample];
          rows.column_of[at] = place.x * rows.scale, rows.row_of[at] = place.y * rows.row_scale;
          rows.height_of[at] = place.z;
        },
        rows);
  }
}

}  // namespace halfshade
