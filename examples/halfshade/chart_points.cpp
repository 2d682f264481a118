#include "chart_points.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "rasterizer/scenes/builtin.h"
#include "shadows/method_options.h"
#include "shadows/solver.h"

namespace halfshade {
namespace {

constexpr const char* kSweeps[] = {"map.resolution=256,512,1024,2048",
                                   "map.bias=0,0.5,2,8",
                                   "shadow-accumulation.kernel=4,8,16,32",
                                   "afsm-lut:afsm.table=8,32,128,512",
                                   "gears.grid=32,64,128,256,512",
                                   "pcf.radius=1,2,4,8",
                                   "pcss.filter=7,15,31"};
constexpr const char* kQuickSweeps[] = {"map.resolution=256,1024", "shadow-accumulation.kernel=8,16",
                                        "afsm-lut:afsm.table=16,128"};
constexpr const char* kQuickScenes[] = {"builtin:demo", "builtin:columns", "builtin:fence"};

std::vector<std::string> split(const std::string& text, char separator) {
  std::vector<std::string> parts;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(separator, begin), text.size());
    parts.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return parts;
}

/// "[METHOD:]OPTION=V1,V2,..."
struct Sweep {
  std::string method;  // empty: all that the option concerns
  const MethodOption* option = nullptr;
  std::vector<std::string> values;
};

Sweep parse_sweep(const std::string& text) {
  const std::size_t equals = text.find('='), colon = text.substr(0, equals).find(':');
  if (equals == std::string::npos) usage_error(fmt::format("--sweep '{}' is not [METHOD:]OPTION=V1,V2,...", text));
  Sweep sweep;
  if (colon != std::string::npos) sweep.method = name_of(shadow_method_from_name(text.substr(0, colon)));
  const std::size_t begin = colon == std::string::npos ? 0 : colon + 1;
  const std::string name = text.substr(begin, equals - begin);
  for (const MethodOption& option : method_options()) {
    if (name == option.name) sweep.option = &option;
  }
  if (sweep.option == nullptr) usage_error(fmt::format("--sweep '{}': there is no option '{}'", text, name));
  sweep.values = split(text.substr(equals + 1), ',');
  return sweep;
}

bool concerns(const Sweep& sweep, ShadowMethod method) {
  return sweep.method.empty() ? concerns(*sweep.option, method) : sweep.method == name_of(method);
}

/// Numbers without trailing zeros: "0.500000" and "0.5" are the same point.
std::string short_number(const std::string& text) {
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  return end == text.c_str() || *end != '\0' ? text : fmt::format("{:g}", value);
}

std::string id_of(const ShadowConfig& config) {
  std::string id = fmt::format("{} n={}", name_of(config.method), config.light_sample_count);
  for (const MethodOption& option : method_options()) {
    const std::string value = option.get(config);
    if (value != option.get(ShadowConfig())) id += fmt::format(" {}={}", option.name, short_number(value));
  }
  return id;
}

ShadowConfig base_config(const ChartOptions& options, ShadowMethod method) {
  ShadowConfig config = shadow_config(options);
  config.method = method;
  config.light_sample_count = options.base_samples;
  return config;
}

ChartSeries samples_series(const ChartOptions& options, ShadowMethod method) {
  ChartSeries series{"light_samples", {}};
  ShadowConfig config = base_config(options, method);
  if (!yields_masks(config)) {
    series.points.push_back({config, id_of(config), "default"});
    return series;
  }
  for (const std::uint32_t count : options.samples) {
    config.light_sample_count = count;
    series.points.push_back({config, id_of(config), fmt::format("{}", count)});
  }
  return series;
}

ChartSeries sweep_series(const ChartOptions& options, ShadowMethod method, const Sweep& sweep) {
  const std::string name = sweep.option->name;
  ChartSeries series{name, {}};
  for (const std::string& value : sweep.values) {
    ShadowConfig config = base_config(options, method);
    set_method_option(config, name + "=" + value);
    series.points.push_back({config, id_of(config), name.substr(name.find('.') + 1) + " " + value});
  }
  return series;
}

/// OBJ files in the directory's subdirectories, by name.
std::vector<std::string> scenes_below(const std::string& directory) {
  std::vector<std::string> scenes;
  std::error_code error;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(directory, error)) {
    if (entry.path().extension() == ".obj") scenes.push_back(entry.path().string());
  }
  if (error) usage_error(fmt::format("--shared-scenes '{}': {}", directory, error.message()));
  std::sort(scenes.begin(), scenes.end());
  return scenes;
}

std::vector<std::string> default_scenes(const ChartOptions& options) {
  if (options.quick) return {std::begin(kQuickScenes), std::end(kQuickScenes)};
  std::vector<std::string> scenes;
  for (const BuiltinInfo& info : builtin_scenes()) scenes.push_back("builtin:" + std::string(info.name));
  return scenes;
}

std::uint32_t nearest_sample_count(const std::vector<std::uint32_t>& samples) {
  const auto distance = [](std::uint32_t n) { return std::fabs(std::log(n / 256.0)); };
  return *std::min_element(samples.begin(), samples.end(), [&](auto a, auto b) { return distance(a) < distance(b); });
}

}  // namespace

void complete_options(ChartOptions& o) {
  if (o.scenes.empty()) {
    o.scenes = default_scenes(o);
    if (!o.shared_scenes.empty() && !o.quick) {
      for (const std::string& scene : scenes_below(o.shared_scenes)) o.scenes.push_back(scene);
    }
  }
  if (o.size.empty()) o.size = o.quick ? "128x128" : "256x256";
  if (o.methods.empty()) {
    for (const MethodTraits& m : shadow_methods()) {
      if (m.method != ShadowMethod::kOracle) o.methods.push_back(m.name);
    }
  }
  if (o.samples.empty())
    o.samples =
        o.quick ? std::vector<std::uint32_t>{4, 16, 64, 256} : std::vector<std::uint32_t>{4, 16, 64, 256, 1024, 4096};
  std::sort(o.samples.begin(), o.samples.end());
  for (const std::uint32_t n : o.samples) {
    if (n < 1 || n > 4096) usage_error(fmt::format("--samples {} is not in 1..4096", n));
  }
  if (o.base_samples == 0) o.base_samples = nearest_sample_count(o.samples);
  if (!o.sweeps.empty()) return;
  if (o.quick) {
    o.sweeps.assign(std::begin(kQuickSweeps), std::end(kQuickSweeps));
  } else {
    o.sweeps.assign(std::begin(kSweeps), std::end(kSweeps));
  }
}

std::vector<ChartSeries> chart_series(const ChartOptions& options) {
  std::vector<Sweep> sweeps;
  for (const std::string& text : options.sweeps) {
    if (text != "none") sweeps.push_back(parse_sweep(text));
  }
  std::vector<ChartSeries> series;
  for (const std::string& name : options.methods) {
    const ShadowMethod method = shadow_method_from_name(name);
    series.push_back(samples_series(options, method));
    for (const Sweep& sweep : sweeps) {
      if (concerns(sweep, method)) series.push_back(sweep_series(options, method, sweep));
    }
  }
  return series;
}

void fix_sample_count(std::vector<ChartSeries>& series, std::uint32_t count) {
  for (ChartSeries& s : series) {
    for (ChartPoint& point : s.points) {
      point.config.light_sample_count = count;
      point.id = id_of(point.config);
      if (s.parameter == "light_samples" && yields_masks(point.config)) point.label = fmt::format("{}", count);
    }
    if (s.parameter == "light_samples") s.points.resize(1);
  }
}

}  // namespace halfshade
