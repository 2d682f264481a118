#include "halfshade/accumulation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "rasterizer/core/parallel.h"

namespace halfshade {
namespace {

constexpr std::size_t kGrain = 8192;

[[noreturn]] void usage_error(const std::string& message) {
  throw Error(ErrorCode::kUsage, "accumulation: " + message);
}

void check_sizes(std::size_t a, std::size_t b) {
  if (a != b) usage_error("sizes differ: " + std::to_string(a) + " and " + std::to_string(b));
}

void check_range(std::span<const std::uint32_t> entries, std::size_t size) {
  for (const std::uint32_t entry : entries) {
    if (entry >= size) usage_error("entry " + std::to_string(entry) + " is not below " + std::to_string(size));
  }
}

}  // namespace

VisibilityAccumulator::VisibilityAccumulator(std::vector<std::uint32_t> visible, std::vector<std::uint32_t> total)
    : visible_(std::move(visible)), total_(std::move(total)) {
  bool valid = visible_.size() == total_.size();
  for (std::size_t i = 0; valid && i < total_.size(); ++i) {
    valid = visible_[i] <= total_[i];
    most_ = std::max<std::uint64_t>(most_, total_[i]);
  }
  if (!valid) throw Error(ErrorCode::kBadInput, "accumulation: the counts do not belong together");
}

void VisibilityAccumulator::check_entries(std::span<const std::uint32_t> entries) const {
  check_range(entries, size());
}

void VisibilityAccumulator::reserve_samples(std::uint64_t more) {
  constexpr std::uint64_t kMost = std::numeric_limits<std::uint32_t>::max();
  if (most_ + more > kMost) {
    throw Error(ErrorCode::kLimit, "accumulation: more than " + std::to_string(kMost) + " samples of one entry");
  }
  most_ += more;
}

void VisibilityAccumulator::add(std::span<const std::uint32_t> entries, const VisibilityMasks& masks) {
  check_sizes(entries.size(), masks.receiver_count);
  check_entries(entries);
  reserve_samples(masks.sample_count);
  parallel_ranges(entries.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) {
      visible_[entries[i]] += masks.sample_count - masks.blocked_count(i);
      total_[entries[i]] += masks.sample_count;
    }
  });
}

void VisibilityAccumulator::add(const VisibilityMasks& masks) {
  check_sizes(size(), masks.receiver_count);
  reserve_samples(masks.sample_count);
  parallel_ranges(size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) {
      visible_[i] += masks.sample_count - masks.blocked_count(i);
      total_[i] += masks.sample_count;
    }
  });
}

void VisibilityAccumulator::add_hidden(std::span<const std::uint32_t> entries, std::uint32_t sample_count) {
  check_entries(entries);
  reserve_samples(sample_count);
  for (const std::uint32_t entry : entries) total_[entry] += sample_count;
}

void VisibilityAccumulator::merge(const VisibilityAccumulator& other) {
  check_sizes(size(), other.size());
  reserve_samples(other.most_);
  for (std::size_t i = 0; i < size(); ++i) {
    visible_[i] += other.visible_[i];
    total_[i] += other.total_[i];
  }
}

void VisibilityError::merge(const VisibilityError& other) {
  if (other.count == 0) return;
  const double own = static_cast<double>(count), more = static_cast<double>(other.count);
  rmse = std::sqrt((rmse * rmse * own + other.rmse * other.rmse * more) / (own + more));
  worst = std::max(worst, other.worst);
  count += other.count;
}

VisibilityError visibility_error(const VisibilityAccumulator& a, const VisibilityAccumulator& b,
                                 std::span<const std::uint32_t> entries) {
  check_sizes(a.size(), b.size());
  check_range(entries, a.size());
  VisibilityError error;
  double squares = 0.0;
  for (const std::uint32_t entry : entries) {
    if (a.total()[entry] == 0 || b.total()[entry] == 0) continue;
    const double d = std::fabs(a.visibility(entry) - b.visibility(entry));
    squares += d * d;
    error.worst = std::max(error.worst, d);
    ++error.count;
  }
  if (error.count > 0) error.rmse = std::sqrt(squares / static_cast<double>(error.count));
  return error;
}

void ColorAccumulator::reserve_frames(std::uint32_t more) {
  constexpr std::uint32_t kMostFrames = 1u << 25;  // times 2^36 units at most: below 2^64
  if (more > kMostFrames - frames_) throw Error(ErrorCode::kLimit, "accumulation: more than 2^25 frames");
  frames_ += more;
}

void ColorAccumulator::add(std::span<const float> values) {
  check_sizes(size(), values.size());
  reserve_frames(1);
  parallel_ranges(size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) {
      const double value = values[i] > 0.0f ? std::min(static_cast<double>(values[i]), 65536.0) : 0.0;
      sums_[i] += static_cast<std::uint64_t>(value * 0x1p20 + 0.5);
    }
  });
}

void ColorAccumulator::merge(const ColorAccumulator& other) {
  check_sizes(size(), other.size());
  reserve_frames(other.frames_);
  for (std::size_t i = 0; i < size(); ++i) sums_[i] += other.sums_[i];
}

double convergence_exponent(std::span<const double> frames, std::span<const double> error) {
  check_sizes(frames.size(), error.size());
  double n = 0.0, sx = 0.0, sy = 0.0, sxx = 0.0, sxy = 0.0;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (!(frames[i] > 0.0 && error[i] > 0.0)) continue;
    const double x = std::log(frames[i]), y = std::log(error[i]);
    n += 1.0, sx += x, sy += y, sxx += x * x, sxy += x * y;
  }
  const double spread = n * sxx - sx * sx;
  return n >= 2.0 && spread > 0.0 ? (n * sxy - sx * sy) / spread : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace halfshade
