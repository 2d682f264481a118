// What a chart measures: series of points that differ in one parameter.
#pragma once

#include <string>
#include <vector>

#include "pipeline.h"

namespace halfshade {

struct ChartOptions : PipelineOptions {
  std::vector<std::string> scenes, methods, sweeps;
  std::vector<std::uint32_t> samples;
  std::string shared_scenes, output = "out/chart";
  double time_limit = 1.0;         // seconds for one run; a point whose runs took longer together has enough of them
  std::uint32_t base_samples = 0;  // where another parameter is swept; 0 = 256, or the nearest of `samples`
  std::uint32_t repeat = 3, reference_samples = 16384;
  bool quick = false, fresh = false;
};

struct ChartPoint {
  ShadowConfig config;
  std::string id;     // method and every parameter that differs from its default, "pcf n=256 map.resolution=512"
  std::string label;  // what the series varies, "resolution 512"
};

/// Points in increasing value of one parameter; the first that takes too long ends the series.
struct ChartSeries {
  std::string parameter;  // "light_samples" or the option's name
  std::vector<ChartPoint> points;
};

/// Fills in what depends on --quick and what was not given.
void complete_options(ChartOptions& options);

/// One series over light samples per method with masks, one point per method without, and one series per sweep and
/// method that it concerns. Throws Error{kUsage} for unknown names and values out of range.
std::vector<ChartSeries> chart_series(const ChartOptions& options);

/// For lights that always have `count` samples: points that this makes equal remain once.
void fix_sample_count(std::vector<ChartSeries>& series, std::uint32_t count);

}  // namespace halfshade
