// Runs stored inputs through a fuzz target, for compilers without libFuzzer.
//   fuzz_replay TARGET FILE_OR_DIRECTORY...
// Exit code 1 when an input takes more than a second of processor time or 512 MiB; the target itself ends the process
// where something does not hold, after the name of the input has been printed.
#include <algorithm>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <iterator>
#include <vector>

#include <sys/resource.h>
#include <tbb/global_control.h>

#include "fuzz/fuzz_target.h"
#include "support/sanitized.h"

namespace {

namespace fs = std::filesystem;
using namespace halfshade::fuzz;

struct Target {
  std::string_view name;
  void (*run)(Bytes input);
};
constexpr Target kTargets[] = {{"obj", fuzz_obj}, {"mtl", fuzz_mtl},     {"view", fuzz_view},  {"image", fuzz_image},
                               {"npy", fuzz_npy}, {"solve", fuzz_solve}, {"c_api", fuzz_c_api}};

constexpr double kMostSeconds = halfshade::test::kSanitized ? 10.0 : 1.0;
constexpr long kMostKilobytes = halfshade::test::kSanitized ? 4l << 20 : 512l << 10;

std::vector<fs::path> files_of(const fs::path& path) {
  if (!fs::is_directory(path)) return {path};
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(path)) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

std::vector<std::uint8_t> bytes_of(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  require(stream.good(), "readable: " + file.string());
  return {std::istreambuf_iterator<char>(stream), {}};
}

long peak_kilobytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return usage.ru_maxrss;
}

/// False when it took too long.
bool replay(const Target& target, const fs::path& file) {
  const std::vector<std::uint8_t> input = bytes_of(file);
  std::printf("%s\n", file.c_str());
  std::fflush(stdout);
  const std::clock_t start = std::clock();
  target.run(input);
  const double seconds = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
  if (seconds <= kMostSeconds) return true;
  std::printf("  took %.2f s, allowed %.0f\n", seconds, kMostSeconds);
  return false;
}

}  // namespace

int main(int argc, char** argv) {
  const auto target = std::find_if(std::begin(kTargets), std::end(kTargets),
                                   [&](const Target& t) { return argc > 1 && t.name == argv[1]; });
  if (target == std::end(kTargets) || argc < 3) {
    std::fprintf(stderr, "usage: fuzz_replay TARGET FILE_OR_DIRECTORY...; targets:");
    for (const Target& t : kTargets) std::fprintf(stderr, " %s", t.name.data());
    std::fprintf(stderr, "\n");
    return 2;
  }
  const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
  bool quick = true;
  std::size_t count = 0;
  for (int i = 2; i < argc; ++i) {
    for (const fs::path& file : files_of(argv[i])) quick = replay(*target, file) && quick, ++count;
  }
  const long peak = peak_kilobytes();
  std::printf("%zu inputs, peak %ld MiB, allowed %ld\n", count, peak >> 10, kMostKilobytes >> 10);
  return count > 0 && quick && peak <= kMostKilobytes ? 0 : 1;
}
