// Takes the place of embree_rays.cpp where Embree was not found: there are no modes, so nothing is ever traced.
#include "shadows/raytrace/embree_rays.h"

namespace halfshade {

struct EmbreeRays::State {};

std::string EmbreeMode::name() const { return "none"; }
std::vector<EmbreeMode> embree_modes(std::uint32_t) { return {}; }
EmbreeMode best_embree_mode(std::uint32_t, bool) { return {}; }
EmbreeRays::EmbreeRays(const LatticeMesh&, const ReceiverArray&, const LightSamples&, int) {}
EmbreeRays::~EmbreeRays() = default;
double EmbreeRays::build_ms(const EmbreeMode&) { return 0.0; }
void EmbreeRays::trace(const EmbreeMode&, std::span<const std::uint32_t>, VisibilityMasks&) const {}
bool embree_available() { return false; }

}  // namespace halfshade
