// The options of single methods by name, as text: "afsm.grid" = "256". What the command line's --set and the charts
// use.
#pragma once

#include "halfshade/names.h"

namespace halfshade {

struct MethodOption {
  const char* name;                                             // "method.option"
  const char* help;                                             // meaning, range, default
  void (*set)(ShadowConfig& config, const std::string& value);  // throws Error{kUsage} naming the allowed range
  std::string (*get)(const ShadowConfig& config);
};

/// All of them, by method.
std::span<const MethodOption> method_options();

/// Does the method read that option? Those named "map." belong to all methods that look into shadow maps.
bool concerns(const MethodOption& option, ShadowMethod method);

}  // namespace halfshade
