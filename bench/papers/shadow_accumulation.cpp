// Aszodi, Szirmay-Kalos 2006, figure 3 and the claims around it: is one map whose lexels are small casters nearer to
// the truth than percentage-closer soft shadows, and faster? Truth: 1024 samples of the same light, exact.
#include <fmt/format.h>

#include <cmath>

#include "bench/bench_case.h"
#include "bench/harness.h"
#include "papers.h"
#include "rasterizer/scenes/builtin.h"
#include "shadows/solver.h"

namespace halfshade::bench {
namespace {

struct Contender {
  std::string name;
  ShadowConfig config;
  std::vector<float> visibility = {};
  ShadowStats stats = {};
};

ShadowConfig config_of(ShadowMethod method) {
  ShadowConfig config;
  config.method = method;
  config.light_sample_count = 1024;
  config.shadow_map.resolution = 512;  // the paper's
  return config;
}

ShadowConfig accumulation(std::uint32_t kernel, AccumulationForm form, bool refine, std::uint32_t layers) {
  ShadowConfig config = config_of(ShadowMethod::kShadowAccumulation);
  config.shadow_map.kernel = kernel;
  config.shadow_map.form = form;
  config.shadow_map.refine = refine;
  config.shadow_map.layers = layers;
  return config;
}

std::vector<Contender> contenders() {
  std::vector<Contender> all = {{"PCSS", config_of(ShadowMethod::kPercentageCloserSoftShadows)}};
  for (const std::uint32_t k : {5u, 10u}) {
    all.push_back({fmt::format("sum K={}", k), accumulation(k, AccumulationForm::kSum, false, 1)});
    all.push_back({fmt::format("bits K={}", k), accumulation(k, AccumulationForm::kBits, false, 1)});
    all.push_back({fmt::format("refined sum K={}", k), accumulation(k, AccumulationForm::kSum, true, 1)});
    all.push_back({fmt::format("refined bits K={}", k), accumulation(k, AccumulationForm::kBits, true, 1)});
  }
  all.push_back({"refined bits K=10, 8 layers", accumulation(10, AccumulationForm::kBits, true, 8)});
  all.push_back({"refined bits K=32, 8 layers", accumulation(32, AccumulationForm::kBits, true, 8)});
  return all;
}

void solve(const Case& c, Contender& contender) {
  solve_visibility(c.mesh, c.receivers, c.light, c.samples, contender.config, contender.visibility, contender.stats);
}

struct Error {
  double rms = 0.0, mean = 0.0;
};

Error error_of(const std::vector<float>& visibility, const std::vector<float>& truth) {
  Error error;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const double e = double{visibility[i]} - truth[i];
    error.rms += e * e / static_cast<double>(truth.size());
    error.mean += e / static_cast<double>(truth.size());
  }
  error.rms = std::sqrt(error.rms);
  return error;
}

void run_scene(const std::string& name, const PaperOptions& o) {
  const BuiltinScene source = make_builtin_scene(name);
  ShadowConfig exact = config_of(ShadowMethod::kExact);
  const Case c = make_case(name, source.scene, source.view, 0, o.size, exact);
  std::vector<float> truth;
  ShadowStats stats;
  solve_visibility(c.mesh, c.receivers, c.light, c.samples, exact, truth, stats);
  std::vector<Contender> all = contenders();
  std::vector<std::function<void()>> work;
  for (Contender& contender : all) work.push_back([&c, &contender] { solve(c, contender); });
  const std::vector<Timing> times = measure_interleaved(work, o.repeat);
  const Error rival = error_of(all[0].visibility, truth);
  const std::string title = fmt::format("{} ({} receivers)", name, c.receivers.size());
  print_claim("PCSS, error of visibility: " + title, "-",
              fmt::format("rms {:.4f}, mean {:+.4f}", rival.rms, rival.mean));
  for (std::size_t i = 1; i < all.size(); ++i) {
    const Error e = error_of(all[i].visibility, truth);
    print_claim(fmt::format("{}: rms error over PCSS's, time over PCSS's, rms, mean: {}", all[i].name, title),
                "closer and faster (figure 3)",
                fmt::format("{:.2f}, {:.2f}, {:.4f}, {:+.4f}", e.rms / rival.rms, times[i].median() / times[0].median(),
                            e.rms, e.mean));
  }
  exact.light_sample_count = 64;
  std::vector<float> few;
  const LightSamples samples = make_light_samples(c.light, exact, c.mesh.frame);
  solve_visibility(c.mesh, c.receivers, c.light, samples, exact, few, stats);
  const Error reference = error_of(few, truth);
  print_claim("64 samples, the paper's reference: " + title, "-",
              fmt::format("rms {:.4f}, mean {:+.4f}", reference.rms, reference.mean));
}

}  // namespace

void run_shadow_accumulation(const PaperOptions& options) {
  run_scene("torus_knot", options);
  if (options.quick) return;
  run_scene("columns", options);
  run_scene("demo", options);
}

}  // namespace halfshade::bench
