// Penumbra volumes: everything that a blocker may hide some part of a light, or of a group of light samples, from
// (Laine and Aila 2005, sections 3.1 and 3.2).
//
// Let P be a convex bound of the samples and n a direction with n . l <= b for all of P and n . t >= b for all of the
// blocker. A receiver r hidden from l lies beyond the blocker's point t, r = l + s (t - l) with s >= 1, hence
// n . r = n . t + (s - 1)(n . t - n . l) >= b. Such planes are found through an edge of one and a corner of the other;
// the blocker's own plane is one more candidate (the cap). Each plane is accepted only where its rounded numbers are
// certain to separate, so a volume may be too large, never too small; a blocker that touches the bound has no planes
// at all and its volume is all of space.
#pragma once

#include "shadows/light_view.h"
#include "shadows/visibility_kernel.h"

namespace halfshade {

/// Convex bound of light samples: a polygon of at most eight corners with a small thickness, or a box.
struct LightHull {
  struct Edge {
    std::uint8_t from, to;
  };
  std::uint32_t corner_count = 0, edge_count = 0;
  std::array<dvec3, 8> corner;  // local frame; all samples lie between these, +- thickness
  std::array<dvec3, 8> outer;   // the same, larger by more than rounding can matter: what planes are laid through
  std::array<Edge, 12> edge;
  dvec3 thickness{0.0};  // half of it, as a vector along the normal
};

/// Around the whole light. Flat lights use the light's outline.
LightHull make_light_hull(const LightBound& bound, const LightSamples& samples, const KernelSamples& kernel);

/// One per group of `group_size` consecutive samples of the kernel's order, each around these samples of all sets.
/// `group_size` is a multiple of KernelSamples::kGroup.
std::vector<LightHull> make_group_hulls(const LightSamples& samples, const KernelSamples& kernel,
                                        std::uint32_t group_size);

/// An intersection of half spaces normal . p >= offset.
struct PenumbraVolume {
  static constexpr std::uint32_t kMostPlanes = 16;
  using PlaneSet = std::uint32_t;  // bit k: plane k still has to be tested

  std::uint32_t count = 0;
  std::array<dvec3, kMostPlanes> normal;     // unit
  std::array<double, kMostPlanes> offset{};  // lowered by more than any rounding of normal . p

  PlaneSet all() const { return (PlaneSet{1} << count) - 1; }
};

/// `volume` gets the separating planes of hull and blocker, and the cap plane.
void make_penumbra_volume(const LightHull& hull, const std::array<vec3, 3>& blocker, PenumbraVolume& volume);

/// Does the box [low, high] meet the volume? Tests the planes of `active` and takes out those that the box lies inside
/// of. `tests` counts planes.
inline bool meets(const PenumbraVolume& volume, const vec3& low, const vec3& high, PenumbraVolume::PlaneSet& active,
                  std::uint64_t& tests) {
  // Sums and differences of lattice floats are exact in double.
  const dvec3 center = (dvec3(low) + dvec3(high)) * 0.5, half = (dvec3(high) - dvec3(low)) * 0.5;
  for (PenumbraVolume::PlaneSet rest = active; rest != 0; rest &= rest - 1) {
    const int k = __builtin_ctz(rest);
    const dvec3& n = volume.normal[static_cast<std::size_t>(k)];
    const double value = glm::dot(n, center) - volume.offset[static_cast<std::size_t>(k)];
    const double reach = glm::dot(glm::abs(n), half);
    ++tests;
    if (value + reach < 0.0) return false;
    if (value - reach >= 0.0) active &= ~(PenumbraVolume::PlaneSet{1} << k);
  }
  return true;
}

}  // namespace halfshade
