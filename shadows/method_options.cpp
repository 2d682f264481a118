#include "shadows/method_options.h"

#include <charconv>

namespace halfshade {
namespace {

[[noreturn]] void bad_value(const std::string& value, const std::string& allowed) {
  throw Error(ErrorCode::kUsage, "'" + value + "' is not " + allowed);
}

bool parse_switch(const std::string& value) {
  if (value == "on") return true;
  if (value != "off") bad_value(value, "on or off");
  return false;
}

template <class Number>
Number parse_number(const std::string& value, Number low, Number high) {
  Number number{};
  const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), number);
  if (error != std::errc() || end != value.data() + value.size() || !(number >= low && number <= high)) {
    bad_value(value, "in " + std::to_string(low) + ".." + std::to_string(high));
  }
  return number;
}

/// A field of the configuration, or of one method's part of it, as a function of the configuration.
#define HALFSHADE_SWITCH(field)                                                     \
  [](ShadowConfig& c, const std::string& value) { c.field = parse_switch(value); }, \
      [](const ShadowConfig& c) { return std::string(c.field ? "on" : "off"); }
#define HALFSHADE_NUMBER(field, low, high)                                                                        \
  [](ShadowConfig& c, const std::string& value) { c.field = parse_number<decltype(c.field)>(value, low, high); }, \
      [](const ShadowConfig& c) { return std::to_string(c.field); }

constexpr const char* kOutlines[] = {"hull", "hexagon", "octagon", "dodecagon", "aabb", "quad"};

void set_outline(ShadowConfig& c, const std::string& value) {
  for (std::size_t i = 0; i < std::size(kOutlines); ++i) {
    if (value == kOutlines[i]) return void(c.afsm.region = static_cast<InfluenceOutline>(i));
  }
  bad_value(value, "one of: hull, hexagon, octagon, dodecagon, aabb, quad");
}

void set_gears_region(ShadowConfig& c, const std::string& value) {
  if (value != "aabb" && value != "hull") bad_value(value, "aabb or hull");
  c.gears.region = value == "hull" ? GearsRegion::kHull : GearsRegion::kBox;
}

void set_stsv_opaque(ShadowConfig& c, const std::string& value) {
  if (value != "exact" && value != "volumes") bad_value(value, "exact or volumes");
  c.stsv.opaque = value == "volumes" ? OpaqueBlockers::kVolumes : OpaqueBlockers::kExact;
}

void set_stsv_filter(ShadowConfig& c, const std::string& value) {
  if (value != "nearest" && value != "filtered") bad_value(value, "nearest or filtered");
  c.stsv.filter = value == "filtered" ? OpacityFilter::kFiltered : OpacityFilter::kNearest;
}

constexpr MethodOption kOptions[] = {
    {"stsv.opaque", "opaque triangles by the exact engine, or through volumes too: exact, volumes (equal masks)",
     set_stsv_opaque,
     [](const ShadowConfig& c) {
       return std::string(c.stsv.opaque == OpaqueBlockers::kVolumes ? "volumes" : "exact");
     }},
    {"stsv.filter", "opacity at the texel, or averaged over a sample's footprint (no masks): nearest, filtered",
     set_stsv_filter,
     [](const ShadowConfig& c) {
       return std::string(c.stsv.filter == OpacityFilter::kFiltered ? "filtered" : "nearest");
     }},
    {"afsm.grid", "cells per axis of the light view, 16..2048; 0 = from the number of receivers",
     HALFSHADE_NUMBER(grid_resolution, 0, 2048)},
    {"afsm.back-faces", "skip front faces of certified closed meshes: on, off (exact too)",
     HALFSHADE_SWITCH(back_face_casters)},
    {"afsm.region", "outline of a blocker's region: hull, hexagon, octagon, dodecagon, aabb, quad (all exact)",
     set_outline,
     [](const ShadowConfig& c) { return std::string(kOutlines[static_cast<std::size_t>(c.afsm.region)]); }},
    {"afsm.fit", "grid fitted to the receivers instead of to the scene: on, off (exact too)",
     HALFSHADE_SWITCH(afsm.fit)},
    {"afsm.far-fit", "far plane at the farthest receiver instead of the scene's end: on, off (exact too)",
     HALFSHADE_SWITCH(afsm.far_fit)},
    {"afsm.skip-empty", "skip cells without receivers beyond the blocker: on, off (exact too)",
     HALFSHADE_SWITCH(afsm.skip_empty)},
    {"afsm.plane-cut", "skip cells that the blocker's own plane shields: on, off (exact too)",
     HALFSHADE_SWITCH(afsm.plane_cut)},
    {"afsm.cull-back-facing", "certified blockers that face away from the whole light are skipped: on, off (exact too)",
     HALFSHADE_SWITCH(afsm.cull_back_facing)},
    {"afsm.silhouettes", "closed meshes: one sample decides where no silhouette edge matters: on, off (exact too)",
     HALFSHADE_SWITCH(afsm.silhouettes)},
    {"afsm.table", "afsm-lut: steps per axis of the table of half-planes, 4..1024 (wrong bits fall as it grows)",
     HALFSHADE_NUMBER(afsm.table, 4, 1024)},
    {"hpc.umbra-bits", "A: leave out groups that a whole node sees nothing of: on, off",
     HALFSHADE_SWITCH(hpc.umbra_bits)},
    {"hpc.rebuild", "A: build a hierarchy anew when this share of it is in umbra, 0..1; 1 = never",
     HALFSHADE_NUMBER(hpc.rebuild, 0, 1)},
    {"hpc.plane-sets", "B: do not test planes again that a node lies inside of: on, off",
     HALFSHADE_SWITCH(hpc.plane_sets)},
    {"hpc.lazy-volumes", "C: make the volumes of groups when first needed: on, off",
     HALFSHADE_SWITCH(hpc.lazy_volumes)},
    {"hpc.masks-on-demand", "D: masks only for receivers in penumbra: on, off", HALFSHADE_SWITCH(hpc.masks_on_demand)},
    {"hpc.buckets", "blockers sorted into this many buckets by area, 0..256; 0 = scene order",
     HALFSHADE_NUMBER(hpc.area_buckets, 0, 256)},
    {"hpc.group", "light samples per group, a multiple of 16 in 16..4096", HALFSHADE_NUMBER(hpc.group, 16, 4096)},
    {"hpc.leaf", "receivers per leaf, 1..1024", HALFSHADE_NUMBER(hpc.leaf, 1, 1024)},
    {"hpc.weigh-split", "split nodes by area times points instead of area alone: on, off",
     HALFSHADE_SWITCH(hpc.weigh_split)},
    {"gears.grid", "cells per axis of the grid, 8..1024; 0 = from the number of receivers",
     HALFSHADE_NUMBER(gears.grid, 0, 1024)},
    {"gears.region", "bound of a shadow volume's projection: aabb, hull", set_gears_region,
     [](const ShadowConfig& c) { return std::string(c.gears.region == GearsRegion::kHull ? "hull" : "aabb"); }},
    {"gears.refine", "drop cells without receivers in the 3-D frustum around the shadow volume: on, off",
     HALFSHADE_SWITCH(gears.refine)},
    {"gears.subdivide", "cells with many receivers get a grid of their own: on, off",
     HALFSHADE_SWITCH(gears.subdivide)},
    {"gears.bounds", "cells shrink to the box and depth of their receivers, volumes to that depth: on, off",
     HALFSHADE_SWITCH(gears.bounds)},
    {"gears.coarse", "one pair for 8x8 cells that a region covers: on, off", HALFSHADE_SWITCH(gears.coarse)},
    {"gears.camera", "distance of the camera behind the light in diagonals of the light, 0..16",
     HALFSHADE_NUMBER(gears.camera, 0, 16)},
    {"gears.pair-budget", "most (triangle, cell) pairs held at once, 1..2147483648; 16 bytes each",
     HALFSHADE_NUMBER(gears.pair_budget, 1, 2147483648u)},
    {"gears.study", "count necessary assignments, and samples in box, hull and frustum (slow): on, off",
     HALFSHADE_SWITCH(gears.study)},
    {"map.resolution", "lexels along the longer side of every shadow map, 16..8192",
     HALFSHADE_NUMBER(shadow_map.resolution, 16, 8192)},
    {"map.bias", "lexel widths by which a lexel must lie nearer to the light than the receiver, 0..64",
     HALFSHADE_NUMBER(shadow_map.bias, 0.0f, 64.0f)},
    {"map.slope-bias", "lexel widths by which its point must lie above the receiver's tangent plane, 0..64",
     HALFSHADE_NUMBER(shadow_map.slope_bias, 0.0f, 64.0f)},
    {"pcf.radius", "(2 radius + 1)^2 lexels are compared, 0..64", HALFSHADE_NUMBER(shadow_map.pcf_radius, 0, 64)},
    {"pcss.search", "lookups per axis of the blocker search, 1..64", HALFSHADE_NUMBER(shadow_map.pcss_search, 1, 64)},
    {"pcss.filter", "lookups per axis of the filter, 1..64", HALFSHADE_NUMBER(shadow_map.pcss_filter, 1, 64)},
    {"shadow-accumulation.kernel", "lookups per axis (the paper's K), 1..64",
     HALFSHADE_NUMBER(shadow_map.kernel, 1, 64)},
    {"shadow-accumulation.form", "bits: every part of the light counts once; sum: areas of casters are added",
     [](ShadowConfig& c, const std::string& value) {
       if (value != "bits" && value != "sum") bad_value(value, "one of: bits, sum");
       c.shadow_map.form = value == "sum" ? AccumulationForm::kSum : AccumulationForm::kBits;
     },
     [](const ShadowConfig& c) { return std::string(c.shadow_map.form == AccumulationForm::kSum ? "sum" : "bits"); }},
    {"shadow-accumulation.layers", "depth layers peeled at most, 1..64", HALFSHADE_NUMBER(shadow_map.layers, 1, 64)},
    {"shadow-accumulation.refine",
     "second kernel, as small as the casters found by the first allow: on, off (the paper)",
     HALFSHADE_SWITCH(shadow_map.refine)},
    {"shadow-accumulation.plane", "distance of the map plane in light radii, 1..1e6; 0 = at the nearest caster",
     [](ShadowConfig& c, const std::string& value) {
       c.shadow_map.plane = parse_number<float>(value, 0.0f, 1e6f);
       if (c.shadow_map.plane > 0.0f && c.shadow_map.plane < 1.0f) bad_value(value, "0 or in 1..1e6");
     },
     [](const ShadowConfig& c) { return std::to_string(c.shadow_map.plane); }},
    {"raytrace.mode", "robust: Embree's watertight mode; fast: its fastest",
     [](ShadowConfig& c, const std::string& value) {
       if (value != "robust" && value != "fast") bad_value(value, "one of: robust, fast");
       c.raytrace.robust = value == "robust";
     },
     [](const ShadowConfig& c) { return std::string(c.raytrace.robust ? "robust" : "fast"); }},
};

}  // namespace

std::span<const MethodOption> method_options() { return kOptions; }

bool concerns(const MethodOption& option, ShadowMethod method) {
  const std::string name = option.name;
  const bool uses_maps = method == ShadowMethod::kShadowAccumulation ||
                         (method >= ShadowMethod::kShadowMap && method <= ShadowMethod::kShadowMapPerSample);
  return name.starts_with(traits_of(method).name + std::string(".")) || (uses_maps && name.starts_with("map.")) ||
         (method == ShadowMethod::kAliasFreeLookupTable && name.starts_with("afsm."));
}

void set_method_option(ShadowConfig& config, const std::string& assignment) {
  const std::size_t equals = assignment.find('=');
  const std::string name = assignment.substr(0, equals);
  std::string known;
  for (const MethodOption& option : kOptions) {
    known += (known.empty() ? "" : ", ") + std::string(option.name);
    if (name != option.name) continue;
    if (equals == std::string::npos) throw Error(ErrorCode::kUsage, "option '" + name + "' needs '=value'");
    try {
      option.set(config, assignment.substr(equals + 1));
    } catch (const Error& e) {
      throw Error(e.code(), "option '" + name + "': " + e.what());
    }
    return;
  }
  throw Error(ErrorCode::kUsage, "option '" + name + "' is not one of: " + known);
}

}  // namespace halfshade
