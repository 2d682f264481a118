// The tables and claims of the papers, measured again: one function per paper, one row per claim.
#pragma once

#include <string>
#include <vector>

namespace halfshade::bench {

struct PaperOptions {
  std::string shared_scenes;  // directory of real scenes; rows that need it are skipped without it
  std::string size = "512x512";
  int threads = 2, repeat = 3;
  bool quick = false;  // small pictures, few rows: for trying whether it works
};

void run_gears(const PaperOptions& options);
void run_hpc(const PaperOptions& options);
void run_afsm(const PaperOptions& options);
void run_stsv(const PaperOptions& options);
void run_shadow_accumulation(const PaperOptions& options);

/// Prints Markdown rows "claim | paper | ours".
void print_claim(const std::string& claim, const std::string& paper, const std::string& ours);

}  // namespace halfshade::bench
