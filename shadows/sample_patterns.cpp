#include "shadows/sample_patterns.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <utility>

#include "rasterizer/core/hash.h"
#include "rasterizer/core/reuse.h"

namespace halfshade {
namespace {

/// Rows of the cell grid: the exact grid with rows <= columns <= 2 rows where the count has one, else
/// floor(sqrt(count)) rows whose numbers of columns differ by at most one; each sample stands for the same area either
/// way.
std::uint32_t row_count(std::uint32_t count) {
  auto root = static_cast<std::uint32_t>(std::sqrt(static_cast<double>(count)));
  while (root * root > count) --root;
  for (std::uint32_t rows = root; rows >= 1 && count <= 2 * rows * rows; --rows) {
    if (count % rows == 0) return rows;
  }
  return root;
}

constexpr double kQuarterPi = 0.7853981633974483;  // area of a disk of diameter 1

double fraction(double x) { return x - std::floor(x); }

/// Shift of row `row` as a fraction of a column: a rank-1 lattice whose generator is coprime to the number of rows and
/// near the golden section of it, so that neighbouring rows are spread well.
double row_shift(std::uint32_t row, std::uint32_t rows) {
  auto gcd = [](std::uint32_t a, std::uint32_t b) {
    while (b != 0) a = std::exchange(b, a % b);
    return a;
  };
  auto generator = static_cast<std::uint32_t>(rows * 0.6180339887498949 + 0.5);
  while (generator > 1 && gcd(generator, rows) != 1) --generator;
  return (static_cast<double>((std::uint64_t{row} * generator) % rows) + 0.5) / rows;
}

std::uint32_t reversed_bits(std::uint32_t x) {
  x = (x >> 16) | (x << 16);
  x = ((x & 0x00ff00ffu) << 8) | ((x & 0xff00ff00u) >> 8);
  x = ((x & 0x0f0f0f0fu) << 4) | ((x & 0xf0f0f0f0u) >> 4);
  x = ((x & 0x33333333u) << 2) | ((x & 0xccccccccu) >> 2);
  return ((x & 0x55555555u) << 1) | ((x & 0xaaaaaaaau) >> 1);
}

/// Second dimension of the Sobol' sequence (the first is reversed_bits): direction numbers of Pascal's triangle mod 2.
std::uint32_t sobol_second(std::uint32_t index) {
  std::uint32_t result = 0;
  for (std::uint32_t direction = 1u << 31; index != 0; index >>= 1, direction ^= direction >> 1) {
    if (index & 1) result ^= direction;
  }
  return result;
}

/// Offset of a set on the torus. Sets after the first come in pairs, p and -p, so that the mean offset stays near zero;
/// p follows the (0,2)-sequence in one half of the cell, so that the sets refine it evenly in both directions and along
/// each axis by itself; the third keeps the heights of -p off those of p. (Additive sequences such as Roberts' R2 stay
/// uneven along the axes for fifty sets: 0.75488 is nearly 3/4.)
dvec2 shifted(const dvec2& st, std::uint32_t set) {
  if (set == 0) return st;
  const std::uint32_t pair = set / 2 + set % 2;
  const dvec2 p(reversed_bits(pair) * 0x1p-33, fraction(sobol_second(pair) * 0x1p-32 + 1.0 / 3.0) - 0.5);
  const dvec2 moved = set % 2 == 1 ? st + p : st - p;
  return {fraction(moved.x), fraction(moved.y)};
}

/// The patterns on a grid of cells: sample `index` lies in its own cell.
dvec2 cell_sample(SamplePattern pattern, std::uint32_t index, std::uint32_t count, std::uint32_t rows,
                  std::uint32_t set, std::uint32_t seed) {
  const auto row = static_cast<std::uint32_t>((std::uint64_t{index} * rows + rows - 1) / count);
  const auto first = static_cast<std::uint32_t>(std::uint64_t{row} * count / rows);
  const std::uint32_t columns = static_cast<std::uint32_t>(std::uint64_t{row + 1} * count / rows) - first;
  dvec2 st(0.5, 0.5);
  if (pattern == SamplePattern::kStratified) {
    st = {hash_unit(index, hash32(seed, 2 * set)), hash_unit(index, hash32(seed, 2 * set + 1))};
  } else {
    if (pattern == SamplePattern::kRows) st.x = row_shift(row, rows);
    st = shifted(st, set);
  }
  return {(index - first + st.x) / columns, (first + st.y * columns) / count};
}

/// Owen's nested scrambling by a hash (Laine and Karras 2011; constants of Vegdahl 2021): on reversed bits, each step
/// changes a bit by a function of lower ones only, so elementary intervals are exchanged whole.
std::uint32_t scrambled(std::uint32_t x, std::uint32_t seed) {
  x = reversed_bits(x);
  x ^= x * 0x3d20adeau;
  x += seed;
  x *= (seed >> 16) | 1;
  x ^= x * 0x05526c56u;
  x ^= x * 0x53a22864u;
  return reversed_bits(x);
}

dvec2 low_discrepancy_sample(std::uint32_t index, std::uint32_t set, std::uint32_t seed) {
  return {scrambled(reversed_bits(index), hash32(seed, 2 * set)) * 0x1p-32,
          scrambled(sobol_second(index), hash32(seed, 2 * set + 1)) * 0x1p-32};
}

/// Points on the torus, sorted into cells for the question whether one lies nearer than a radius.
class TorusPoints {
 public:
  /// For up to `most` points, which are kept in `points`; without memory of its own, since lights that move ask again
  /// and again.
  TorusPoints(std::uint32_t most, std::vector<dvec2>& points) : points_(points) {
    while (cells_ < kMostCells && cells_ * cells_ < most) cells_ *= 2;
    heads_.fill(kNone);
  }

  void add(const dvec2& p) {
    std::uint32_t& head = heads_[cell(p.y) * cells_ + cell(p.x)];
    next_[points_.size()] = std::exchange(head, static_cast<std::uint32_t>(points_.size()));
    points_.push_back(p);
  }

  bool any_within(const dvec2& p, double radius) const {
    const auto reach = static_cast<std::uint32_t>(radius * cells_) + 1;
    if (2 * reach + 1 >= cells_) {
      return std::any_of(points_.begin(), points_.end(), [&](const dvec2& q) { return near(p, q, radius); });
    }
    for (std::uint32_t y = cell(p.y) + cells_ - reach, y_end = y + 2 * reach; y <= y_end; ++y) {
      for (std::uint32_t x = cell(p.x) + cells_ - reach, x_end = x + 2 * reach; x <= x_end; ++x) {
        for (std::uint32_t i = heads_[y % cells_ * cells_ + x % cells_]; i != kNone; i = next_[i]) {
          if (near(p, points_[i], radius)) return true;
        }
      }
    }
    return false;
  }

  static constexpr std::uint32_t kMostCells = 64, kMostPoints = kMostCells * kMostCells;

 private:
  std::uint32_t cell(double x) const { return static_cast<std::uint32_t>(x * cells_); }
  static bool near(const dvec2& p, const dvec2& q, double radius) {
    const dvec2 d = glm::abs(p - q), torus = glm::min(d, 1.0 - d);
    return glm::dot(torus, torus) < radius * radius;
  }

  std::vector<dvec2>& points_;
  std::uint32_t cells_ = 1;
  std::array<std::uint32_t, kMostPoints> heads_, next_;  // linked lists per cell
};

/// Dart throwing with a radius that shrinks while it stays unsuccessful (McCool and Fiume 1992): any first part of the
/// sequence is a Poisson disk pattern by itself. Into `result`, which is empty.
void poisson_disk_sequence(std::uint32_t count, std::uint32_t seed, std::vector<dvec2>& result) {
  constexpr double kShrink = 0.995, kFirst = 0.95;
  constexpr std::uint32_t kPatience = 400;  // darts per radius
  assert(count <= TorusPoints::kMostPoints);
  TorusPoints torus(count, result);
  double factor = kFirst;
  std::uint32_t dart = 0, misses = 0;
  while (result.size() < count) {
    const double densest = std::sqrt(1.1547005383792517 / static_cast<double>(result.size() + 1));
    const dvec2 p(hash_unit(dart, hash32(seed, 0x9015501u)), hash_unit(dart, hash32(seed, 0xd15cu)));
    ++dart;
    if (!torus.any_within(p, factor * densest)) {
      torus.add(p);
      factor = std::min(kFirst, factor * 1.005), misses = 0;
    } else if (++misses % kPatience == 0) {
      factor *= kShrink;
    }
  }
}

/// The sequence lies where the first set will be until all others have been made of it.
void poisson_disk_samples(std::uint32_t count, std::uint32_t first_set, std::uint32_t sets, std::uint32_t seed,
                          std::vector<dvec2>& result) {
  poisson_disk_sequence(count, seed, result);
  result.resize(std::size_t{count} * sets);
  for (std::uint32_t set = sets; set-- > 0;) {
    for (std::uint32_t i = 0; i < count; ++i)
      result[std::size_t{set} * count + i] = shifted(result[i], first_set + set);
  }
}

}  // namespace

/// As many rows as columns, nearly; more where that makes a word of 32 hold a row (shadows/sample_rows.h), or two.
std::uint32_t disk_row_count(std::uint32_t count) {
  const auto root = static_cast<std::uint32_t>(std::sqrt(static_cast<double>(count)));
  const auto rows_of = [&](double columns) {  // a lattice of that many columns covers one more
    return static_cast<std::uint32_t>(std::ceil(count / (kQuarterPi * (columns - 1.0))));
  };
  if (10 * rows_of(32.0) <= 14 * root) return std::max({1u, root, rows_of(32.0)});
  return std::max({1u, root, rows_of(64.0)});
}

void disk_rows(std::span<dvec2> points) {
  const auto count = static_cast<std::uint32_t>(points.size()), rows = disk_row_count(count);
  const auto chords = [&](std::uint32_t row) {  // of 16 heights of a row, all together
    double sum = 0.0;
    for (int k = 0; k < 16; ++k) {
      const double y = (row + (k + 0.5) / 16.0) / rows;
      sum += std::sqrt(y * (1.0 - y));
    }
    return sum;
  };
  double all = 0.0, so_far = 0.0;
  for (std::uint32_t row = 0; row < rows; ++row) all += chords(row);
  const double pitch = kQuarterPi * rows / count;
  std::uint32_t next = 0;
  for (std::uint32_t row = 0; row < rows; ++row) {
    so_far += chords(row);
    const std::uint32_t first = next;
    next = row + 1 < rows ? static_cast<std::uint32_t>(count * so_far / all + 0.5) : count;
    if (first == next) continue;
    const double y = (row + 0.5) / rows, reach = 0.5 * (next - first - 1.0) * pitch,
                 room = std::max(0.0, std::sqrt(y * (1.0 - y)) - reach),
                 shift = std::clamp(0.5 * (row_shift(row, rows) - 0.5) * pitch, -0.999 * room, 0.999 * room);
    for (std::uint32_t i = first; i < next; ++i) points[i] = {0.5 + shift + (i - first) * pitch - reach, y};
  }
}

std::vector<dvec2> unit_square_samples(SamplePattern pattern, std::uint32_t count, std::uint32_t first_set,
                                       std::uint32_t sets, std::uint32_t seed, std::vector<dvec2> reuse) {
  const std::uint32_t rows = row_count(count);
  std::vector<dvec2> result = emptied(reuse);
  result.reserve(std::size_t{count} * sets);
  if (pattern == SamplePattern::kPoissonDisk) {
    poisson_disk_samples(count, first_set, sets, seed, result);
    return result;
  }
  for (std::uint32_t set = first_set; set < first_set + sets; ++set) {
    for (std::uint32_t i = 0; i < count; ++i) {
      result.push_back(pattern == SamplePattern::kLowDiscrepancy ? low_discrepancy_sample(i, set, seed)
                                                                 : cell_sample(pattern, i, count, rows, set, seed));
    }
  }
  return result;
}

}  // namespace halfshade
