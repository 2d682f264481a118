#include "shadows/method_options.h"

#include <charconv>

namespace halfshade {
namespace {

[[noreturn]] void bad_value(const std::string& value, const std::string& allowed) {
  throw Error(ErrorCode::kUsage, "'" + value + "' is not " + allowed);
}

bool parse_switch(const std::string& value) {
  if (value == "on") return true;
  if (value != "off") bad_value(value, "on or off");
  return false;
}

template <class Number>
Number parse_number(const std::string& value, Number low, Number high) {
  Number number{};
  const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), number);
  if (error != std::errc() || end != value.data() + value.size() || !(number >= low && number <= high)) {
    bad_value(value, "in " + std::to_string(low) + ".." + std::to_string(high));
  }
  return number;
}

/// A field of the configuration, or of one method's part of it, as a function of the configuration.
#define HALFSHADE_SWITCH(field)                                                     \
  [](ShadowConfig& c, const std::string& value) { c.field = parse_switch(value); }, \
      [](const ShadowConfig& c) { return std::string(c.field ? "on" : "off"); }
#define HALFSHADE_NUMBER(field, low, high)                                                                        \
  [](ShadowConfig& c, const std::string& value) { c.field = parse_number<decltype(c.field)>(value, low, high); }, \
      [](const ShadowConfig& c) { return std::to_string(c.field); }

constexpr MethodOption kOptions[] = {
    {"afsm.grid", "cells per axis of the light view, 16..2048; 0 = from the number of receivers",
     HALFSHADE_NUMBER(grid_resolution, 0, 2048)},
    {"afsm.back-faces", "skip front faces of certified closed meshes: on, off (exact too)",
     HALFSHADE_SWITCH(back_face_casters)},
};

}  // namespace

std::span<const MethodOption> method_options() { return kOptions; }

void set_method_option(ShadowConfig& config, const std::string& assignment) {
  const std::size_t equals = assignment.find('=');
  const std::string name = assignment.substr(0, equals);
  std::string known;
  for (const MethodOption& option : kOptions) {
    known += (known.empty() ? "" : ", ") + std::string(option.name);
    if (name != option.name) continue;
    if (equals == std::string::npos) throw Error(ErrorCode::kUsage, "option '" + name + "' needs '=value'");
    try {
      option.set(config, assignment.substr(equals + 1));
    } catch (const Error& e) {
      throw Error(e.code(), "option '" + name + "': " + e.what());
    }
    return;
  }
  throw Error(ErrorCode::kUsage, "option '" + name + "' is not one of: " + known);
}

}  // namespace halfshade
