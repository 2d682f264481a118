// render --verify when something is wrong: answers are altered by hand before they are checked.
#include <doctest/doctest.h>

#include "examples/halfshade/render.h"
#include "shadows/solver.h"

using namespace halfshade;

namespace {

constexpr double kGoal = 1.0 / 32.0;

/// The columns in a few pixels, all receivers of which are checked. Renders are not to be copied.
struct Verified {
  Render render;
  explicit Verified(const std::string& method = "exact") {
    RenderOptions& o = render.options;
    o.scene = "builtin:columns:2", o.size = "24x24", o.method = method, o.light_samples = 64, o.verify_percent = 100.0;
    open_pipeline(o, 0.0, render);
  }
  const Light& light() const { return render.source.view.lights.front(); }
};

LightResult& solve(Verified& v) {
  LightResult& result = add_light(v.render, v.light());
  solve_light_by_method(v.render.mesh, result.receivers, v.light(), result.samples, shadow_config(v.render.options),
                        result.masks, result.receiver_visibility, result.stats);
  return result;
}

LightResult& solve_to_goal(Verified& v) {
  v.render.options.error_goal = kGoal;
  LightResult& result = v.render.lights.emplace_back();
  const ShadowConfig config = shadow_config(v.render.options);
  result.receivers = receivers_of_whole_light(v.render.gbuffer, v.light(), config, v.render.mesh.frame);
  solve_to_error(v.render.mesh, result.receivers, v.light(), config, kGoal, result.adaptive, result.stats);
  return result;
}

void check_goal(Verified& v, LightResult& result) {
  result.check = check_max_error_run(v.render.mesh, result.receivers, v.light(), shadow_config(v.render.options),
                                     result.adaptive, v.render.options.verify_percent);
}

/// The first receiver in penumbra.
std::size_t in_penumbra(const std::vector<float>& visibility) {
  for (std::size_t i = 0; i < visibility.size(); ++i) {
    if (visibility[i] > 0.25f && visibility[i] < 0.75f) return i;
  }
  FAIL("there is no penumbra");
  return 0;
}

}  // namespace

TEST_CASE("fixed samples: an exact picture is right") {
  Verified v;
  LightResult& result = solve(v);
  finish_light(v.render, v.light(), result);
  CHECK(result.verified == result.receivers.size());
  CHECK(result.wrong_bits == 0);
  CHECK(finish_render(v.render) == kOk);
}

TEST_CASE("fixed samples: one wrong bit of an exact method is counted and ends with exit code 1") {
  Verified v;
  LightResult& result = solve(v);
  const std::size_t at = in_penumbra(result.receiver_visibility);
  result.masks.words[at * result.masks.words_per_receiver] ^= 1;
  result.receiver_visibility[at] = result.masks.visibility(at);
  finish_light(v.render, v.light(), result);
  CHECK(result.wrong_bits == 1);
  CHECK(result.largest_error == doctest::Approx(1.0 / 64.0));
  CHECK(finish_render(v.render) == kDifferent);
}

TEST_CASE("fixed samples: an approximate method is measured, not judged") {
  Verified v("afsm-lut");
  LightResult& result = solve(v);
  result.masks.words[in_penumbra(result.receiver_visibility) * result.masks.words_per_receiver] ^= 1;
  finish_light(v.render, v.light(), result);
  CHECK(result.wrong_bits >= 1);
  CHECK(finish_render(v.render) == kOk);
}

TEST_CASE("max-error: a run that keeps its goal is right") {
  Verified v;
  LightResult& result = solve_to_goal(v);
  check_goal(v, result);
  CHECK(result.check.receivers == result.receivers.size());
  CHECK(result.check.violations == 0);
  CHECK(result.check.wrong_proofs == 0);
  CHECK(finish_render(v.render) == kOk);
}

TEST_CASE("max-error: one altered visibility is a violation and ends with exit code 1") {
  Verified v;
  LightResult& result = solve_to_goal(v);
  result.adaptive.visibility[in_penumbra(result.adaptive.visibility)] += static_cast<float>(2.0 * kGoal);
  check_goal(v, result);
  CHECK(result.check.violations == 1);
  CHECK(result.check.wrong_proofs == 0);
  CHECK(finish_render(v.render) == kDifferent);
}

TEST_CASE("max-error: one false proof is found although the goal is kept, and ends with exit code 1") {
  Verified v;
  LightResult& result = solve_to_goal(v);
  const std::size_t at = in_penumbra(result.adaptive.visibility);
  const std::uint64_t proofs = result.adaptive.proved_lit + result.adaptive.proved_umbra;
  REQUIRE(result.adaptive.evidence[at] == ErrorEvidence::kEstimate);
  result.adaptive.evidence[at] = ErrorEvidence::kProof;
  check_goal(v, result);
  CHECK(result.check.violations == 0);
  CHECK(result.check.proofs == proofs + 1);
  CHECK(result.check.wrong_proofs == 1);
  CHECK(finish_render(v.render) == kDifferent);
}
