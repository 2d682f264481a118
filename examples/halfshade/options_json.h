// The options of a method as JSON.
#pragma once

#include <nlohmann/json.hpp>

#include "shadows/method_options.h"

namespace halfshade {

/// All that the configured method reads, by name.
inline nlohmann::ordered_json options_json(const ShadowConfig& config) {
  nlohmann::ordered_json options = nlohmann::ordered_json::object();
  for (const MethodOption& option : method_options()) {
    if (concerns(option, config.method)) options[option.name] = option.get(config);
  }
  return options;
}

}  // namespace halfshade
