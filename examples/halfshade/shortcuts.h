// The shortcuts of the exact methods: which of them a certificate switched on for this scene and light, how often they
// applied, and what they gain.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>

#include "shadows/receivers.h"

namespace halfshade {

struct Shortcut {
  std::string name;
  bool on = false;
  std::uint64_t applied = 0, of = 0;  // of `unit`
  std::string unit;
  std::optional<double> gain;  // time without / time with it, if it was measured
  std::string note;
};

/// `stats` is what the run counted. With `measure`, method exact runs with and without each shortcut that can be
/// switched, interleaved, three times each; medians count.
std::vector<Shortcut> list_shortcuts(const LatticeMesh& mesh, const ReceiverArray& receivers, const Light& light,
                                     const ShadowConfig& config, const ShadowStats& stats, bool measure);

nlohmann::ordered_json shortcuts_json(const std::vector<Shortcut>& shortcuts);
void print_shortcuts(std::FILE* out, const std::vector<Shortcut>& shortcuts);

}  // namespace halfshade
