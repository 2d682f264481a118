#include "input_hashes.h"

#define XXH_INLINE_ALL
#include <xxhash.h>

#include <fmt/format.h>

namespace halfshade {
namespace {

template <class T>
void append(std::string& bytes, std::span<const T> values) {
  bytes.append(reinterpret_cast<const char*>(values.data()), values.size_bytes());
}

std::string text_of(const dvec3& p) { return fmt::format("({} {} {}) ", p.x, p.y, p.z); }

}  // namespace

std::string hash_of(std::string_view bytes) {
  const XXH128_hash_t digest = XXH3_128bits(bytes.data(), bytes.size());
  return fmt::format("{:016x}{:016x}", digest.high64, digest.low64);
}

std::string view_hash(const View& view) {
  const Camera& c = view.camera;
  std::string bytes = text_of(c.eye) + text_of(c.target) + text_of(c.up) + fmt::format("{} ", c.fov_y_deg);
  for (const Light& light : view.lights) {
    bytes += fmt::format("{} {}{}x{} ", light.name, text_of(dvec3(light.emission)), light.emission_image.width,
                         light.emission_image.height);
    append(bytes, std::span(light.emission_image.rgb));
  }
  return hash_of(bytes);
}

std::string samples_hash(std::span<const LightSamples> frames) {
  std::string bytes;
  for (const LightSamples& samples : frames) {
    append(bytes, std::span(samples.points));
    bytes += fmt::format("{} {} {} {}", samples.count, samples.sets, samples.interleaved, samples.one_sided);
  }
  return hash_of(bytes);
}

std::string receivers_hash(const GBuffer& gbuffer, const ReceiverArray& receivers, std::size_t begin, std::size_t end) {
  const std::size_t count = end - begin;
  std::vector<std::uint32_t> places;
  places.reserve(count);
  for (const std::uint32_t entry : std::span(receivers.sample).subspan(begin, count)) {
    const std::uint32_t x = gbuffer.window.x0 + entry % gbuffer.window.width();
    const std::uint32_t y = gbuffer.window.y0 + entry / gbuffer.window.width();
    places.push_back(y * gbuffer.width + x);
  }
  std::string bytes = fmt::format("{} {}x{} ", count, gbuffer.width, gbuffer.height);
  append(bytes, std::span(receivers.position).subspan(begin, count));
  append(bytes, std::span(receivers.triangle).subspan(begin, count));
  append(bytes, std::span(receivers.set).subspan(begin, count));
  append(bytes, std::span<const std::uint32_t>(places));
  return hash_of(bytes);
}

}  // namespace halfshade
