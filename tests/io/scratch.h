// A directory that is gone after the test, and what tests ask about errors.
#pragma once

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <string_view>

#include <doctest/doctest.h>

#include "halfshade/error.h"
#include "support/sanitized.h"

namespace halfshade::test {

class Scratch {
 public:
  Scratch() {
    std::string pattern = (std::filesystem::temp_directory_path() / "halfshade-test-XXXXXX").string();
    REQUIRE(::mkdtemp(pattern.data()) != nullptr);
    directory_ = std::filesystem::canonical(pattern);
  }
  ~Scratch() {
    std::error_code ignored;
    std::filesystem::remove_all(directory_, ignored);
  }
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;

  const std::filesystem::path& path() const { return directory_; }
  std::filesystem::path path(const std::string& name) const { return directory_ / name; }
  std::filesystem::path write(const std::string& name, std::string_view bytes) const {
    std::ofstream stream(path(name), std::ios::binary);
    stream.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    return path(name);
  }
  std::size_t file_count() const {
    const auto files = std::filesystem::directory_iterator(directory_);
    return static_cast<std::size_t>(std::distance(begin(files), end(files)));
  }

 private:
  std::filesystem::path directory_;
};

inline std::string read_bytes(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// Refusals take milliseconds; the limit of one second has room for a busy machine.
inline constexpr double kHang = 5.0;

struct Outcome {
  bool threw = false;
  ErrorCode code{};
  std::string message;
  double seconds = 0.0;
  bool has(std::string_view text) const { return message.find(text) != std::string::npos; }
};

template <class Call>
Outcome outcome_of(const Call& call) {
  const auto start = std::chrono::steady_clock::now();
  Outcome outcome;
  try {
    call();
  } catch (const Error& error) {
    outcome = {true, error.code(), error.what()};
  }
  outcome.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return outcome;
}

/// How far the peak of resident memory rises above what the process used at construction.
class PeakMemory {
 public:
  PeakMemory() {
    std::ofstream("/proc/self/clear_refs") << "5";  // the peak starts anew from here
    start_ = peak();
  }
  /// MiB; 0 where the system does not tell, or a sanitizer's own memory would count.
  double growth() const { return kSanitized ? 0.0 : peak() - start_; }

 private:
  static double peak() {
    std::ifstream status("/proc/self/status");
    for (std::string word; status >> word;) {
      double kilobytes = 0.0;
      if (word == "VmHWM:" && status >> kilobytes) return kilobytes / 1024.0;
    }
    return 0.0;
  }
  double start_ = 0.0;
};

}  // namespace halfshade::test
