// From visibility to colour: Lambert under each light's centre, times visibility, plus a hemisphere of ambient light
// (the factored form of Sintorn, Eisemann, Assarsson 2008, section 1: visibility separated from lighting).
#pragma once

#include "halfshade/light.h"
#include "rasterizer/core/lattice.h"
#include "rasterizer/gbuffer.h"

namespace halfshade {

/// Ambient light from above and from below (along the camera's up vector), multiplied with the surface's colour.
struct Ambient {
  vec3 sky{0.30f, 0.33f, 0.38f};
  vec3 ground{0.15f, 0.14f, 0.13f};
};

inline constexpr vec3 kBackground{0.62f, 0.69f, 0.78f};

/// Linear RGB of every G-buffer entry. visibility[light] has one value in [0, 1] per entry (0 where the surface faces
/// away). No distance falloff: a light's emission is the irradiance it gives to a surface that faces its centre.
std::vector<vec3> shade(const GBuffer& gbuffer, const LocalFrame& frame, const View& view,
                        std::span<const std::vector<float>> visibility, const Ambient& ambient = {});

}  // namespace halfshade
