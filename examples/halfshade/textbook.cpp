#include "textbook.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include <glm/common.hpp>

#include "rasterizer/core/parallel.h"
#include "rasterizer/core/predicate.h"
#include "shadows/solver.h"

namespace halfshade {
namespace {

/// Moeller and Trumbore's test without any tolerance.
bool hit_by_float_ray(const std::array<vec3, 3>& t, const vec3& r, const vec3& l) {
  const vec3 d = l - r, e1 = t[1] - t[0], e2 = t[2] - t[0], p = glm::cross(d, e2);
  const float determinant = glm::dot(e1, p);
  if (determinant == 0.0f) return false;
  const vec3 s = r - t[0];
  const float u = glm::dot(s, p) / determinant;
  if (u < 0.0f || u > 1.0f) return false;
  const vec3 q = glm::cross(s, e1);
  const float v = glm::dot(d, q) / determinant, along = glm::dot(e2, q) / determinant;
  return v >= 0.0f && u + v <= 1.0f && along > 0.0f && along < 1.0f;
}

/// What the forms read, prepared once.
struct Textbook {
  TextbookForm form;
  const LatticeMesh& mesh;
  const LightSamples& samples;
  std::vector<std::array<vec3, 3>> world;  // triangles in world space, rounded; kFloatRays
  std::vector<vec3> world_samples;
  std::vector<std::array<dvec2, 2>> boxes;  // on the far plane; kFarPlane
  double far = 0.0;                         // its distance from the light's plane

  dvec2 on_light(const dvec3& p) const {
    return {glm::dot(p - samples.center, samples.axis_u), glm::dot(p - samples.center, samples.axis_v)};
  }
  double depth(const dvec3& p) const { return glm::dot(p - samples.center, samples.axis_n); }

  void prepare_world() {
    for (const auto& t : mesh.scene->triangles) {
      auto& corners = world.emplace_back();
      for (std::size_t k = 0; k < 3; ++k) corners[k] = vec3(mesh.scene->positions[t[k]]);
    }
    for (const vec3& l : samples.set(0)) world_samples.emplace_back(mesh.frame.to_world(dvec3(l)));
  }

  void prepare_boxes(const ReceiverArray& receivers) {
    for (const vec3& r : receivers.position) far = std::max(far, depth(dvec3(r)));
    dvec2 low(HUGE_VAL), high(-HUGE_VAL);  // of the light
    for (const vec3& l : samples.set(0)) {
      low = glm::min(low, on_light(dvec3(l)));
      high = glm::max(high, on_light(dvec3(l)));
    }
    for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
      std::array<dvec2, 2> box{dvec2(HUGE_VAL), dvec2(-HUGE_VAL)};
      for (const vec3& corner : mesh.corners(t)) {
        const dvec3 p(corner);
        for (const dvec2& l : {low, high, dvec2(low.x, high.y), dvec2(high.x, low.y)}) {
          const dvec2 projected = l + (on_light(p) - l) * (far / depth(p));  // nothing asks whether depth(p) > 0
          box = {glm::min(box[0], projected), glm::max(box[1], projected)};
        }
      }
      boxes.push_back(box);
    }
  }

  bool concerns(std::uint32_t t, const vec3& receiver) const {
    const auto [a, b, c] = mesh.corners(t);
    const dvec3 r(receiver), normal = glm::cross(dvec3(b) - dvec3(a), dvec3(c) - dvec3(a));
    const double center_side = glm::dot(normal, samples.center - dvec3(a));
    switch (form) {
      case TextbookForm::kBackFacesOnly:
        return center_side < 0.0;
      case TextbookForm::kCenterVolumes:
        return center_side * glm::dot(normal, r - dvec3(a)) < 0.0;
      case TextbookForm::kFarPlane: {
        const dvec2 at = on_light(r);
        return at.x >= boxes[t][0].x && at.x <= boxes[t][1].x && at.y >= boxes[t][0].y && at.y <= boxes[t][1].y;
      }
      default:
        return true;
    }
  }

  void blocked_by(std::uint32_t t, const vec3& receiver, const vec3& receiver_world,
                  std::span<std::uint64_t> mask) const {
    const auto [a, b, c] = mesh.corners(t);
    for (std::uint32_t s = 0; s < samples.count; ++s) {
      const std::uint64_t bit = std::uint64_t{1} << (s % 64);
      if (mask[s / 64] & bit) continue;
      const bool hit = form == TextbookForm::kFloatRays ? hit_by_float_ray(world[t], receiver_world, world_samples[s])
                                                        : blocks(a, b, c, receiver, samples.points[s]);
      if (hit) mask[s / 64] |= bit;
    }
  }
};

}  // namespace

const char* name_of(TextbookForm form) {
  constexpr const char* kNames[] = {"float rays", "back faces only", "volumes from the centre", "added coverage",
                                    "box on a far plane"};
  return kNames[static_cast<std::size_t>(form)];
}

void solve_textbook(TextbookForm form, const LatticeMesh& mesh, const ReceiverArray& receivers,
                    std::span<const dvec3> world, const LightSamples& samples, VisibilityMasks& masks,
                    std::vector<float>& visibility) {
  Textbook book{form, mesh, samples, {}, {}, {}};
  if (form == TextbookForm::kFloatRays) book.prepare_world();
  if (form == TextbookForm::kFarPlane) book.prepare_boxes(receivers);
  const auto triangles = static_cast<std::uint32_t>(mesh.triangles.size());
  masks.reset(receivers.size(), samples.count);
  visibility.assign(receivers.size(), 1.0f);
  parallel_ranges(receivers.size(), 16, [&](std::size_t begin, std::size_t end) {
    std::vector<std::uint64_t> single(masks.words_per_receiver);
    for (std::size_t i = begin; i < end; ++i) {
      const std::span<std::uint64_t> all(&masks.words[i * masks.words_per_receiver], masks.words_per_receiver);
      std::uint64_t added = 0;
      for (std::uint32_t t = 0; t < triangles; ++t) {
        if (t == receivers.triangle[i] || !book.concerns(t, receivers.position[i])) continue;
        if (form != TextbookForm::kAddedCoverage) {
          book.blocked_by(t, receivers.position[i], vec3(world[i]), all);
          continue;
        }
        std::fill(single.begin(), single.end(), 0);
        book.blocked_by(t, receivers.position[i], vec3(world[i]), single);
        for (const std::uint64_t word : single) added += static_cast<std::uint64_t>(std::popcount(word));
      }
      const double hidden = std::min(1.0, static_cast<double>(added) / samples.count);
      visibility[i] = form == TextbookForm::kAddedCoverage ? static_cast<float>(1.0 - hidden) : masks.visibility(i);
    }
  });
  if (form == TextbookForm::kAddedCoverage) masks = {};
}

}  // namespace halfshade
