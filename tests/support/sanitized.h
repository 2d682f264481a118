// Is this program instrumented by GCC's address or thread sanitizer? Then it is slower and takes more memory.
#pragma once

namespace halfshade::test {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kSanitized = true;
#else
constexpr bool kSanitized = false;
#endif

}  // namespace halfshade::test
