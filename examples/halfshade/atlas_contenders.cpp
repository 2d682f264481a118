// Who is asked in every entry of the atlas, and how each fails in general.
#include <algorithm>

#include "atlas_entry.h"
#include "halfshade/error.h"
#include "shadows/method_options.h"
#include "shadows/raytrace/embree_rays.h"

namespace halfshade {
namespace {

struct Standard {
  const char* id;
  ShadowMethod method;
  std::initializer_list<const char*> options;
  const char* why;
};

AtlasContender contender_of(const Standard& s, std::uint32_t samples) {
  AtlasContender contender{s.id, {}, {}, s.why};
  contender.config.method = s.method;
  contender.config.light_sample_count = samples;
  contender.config.pattern = SamplePattern::kUniform;
  contender.config.shadow_map.resolution = 512;
  contender.config.stsv.opaque = OpaqueBlockers::kVolumes;  // by volumes, not by the exact engine
  for (const char* option : s.options) set_method_option(contender.config, option);
  return contender;
}

}  // namespace

std::vector<AtlasContender> standard_contenders(std::uint32_t samples) {
  const Standard standards[] = {
      {"exact", ShadowMethod::kExact, {}, ""},
      {"afsm", ShadowMethod::kAliasFreeShadowMap, {}, ""},
      {"hpc", ShadowMethod::kHierarchicalPenumbraCasting, {}, ""},
      {"gears", ShadowMethod::kGears, {}, ""},
      {"stsv", ShadowMethod::kSoftTexturedShadowVolumes, {}, ""},
      {"afsm-lut",
       ShadowMethod::kAliasFreeLookupTable,
       {},
       "Edges of triangles are moved to the nearest of the table's planes: samples near an edge change sides."},
      {"raytrace robust",
       ShadowMethod::kRaytrace,
       {"raytrace.mode=robust"},
       "Rays in single precision: segments near an edge may go either way."},
      {"raytrace fast",
       ShadowMethod::kRaytrace,
       {"raytrace.mode=fast"},
       "Rays in single precision without Embree's watertight test: segments near edges may pass."},
      {"shadow-maps",
       ShadowMethod::kShadowMapPerSample,
       {},
       "A lexel's centre answers for all of it: edges move by up to a lexel, contacts within the bias are lit."},
      {"pcss",
       ShadowMethod::kPercentageCloserSoftShadows,
       {},
       "One map from the light's centre, one mean blocker depth per receiver, and every light is a disk."},
      {"pcf",
       ShadowMethod::kPercentageCloserFiltering,
       {},
       "The penumbra is a fixed number of lexels wide, whatever the light and the distances."},
      {"shadow-map", ShadowMethod::kShadowMap, {}, "It knows the light's centre alone: no penumbra."},
      {"accumulation bits",
       ShadowMethod::kShadowAccumulation,
       {},
       "One map from the light's centre: casters that its first layer does not show are lost; every light is a disk."},
      {"accumulation bits, 8 layers",
       ShadowMethod::kShadowAccumulation,
       {"shadow-accumulation.layers=8"},
       "A square of few lexels stands for each caster, and every light is a disk."},
      {"accumulation sum",
       ShadowMethod::kShadowAccumulation,
       {"shadow-accumulation.form=sum", "shadow-accumulation.refine=off"},
       "Areas of enlarged lexels are added up: overlaps count twice, and few large ones overshoot or miss."}};
  std::vector<AtlasContender> contenders;
  for (const Standard& s : standards) {
    if (s.method == ShadowMethod::kRaytrace && !embree_available()) continue;
    contenders.push_back(contender_of(s, samples));
  }
  return contenders;
}

void AtlasEntry::explain(std::initializer_list<const char*> ids, const std::string& why) {
  for (AtlasContender& contender : contenders) {
    if (std::find(ids.begin(), ids.end(), contender.id) != ids.end()) contender.why = why;
  }
}

void AtlasEntry::add_variant(const std::string& name, const char* base, std::initializer_list<const char*> options,
                             const std::string& why) {
  const auto found =
      std::find_if(contenders.begin(), contenders.end(), [&](const AtlasContender& c) { return c.id == base; });
  if (found == contenders.end()) throw Error(ErrorCode::kUsage, "no contender '" + std::string(base) + "'");
  AtlasContender contender = *found;
  contender.id = name;
  if (!why.empty()) contender.why = why;
  for (const char* option : options) set_method_option(contender.config, option);
  contenders.push_back(std::move(contender));
}

void AtlasEntry::add_textbook(TextbookForm form, const std::string& why) {
  AtlasContender contender{"textbook: " + std::string(name_of(form)), contenders.front().config, form, why};
  contenders.push_back(std::move(contender));
}

}  // namespace halfshade
