// halfshade relight: the picture of a stored dump with another emission image. The masks answer for every image, so
// nothing is rasterized and no visibility is computed.
#include <fmt/format.h>

#include "dump.h"
#include "halfshade/emission.h"
#include "picture.h"
#include "rasterizer/core/stopwatch.h"
#include "rasterizer/io/emission_file.h"
#include "verbs.h"

namespace halfshade {
namespace {

struct RelightOptions {
  std::string dump, emission, output, command_line;
};

/// Adds each receiver's light to its pixel.
Picture relit_picture(const Dump& dump, const DumpLighting& lighting, std::span<const vec3> weights) {
  const PixelWindow& window = lighting.window;
  const auto width = dump.about.at("width").get<std::uint32_t>();
  if (width < window.x1) throw Error(ErrorCode::kBadInput, fmt::format("dump.json: width {} is too small", width));
  std::vector<vec3> color = lighting.rest;
  for (std::size_t i = 0; i < dump.receivers.size(); ++i) {
    const std::uint32_t pixel = dump.receivers.sample[i], x = pixel % width, y = pixel / width;
    if (x < window.x0 || x >= window.x1 || y < window.y0 || y >= window.y1) {
      throw Error(ErrorCode::kBadInput, fmt::format("receiver_pixels.npy: pixel {} is outside the window", pixel));
    }
    const std::size_t first = std::size_t{dump.receivers.set[i]} * dump.samples.count;
    const vec3 visible = weighted_visibility(dump.masks.mask(i), weights.subspan(first, dump.samples.count));
    color[std::size_t{y - window.y0} * window.width() + x - window.x0] += lighting.response[i] * visible;
  }
  Picture picture;
  picture.width = window.width();
  picture.height = window.height();
  for (const vec3& c : color) picture.color.insert(picture.color.end(), {c.x, c.y, c.z});
  return picture;
}

void write_exr_color(const RelightOptions& options, const Picture& picture, const ImageAttributes& attributes) {
  std::array<std::vector<float>, 3> planes;
  for (std::size_t i = 0; i < picture.color.size(); ++i) planes[i % 3].push_back(picture.color[i]);
  using Type = ImageChannel::Type;
  const ImageChannel channels[] = {
      {"R", Type::kHalf, planes[0].data()}, {"G", Type::kHalf, planes[1].data()}, {"B", Type::kHalf, planes[2].data()}};
  write_exr(options.output, picture.width, picture.height, channels, attributes);
}

void run(const RelightOptions& options) {
  check_picture_path(options.output);
  Dump dump;
  read_dump(options.dump, dump);
  const DumpLighting lighting = read_lighting(options.dump, dump);
  const auto counts = dump.about.value("counts", nlohmann::ordered_json::object());
  const std::uint64_t translucent = counts.value("translucent_triangles", std::uint64_t{0});
  if (translucent > 0) {
    fmt::print(stderr,
               "halfshade: warning: {} translucent triangles: the dump's masks do not know them, their light is "
               "neither dimmed nor coloured\n",
               translucent);
  }
  const EmissionImage image = load_emission_image(options.emission);
  Stopwatch watch;
  const Picture picture = relit_picture(dump, lighting, sample_emission(image, dump.samples));
  const double milliseconds = watch.lap();
  const ImageAttributes attributes = {{"halfshade.version", HALFSHADE_VERSION},
                                      {"halfshade.command", options.command_line},
                                      {"halfshade.mask_hash", dump.masks.hash()}};
  if (std::filesystem::path(options.output).extension() == ".exr") {
    write_exr_color(options, picture, attributes);
  } else {
    write_picture(options.output, picture, attributes);
  }
  fmt::print("relit      {} receivers with {} samples in {:.1f} ms\n", dump.receivers.size(), dump.samples.count,
             milliseconds);
  fmt::print("written    {}\n", options.output);
}

}  // namespace

void add_relight(CLI::App& app, const std::string& command_line) {
  CLI::App* verb = app.add_subcommand("relight", "The picture of a dump with another emission image on its light");
  auto o = std::make_shared<RelightOptions>();
  verb->add_option("dump", o->dump, "Directory written by render --dump")->required();
  verb->add_option("--emission", o->emission, "Image of the light's colours: .png, .jpg or .exr")->required();
  verb->add_option("-o,--output", o->output, "Picture to write: .png or .exr (colour only)")->required();
  verb->callback([o, command_line] {
    o->command_line = command_line;
    run(*o);
  });
}

}  // namespace halfshade
