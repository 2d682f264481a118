// Statistics of a run as JSON (schema "halfshade.stats/1", docs/files.md).
#pragma once

#include <nlohmann/json.hpp>

#include "halfshade/shadows.h"

namespace halfshade {

/// CPU, logical cores, Highway target in use, compiler.
nlohmann::ordered_json machine_json();
nlohmann::ordered_json stats_json(const ShadowStats& stats);
/// Peak resident memory of this process in bytes.
std::uint64_t peak_rss_bytes();
/// Name of the instruction set that the kernels run on.
std::string simd_target();
/// Makes the kernels run on the named target alone ("AVX2", "SSE4", ...). Throws Error{kUsage} with the possible names.
void force_simd_target(const std::string& name);

}  // namespace halfshade
