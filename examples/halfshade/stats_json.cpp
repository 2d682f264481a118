#include "stats_json.h"

#include <hwy/targets.h>
#include <sys/resource.h>
#include <unistd.h>

#include <fstream>

namespace halfshade {
namespace {

std::string cpu_name() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    const std::size_t colon = line.find(':');
    if (line.starts_with("model name") && colon != std::string::npos) return line.substr(colon + 2);
  }
  return "unknown";
}

}  // namespace

std::string simd_target() {
  // The dispatcher takes the best of the supported targets that were compiled; lower bits are better.
  return hwy::TargetName(hwy::SupportedAndGeneratedTargets().front());
}

void force_simd_target(const std::string& name) {
  std::string known;
  for (const auto target : hwy::SupportedAndGeneratedTargets()) {
    if (name == hwy::TargetName(target)) {
      hwy::SetSupportedTargetsForTest(target);
      hwy::GetChosenTarget().DeInit();
      return;
    }
    known += (known.empty() ? "" : ", ") + std::string(hwy::TargetName(target));
  }
  throw Error(ErrorCode::kUsage, "SIMD target '" + name + "' is not one of: " + known);
}

nlohmann::ordered_json machine_json() {
  return {{"cpu", cpu_name()},
          {"logical_cores", sysconf(_SC_NPROCESSORS_ONLN)},
          {"simd_target", simd_target()},
          {"compiler", std::string("g++ ") + __VERSION__}};
}

nlohmann::ordered_json stats_json(const ShadowStats& s) {
  nlohmann::ordered_json details = nlohmann::ordered_json::object();
  for (const auto& [name, value] : s.details) details[name] = value;
  return {{"index_ms", s.index_ms},
          {"cull_ms", s.cull_ms},
          {"test_ms", s.test_ms},
          {"receivers", s.receivers},
          {"triangles", s.triangles},
          {"pairs_tested", s.pairs_tested},
          {"pairs_sampled", s.pairs_sampled},
          {"pairs_necessary", s.pairs_necessary},
          {"sample_tests", s.sample_tests},
          {"exact_fallbacks", s.exact_fallbacks},
          {"lists_occupied", s.lists_occupied},
          {"lists_longest", s.lists_longest},
          {"certified_blockers", s.certified_blockers},
          {"leaves_listed", s.leaves_listed},
          {"leaves_tested", s.leaves_tested},
          {"clusters_lit", s.clusters_lit},
          {"clusters_by_sample", s.clusters_by_sample},
          {"everywhere_blockers", s.everywhere_blockers},
          {"bytes", s.bytes},
          {"details", details}};
}

std::uint64_t peak_rss_bytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::uint64_t>(usage.ru_maxrss) * 1024;
}

}  // namespace halfshade
