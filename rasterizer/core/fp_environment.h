// The floating-point environment that the project's bit-exact results need: round to nearest, denormals kept.
#pragma once

#if defined(__SSE2__)
#include <xmmintrin.h>
#else
#include <cfenv>
#endif

namespace halfshade {

/// Saves the caller's floating-point environment, sets the one needed, restores the caller's on leaving.
class FpEnvironment {
 public:
#if defined(__SSE2__)
  FpEnvironment() : saved_(_mm_getcsr()) { _mm_setcsr(0x1f80u); }
  ~FpEnvironment() { _mm_setcsr(saved_); }

 private:
  unsigned saved_;
#else
  FpEnvironment() {
    std::fegetenv(&saved_);
    std::fesetenv(FE_DFL_ENV);
  }
  ~FpEnvironment() { std::fesetenv(&saved_); }

 private:
  std::fenv_t saved_;
#endif
 public:
  FpEnvironment(const FpEnvironment&) = delete;
  FpEnvironment& operator=(const FpEnvironment&) = delete;
};

}  // namespace halfshade
