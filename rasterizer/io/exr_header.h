// What OpenEXR believes in a header, checked against the file before it does.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace halfshade {

/// Bytes of the largest buffer, of rows that are compressed together or of a tile, that OpenEXR sets aside for a file
/// as soon as it is opened: before its size can be asked for. Nothing if the header is damaged: all attributes of all
/// headers must lie inside the file, each as long as its type and content need. OpenEXR 3.1 sets aside whatever length
/// an attribute claims (2 GB in a file of 300 bytes), and passes over the length of most types, so that the next
/// attribute starts where the value ends and not where the length says.
std::optional<std::uint64_t> exr_buffer_bytes(std::string_view bytes);

}  // namespace halfshade
