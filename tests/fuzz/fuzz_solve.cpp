// Small scenes, lights and receivers made of the input's bytes, degenerate and broken ones among them. What the oracle
// answers, an exact method must answer bit by bit; what it refuses, the method must refuse. Last, an emission image.
#include <cmath>

#include "fuzz/coordinates.h"
#include "halfshade/emission.h"
#include "halfshade/shadows.h"

namespace halfshade::fuzz {
namespace {

class SceneReader {
 public:
  explicit SceneReader(Bytes input) : in_(input) {}

  ShadowConfig config() {
    constexpr ShadowMethod methods[] = {ShadowMethod::kExact, ShadowMethod::kAliasFreeShadowMap,
                                        ShadowMethod::kHierarchicalPenumbraCasting, ShadowMethod::kGears,
                                        ShadowMethod::kSoftTexturedShadowVolumes};
    constexpr std::uint32_t counts[] = {1, 2, 7, 16, 17, 64, 65};
    ShadowConfig config;
    config.method = methods[in_.below(std::size(methods))];
    config.light_sample_count = counts[in_.below(std::size(counts))];
    config.pattern = static_cast<SamplePattern>(in_.below(5));
    config.sample_sets = 1 + in_.below(3);
    const std::uint32_t bits = in_.byte();
    config.interleave = (bits & 1) != 0;
    config.rotate_sets = (bits & 2) != 0;
    config.back_face_casters = (bits & 4) == 0;
    config.afsm.silhouettes = (bits & 8) == 0;
    config.hpc.leaf = (bits & 16) != 0 ? 1 : 16;
    config.hpc.group = (bits & 32) != 0 ? 16 : 32;
    config.gears.region = (bits & 64) != 0 ? GearsRegion::kHull : GearsRegion::kBox;
    config.stsv.opaque = (bits & 128) != 0 ? OpaqueBlockers::kVolumes : OpaqueBlockers::kExact;
    return config;
  }

  Light light() {
    Light light;
    light.shape = static_cast<LightShape>(in_.below(7));
    light.two_sided = in_.flag();
    light.center = in_.point();
    light.u = in_.point(), light.v = in_.point();
    light.normal = light.u;
    light.radius = std::fabs(in_.coordinate());
    light.axes = {light.u, light.v, in_.point()};
    if (light.shape == LightShape::kSamples || light.shape == LightShape::kPolygon) {
      for (std::uint32_t n = in_.below(6); n > 0; --n) light.points.push_back(in_.point());
    }
    return light;
  }

  Scene scene() {
    Scene scene;
    scene.materials.resize(2);
    const std::uint32_t alpha = in_.byte();  // half of the scenes have a perforated material
    const bool perforated = (alpha & 1) != 0;
    if (perforated) {
      scene.materials[1].alpha_map = 0;
      scene.alpha_maps.push_back({"a", 2, 2, {255, 0, 0, static_cast<std::uint8_t>(alpha)}});
    }
    if ((alpha & 6) == 6) scene.materials[0].opacity = 0.5f;
    for (std::uint32_t n = in_.below(24); n > 0; --n) scene.positions.push_back(in_.point());
    const auto points = static_cast<std::uint32_t>(scene.positions.size());
    for (std::uint32_t n = in_.below(24); n > 0 && points > 0; --n) {
      const auto index = [&] { return in_.broken() ? in_.take<std::uint32_t>() : in_.below(points); };
      const std::uint32_t a = index(), b = index(), c = index();
      scene.triangles.push_back({a, b, c});
      scene.triangle_materials.push_back(in_.flag());
      if (perforated) {
        const auto uv = [&] {
          return vec2{static_cast<float>(in_.coordinate()), static_cast<float>(in_.coordinate())};
        };
        const vec2 first = uv(), second = uv();
        scene.triangle_uvs.push_back({first, second, uv()});
      }
    }
    return scene;
  }

  std::vector<Receiver> receivers(std::size_t triangles) {
    std::vector<Receiver> result;
    for (std::uint32_t n = in_.below(12); n > 0; --n) {
      const dvec3 p = in_.point();
      const bool owned = triangles > 0 && in_.flag();
      const auto last = static_cast<std::uint32_t>(triangles);
      result.push_back({p, owned ? (in_.broken() ? in_.take<std::uint32_t>() : in_.below(last)) : kNone});
    }
    return result;
  }

  /// Sometimes with texels too many or too few, or with one that nothing can emit.
  EmissionImage image() {
    EmissionImage image{"", in_.below(5), in_.below(5), {}};
    image.rgb.resize(image.width * image.height, vec3(1.0f));
    if (in_.broken()) image.rgb.resize(in_.below(30));
    if (in_.broken()) image.width = in_.take<std::uint32_t>();
    for (std::uint32_t n = in_.below(4); n > 0 && !image.empty(); --n) {
      vec3& texel = image.rgb[in_.below(static_cast<std::uint32_t>(image.rgb.size()))];
      texel = vec3(in_.flag() ? in_.take<float>() : static_cast<float>(in_.byte()));
    }
    return image;
  }

 private:
  CoordinateReader in_;
};

/// Is the image refused exactly where EmissionImage says that it cannot be, and is what is read of it light?
void check_emission(const EmissionImage& image, const ShadowConfig& config) {
  bool good = !image.empty() && image.rgb.size() == std::uint64_t{image.width} * image.height;
  for (const vec3& texel : image.rgb) {
    for (int k = 0; k < 3; ++k) good &= std::isfinite(texel[k]) && texel[k] >= 0.0f;
  }
  Light light;
  light.emission_image = image;
  std::vector<vec3> weights;
  const Refusal refusal = refusal_of([&] { weights = sample_emission(light, config); });
  require(refusal.refused == !good, "emission images are refused where they are wrong: " + refusal.message);
  for (const vec3& weight : weights) {
    for (int k = 0; k < 3; ++k) require(std::isfinite(weight[k]) && weight[k] >= 0.0f, "weights are light");
  }
}

}  // namespace

void fuzz_solve(Bytes input) {
  SceneReader in(input);
  ShadowConfig config = in.config();
  const Light light = in.light();
  const Scene scene = in.scene();
  const std::vector<Receiver> receivers = in.receivers(scene.triangles.size());
  VisibilityMasks masks, truth;
  const Refusal refusal = refusal_of([&] { solve_shadows(scene, receivers, light, config, masks); });
  const ShadowMethod method = config.method;
  config.method = ShadowMethod::kOracle;
  const Refusal of_oracle = refusal_of([&] { solve_shadows(scene, receivers, light, config, truth); });
  const std::string name = std::string("method ") + traits_of(method).name;
  require(refusal.refused == of_oracle.refused, name + " refuses what the oracle refuses: " + refusal.message);
  if (!refusal.refused) require(masks.words == truth.words, name + " has the oracle's bits");
  check_emission(in.image(), config);
}

}  // namespace halfshade::fuzz
