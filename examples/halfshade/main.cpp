// halfshade: exact soft shadows from area lights on the CPU. Results on standard output, everything else on standard
// error.
#include <fmt/format.h>

#include <new>

#include "halfshade/error.h"
#include "progress.h"
#include "verbs.h"

namespace {

int exit_code_of(halfshade::ErrorCode code) {
  switch (code) {
    case halfshade::ErrorCode::kUsage:
      return halfshade::kUsage;
    case halfshade::ErrorCode::kBadInput:
      return halfshade::kBadInput;
    case halfshade::ErrorCode::kLimit:
      return halfshade::kLimit;
    case halfshade::ErrorCode::kOutput:
      return halfshade::kOutput;
    case halfshade::ErrorCode::kCancelled:
      return 128 + halfshade::stop_signal();
  }
  return halfshade::kBadInput;
}

std::string joined(int argc, char** argv) {
  std::string line = "halfshade";
  for (int i = 1; i < argc; ++i) line += " " + std::string(argv[i]);
  return line;
}

int run(int argc, char** argv) {
  CLI::App app("Exact soft shadows from area lights: one bit for every receiver and light sample.", "halfshade");
  app.set_version_flag("--version", HALFSHADE_VERSION);
  app.require_subcommand(1);
  app.footer(
      "Exit codes: 0 ok, 1 comparison failed, 2 usage, 3 bad input, 4 limit or memory, 5 output, 130/143 stopped.");
  int exit_code = halfshade::kOk;
  halfshade::add_render(app, joined(argc, argv), exit_code);
  halfshade::add_accumulate(app, joined(argc, argv));
  halfshade::add_chart(app, joined(argc, argv));
  halfshade::add_atlas(app, joined(argc, argv), exit_code);
  halfshade::add_info(app);
  halfshade::add_recommend(app, joined(argc, argv), exit_code);
  halfshade::add_compare(app, exit_code);
  halfshade::add_verify(app, exit_code);
  halfshade::add_merge(app, joined(argc, argv), exit_code);
  halfshade::add_relight(app, joined(argc, argv));
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? halfshade::kOk : halfshade::kUsage;
  }
  return exit_code;
}

}  // namespace

int main(int argc, char** argv) {
  halfshade::install_signal_handlers();
  try {
    return run(argc, argv);
  } catch (const halfshade::Error& e) {
    fmt::print(stderr, "halfshade: {}\n", e.what());
    return exit_code_of(e.code());
  } catch (const std::bad_alloc&) {
    fmt::print(stderr, "halfshade: out of memory\n");
    return halfshade::kLimit;
  } catch (const std::exception& e) {
    fmt::print(stderr, "halfshade: {}\n", e.what());
    return halfshade::kBadInput;
  }
}
