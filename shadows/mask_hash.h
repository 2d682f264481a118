// The hash of masks that come in parts.
#pragma once

#include <memory>

#include "halfshade/shadows.h"

namespace halfshade {

/// VisibilityMasks::hash of the masks of all receivers, given in parts, in order.
class MaskHasher {
 public:
  MaskHasher(std::uint64_t receivers, std::uint64_t samples);
  ~MaskHasher();
  void add(const VisibilityMasks& part);
  std::string digest() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace halfshade
