#include "picture.h"

#include <fmt/format.h>

#include "halfshade/error.h"

namespace halfshade {
namespace {

/// Sums of one pixel's samples.
struct PixelSums {
  vec3 color{0.0f};
  float surfaces = 0.0f;
  std::vector<float> visibility;
};

PixelSums sum_pixel(const GBuffer& gbuffer, std::uint32_t k, std::uint32_t x, std::uint32_t y,
                    const std::vector<vec3>& color, std::span<const std::vector<float>> visibility) {
  PixelSums sums;
  sums.visibility.assign(visibility.size(), 0.0f);
  for (std::uint32_t j = 0; j < k; ++j) {
    for (std::uint32_t i = 0; i < k; ++i) {
      const std::size_t entry = std::size_t{y * k + j} * gbuffer.window.width() + x * k + i;
      sums.color += color[entry];
      if (gbuffer.triangle[entry] == kNone) continue;
      sums.surfaces += 1.0f;
      for (std::size_t l = 0; l < visibility.size(); ++l) sums.visibility[l] += visibility[l][entry];
    }
  }
  return sums;
}

void push(std::vector<float>& to, const vec3& v) { to.insert(to.end(), {v.x, v.y, v.z}); }

/// One channel of an interleaved array, as a plane.
std::vector<float> plane(const std::vector<float>& values, std::size_t stride, std::size_t offset) {
  std::vector<float> result;
  result.reserve(values.size() / stride);
  for (std::size_t i = offset; i < values.size(); i += stride) result.push_back(values[i]);
  return result;
}

class ExrLayers {
 public:
  void add(const std::string& name, ImageChannel::Type type, std::vector<float> values) {
    planes_.push_back(std::move(values));
    channels_.push_back({name, type, nullptr});
  }
  void add_vector(const std::string& name, const char* axes, ImageChannel::Type type,
                  const std::vector<float>& values) {
    for (std::size_t k = 0; k < 3; ++k) add(name + axes[k], type, plane(values, 3, k));
  }
  std::vector<ImageChannel> channels() {
    for (std::size_t i = 0; i < planes_.size(); ++i) channels_[i].data = planes_[i].data();
    return channels_;
  }

 private:
  std::vector<std::vector<float>> planes_;
  std::vector<ImageChannel> channels_;
};

void write_layers(const std::filesystem::path& path, const Picture& picture, const ImageAttributes& attributes) {
  using Type = ImageChannel::Type;
  ExrLayers layers;
  layers.add_vector("", "RGB", Type::kHalf, picture.color);
  layers.add("A", Type::kHalf, picture.alpha);
  for (std::size_t l = 0; l < picture.visibility.size(); ++l) {
    layers.add("shadow." + picture.light_names[l] + ".V", Type::kFloat, picture.visibility[l]);
  }
  layers.add_vector("N.", "XYZ", Type::kHalf, picture.normal);
  layers.add_vector("P.", "XYZ", Type::kFloat, picture.position_world);
  layers.add("Z", Type::kFloat, picture.depth_world);
  std::vector<ImageChannel> channels = layers.channels();
  channels.push_back({"id.I", Type::kUint32, picture.triangle.data()});
  write_exr(path, picture.width, picture.height, channels, attributes);
}

}  // namespace

Picture resolve(const GBuffer& gbuffer, std::uint32_t subsamples, const LocalFrame& frame, const View& view,
                const std::vector<vec3>& color, std::span<const std::vector<float>> visibility) {
  Picture picture;
  picture.width = gbuffer.window.width() / subsamples;
  picture.height = gbuffer.window.height() / subsamples;
  picture.visibility.resize(visibility.size());
  for (const Light& light : view.lights) picture.light_names.push_back(light.name);
  const float per_sample = 1.0f / static_cast<float>(subsamples * subsamples);
  for (std::uint32_t y = 0; y < picture.height; ++y) {
    for (std::uint32_t x = 0; x < picture.width; ++x) {
      const PixelSums sums = sum_pixel(gbuffer, subsamples, x, y, color, visibility);
      push(picture.color, sums.color * per_sample);
      picture.alpha.push_back(sums.surfaces * per_sample);
      for (std::size_t l = 0; l < visibility.size(); ++l) {
        picture.visibility[l].push_back(sums.surfaces > 0.0f ? sums.visibility[l] / sums.surfaces : 0.0f);
      }
      const std::size_t middle =
          std::size_t{y * subsamples + subsamples / 2} * gbuffer.window.width() + x * subsamples + subsamples / 2;
      const bool hit = gbuffer.triangle[middle] != kNone;
      push(picture.normal, gbuffer.shading_normal[middle]);
      push(picture.position_world, hit ? vec3(frame.to_world(gbuffer.position[middle])) : vec3(0.0f));
      picture.depth_world.push_back(hit ? static_cast<float>(gbuffer.depth[middle] / frame.scale) : 0.0f);
      picture.triangle.push_back(gbuffer.triangle[middle]);
    }
  }
  return picture;
}

void check_picture_path(const std::filesystem::path& path) {
  if (path.extension() == ".png" || path.extension() == ".exr") return;
  throw Error(ErrorCode::kUsage, fmt::format("output '{}': the ending is not .png or .exr", path.string()));
}

void write_picture(const std::filesystem::path& path, const Picture& picture, const ImageAttributes& attributes) {
  check_picture_path(path);
  if (path.extension() == ".png") {
    write_png(path, picture.width, picture.height, 3, picture.color, true, 8, attributes);
  } else {
    write_layers(path, picture, attributes);
  }
}

}  // namespace halfshade
