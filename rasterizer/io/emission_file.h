// Emission images of rectangle lights from files.
#pragma once

#include <filesystem>

#include "halfshade/light.h"

namespace halfshade {

/// PNG or JPEG (sRGB, made linear) or EXR (linear as stored); grey pictures give grey light, alpha is ignored. `name`
/// is left empty. Throws Error{kBadInput} for a file that cannot be decoded completely or holds negative or non-finite
/// values, Error{kLimit} for sides above 4096.
EmissionImage load_emission_image(const std::filesystem::path& file);

}  // namespace halfshade
