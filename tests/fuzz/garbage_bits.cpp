// S35: meshes of random bits are refused with the number of what is wrong, or solved, and cost no more than clean ones.
#include <cmath>
#include <ctime>
#include <limits>

#include <doctest/doctest.h>
#include <tbb/global_control.h>

#include "support/lit_scene.h"

namespace halfshade {
namespace {

enum class Kind { kDoubleBits, kFloatBits, kDenormals, kIndexBits, kUvBits, kLightBits, kCount };

struct Case {
  Scene scene;
  std::vector<Receiver> receivers;
  Light light = test::frame_light();
  std::string fault;  // start of the message, empty where nothing is wrong
};

class Garbage {
 public:
  explicit Garbage(std::uint64_t seed) : random_(seed) {}

  Case clean() {
    Case c;
    const auto size = 1 + static_cast<int>(random_.engine() % 16);
    c.scene = test::scene_of(test::random_triangles(random_, size, 1.0));
    c.receivers = test::receivers_at(test::random_points(random_, 4, -4.0, 2.0));
    return c;
  }

  Case make(Kind kind) {
    Case c = clean();
    switch (kind) {
      case Kind::kDoubleBits:
      case Kind::kFloatBits:
      case Kind::kDenormals:
        for (dvec3& p : c.scene.positions) {
          for (int axis = 0; axis < 3; ++axis) p[axis] = coordinate(kind);
        }
        c.fault = fault_of(c.scene);
        break;
      case Kind::kIndexBits:
        spoil_index(c);
        break;
      case Kind::kUvBits:
        spoil_uvs(c);
        break;
      default:
        spoil_light(c);
    }
    return c;
  }

 private:
  double coordinate(Kind kind) {
    const std::uint64_t bits = random_.engine();
    if (kind == Kind::kDoubleBits) return std::bit_cast<double>(bits);
    if (kind == Kind::kFloatBits) return std::bit_cast<float>(static_cast<std::uint32_t>(bits));
    return std::bit_cast<double>(bits & 0x800fffffffffffffull);
  }

  static std::string fault_of(const Scene& scene) {
    dvec3 low = scene.positions[0], high = low;
    for (std::size_t i = 0; i < scene.positions.size(); ++i) {
      if (!is_finite(scene.positions[i])) return "position " + std::to_string(i) + " is not finite";
      low = glm::min(low, scene.positions[i]), high = glm::max(high, scene.positions[i]);
    }
    return is_finite(high - low) ? "" : "the scene's extent is not finite";
  }

  static bool is_finite(const dvec3& p) { return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z); }

  void spoil_index(Case& c) {
    auto& triangles = c.scene.triangles;
    const std::size_t t = random_.engine() % triangles.size();
    const auto bits = static_cast<std::uint32_t>(random_.engine());
    const std::uint32_t number = bits % 4 == 0 ? bits % 64 : bits;
    const std::string range = std::string(" ").append(std::to_string(number)).append(" is out of range");
    if (bits % 3 == 0) {
      triangles[t][bits % 2] = number;
      if (number >= c.scene.positions.size()) c.fault = "triangle " + std::to_string(t) + ": position" + range;
    } else if (bits % 3 == 1) {
      c.scene.triangle_materials[t] = number;
      if (number >= 1) c.fault = "triangle " + std::to_string(t) + ": material" + range;
    } else {
      c.receivers[2].triangle = number;
      if (number >= triangles.size() && number != kNone) c.fault = "receiver 2: own triangle" + range;
    }
  }

  void spoil_uvs(Case& c) {
    c.scene.alpha_maps.push_back({"a", 2, 2, {255, 0, 0, 255}});
    c.scene.materials[0].alpha_map = 0;
    c.scene.triangle_uvs.resize(c.scene.triangles.size());
    for (std::size_t t = 0; t < c.scene.triangles.size(); ++t) {
      for (vec2& uv : c.scene.triangle_uvs[t]) {
        // Half of the scenes keep within what is allowed.
        const auto bits = static_cast<std::uint32_t>(random_.engine());
        const float u = std::bit_cast<float>(bits), v = std::bit_cast<float>(bits * 2654435761u);
        const bool tame = c.scene.triangles.size() % 2 == 0;
        const auto in = [&](float x) { return !tame || std::fabs(x) <= 0x1p30f ? x : 0.5f; };
        uv = {in(u), in(v)};
        const bool wrong = !(std::fabs(uv.x) <= 0x1p30f && std::fabs(uv.y) <= 0x1p30f);
        if (wrong && c.fault.empty()) c.fault = "triangle " + std::to_string(t) + ": a texture coordinate";
      }
    }
  }

  void spoil_light(Case& c) {
    const std::uint64_t choice = random_.engine();
    c.light.shape = choice % 2 == 0 ? LightShape::kRectangle : LightShape::kSphere;
    dvec3& target = choice % 4 < 2 ? c.light.center : c.receivers[1].position_world;
    for (int axis = 0; axis < 3; ++axis) target[axis] = coordinate(Kind::kDoubleBits);
    c.light.radius = 1.0;
    c.fault = is_finite(target) ? "" : "light 'light': a coordinate or the extent is not finite";
    if (&target != &c.light.center && !is_finite(target)) c.fault = "receiver 1: the position is not finite";
    // A box corner beyond the largest double is an extent that is not finite.
    if (c.fault.empty() && std::max({std::fabs(target.x), std::fabs(target.y), std::fabs(target.z)}) > 0x1p1022) {
      c.fault = "?";
    }
  }

  test::Random random_;
};

double seconds_of(const std::function<void()>& call) {
  const std::clock_t start = std::clock();
  call();
  return static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
}

struct Totals {
  double garbage_seconds = 0.0, clean_seconds = 0.0;
  std::size_t solved = 0, refused = 0;
};

/// Solves, or checks that the refusal names what is wrong. Returns false for a refusal.
bool solve_or_refuse(const Case& c, const ShadowConfig& config, VisibilityMasks& masks) {
  try {
    solve_shadows(c.scene, c.receivers, c.light, config, masks);
  } catch (const Error& error) {
    CAPTURE(error.what());
    CAPTURE(c.fault);
    CHECK(error.code() == ErrorCode::kBadInput);
    CHECK_FALSE(c.fault.empty());
    if (c.fault != "?") CHECK(std::string_view(error.what()).starts_with(c.fault));
    return false;
  }
  if (c.fault != "?") CHECK(c.fault == "");
  return true;
}

void run(std::size_t meshes, std::uint64_t seed) {
  const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
  Garbage garbage(seed);
  Totals totals;
  ShadowConfig config = test::frame_config(64);
  for (std::size_t i = 0; i < meshes; ++i) {
    CAPTURE(i);
    const auto& methods = test::exact_methods();
    config.method = methods[i / static_cast<std::size_t>(Kind::kCount) % methods.size()];
    const Case c = garbage.make(static_cast<Kind>(i % static_cast<std::size_t>(Kind::kCount)));
    const Case clean = garbage.clean();
    VisibilityMasks masks, truth;
    bool solved = false;
    totals.garbage_seconds += seconds_of([&] { solved = solve_or_refuse(c, config, masks); });
    totals.clean_seconds +=
        seconds_of([&] { solve_shadows(clean.scene, clean.receivers, clean.light, config, truth); });
    ++(solved ? totals.solved : totals.refused);
    if (!solved || i % 4 != 0) continue;
    config.method = ShadowMethod::kOracle;
    solve_shadows(c.scene, c.receivers, c.light, config, truth);
    CHECK(test::wrong_bits(masks, truth) == 0);
  }
  MESSAGE(totals.solved << " solved, " << totals.refused << " refused, " << totals.garbage_seconds << " s against "
                        << totals.clean_seconds << " s for clean meshes");
  CHECK(totals.solved > meshes / 4);
  CHECK(totals.refused > meshes / 8);
  CHECK(totals.garbage_seconds <= 2.5 * totals.clean_seconds);
}

TEST_CASE("S35 garbage_bits: random bits are refused by number or solved") { run(3000, 35); }

TEST_CASE("S35_long garbage_bits: 100,000 meshes") { run(100'000, 36); }

}  // namespace
}  // namespace halfshade
