// Coordinates out of an input's bytes, made to coincide, to align, and to break things.
#pragma once

#include <cmath>
#include <limits>

#include "fuzz/fuzz_target.h"
#include "halfshade/types.h"

namespace halfshade::fuzz {

class CoordinateReader : public ByteReader {
 public:
  using ByteReader::ByteReader;

  dvec3 point() {
    const double x = coordinate(), y = coordinate();
    return {x, y, coordinate()};
  }

  /// Mostly eighths between -12 and 12, which coincide and align; else the last one moved by a little, an extreme value
  /// or any bits at all.
  double coordinate() {
    const std::uint32_t kind = byte();
    if (kind < 193) return last_ = (static_cast<double>(kind) - 96.0) / 8.0;
    if (kind < 209) return last_;
    if (kind < 225) return last_ += std::ldexp(static_cast<double>(kind) - 216.5, -40);
    constexpr double inf = std::numeric_limits<double>::infinity();
    constexpr double extreme[] = {0.0,   -0.0,  1e-320, 1e-30, 1e-9,
                                  1e6,   -1e6,  1e9,    1e30,  1e38,
                                  1e150, 1e300, -1e300, inf,   std::numeric_limits<double>::quiet_NaN()};
    if (kind < 240) return extreme[kind - 225];
    if (kind < 248) return take<float>();
    return take<double>();
  }

  /// Rarely true, so that most inputs get past the checks of indices and sizes.
  bool broken() { return byte() == 255; }

 private:
  double last_ = 0.0;
};

}  // namespace halfshade::fuzz
