// Names and directories of results.
#pragma once

#include <fmt/format.h>

#include <filesystem>
#include <string>

#include "halfshade/error.h"

namespace halfshade {

/// The text with everything but letters, digits, '.' and '-' replaced by '_'.
inline std::string file_name(const std::string& text) {
  std::string name;
  for (const char c : text) name += std::isalnum(static_cast<unsigned char>(c)) || c == '.' || c == '-' ? c : '_';
  return name;
}

/// With its parents, unless it is there. Throws Error{kOutput}.
inline void make_directory(const std::filesystem::path& path) {
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (error) throw Error(ErrorCode::kOutput, fmt::format("{}: {}", path.string(), error.message()));
}

}  // namespace halfshade
