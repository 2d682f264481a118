#include "shadows/call_receivers.h"

#include <algorithm>
#include <atomic>
#include <string_view>

#include "rasterizer/core/parallel.h"
#include "shadows/view_access.h"

namespace halfshade {
namespace {

constexpr std::size_t kPart = 4096;  // receivers per task

/// The least index that anybody noted.
class FirstWrong {
 public:
  void note(std::size_t i) {
    std::size_t least = least_.load(std::memory_order_relaxed);
    while (i < least && !least_.compare_exchange_weak(least, i, std::memory_order_relaxed)) {
    }
  }
  bool any() const { return index() != ~std::size_t{0}; }
  std::size_t index() const { return least_.load(std::memory_order_relaxed); }

 private:
  std::atomic<std::size_t> least_{~std::size_t{0}};
};

[[noreturn]] void refuse(std::size_t receiver, const std::string& what) {
  throw Error(ErrorCode::kBadInput, "receiver " + std::to_string(receiver) + ": " + what);
}

std::string text_of(const dvec3& p) {
  return "(" + std::to_string(p.x) + ", " + std::to_string(p.y) + ", " + std::to_string(p.z) + ")";
}

void check_lengths(const ReceiverView& view) {
  const auto require = [&](std::size_t count, const char* what) {
    if (count == 0 || count == view.positions.count) return;
    throw Error(ErrorCode::kUsage, "receivers: " + std::to_string(count) + " " + what + " for " +
                                       std::to_string(view.positions.count) + " positions");
  };
  require(view.normals.count, "normals");
  require(view.meshes.count, "own meshes");
  require(view.triangles.count, "own triangles");
  if (view.meshes.empty() != view.triangles.empty()) {
    throw Error(ErrorCode::kUsage, "receivers: own meshes and own triangles belong together");
  }
  if (!((view.lift >= 0.0 && view.lift <= 1.0) || view.lift == kDefaultLift)) {
    throw Error(ErrorCode::kUsage,
                "receivers: lift " + std::to_string(view.lift) + " is neither in 0..1 nor -1, the default");
  }
  if (view.positions.count >= kNone) {
    throw Error(ErrorCode::kLimit,
                "receivers: " + std::to_string(view.positions.count) + ", 2^32 - 2 are allowed in one call");
  }
}

std::uint32_t own_triangle(const ShadowScene::Impl& scene, const ReceiverView& view, std::size_t i, bool& wrong) {
  if (view.meshes.empty()) return kNone;
  const MeshTriangle own{element(view.meshes, i), element(view.triangles, i)};
  if (own.mesh == kNone || own.triangle == kNone) return kNone;
  const std::uint32_t number = scene.triangle_number(own);
  wrong |= number == kNone;
  return number;
}

/// The unit vector, or zero where the direction means nothing.
vec3 unit(const dvec3& v) {
  const double largest = std::max({std::fabs(v.x), std::fabs(v.y), std::fabs(v.z)});
  if (!(largest > 0.0 && std::isfinite(largest))) return vec3(0.0f);
  const dvec3 scaled = v / largest;
  return vec3(scaled / std::sqrt(glm::dot(scaled, scaled)));
}

[[noreturn]] void explain(const ShadowScene::Impl& scene, const ReceiverView& view, std::size_t i) {
  const dvec3 p = element(view.positions, i);
  if (!is_finite(p)) refuse(i, "the position is not finite");
  if (!in_reach(scene.mesh.frame, p)) {
    refuse(i, "the position " + text_of(p) + " is outside the scene's reach; ShadowScene::extend widens it");
  }
  if (!view.normals.empty() && unit(element(view.normals, i)) == vec3(0.0f)) {
    refuse(i, "the normal is zero or not finite");
  }
  refuse(i, "there is no triangle " + std::to_string(element(view.triangles, i)) + " of a mesh " +
                std::to_string(element(view.meshes, i)));
}

/// What is wrong with an entry that is no background; or nothing.
std::string_view fault_of(const ShadowScene::Impl& scene, const GBuffer& gbuffer, std::size_t i) {
  if (gbuffer.triangle[i] >= scene.mesh.triangles.size()) {
    return "the G-buffer belongs to another scene: there is no such triangle";
  }
  if (gbuffer.drawn != DrawnState()) return {};  // the rest is ours
  const dvec3 p = glm::abs(gbuffer.position[i]);
  if (!(p.x <= 1.0 && p.y <= 1.0 && p.z <= 1.0)) return "the G-buffer's position is not in the local frame, -1..1";
  if (!is_finite(dvec3(gbuffer.geometric_normal[i]))) return "the G-buffer's normal is not finite";
  return {};
}

}  // namespace

void CallReceivers::resize(std::size_t count) {
  position.resize(count), normal.resize(count);
  own.resize(count), number.resize(count);
  quad.resize(count), absent.resize(count);
}

void read_receivers(const ShadowScene::Impl& scene, const ReceiverView& view, CallReceivers& receivers) {
  check_lengths(view);
  receivers.resize(view.positions.count);
  receivers.has_normals = !view.normals.empty();
  const LocalFrame& frame = scene.mesh.frame;
  const double lift = view.lift == kDefaultLift ? default_lift(scene.reach) : view.lift;
  FirstWrong first_wrong;
  parallel_ranges(view.positions.count, kPart, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) {
      const dvec3 world = element(view.positions, i);
      bool wrong = !in_reach(frame, world);
      const vec3 normal = receivers.has_normals ? unit(element(view.normals, i)) : vec3(0.0f);
      wrong |= receivers.has_normals && normal == vec3(0.0f);
      receivers.own[i] = own_triangle(scene, view, i, wrong);
      if (wrong) {
        first_wrong.note(i);
        continue;
      }
      receivers.position[i] = snap_to_lattice(frame.to_local(world) + dvec3(normal) * lift);
      receivers.normal[i] = normal;
      receivers.number[i] = view.first + static_cast<std::uint32_t>(i);
      receivers.quad[i] = static_cast<std::uint8_t>(receivers.number[i] % kInterleavedSets);
      receivers.absent[i] = 0;
    }
  });
  if (first_wrong.any()) explain(scene, view, first_wrong.index());
}

void read_receivers(const ShadowScene::Impl& scene, const GBuffer& gbuffer, CallReceivers& receivers) {
  if (gbuffer.drawn != DrawnState() && gbuffer.drawn != scene.state()) {
    throw Error(ErrorCode::kUsage, gbuffer.drawn.scene == scene.identity
                                       ? "receivers: the G-buffer is older than a commit that changed meshes or frame"
                                       : "receivers: the G-buffer shows another scene");
  }
  if (gbuffer.position.size() != gbuffer.size() || gbuffer.geometric_normal.size() != gbuffer.size() ||
      std::size_t{gbuffer.window.width()} * gbuffer.window.height() != gbuffer.size()) {
    throw Error(ErrorCode::kBadInput, "receivers: the G-buffer's arrays do not have the size of its window");
  }
  if (!(gbuffer.reach > 0.0 && gbuffer.reach <= 1.0)) {
    throw Error(ErrorCode::kBadInput, "receivers: the G-buffer's reach is not in 0..1");
  }
  receivers.resize(gbuffer.size());
  receivers.has_normals = true;
  FirstWrong first_wrong;
  parallel_ranges(gbuffer.size(), kPart, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i != end; ++i) {
      receivers.absent[i] = gbuffer.triangle[i] == kNone;
      if (receivers.absent[i]) continue;
      if (!fault_of(scene, gbuffer, i).empty()) {
        first_wrong.note(i);
        continue;
      }
      const std::uint32_t x = gbuffer.window.x0 + static_cast<std::uint32_t>(i % gbuffer.window.width());
      const std::uint32_t y = gbuffer.window.y0 + static_cast<std::uint32_t>(i / gbuffer.window.width());
      receivers.normal[i] = gbuffer.geometric_normal[i];
      receivers.position[i] = lifted_receiver(gbuffer.position[i], gbuffer.geometric_normal[i], gbuffer.reach);
      receivers.own[i] = gbuffer.triangle[i];
      receivers.number[i] = y * gbuffer.width + x;
      receivers.quad[i] = static_cast<std::uint8_t>(interleaved_set(x, y));
    }
  });
  if (first_wrong.any()) refuse(first_wrong.index(), std::string(fault_of(scene, gbuffer, first_wrong.index())));
}

void select_lit(const CallReceivers& receivers, const LightSamples& samples, std::uint32_t seed, LitReceivers& lit) {
  const std::size_t count = receivers.size(), parts = (count + kPart - 1) / kPart;
  const auto end_of = [&](std::size_t part) { return std::min(count, (part + 1) * kPart); };
  const auto set_of = [&](std::size_t i) {
    return samples.interleaved ? receivers.quad[i] : receiver_set(receivers.number[i], seed, samples.sets);
  };
  lit.place.resize(count);
  lit.counts.resize(parts);
  parallel_tasks(parts, [&](std::size_t part) {
    std::uint32_t in_part = 0;
    for (std::size_t i = part * kPart; i < end_of(part); ++i) {
      const bool dark =
          receivers.absent[i] ||
          (receivers.has_normals ? faces_away(receivers.position[i], receivers.normal[i], samples, set_of(i))
                                 : behind_light(receivers.position[i], samples));
      lit.place[i] = dark ? kNone : in_part++;
    }
    lit.counts[part] = in_part;
  });
  exclusive_scan(lit.counts, lit.offsets);
  lit.array.reserve(count);
  lit.array.resize(lit.offsets.back());
  parallel_tasks(parts, [&](std::size_t part) {
    for (std::size_t i = part * kPart; i < end_of(part); ++i) {
      if (lit.place[i] == kNone) continue;
      const std::uint32_t at = lit.place[i] += lit.offsets[part];
      lit.array.position[at] = receivers.position[i];
      lit.array.normal[at] = receivers.normal[i];
      lit.array.triangle[at] = receivers.own[i];
      lit.array.sample[at] = static_cast<std::uint32_t>(i);
      lit.array.set[at] = static_cast<std::uint8_t>(set_of(i));
    }
  });
}

}  // namespace halfshade
