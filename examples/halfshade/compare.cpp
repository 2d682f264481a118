// halfshade compare: two dumps by their bits, or two pictures by their values.
#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <nlohmann/json.hpp>

#include "dump.h"
#include "halfshade/error.h"
#include "rasterizer/io/flip.h"
#include "rasterizer/io/image.h"
#include "rasterizer/io/srgb.h"
#include "verbs.h"

namespace halfshade {
namespace {

struct CompareOptions {
  std::string a, b, difference, flip_map;
  double max_error = 0.0;
};

int compare_dumps(const CompareOptions& options) {
  Dump a, b;
  read_dump(options.a, a);
  read_dump(options.b, b);
  if (a.receivers.position != b.receivers.position || a.samples.points != b.samples.points) {
    throw Error(ErrorCode::kBadInput,
                "the dumps have different receivers or light samples: their bits cannot be compared");
  }
  std::uint64_t wrong = 0, receivers = 0;
  double worst = 0.0, squares = 0.0;
  for (std::size_t r = 0; r < a.masks.receiver_count; ++r) {
    std::uint64_t here = 0;
    for (std::size_t w = 0; w < a.masks.words_per_receiver; ++w) {
      here += static_cast<std::uint64_t>(std::popcount(a.masks.mask(r)[w] ^ b.masks.mask(r)[w]));
    }
    const double dv = std::fabs(static_cast<double>(a.masks.visibility(r)) - b.masks.visibility(r));
    wrong += here, receivers += here > 0;
    worst = std::max(worst, dv), squares += dv * dv;
  }
  const double count = std::max<double>(1.0, static_cast<double>(a.masks.receiver_count));
  fmt::print("bits         {} of {} differ, in {} of {} receivers\n", wrong,
             a.masks.receiver_count * a.masks.sample_count, receivers, a.masks.receiver_count);
  fmt::print("visibility   max |dV| {:g}, RMSE {:g}\n", worst, std::sqrt(squares / count));
  return worst <= options.max_error && (options.max_error > 0.0 || wrong == 0) ? kOk : kDifferent;
}

/// Mean structural similarity of two planes over 8x8 windows, values 0..1 (Wang et al. 2004, uniform window).
double structural_similarity(const std::vector<double>& a, const std::vector<double>& b, std::size_t width,
                             std::size_t height) {
  constexpr std::size_t kWindow = 8;
  constexpr double kC1 = 0.01 * 0.01, kC2 = 0.03 * 0.03;
  double sum = 0.0;
  std::size_t count = 0;
  for (std::size_t y = 0; y + kWindow <= height; y += 4) {
    for (std::size_t x = 0; x + kWindow <= width; x += 4) {
      double sa = 0, sb = 0, saa = 0, sbb = 0, sab = 0;
      for (std::size_t i = 0; i < kWindow * kWindow; ++i) {
        const std::size_t at = (y + i / kWindow) * width + x + i % kWindow;
        sa += a[at], sb += b[at], saa += a[at] * a[at], sbb += b[at] * b[at], sab += a[at] * b[at];
      }
      const double n = kWindow * kWindow, ma = sa / n, mb = sb / n;
      const double va = saa / n - ma * ma, vb = sbb / n - mb * mb, cov = sab / n - ma * mb;
      sum += (2 * ma * mb + kC1) * (2 * cov + kC2) / ((ma * ma + mb * mb + kC1) * (va + vb + kC2));
      ++count;
    }
  }
  return count > 0 ? sum / static_cast<double>(count) : 1.0;
}

std::vector<double> luminance(const FloatImage& image) {
  const std::size_t channels = image.channel_names.size();
  std::vector<double> plane;
  for (std::size_t i = 0; i < image.values.size(); i += channels) {
    const float* p = &image.values[i];
    plane.push_back(channels >= 3 ? 0.2126 * p[0] + 0.7152 * p[1] + 0.0722 * p[2] : p[0]);
  }
  return plane;
}

/// Linear RGB: of R, G, B where the picture has them, else of its only (or first) channel as grey. `encoded` values are
/// sRGB codes.
std::vector<vec3> linear_colors(const FloatImage& image, bool encoded) {
  const std::vector<std::string>& names = image.channel_names;
  std::array<std::size_t, 3> channel{0, 0, 0};
  for (std::size_t k = 0; k < 3; ++k) {
    const auto found = std::find(names.begin(), names.end(), std::string(1, "RGB"[k]));
    if (found != names.end()) channel[k] = static_cast<std::size_t>(found - names.begin());
  }
  std::vector<vec3> colors;
  for (std::size_t i = 0; i < image.values.size(); i += names.size()) {
    vec3& c = colors.emplace_back();
    for (int k = 0; k < 3; ++k) {
      const float value = image.values[i + channel[static_cast<std::size_t>(k)]];
      c[k] = encoded ? decode_srgb(value) : value;
    }
  }
  return colors;
}

/// Mean FLIP of the pictures as they look on a screen; the error of every pixel goes to options.flip_map.
double compare_looks(const FloatImage& a, const FloatImage& b, const CompareOptions& options) {
  const auto encoded = [](const std::string& path) { return std::filesystem::path(path).extension() != ".exr"; };
  const std::vector<float> errors =
      flip_errors(linear_colors(a, encoded(options.a)), linear_colors(b, encoded(options.b)), a.width, a.height);
  if (!options.flip_map.empty()) write_png(options.flip_map, a.width, a.height, 1, errors, false, 8, {});
  return mean_of(errors);
}

/// Differences as a picture: grey where equal, brighter or darker where A is.
void write_difference(const std::string& path, const std::vector<double>& a, const std::vector<double>& b,
                      std::uint32_t width, std::uint32_t height) {
  std::vector<float> values;
  for (std::size_t i = 0; i < a.size(); ++i)
    values.push_back(static_cast<float>(std::clamp(0.5 + 0.5 * (a[i] - b[i]), 0.0, 1.0)));
  write_png(path, width, height, 1, values, false, 8, {});
}

int compare_images(const CompareOptions& options) {
  const FloatImage a = read_image(options.a), b = read_image(options.b);
  if (a.width != b.width || a.height != b.height || a.channel_names != b.channel_names) {
    throw Error(
        ErrorCode::kBadInput,
        fmt::format("the pictures differ in size or channels: {}x{} with {} and {}x{} with {}", a.width, a.height,
                    fmt::join(a.channel_names, ","), b.width, b.height, fmt::join(b.channel_names, ",")));
  }
  double worst = 0.0, squares = 0.0;
  std::uint64_t different = 0;
  for (std::size_t i = 0; i < a.values.size(); ++i) {
    const double d = std::fabs(static_cast<double>(a.values[i]) - b.values[i]);
    worst = std::max(worst, d), squares += d * d, different += d > 0.0;
  }
  const double rmse = std::sqrt(squares / std::max<double>(1.0, static_cast<double>(a.values.size())));
  const std::vector<double> la = luminance(a), lb = luminance(b);
  fmt::print("values       {} of {} differ\n", different, a.values.size());
  fmt::print("difference   max {:g}, RMSE {:g}, PSNR {:.2f} dB, SSIM {:.5f}\n", worst, rmse,
             rmse > 0.0 ? -20.0 * std::log10(rmse) : HUGE_VAL, structural_similarity(la, lb, a.width, a.height));
  fmt::print("FLIP         mean {:.5f}\n", compare_looks(a, b, options));
  if (!options.difference.empty()) write_difference(options.difference, la, lb, a.width, a.height);
  return worst <= options.max_error ? kOk : kDifferent;
}

}  // namespace

void add_compare(CLI::App& app, int& exit_code) {
  CLI::App* verb = app.add_subcommand("compare", "Compare two dumps bit by bit, or two pictures value by value");
  auto o = std::make_shared<CompareOptions>();
  verb->add_option("a", o->a, "Dump directory, or .png/.exr")->required();
  verb->add_option("b", o->b, "The same kind as A")->required();
  verb->add_option("--difference", o->difference, "Pictures: write the difference as a PNG");
  verb->add_option("--flip-map", o->flip_map,
                   "Pictures: write the FLIP error of every pixel, black 0 to white 1, as a PNG");
  verb->add_option("--max-error", o->max_error, "Largest difference that still counts as equal")->capture_default_str();
  verb->callback([o, &exit_code] {
    const bool dumps = std::filesystem::is_directory(o->a) && std::filesystem::is_directory(o->b);
    exit_code = dumps ? compare_dumps(*o) : compare_images(*o);
  });
}

}  // namespace halfshade
