// What a translucent surface does to light that crosses it, per colour channel, from its material and the texels under
// the crossing (definition: halfshade/transmittance.h).
#pragma once

#include <array>

#include "halfshade/scene.h"
#include "shadows/attenuation.h"

namespace halfshade {

using RgbAttenuation = std::array<Attenuation, 3>;

class SurfaceFilter {
 public:
  /// `textured` is whether the scene has texture coordinates; without them maps count for nothing.
  SurfaceFilter(const Scene& scene, const Material& material, bool textured);

  const AlphaMap* alpha_map() const { return alpha_; }          // null if there is none
  const ColorMap* transmittance_map() const { return color_; }  // null if there is none
  bool is_uniform() const { return alpha_ == nullptr && color_ == nullptr; }
  const RgbAttenuation& uniform() const { return uniform_; }

  /// At texels [column, row] of the two maps; of a map that there is not, any.
  RgbAttenuation at(const std::array<std::uint32_t, 2>& alpha_texel,
                    const std::array<std::uint32_t, 2>& color_texel) const;

 private:
  const AlphaMap* alpha_ = nullptr;
  const ColorMap* color_ = nullptr;
  std::array<double, 3> clear_{};  // (1 - d) Tf
  RgbAttenuation uniform_{};
  std::array<std::array<Attenuation, 256>, 3> of_code_{};  // [channel][texel], where there is one map
};

}  // namespace halfshade
