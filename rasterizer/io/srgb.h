// Linear light to the sRGB code values of IEC 61966-2-1, with bits that do not depend on any math library.
#pragma once

#include <cstdint>

namespace halfshade {

/// Code value 0..255 or 0..65535 nearest to the encoded `linear`; negative and NaN give 0, above 1 the largest.
std::uint32_t encode_srgb(float linear, int bits);
/// Linear light of an encoded value 0..1, rounded to the nearest 16-bit code first: exact for 8- and 16-bit pictures.
float decode_srgb(float encoded);
/// encode_srgb without the sRGB curve.
std::uint32_t encode_linear(float value, int bits);

}  // namespace halfshade
