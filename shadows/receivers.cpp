#include "shadows/receivers.h"

#include "rasterizer/core/hash.h"
#include "rasterizer/core/parallel.h"

namespace halfshade {
namespace {

/// By place in the whole picture, so that a crop gives every pixel the same samples as the full render.
std::uint32_t set_of_entry(const GBuffer& gbuffer, const LightSamples& samples, std::uint32_t seed,
                           std::uint32_t entry) {
  const std::uint32_t x = gbuffer.window.x0 + entry % gbuffer.window.width();
  const std::uint32_t y = gbuffer.window.y0 + entry / gbuffer.window.width();
  return samples.interleaved ? interleaved_set(x, y) : receiver_set(y * gbuffer.width + x, seed, samples.sets);
}

ReceiverArray receivers_of_range(const GBuffer& gbuffer, const LightSamples& samples, std::uint32_t seed,
                                 std::size_t begin, std::size_t end) {
  ReceiverArray part;
  for (std::size_t i = begin; i != end; ++i) {
    if (gbuffer.triangle[i] == kNone) continue;
    const auto entry = static_cast<std::uint32_t>(i);
    const vec3 normal = gbuffer.geometric_normal[i];
    const vec3 position = lifted_receiver(gbuffer.position[i], normal);
    const std::uint32_t set = set_of_entry(gbuffer, samples, seed, entry);
    if (faces_away(position, normal, samples, set)) continue;
    part.push_back(position, normal, gbuffer.triangle[i], entry, static_cast<std::uint8_t>(set));
  }
  return part;
}

template <class T>
void append(std::vector<T>& to, const std::vector<T>& from) {
  to.insert(to.end(), from.begin(), from.end());
}

}  // namespace

void ReceiverArray::resize(std::size_t count) {
  position.resize(count), normal.resize(count);
  triangle.resize(count), sample.resize(count), set.resize(count);
}

void ReceiverArray::reserve(std::size_t count) {
  position.reserve(count), normal.reserve(count);
  triangle.reserve(count), sample.reserve(count), set.reserve(count);
}

void ReceiverArray::push_back(const vec3& p, const vec3& n, std::uint32_t own, std::uint32_t from,
                              std::uint8_t light_set) {
  position.push_back(p);
  normal.push_back(n);
  triangle.push_back(own);
  sample.push_back(from);
  set.push_back(light_set);
}

bool faces_away(const vec3& position, const vec3& normal, const LightSamples& samples, std::uint32_t set) {
  if (behind_light(position, samples)) return true;
  const dvec3 p(position), n(normal);
  for (const vec3& l : samples.set(set)) {
    if (glm::dot(n, dvec3(l) - p) > 0.0) return false;
  }
  return true;
}

std::uint32_t receiver_set(std::uint32_t index, std::uint32_t seed, std::uint32_t sets) {
  return sets == 1 ? 0 : hash32(index, seed) % sets;
}

ReceiverArray make_receivers(const GBuffer& gbuffer, const LightSamples& samples, std::uint32_t seed) {
  constexpr std::size_t kPart = 16384;
  std::vector<ReceiverArray> parts((gbuffer.size() + kPart - 1) / kPart);
  parallel_tasks(parts.size(), [&](std::size_t i) {
    parts[i] = receivers_of_range(gbuffer, samples, seed, i * kPart, std::min(gbuffer.size(), (i + 1) * kPart));
  });
  ReceiverArray all;
  for (const ReceiverArray& part : parts) {
    append(all.position, part.position);
    append(all.normal, part.normal);
    append(all.triangle, part.triangle);
    append(all.sample, part.sample);
    append(all.set, part.set);
  }
  return all;
}

}  // namespace halfshade
