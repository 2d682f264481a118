// Methods, patterns and the options of single methods by name, as text: for command lines and other languages.
#pragma once

#include <string>

#include "halfshade/shadows.h"

namespace halfshade {

/// "exact", "afsm" ... Throws Error{kUsage} listing the known names, here and below.
HALFSHADE_API ShadowMethod shadow_method_from_name(const std::string& name);
HALFSHADE_API const char* name_of(ShadowMethod method);
/// "rows", "uniform" ...
HALFSHADE_API SamplePattern sample_pattern_from_name(const std::string& name);
HALFSHADE_API const char* name_of(SamplePattern pattern);

/// `assignment` is "method.option=value", for instance "hpc.leaf=8". Throws Error{kUsage} for unknown options, and for
/// values out of range with the range.
HALFSHADE_API void set_method_option(ShadowConfig& config, const std::string& assignment);

}  // namespace halfshade
