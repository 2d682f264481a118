#include <doctest/doctest.h>

#include "shadows/light_view.h"
#include "shadows/visibility_kernel.h"
#include "support/lit_scene.h"
#include "support/simd_targets.h"

using namespace halfshade;
using namespace halfshade::test;

namespace {

/// Blockers, receivers and samples thrown together so that many pairs meet, with ties and doubtful planes among them.
struct Mixture {
  Scene scene;
  LatticeMesh mesh;
  Light light = frame_light();
  LightSamples samples;
  KernelSamples kernel_samples;
  KernelReceivers receivers;
  std::vector<BlockerSpan> spans;

  Mixture(std::uint64_t seed, std::uint32_t sample_count, std::uint32_t sets, std::uint32_t receiver_count) {
    Random random(seed);
    std::vector<Triangle> triangles;
    for (int i = 0; i < 40; ++i) {
      const dvec3 c(random.uniform(-2, 2), random.uniform(0, 4.2), random.uniform(-2, 2));
      const double size = i % 2 == 0 ? 0.2 : 2.0;
      triangles.push_back(
          {c + size * random.in_box(-1, 1), c + size * random.in_box(-1, 1), c + size * random.in_box(-1, 1)});
    }
    triangles.push_back({dvec3(-4, 2, -4), dvec3(4, 2, -4), dvec3(0, 2, 4)});  // edges through sample columns
    triangles.push_back({dvec3(1, 1, 1), dvec3(1, 1, 1), dvec3(2, 1, 1)});     // no area
    scene = scene_of(triangles);
    ShadowConfig config = frame_config(sample_count);
    config.sample_sets = sets;
    mesh = make_lattice_mesh(scene, make_local_frame(scene.positions, light_extent(light)));
    samples = make_light_samples(light, config, mesh.frame);
    kernel_samples = make_kernel_samples(samples, make_light_bound(light, samples));
    add_receivers(random, receiver_count);
    for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
      spans.push_back({t, t % 3, receiver_count - t % 5});
    }
  }

  void add_receivers(Random& random, std::uint32_t count) {
    const std::size_t padded = count + KernelReceivers::kLanePadding;
    receivers.count = count;
    receivers.words = kernel_samples.padded / 64;
    for (std::size_t i = 0; i < padded; ++i) {
      const vec3 p = mesh.frame.to_lattice(
          {std::round(random.uniform(-16, 16)) / 4.0, random.uniform(-1, 1) < 0 ? 0.0 : 1.0, random.uniform(-4, 4)});
      receivers.x.push_back(p.x), receivers.y.push_back(p.y), receivers.z.push_back(p.z);
      receivers.own.push_back(i % 7 == 0 ? static_cast<std::uint32_t>(i % mesh.triangles.size()) : kNone);
      receivers.open.push_back(~0u);
      receivers.set.push_back(static_cast<std::uint8_t>(i % samples.sets));
    }
    receivers.masks.assign(count * receivers.words + 8, 0x5555555555555555u);  // guard words behind the masks
    std::fill_n(receivers.masks.begin(), count * receivers.words, 0);
  }
};

}  // namespace

TEST_CASE("the kernel's masks equal the scalar reference on every instruction set") {
  for (const std::uint32_t samples : {1u, 5u, 64u, 100u, 256u, 1100u}) {
    for (const std::uint32_t receivers : {9u, 64u, 333u}) {
      CAPTURE(samples);
      CAPTURE(receivers);
      const Mixture mixture(samples + receivers, samples, samples % 2 == 0 ? 3 : 1, receivers);
      KernelReceivers expected = mixture.receivers;
      KernelCounters counters;
      test_blockers_reference(mixture.mesh, mixture.kernel_samples, mixture.spans, expected, counters);
      CHECK(counters.pairs_necessary > 0);
      for_each_simd_target([&](const std::string& target) {
        CAPTURE(target);
        KernelReceivers actual = mixture.receivers;
        KernelCounters fast;
        test_blockers(mixture.mesh, mixture.kernel_samples, mixture.spans, actual, fast);
        CHECK(actual.masks == expected.masks);
        CHECK(fast.pairs_tested > 0);
      });
    }
  }
}

TEST_CASE("the kernel hands doubtful samples to the exact predicate, and few of them") {
  const Mixture mixture(3, 256, 1, 300);
  KernelReceivers receivers = mixture.receivers;
  KernelCounters counters;
  test_blockers(mixture.mesh, mixture.kernel_samples, mixture.spans, receivers, counters);
  CHECK(counters.exact_fallbacks > 0);  // the aligned triangle has ties
  CHECK(counters.exact_fallbacks < counters.sample_tests / 10);
}

TEST_CASE("sample order: restoring a kernel mask gives every sample its own bit") {
  for (const std::uint32_t count : {1u, 16u, 17u, 64u, 65u, 256u, 1000u}) {
    const Mixture mixture(count, count, 1, 16);
    const KernelSamples& k = mixture.kernel_samples;
    for (std::uint32_t i = 0; i < count; ++i) {
      std::vector<std::uint64_t> kernel_mask(k.padded / 64, 0), mask(k.padded / 64, 0);
      kernel_mask[i / 64] = std::uint64_t{1} << (i % 64);
      restore_sample_order(k, 0, kernel_mask, mask);
      const std::uint32_t sample = k.order[i];
      CHECK(mixture.samples.points[sample] == k.points[i]);
      std::vector<std::uint64_t> expected(mask.size(), 0);
      expected[sample / 64] = std::uint64_t{1} << (sample % 64);
      CHECK(mask == expected);
    }
  }
}
