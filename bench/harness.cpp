#include "harness.h"

#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdio>
#include <thread>

#include "examples/halfshade/stats_json.h"
#include "rasterizer/core/stopwatch.h"

namespace halfshade::bench {
namespace {

/// "1c8749e" or "1c8749e-dirty"; "unknown" outside a git checkout.
std::string source_version() {
  std::string text;
  if (std::FILE* pipe =
          popen("git -C '" HALFSHADE_SOURCE_DIR "' describe --always --dirty --abbrev=12 2>/dev/null", "r")) {
    std::array<char, 128> line{};
    if (std::fgets(line.data(), line.size(), pipe) != nullptr) text = line.data();
    pclose(pipe);
  }
  while (!text.empty() && text.back() == '\n') text.pop_back();
  return text.empty() ? "unknown" : text;
}

}  // namespace

int run_on_threads(const char* program, int threads, const std::function<void(int)>& work) {
  try {
    if (threads <= 0) threads = static_cast<int>(std::thread::hardware_concurrency());
    tbb::task_arena arena(threads);
    arena.execute([&] { work(threads); });
  } catch (const std::exception& e) {
    fmt::print(stderr, "{}: {}\n", program, e.what());
    return 1;
  }
  return 0;
}

double Timing::median() const {
  std::vector<double> sorted = ms;
  std::sort(sorted.begin(), sorted.end());
  const std::size_t n = sorted.size();
  return n == 0 ? 0.0 : (sorted[(n - 1) / 2] + sorted[n / 2]) * 0.5;
}

double Timing::min() const { return ms.empty() ? 0.0 : *std::min_element(ms.begin(), ms.end()); }
double Timing::max() const { return ms.empty() ? 0.0 : *std::max_element(ms.begin(), ms.end()); }

std::vector<Timing> measure_interleaved(const std::vector<std::function<void()>>& contenders, int rounds) {
  std::vector<Timing> timings(contenders.size());
  for (int round = 0; round < rounds; ++round) {
    for (std::size_t i = 0; i < contenders.size(); ++i) {
      Stopwatch watch;
      contenders[i]();
      timings[i].ms.push_back(watch.lap());
    }
  }
  return timings;
}

std::uint64_t count_differences(const VisibilityMasks& a, const VisibilityMasks& b) {
  std::uint64_t count = 0;
  for (std::size_t i = 0; i < a.words.size(); ++i)
    count += static_cast<std::uint64_t>(std::popcount(a.words[i] ^ b.words[i]));
  return count;
}

double geometric_mean(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += std::log(value);
  return values.empty() ? 0.0 : std::exp(sum / static_cast<double>(values.size()));
}

nlohmann::ordered_json run_conditions(int threads) {
  nlohmann::ordered_json json = machine_json();
  json["threads"] = threads;
  json["flags"] = HALFSHADE_FLAGS;
  json["commit"] = source_version();
  return json;
}

nlohmann::ordered_json timing_json(const Timing& timing) {
  return {
      {"median_ms", timing.median()}, {"min_ms", timing.min()}, {"max_ms", timing.max()}, {"samples_ms", timing.ms}};
}

}  // namespace halfshade::bench
