// The terminator in the failure atlas: a coarse sphere with smooth normals, where interpolated normals light facets
// that face away from the light (Sintorn et al. 2008, section 4.3).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace halfshade {

struct TerminatorPicture {
  std::string id, why;
  std::vector<float> shade;       // [row][column]: cosine times visibility
  double lit_facing_away = 0.0;   // share of the pixels on facets that face away from the light which are lit
  std::uint64_t facing_away = 0;  // how many these are
};

struct Terminator {
  std::string title, what, truth_is;
  std::uint32_t side = 0;
  std::vector<float> truth;  // the same sphere, finely tessellated
  std::vector<TerminatorPicture> pictures;
};

Terminator make_terminator(std::uint32_t side);

}  // namespace halfshade
