// The shadow methods, and what only one of them understands.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "halfshade/export.h"

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
HALFSHADE_API std::span<const MethodTraits> shadow_methods();
HALFSHADE_API const MethodTraits& traits_of(ShadowMethod method);

/// Outline of the part of the light view that a blocker can matter to. All hold the region; they differ in how tightly.
enum class InfluenceOutline {
  kHull,       // hull of the light's own outline seen through the corners; spheres: a hexagon around their silhouette
  kHexagon,    // the same with 6, 8 or 12 corners around the silhouette of the light's bounding sphere
  kOctagon,    //
  kDodecagon,  //
  kBox,        // box of the hull along the grid's axes
  kQuad,       // smallest rectangle around the hull
};

/// afsm, afsm-lut. No option changes a bit of afsm; the approximate masks of afsm-lut depend on all of them.
struct AliasFreeOptions {
  InfluenceOutline region = InfluenceOutline::kHull;
  bool fit = true;               // grid over the receivers' slopes; otherwise over those of the whole scene
  bool far_fit = true;           // far plane at the farthest receiver; otherwise at the scene's farthest corner
  bool skip_empty = true;        // skip cells without receivers beyond the blocker
  bool plane_cut = true;         // skip cells whose receivers lie where the blocker's plane shields them
  bool cull_back_facing = true;  // certified blockers that face away from the whole light skip cells outside their box
  bool silhouettes = true;       // closed meshes: soft tests only where a silhouette edge matters, elsewhere one sample
  std::uint32_t table = 128;     // afsm-lut: steps per axis of the table, 4..1024
};

/// hpc. Letters are those of the paper's section 3.3; nothing here changes a bit, only time and memory.
struct PenumbraCastingOptions {
  bool umbra_bits = true;           // A: nodes know which groups of samples none of their receivers sees any more
  float rebuild = 0.25f;            // A: a hierarchy is built anew when this share of it is in umbra; 1 = never
  bool plane_sets = true;           // B: planes that a node lies inside of are not tested again below it
  bool lazy_volumes = true;         // C: volumes of groups are made when the first receiver needs them
  bool masks_on_demand = true;      // D: receivers get a mask when first needed and lose it in umbra
  std::uint32_t area_buckets = 16;  // blockers are sorted into this many buckets by area, 0..256; 0 = scene order
  std::uint32_t group = 32;         // light samples per group, 16..4096, a multiple of 16
  std::uint32_t leaf = 16;          // receivers per leaf, 1..1024
  bool weigh_split = false;         // split nodes by area times points instead of area alone
};

/// How gears bounds the cells that a blocker's shadow volume touches.
enum class GearsRegion {
  kBox,   // box along the grid's axes around the projected extrusion points, as in the paper
  kHull,  // their convex hull as well
};

/// gears. None of them changes a mask.
struct GearsOptions {
  std::uint32_t grid = 0;  // cells per axis, 8..1024; 0 = from the number of receivers
  GearsRegion region = GearsRegion::kBox;
  bool refine = false;  // keep a (blocker, cell) pair only if a receiver of the cell is in the 3-D frustum (figure 11)
  bool subdivide = true;  // cells with many receivers get a grid of their own
  bool bounds = true;     // cells shrink to the box and depth of their receivers, and shadow volumes to that depth
  bool coarse = true;     // regions that cover 8x8 cells, or a whole subdivided one, are noted once for all of them
  double camera = 0.25;   // distance of the camera C behind the light, in diagonals of the light, 0..16
  std::uint32_t pair_budget = 1u << 22;  // most (blocker, cell) pairs held at once, 1..2^31; 16 bytes each
  bool study = false;  // count how many assignments were necessary and tight (section 5.3): every pair by itself, slow
};

/// Who decides about opaque triangles in stsv; equal masks.
enum class OpaqueBlockers {
  kExact,    // the exact engine, perforated triangles alone make volumes
  kVolumes,  // they make volumes as well
};

/// How stsv reads opacity textures.
enum class OpacityFilter {
  kNearest,   // the texel under each segment: exact
  kFiltered,  // averaged over the part of the texture that a sample's share of the light covers: no masks, approximate
};

/// stsv.
struct ShadowVolumeOptions {
  OpaqueBlockers opaque = OpaqueBlockers::kExact;
  OpacityFilter filter = OpacityFilter::kNearest;
};

/// How shadow-accumulation joins what its lexels hide.
enum class AccumulationForm {
  kBits,  // one bit per part of the light, set once however many casters hide it (the paper's equation 1)
  kSum,   // areas added up; casters that overlap count twice (equations 2 and 3)
};

/// shadow-map, pcf, pcss, shadow-maps, shadow-accumulation: `resolution` and the two biases belong to all of them.
struct ShadowMapOptions {
  std::uint32_t resolution = 1024;  // lexels along the longer side of every map, 16..8192
  /// A lexel hides a receiver where its depth is smaller than the receiver's by more than `bias` lexel widths, and its
  /// point lies above the receiver's tangent plane by more than `slope_bias` lexel widths; 0..64 each.
  float bias = 0.5f, slope_bias = 0.5f;
  std::uint32_t pcf_radius = 2;    // pcf: (2 radius + 1)^2 lexels are compared, 0..64
  std::uint32_t pcss_search = 9;   // pcss: lookups per axis of the blocker search, 1..64
  std::uint32_t pcss_filter = 15;  // pcss: lookups per axis of the filter, 1..64
  std::uint32_t kernel = 10;       // shadow-accumulation: lookups per axis (the paper's K), 1..64
  AccumulationForm form = AccumulationForm::kBits;
  std::uint32_t layers = 1;  // shadow-accumulation: depth layers peeled at most, 1..64
  bool refine = true;  // shadow-accumulation: a second kernel, no larger than the casters that the first one saw need
  float plane = 0.0f;  // shadow-accumulation: the map plane's distance in light radii, 1..1e6; 0 = nearest caster
};

/// raytrace.
struct RaytraceOptions {
  bool robust = true;  // Embree's robust traversal and intersection; otherwise its fastest
};

}  // namespace halfshade
