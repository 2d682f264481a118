// Runs a test body once per instruction set that this machine and this build have.
#pragma once

#include <hwy/targets.h>

#include <string>

namespace halfshade::test {

/// body(name) with the kernels forced onto each Highway target in turn; restores the normal choice afterwards.
template <class Body>
void for_each_simd_target(const Body& body) {
  for (const auto target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().DeInit();
    body(std::string(hwy::TargetName(target)));
    hwy::SetSupportedTargetsForTest(0);
  }
  hwy::GetChosenTarget().DeInit();
}

}  // namespace halfshade::test
