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

/// World-space centre of a light, which stands for all of it in the cosine.
dvec3 light_center(const Light& light);

/// Colour that an entry gains per unit of visible emission: albedo times cosine towards the light's centre, or times
/// `cosines` (one per entry) where they are given.
std::vector<vec3> light_response(const GBuffer& gbuffer, const LocalFrame& frame, const Light& light,
                                 std::span<const float> cosines = {});

/// Linear RGB of every G-buffer entry. visibility[light] has one value in [0, 1] per entry (0 where the surface faces
/// away). No distance falloff: a light's emission is the irradiance it gives to a surface that faces its centre.
/// visible_emission[light], where not empty, has the sum of the visible samples' weights per entry (emission.h) and
/// takes the place of emission times visibility; without it an emission image counts with its mean.
/// cosines[light], where given, take the place of the shading normal's cosine (bent_normals.h).
std::vector<vec3> shade(const GBuffer& gbuffer, const LocalFrame& frame, const View& view,
                        std::span<const std::vector<float>> visibility, const Ambient& ambient = {},
                        std::span<const std::vector<vec3>> visible_emission = {},
                        std::span<const std::vector<float>> cosines = {});

}  // namespace halfshade
