// halfshade_paper_bench PAPER: measures what a paper reports and prints it beside our numbers, as ratios.
#include "papers.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <functional>

#include "bench/harness.h"

namespace halfshade::bench {
namespace {

struct Paper {
  const char* name;
  const char* title;
  void (*run)(const PaperOptions& options);
};

const std::vector<Paper>& papers() {
  static const std::vector<Paper> all = {
      {"afsm", "Sintorn, Eisemann, Assarsson 2008: alias-free shadow maps", run_afsm},
      {"gears", "Wang et al. 2014: GEARS, tables 1 to 8 against ray tracing", run_gears},
      {"hpc", "Laine, Aila 2005: hierarchical penumbra casting, table 2 against ray tracing", run_hpc},
      {"stsv", "Forest, Barthe, Paulin 2009: soft textured shadow volumes, a card against its mesh", run_stsv},
      {"shadow-accumulation", "Aszodi, Szirmay-Kalos 2006: shadow accumulation against PCSS", run_shadow_accumulation},
  };
  return all;
}

}  // namespace

void print_claim(const std::string& claim, const std::string& paper, const std::string& ours) {
  fmt::print("| {} | {} | {} |\n", claim, paper, ours);
  std::fflush(stdout);
}

}  // namespace halfshade::bench

int main(int argc, char** argv) {
  using halfshade::bench::papers;
  CLI::App app("Measures the claims of the papers again, as ratios on this machine.", "halfshade_paper_bench");
  halfshade::bench::PaperOptions o;
  app.add_option("--shared-scenes", o.shared_scenes, "Directory of real scenes (default: built-in scenes only)")
      ->check(CLI::ExistingDirectory);
  app.add_option("--size", o.size, "Picture in pixels, WIDTHxHEIGHT")->capture_default_str();
  app.add_option("--threads", o.threads, "Threads")->check(CLI::Range(1, 1024))->capture_default_str();
  app.add_option("--repeat", o.repeat, "Repetitions; medians count")->check(CLI::Range(1, 100))->capture_default_str();
  app.add_flag("--quick", o.quick, "Small and fast: to see that it works");
  app.require_subcommand(1);
  for (const auto& paper : papers()) app.add_subcommand(paper.name, paper.title);
  CLI11_PARSE(app, argc, argv);
  return halfshade::bench::run_on_threads("halfshade_paper_bench", o.threads, [&](int) {
    for (const auto& paper : papers()) {
      if (app.got_subcommand(paper.name)) paper.run(o);
    }
  });
}
