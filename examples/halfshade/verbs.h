// The verbs of the command line. Each function adds its options to `app` and sets the callback that runs it.
#pragma once

#include <CLI/CLI.hpp>

namespace halfshade {

/// Exit codes, the same for every verb.
enum ExitCode { kOk = 0, kDifferent = 1, kUsage = 2, kBadInput = 3, kLimit = 4, kOutput = 5 };

/// `exit_code` receives what a verb has to say beyond exceptions (kDifferent).
/// `command_line` is stored with the results.
void add_render(CLI::App& app, const std::string& command_line, int& exit_code);
void add_accumulate(CLI::App& app, const std::string& command_line);
void add_chart(CLI::App& app, const std::string& command_line);
void add_atlas(CLI::App& app, const std::string& command_line, int& exit_code);
void add_info(CLI::App& app);
void add_recommend(CLI::App& app, const std::string& command_line, int& exit_code);
void add_compare(CLI::App& app, int& exit_code);
void add_verify(CLI::App& app, int& exit_code);
void add_merge(CLI::App& app, const std::string& command_line, int& exit_code);
void add_relight(CLI::App& app, const std::string& command_line);

}  // namespace halfshade
