// Masks as NPY arrays: u1 [receiver, byte], bit i % 8 of byte i / 8 is light sample i, 1 = blocked (docs/files.md).
#pragma once

#include <filesystem>

#include "halfshade/shadows.h"

namespace halfshade {

/// Atomic. Throws Error{kOutput}.
void write_masks(const std::filesystem::path& path, const VisibilityMasks& masks);

/// Throws Error{kBadInput} naming the file for another type or shape, and for bits behind the last sample.
void read_masks(const std::filesystem::path& path, std::size_t receivers, std::uint32_t samples,
                VisibilityMasks& masks);

}  // namespace halfshade
