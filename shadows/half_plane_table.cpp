#include "shadows/half_plane_table.h"

#include <algorithm>
#include <cmath>

#include <glm/vector_relational.hpp>

#include "rasterizer/core/parallel.h"
#include "rasterizer/core/predicate.h"
#include "rasterizer/core/unit_circle.h"

namespace halfshade {
namespace {

constexpr std::uint64_t kMaxBytes = std::uint64_t{1} << 31;

/// Angle of (x, y) in turns, [0, 1). A polynomial for the arc tangent, off by at most 2e-6 turns: far below the table's
/// steps, and the same bits on every platform.
double turns_of(double x, double y) {
  const double ax = std::fabs(x), ay = std::fabs(y), longer = std::max(ax, ay);
  if (!(longer > 0.0)) return 0.0;
  const double t = std::min(ax, ay) / longer, t2 = t * t;
  constexpr double kPerTurn = 0.15915494309189535;
  double turns = -0.0117212;
  for (const double c : {0.05265332, -0.11643287, 0.19354346, -0.33262347, 0.99997726}) turns = turns * t2 + c;
  turns *= t * kPerTurn;
  if (ay > ax) turns = 0.25 - turns;
  if (x < 0.0) turns = 0.5 - turns;
  if (y < 0.0) turns = 1.0 - turns;
  return turns < 1.0 ? turns : 0.0;
}

std::uint32_t step(double x, std::uint32_t count) {
  return x <= 0.0 ? 0u : std::min(count - 1, static_cast<std::uint32_t>(x));
}

bool inside(const Blocker& b, const vec3& p) {
  return glm::all(glm::lessThanEqual(b.box_low, p)) && glm::all(glm::lessThanEqual(p, b.box_high));
}

}  // namespace

HalfPlaneTable::HalfPlaneTable(const LightSamples& light, const KernelSamples& samples, std::uint32_t size)
    : size_(size), flat_(light.flat), axis_u_(light.axis_u), axis_v_(light.axis_v), axis_n_(light.axis_n) {
  for (std::size_t i = 0; i < samples.x.size(); ++i) {
    radius_ = std::max(radius_, glm::length(dvec3(samples.x[i], samples.y[i], samples.z[i])));
  }
  directions_ = flat_ ? size : std::size_t{size} * size;
  words_ = samples.padded / 64;
  const std::uint64_t entries = std::uint64_t{directions_} * size * samples.sets;
  if (entries * words_ * 8 > kMaxBytes) {
    throw Error(ErrorCode::kLimit, "afsm.table=" + std::to_string(size) + " with " + std::to_string(samples.count) +
                                       " samples in " + std::to_string(samples.sets) + " sets needs " +
                                       std::to_string(entries * words_ * 8) + " bytes; at most " +
                                       std::to_string(kMaxBytes) + " are allowed");
  }
  masks_.assign(entries * words_, 0);
  parallel_ranges(directions_ * samples.sets, 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) {
      fill(samples, static_cast<std::uint32_t>(i / directions_), i % directions_);
    }
  });
}

/// The middle of the directions that an index stands for.
dvec3 HalfPlaneTable::direction(std::size_t index) const {
  const double around = 0.5 * static_cast<double>(index % size_) / size_;
  const dvec2 a = unit_circle(around);
  if (flat_) return axis_u_ * a.x + axis_v_ * a.y;
  const dvec2 down = unit_circle(0.5 * (static_cast<double>(index / size_) + 0.5) / size_);
  return (axis_u_ * a.x + axis_v_ * a.y) * down.y + axis_n_ * down.x;
}

/// All distances of one direction: each sample enters at the farthest plane that it lies beyond and stays.
void HalfPlaneTable::fill(const KernelSamples& samples, std::uint32_t set, std::size_t direction_index) {
  const dvec3 n = direction(direction_index);
  std::uint64_t* entry = masks_.data() + (set * directions_ + direction_index) * size_ * words_;
  for (std::uint32_t i = 0; i < samples.count; ++i) {
    const std::size_t at = std::size_t{set} * samples.padded + i;
    const double height = glm::dot(n, dvec3(samples.x[at], samples.y[at], samples.z[at])) / radius_;
    const double last = std::floor((height + 1.0) * 0.5 * size_ - 0.5);  // planes stand at the middles of their steps
    if (last < 0.0) continue;
    entry[std::min<std::size_t>(static_cast<std::size_t>(last), size_ - 1) * words_ + i / 64] |= std::uint64_t{1}
                                                                                                 << (i % 64);
  }
  for (std::size_t k = (size_ - 1) * words_; k-- > 0;) entry[k] |= entry[k + words_];
}

void HalfPlaneTable::keep_side(const dvec3& normal, double value, std::uint32_t set,
                               std::span<std::uint64_t> bits) const {
  const double x = glm::dot(normal, axis_u_), y = glm::dot(normal, axis_v_), z = glm::dot(normal, axis_n_);
  const double across = std::sqrt(x * x + y * y), length = flat_ ? across : std::sqrt(x * x + y * y + z * z);
  const double reach = length * radius_;
  if (value >= reach) return;  // all samples are on the wanted side, as seen from the ball around them
  if (-value > reach) return std::fill(bits.begin(), bits.end(), 0);
  // Half of the directions are enough: opposite ones have complementary masks.
  const double turns = turns_of(x, y);
  bool flip = turns >= 0.5;
  auto index = static_cast<std::size_t>((flip ? turns - 0.5 : turns) * 2.0 * size_ + 0.5);
  if (index == size_) index = 0, flip = !flip;
  const double sign = flip ? -1.0 : 1.0;
  if (!flat_) index += std::size_t{step(turns_of(sign * z, across) * 2.0 * size_, size_)} * size_;
  const std::uint32_t distance = step((1.0 - sign * value / reach) * 0.5 * size_, size_);
  const std::uint64_t* entry = masks_.data() + ((set * directions_ + index) * size_ + distance) * words_;
  for (std::size_t w = 0; w < bits.size(); ++w) bits[w] &= flip ? ~entry[w] : entry[w];
}

bool block_by_table(const HalfPlaneTable& table, const Blocker& blocker, const KernelSamples& samples,
                    std::size_t receiver, KernelReceivers& receivers) {
  std::array<std::uint64_t, 64> scratch;  // 4096 samples
  const std::span<std::uint64_t> bits(scratch.data(), receivers.words);
  std::copy(samples.valid.begin(), samples.valid.end(), bits.begin());
  const vec3 r(receivers.x[receiver], receivers.y[receiver], receivers.z[receiver]);
  const std::uint32_t set = receivers.set[receiver];
  const bool below = orient3d(blocker.corner[0], blocker.corner[1], blocker.corner[2], r) < 0;
  if (below && blocker.back_faces_only && !inside(blocker, r)) return false;  // where the float filter was in doubt
  const double sign = below ? -1.0 : 1.0;
  const dvec3 to_center = dvec3(samples.center) - dvec3(r);
  bool covered = true;  // what the float filter finds certain is certain in double, so its verdict changes no bit
  std::array<dvec3, 3> normal;
  std::array<double, 3> value;
  for (std::size_t k = 0; k < 3; ++k) {
    normal[k] = sign * glm::cross(dvec3(blocker.corner[k]) - dvec3(r),
                                  dvec3(blocker.corner[(k + 1) % 3]) - dvec3(blocker.corner[k]));
    value[k] = glm::dot(normal[k], to_center);
    double reach = 0.0;
    for (const vec3& h : samples.half_axes) reach += std::fabs(glm::dot(normal[k], dvec3(h)));
    if (value[k] < -reach) return false;
    covered = covered && value[k] > reach;
  }
  for (std::size_t k = 0; k < 3 && !covered; ++k) table.keep_side(normal[k], value[k], set, bits);
  if (!(below ? blocker.all_below : blocker.all_above)) {
    const dvec3 a(blocker.corner[0]);
    const dvec3 own = sign * glm::cross(dvec3(blocker.corner[1]) - a, dvec3(blocker.corner[2]) - a);
    table.keep_side(own, glm::dot(own, dvec3(samples.center) - a), set, bits);
  }
  std::uint64_t added = 0, open = 0;
  std::uint64_t* mask = receivers.mask(receiver);
  for (std::size_t w = 0; w < bits.size(); ++w) {
    added |= bits[w] & ~mask[w];
    mask[w] |= bits[w];
    open |= samples.valid[w] & ~mask[w];
  }
  if (open == 0) receivers.open[receiver] = 0;
  return added != 0;
}

}  // namespace halfshade
