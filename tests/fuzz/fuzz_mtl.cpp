// MTL text: parsed by itself, and as the library of an OBJ.
#include <cmath>

#include "fuzz/fuzz_target.h"
#include "rasterizer/io/material_file.h"
#include "rasterizer/io/obj_scene.h"

namespace halfshade::fuzz {
namespace {

bool is_color(const vec3& c) {
  for (int k = 0; k < 3; ++k) {
    if (!(c[k] >= 0.0f && c[k] <= 1e6f)) return false;
  }
  return true;
}

std::vector<MtlMaterial> parse(Bytes input, bool lenient, Refusal& refusal) {
  std::vector<MtlMaterial> materials;
  std::vector<std::string> warnings;
  refusal = refusal_of([&] { materials = parse_mtl(as_text(input), "input.mtl", lenient, warnings); });
  for (const MtlMaterial& m : materials) {
    require(is_color(m.material.diffuse) && is_color(m.material.transmittance), "colours are 0..1e6");
    require(m.material.opacity >= 0.0f && m.material.opacity <= 1.0f, "opacity is 0..1");
  }
  return materials;
}

bool equal(const MtlMaterial& a, const MtlMaterial& b) {
  return a.material.name == b.material.name && a.material.diffuse == b.material.diffuse &&
         a.material.opacity == b.material.opacity && a.material.transmittance == b.material.transmittance &&
         a.color_file.name == b.color_file.name && a.alpha_file.name == b.alpha_file.name &&
         a.filter_file.name == b.filter_file.name;
}

/// Uses the first three materials of the library.
void load_with_scene(Bytes input, const std::vector<MtlMaterial>& materials) {
  write_file("input.mtl", as_text(input));
  std::string obj = "mtllib input.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n";
  for (std::size_t i = 0; i < materials.size() && i < 3; ++i) {
    obj += "usemtl " + materials[i].material.name + "\nf 1/1 2/1 3/1\n";
  }
  const auto file = write_file("uses.obj", obj);
  Scene scene;
  ObjLoadReport report;
  const Refusal refusal = refusal_of([&] { scene = load_obj(file, {.max_texture_bytes = 1 << 20}, report); });
  if (refusal.refused) return;
  for (const Material& m : scene.materials) {
    const auto in = [](std::uint32_t map, const auto& maps) { return map == kNone || map < maps.size(); };
    require(in(m.color_map, scene.color_maps) && in(m.alpha_map, scene.alpha_maps) &&
                in(m.transmittance_map, scene.color_maps),
            "maps are in range");
  }
}

}  // namespace

void fuzz_mtl(Bytes input) {
  Refusal strict_refusal, lenient_refusal;
  const auto strict = parse(input, false, strict_refusal), lenient = parse(input, true, lenient_refusal);
  if (strict_refusal.refused) {
    require(strict_refusal.message.starts_with("input.mtl:"), "messages name file and line");
    return;
  }
  require(!lenient_refusal.refused && strict.size() == lenient.size(), "lenient takes what strict takes");
  for (std::size_t i = 0; i < strict.size(); ++i) require(equal(strict[i], lenient[i]), "strict and lenient agree");
  load_with_scene(input, strict);
}

}  // namespace halfshade::fuzz
