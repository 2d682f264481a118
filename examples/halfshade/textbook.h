// Shadow tests in the form in which papers sketch them, brute force: what the failure atlas shows beside the methods
// that avoid the sketch's fault. Not methods of the library: each is wrong on purpose in one way, exact in all others.
#pragma once

#include "halfshade/light.h"
#include "shadows/receivers.h"

namespace halfshade {

enum class TextbookForm {
  kFloatRays,      // ray against triangle in single precision, in world coordinates
  kBackFacesOnly,  // only triangles wound to face away from the light's centre cast (Sintorn et al. 2008, section 3.3)
  kCenterVolumes,  // a volume has its inside where the light's centre says; none if the centre lies in the plane
  kAddedCoverage,  // shares of the light hidden by single triangles are added up, as penumbra wedges do
  kFarPlane,  // a triangle concerns the box around its corners' projections to a far plane, behind the light or not
};

const char* name_of(TextbookForm form);

/// `world` are the receivers before they were rounded to the lattice. Fills `masks`, except for kAddedCoverage, and
/// `visibility`. Runs in the calling thread's TBB arena.
void solve_textbook(TextbookForm form, const LatticeMesh& mesh, const ReceiverArray& receivers,
                    std::span<const dvec3> world, const LightSamples& samples, VisibilityMasks& masks,
                    std::vector<float>& visibility);

}  // namespace halfshade
