#include "shadows/surface_filter.h"

#include "rasterizer/core/srgb_table.h"

namespace halfshade {
namespace {

/// A surface that covers `alpha` / 255 of the place.
double with_holes(double transmittance, std::uint32_t alpha) {
  const double covered = alpha / 255.0;
  return (1.0 - covered) + covered * transmittance;
}

}  // namespace

SurfaceFilter::SurfaceFilter(const Scene& scene, const Material& material, bool textured) {
  if (textured && material.alpha_map != kNone) alpha_ = &scene.alpha_maps[material.alpha_map];
  if (textured && material.transmittance_map != kNone) color_ = &scene.color_maps[material.transmittance_map];
  for (int c = 0; c < 3; ++c) {
    const double filter = std::min(1.0, double{material.transmittance[c]});
    clear_[c] = (1.0 - std::clamp(double{material.opacity}, 0.0, 1.0)) * std::max(0.0, filter);
    uniform_[c] = attenuation_of(clear_[c]);
    for (std::uint32_t code = 0; code < 256; ++code) {
      const double transmittance = color_ != nullptr ? clear_[c] * double{kLinearFromSrgb[code]} : clear_[c];
      of_code_[c][code] = attenuation_of(color_ != nullptr ? transmittance : with_holes(transmittance, code));
    }
  }
}

RgbAttenuation SurfaceFilter::at(const std::array<std::uint32_t, 2>& alpha_texel,
                                 const std::array<std::uint32_t, 2>& color_texel) const {
  const auto code_in = [](const auto& map, const std::array<std::uint32_t, 2>& texel) {
    return std::size_t{texel[1]} * map.width + texel[0];
  };
  if (is_uniform()) return uniform_;
  const std::uint32_t alpha = alpha_ != nullptr ? alpha_->alpha[code_in(*alpha_, alpha_texel)] : 255;
  RgbAttenuation result;
  for (std::size_t c = 0; c < 3; ++c) {
    if (color_ == nullptr) {
      result[c] = of_code_[c][alpha];
      continue;
    }
    const std::uint8_t code = color_->rgb[code_in(*color_, color_texel) * 3 + c];
    result[c] =
        alpha == 255 ? of_code_[c][code] : attenuation_of(with_holes(clear_[c] * double{kLinearFromSrgb[code]}, alpha));
  }
  return result;
}

}  // namespace halfshade
