// What OpenEXR believes in a header, checked against the file before it does.
#pragma once

#include <string_view>

namespace halfshade {

/// Do all attributes of all headers of an EXR file lie inside it, each as long as its type and content need? OpenEXR
/// 3.1 sets aside whatever length an attribute claims (2 GB in a file of 300 bytes), and passes over the length of most
/// types, so that the next attribute starts where the value ends and not where the length says.
bool has_credible_exr_header(std::string_view bytes);

}  // namespace halfshade
