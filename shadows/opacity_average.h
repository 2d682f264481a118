// Opacity of a map averaged over rectangles: the prefiltered lookup of the soft textured shadow volumes.
//
// A sum table (Crow 1984) of the thresholded opacity, continued periodically and interpolated between texel borders,
// is the exact integral from the origin to any point; four of them are the exact average over any rectangle. Unlike a
// pyramid of halved pictures it knows every width and height, so footprints may be long and narrow, and it falls back
// to the nearest texel by itself as the rectangle shrinks.
#pragma once

#include "shadows/sample_projection.h"

namespace halfshade {

class OpacityAverage {
 public:
  explicit OpacityAverage(const OpacityBits& opacity);

  /// Share of opaque texels in the rectangle around (u, v) with the given width and height, in texels >= 0; 0..1.
  double average(double u, double v, double width, double height) const;

 private:
  double integral(double u, double v) const;  // from (0, 0)
  double within(double u, double v) const;    // the same for 0 <= u <= width, 0 <= v <= height

  std::uint32_t width_, height_;
  std::vector<std::uint32_t> sums_;  // [height + 1][width + 1]
};

}  // namespace halfshade
