// halfshade verify: every mask bit of a dump against the oracle.
#include <fmt/format.h>

#include "dump.h"
#include "progress.h"
#include "shadows/solver.h"
#include "verbs.h"

namespace halfshade {
namespace {

int run(const std::string& directory) {
  Dump dump;
  read_dump(directory, dump);
  Progress progress("verify", false);
  ShadowConfig config;
  config.method = ShadowMethod::kOracle;
  config.progress = [&progress](double done) { return progress(done); };
  VisibilityMasks truth;
  ShadowStats stats;
  solve_masks(dump.mesh, dump.receivers, Light(), dump.samples, config, truth, stats);
  std::uint64_t wrong_bits = 0, wrong_receivers = 0;
  for (std::size_t r = 0; r < truth.receiver_count; ++r) {
    std::uint64_t wrong = 0;
    for (std::size_t w = 0; w < truth.words_per_receiver; ++w) {
      wrong += static_cast<std::uint64_t>(std::popcount(truth.mask(r)[w] ^ dump.masks.mask(r)[w]));
    }
    wrong_bits += wrong;
    wrong_receivers += wrong > 0;
  }
  fmt::print("verify     {} receivers, {} bits, {} wrong in {} receivers\n", truth.receiver_count,
             truth.receiver_count * truth.sample_count, wrong_bits, wrong_receivers);
  return wrong_bits == 0 ? kOk : kDifferent;
}

}  // namespace

void add_verify(CLI::App& app, int& exit_code) {
  CLI::App* verb = app.add_subcommand("verify", "Check every mask bit of a dump with the oracle");
  auto directory = std::make_shared<std::string>();
  verb->add_option("dump", *directory, "Directory written by render --dump")->required();
  verb->callback([directory, &exit_code] { exit_code = run(*directory); });
}

}  // namespace halfshade
