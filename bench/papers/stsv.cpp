// Forest, Barthe, Paulin 2009, "Soft Textured Shadow Volume": a perforated card against the same fence as a mesh, and
// the memory of the light sample buffer. Times are those of the shadows alone: the solve's.
#include <fmt/format.h>

#include "bench/bench_case.h"
#include "bench/harness.h"
#include "examples/halfshade/scene_source.h"
#include "papers.h"
#include "shadows/solver.h"

namespace halfshade::bench {
namespace {

/// One scene with its receivers, and what one method made of it.
struct Subject {
  SceneSource source;
  Case work;
};

ShadowConfig config_of(ShadowMethod method, std::uint32_t samples, OpaqueBlockers opaque = OpaqueBlockers::kExact) {
  ShadowConfig config;
  config.method = method;
  config.light_sample_count = samples;
  config.pattern = SamplePattern::kPoissonDisk;
  config.sample_sets = 16;
  config.stsv.opaque = opaque;
  return config;
}

void load(const std::string& scene, const std::string& size, std::uint32_t samples, Subject& s) {
  s.source = load_scene(scene, "", {});
  s.work = make_case(scene, s.source.scene, s.source.view, 0, size, config_of(ShadowMethod::kExact, samples));
}

struct Run {
  ShadowConfig config;
  VisibilityMasks masks;
  ShadowStats stats;
  void operator()(const Case& c) { solve_masks(c.mesh, c.receivers, c.light, c.samples, config, masks, stats); }
};

/// Figure 11 and the abstract: the card through volumes, the mesh through volumes and by the exact engine.
void card_against_mesh(const PaperOptions& o, std::uint32_t pickets, std::uint32_t samples) {
  Subject card, mesh;
  load(fmt::format("builtin:fence:{}", pickets), o.size, samples, card);
  load(fmt::format("builtin:fence_mesh:{}", pickets), o.size, samples, mesh);
  Run on_card{config_of(ShadowMethod::kSoftTexturedShadowVolumes, samples), {}, {}};
  Run by_volumes{config_of(ShadowMethod::kSoftTexturedShadowVolumes, samples, OpaqueBlockers::kVolumes), {}, {}};
  Run by_engine{config_of(ShadowMethod::kExact, samples), {}, {}};
  Run by_afsm{config_of(ShadowMethod::kAliasFreeShadowMap, samples), {}, {}};
  const std::vector<Timing> t = measure_interleaved({[&] { on_card(card.work); }, [&] { by_volumes(mesh.work); },
                                                     [&] { by_engine(mesh.work); }, [&] { by_afsm(mesh.work); }},
                                                    o.repeat);
  const double base = t[0].median();
  const std::string what = fmt::format("{} pickets, {} samples: mesh of {} triangles, time / card's", pickets, samples,
                                       mesh.work.mesh.triangles.size());
  print_claim(what + ", mesh through volumes", "25 to 35 (233358 triangles, object-based)",
              fmt::format("{:.1f} x ({:.1f} ms / {:.1f} ms)", t[1].median() / base, t[1].median(), base));
  print_claim(what + ", mesh by the exact engine", "-", fmt::format("{:.1f} x", t[2].median() / base));
  print_claim(what + ", mesh by afsm", "-", fmt::format("{:.1f} x", t[3].median() / base));
  const OracleCheck check = check_with_oracle(card.work, on_card.masks, 100.0, 2.0);
  print_claim(what + ", wrong bits of the card", "-",
              fmt::format("{} in {} receivers", check.wrong_bits, check.receivers));
}

/// The same card: volumes against the methods that meet it with the shared lookup.
void card_by_method(const PaperOptions& o, std::uint32_t samples) {
  Subject card;
  load("builtin:fence:256", o.size, samples, card);
  Run volumes{config_of(ShadowMethod::kSoftTexturedShadowVolumes, samples), {}, {}};
  Run afsm{config_of(ShadowMethod::kAliasFreeShadowMap, samples), {}, {}};
  Run exact{config_of(ShadowMethod::kExact, samples), {}, {}};
  const std::vector<Timing> t =
      measure_interleaved({[&] { volumes(card.work); }, [&] { afsm(card.work); }, [&] { exact(card.work); }}, o.repeat);
  print_claim(fmt::format("the card of 256 pickets, {} samples: time / stsv's", samples), "-",
              fmt::format("afsm {:.2f} x, exact {:.2f} x; {} bits differ", t[1].median() / t[0].median(),
                          t[2].median() / t[0].median(), count_differences(volumes.masks, afsm.masks)));
  print_claim("samples that went to the exact predicate or the exact texel", "-",
              fmt::format("{:.4f} %", 100.0 * static_cast<double>(volumes.stats.exact_fallbacks) /
                                          static_cast<double>(volumes.stats.sample_tests)));
}

/// Section 5.1: one bit per receiver and sample, and the pattern.
void memory(const PaperOptions& o) {
  constexpr std::uint32_t kSamples = 64;
  Subject card;
  load("builtin:fence", o.quick ? o.size : "1024x1024", kSamples, card);
  ShadowConfig config = config_of(ShadowMethod::kSoftTexturedShadowVolumes, kSamples);
  config.sample_sets = 1;
  card.work.samples = make_light_samples(card.work.light, config, card.work.mesh.frame);
  card.work.receivers = make_receivers(card.work.gbuffer, card.work.samples, config.seed);
  Run run{config, {}, {}};
  run(card.work);
  const double receivers = static_cast<double>(card.work.receivers.size());
  const double buffer = run.stats.detail("stsv.light_sample_buffer_bytes").value_or(0.0);
  print_claim("light sample buffer, bytes per receiver at 64 samples", "8 (8 MB at 1024x1024)",
              fmt::format("{:.2f} ({:.2f} MB for {:.0f} receivers)", buffer / receivers, buffer * 1e-6, receivers));
  print_claim("sample pattern, bytes at 64 samples", "128",
              fmt::format("{:.0f}", run.stats.detail("stsv.sample_pattern_bytes").value_or(0.0)));
  print_claim("all working memory of the method, bytes per receiver", "-",
              fmt::format("{:.1f}", static_cast<double>(run.stats.bytes) / receivers));
}

}  // namespace

void run_stsv(const PaperOptions& o) {
  const std::vector<std::uint32_t> pickets =
      o.quick ? std::vector<std::uint32_t>{16, 256} : std::vector<std::uint32_t>{16, 256, 1024};
  for (const std::uint32_t n : pickets) card_against_mesh(o, n, 16);
  if (!o.quick) card_against_mesh(o, 256, 64);
  card_by_method(o, 64);
  card_by_method(o, 256);
  memory(o);
}

}  // namespace halfshade::bench
