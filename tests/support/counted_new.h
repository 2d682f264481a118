// operator new that counts, and fails when told to. Defined in counted_new.cpp, for programs that link it.
#pragma once

#include <cstdint>

namespace halfshade::test {

struct Allocations {
  std::uint64_t count = 0;  // calls of operator new
  std::int64_t live = 0;    // bytes not given back
};

Allocations allocations_now();

/// From now on, the `number`-th allocation fails (1 = the next), and those before and after it do not. 0 = none fails.
void fail_allocation(std::uint64_t number);
/// Has it failed since?
bool allocation_failed();

}  // namespace halfshade::test
