// Coloured light through translucent surfaces (Sintorn, Eisemann, Assarsson 2008, section 6, "one value per light
// sample"; Forest, Barthe, Paulin 2009, section 2.1).
//
// Translucent triangles (Material::translucent) block no light sample. A segment from a receiver to a sample that
// nothing opaque blocks carries, per channel, the product of what it crosses:
//
//   T = 1 - a + a (1 - d) min(Tf, 1) m     a: texel of the alpha map / 255, m: linear texel of the transmittance map
//                                          (both nearest; 1 without map or texture coordinates)
//
// Each crossing of a surface counts once, also through an edge or a vertex that triangles share; triangles that cover
// each other exactly are one surface; the receiver's own triangle does not count. A closed body is crossed twice, where
// the light goes in and where it comes out. Light goes straight on: there is no refraction, and thickness counts for
// nothing.
//
// Products are formed in fixed point (logarithms in 2^-16): n crossings are right to n * 5.3e-6 of the product plus
// 6e-8. Equal inputs give equal bits for any order of triangles, number of threads and instruction set.
#pragma once

#include "halfshade/shadows.h"

namespace halfshade {

/// The light that reaches each receiver, linear RGB: the mean over all samples of the light of what their segments
/// carry, 0 for blocked ones; in [0, 1]. A light with an emission image gives the sum of the samples' weights
/// (emission.h) times that instead. Scenes without translucent triangles are fine: all channels are visibility then.
///
/// Visibility itself, and masks, stay those of the opaque triangles alone; ShadowStats::details has the number of
/// translucent ones ("translucent_triangles"). Methods that yield no masks do not know which samples they see: their
/// visibility is multiplied with the transmittance of all samples together, which is wrong where a sample is both
/// blocked and dimmed ("translucent_triangles_approximated" has their number then).
///
/// Errors and threads as solve_shadows; receivers behind a one-sided light get no light.
HALFSHADE_API void solve_light(const Scene& scene, std::span<const Receiver> receivers, const Light& light,
                               const ShadowConfig& config, std::vector<vec3>& reaching, ShadowStats* stats = nullptr);

}  // namespace halfshade
