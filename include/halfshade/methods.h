// The shadow methods, and what only one of them understands.
#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace halfshade {

enum class ShadowMethod {
  kExact,                        // "exact": ours, receivers gather from a tree of blockers
  kAliasFreeShadowMap,           // "afsm": Sintorn, Eisemann, Assarsson 2008
  kAliasFreeLookupTable,         // "afsm-lut": the same with the paper's table of half-plane masks
  kHierarchicalPenumbraCasting,  // "hpc": Laine, Aila 2005
  kGears,                        // "gears": Wang et al. 2014
  kSoftTexturedShadowVolumes,    // "stsv": Forest, Barthe, Paulin 2009
  kShadowAccumulation,           // "shadow-accumulation": Aszodi, Szirmay-Kalos 2006
  kShadowMap,                    // "shadow-map": one map from the light's centre
  kPercentageCloserFiltering,    // "pcf"
  kPercentageCloserSoftShadows,  // "pcss"
  kShadowMapPerSample,           // "shadow-maps": one map per light sample
  kRaytrace,                     // "raytrace": shadow rays through Embree; only where Embree was built in
  kOracle,                       // "oracle": brute force over all triangles, for checking; slow
};

/// What a method promises.
struct MethodTraits {
  ShadowMethod method;
  const char* name;
  bool exact;  // masks equal the oracle's in every bit
  bool masks;  // yields masks (solve_shadows); the others yield visibility only (solve_visibility)
};

/// All methods, in the order of the enumeration.
std::span<const MethodTraits> shadow_methods();
const MethodTraits& traits_of(ShadowMethod method);

/// afsm, afsm-lut.
struct AliasFreeOptions {};

/// hpc.
struct PenumbraCastingOptions {};

/// gears.
struct GearsOptions {};

/// stsv.
struct ShadowVolumeOptions {};

/// shadow-accumulation, shadow-map, pcf, pcss, shadow-maps.
struct ShadowMapOptions {};

}  // namespace halfshade
