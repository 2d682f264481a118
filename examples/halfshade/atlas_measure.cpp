#include "atlas_measure.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <map>

#include "halfshade/error.h"
#include "pipeline.h"
#include "progress.h"
#include "rasterizer/core/stopwatch.h"
#include "shadows/oracle.h"
#include "shadows/receiver_request.h"

namespace halfshade {
namespace {

constexpr int kTimedRuns = 3;  // where times are compared

/// A frame on the lattice, with one set of light samples.
struct Question {
  LatticeMesh mesh;
  Light light;
  LightSamples samples;
  ReceiverArray receivers;   // the points of the picture, then the others
  std::vector<dvec3> world;  // the same in world space
};

struct Reply {
  VisibilityMasks masks;
  std::vector<float> visibility;
  ShadowStats stats;
  double ms = 0.0;
};

Question make_question(const AtlasFrame& frame, const ShadowConfig& config) {
  Question q;
  q.light = frame.light;
  q.world = frame.points;
  q.world.insert(q.world.end(), frame.others.begin(), frame.others.end());
  std::vector<dvec3> reach = light_extent(frame.light);
  reach.insert(reach.end(), q.world.begin(), q.world.end());
  q.mesh = make_lattice_mesh(frame.scene, make_local_frame(frame.scene.positions, reach));
  q.samples = make_light_samples(frame.light, config, q.mesh.frame);
  for (std::uint32_t i = 0; i < q.world.size(); ++i) {
    q.receivers.push_back(q.mesh.frame.to_lattice(q.world[i]), frame.normal, frame.own_triangle, i, 0);
  }
  return q;
}

Reply ask(const AtlasContender& contender, const Question& q) {
  ShadowConfig config = contender.config;
  config.progress = [](double) { return stop_signal() == 0; };
  Reply reply;
  Stopwatch watch;
  if (contender.textbook) {
    solve_textbook(*contender.textbook, q.mesh, q.receivers, q.world, q.samples, reply.masks, reply.visibility);
  } else {
    solve_light_by_method(q.mesh, q.receivers, q.light, q.samples, config, reply.masks, reply.visibility, reply.stats);
  }
  reply.ms = watch.lap();
  return reply;
}

std::uint64_t differing_bits(const VisibilityMasks& a, const VisibilityMasks& b, std::size_t receivers) {
  std::uint64_t count = 0;
  for (std::size_t w = 0; w < receivers * a.words_per_receiver; ++w)
    count += static_cast<std::uint64_t>(std::popcount(a.words[w] ^ b.words[w]));
  return count;
}

/// The frame before, of one contender or of the oracle.
struct Before {
  VisibilityMasks masks;
  std::vector<float> visibility;
};

/// Flips from the frame before to this one, and those among them for which the oracle gives no reason.
void count_flips(const Reply& now, const Before& before, const VisibilityMasks& oracle,
                 const VisibilityMasks& oracle_before, std::size_t points, AtlasAnswer& answer) {
  std::uint64_t flips = 0, unreasoned = 0;
  for (std::size_t i = 0; i < points; ++i) {
    std::uint64_t reasons = 0;
    for (std::size_t w = 0; w < oracle.words_per_receiver; ++w) {
      const std::uint64_t reason = oracle.mask(i)[w] ^ oracle_before.mask(i)[w];
      reasons += static_cast<std::uint64_t>(std::popcount(reason));
      if (now.masks.words.empty()) continue;
      const std::uint64_t flipped = now.masks.mask(i)[w] ^ before.masks.mask(i)[w];
      flips += static_cast<std::uint64_t>(std::popcount(flipped));
      unreasoned += static_cast<std::uint64_t>(std::popcount(flipped & ~reason));
    }
    if (!now.masks.words.empty()) continue;
    const bool changed = now.visibility[i] != before.visibility[i];
    flips += changed, unreasoned += changed && reasons == 0;
  }
  answer.flips_per_frame.push_back(flips);
  answer.unreasoned += unreasoned;
  answer.reasons_asked += now.masks.words.empty() ? points : points * oracle.sample_count;
}

/// Second differences in time of a picture whose rows are frames; their mean is the flicker.
double second_differences(const VPicture& v, std::uint32_t width, VPicture& change) {
  const std::size_t rows = v.size() / width;
  change.assign(v.size(), 0.0f);
  double sum = 0.0;
  for (std::size_t i = width; i + width < v.size(); ++i) {
    change[i] = std::fabs(v[i - width] - 2.0f * v[i] + v[i + width]);
    sum += double{change[i]};
  }
  return rows > 2 ? sum / (static_cast<double>(width) * static_cast<double>(rows - 2)) : 0.0;
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

class EntryMeasurement {
 public:
  EntryMeasurement(const AtlasEntry& entry, const std::function<bool(double)>& progress)
      : entry_(entry), progress_(progress), before_(entry.contenders.size()) {
    measures_.answers.resize(entry.contenders.size());
  }

  AtlasMeasures run() {
    for (std::size_t k = 0; k < entry_.frame_count; ++k) measure_frame(k);
    measures_.width = entry_.width;
    measures_.height = static_cast<std::uint32_t>(measures_.truth.size() / entry_.width);
    if (entry_.temporal) {
      measures_.truth_flicker = second_differences(measures_.truth, entry_.width, measures_.truth_change);
      for (AtlasAnswer& answer : measures_.answers) {
        if (answer.refused.empty()) answer.flicker = second_differences(answer.visibility, entry_.width, answer.change);
      }
    }
    return std::move(measures_);
  }

 private:
  /// Frames on the lattice and the oracle's answer, by number and pattern of samples.
  struct Asked {
    Question question;
    VisibilityMasks oracle;
  };

  void check_progress(std::size_t done_contenders) {
    const double per_frame = 1.0 / static_cast<double>(entry_.frame_count);
    const double of_frame = static_cast<double>(done_contenders) / static_cast<double>(entry_.contenders.size());
    if (!progress_((static_cast<double>(frame_) + of_frame) * per_frame))
      throw Error(ErrorCode::kCancelled, "cancelled");
  }

  Asked& asked(const AtlasFrame& frame, const ShadowConfig& config) {
    const auto [place, is_new] = asked_.try_emplace({config.light_sample_count, config.pattern});
    if (is_new) {
      place->second.question = make_question(frame, config);
      const Question& q = place->second.question;
      solve_oracle(q.mesh, q.receivers, q.samples, config, place->second.oracle);
    }
    return place->second;
  }

  void measure_frame(std::size_t k) {
    frame_ = k;
    asked_.clear();
    const AtlasFrame frame = entry_.frame(k);
    const Asked& base = asked(frame, entry_.contenders.front().config);
    add_truth(k, frame, base);
    for (std::size_t c = 0; c < entry_.contenders.size(); ++c) {
      check_progress(c);
      ask_contender(c, frame);
    }
    if (entry_.easy) compare_with_easy(k, frame);
    if (!entry_.temporal) return;
    if (k > 0) {
      measures_.truth_flips_per_frame.push_back(differing_bits(base.oracle, oracle_before_, frame.points.size()));
    }
    oracle_before_ = base.oracle;
  }

  void add_truth(std::size_t k, const AtlasFrame& frame, const Asked& base) {
    truth_masks_ = base.oracle;
    if (entry_.truth_frame) {
      const ShadowConfig& config = entry_.contenders.front().config;
      const AtlasFrame home = entry_.truth_frame(k);
      const Question q = make_question(home, config);
      solve_oracle(q.mesh, q.receivers, q.samples, config, truth_masks_);
    }
    for (std::size_t i = 0; i < frame.points.size(); ++i) {
      measures_.truth.push_back(entry_.truth ? static_cast<float>(entry_.truth(k, frame.points[i]))
                                             : truth_masks_.visibility(i));
    }
  }

  void ask_contender(std::size_t c, const AtlasFrame& frame) {
    const AtlasContender& contender = entry_.contenders[c];
    AtlasAnswer& answer = measures_.answers[c];
    if (!answer.refused.empty()) return;
    const Asked& base = asked(frame, contender.config);
    const std::size_t points = frame.points.size();
    Reply reply;
    try {
      reply = ask(contender, base.question);
    } catch (const Error& e) {
      if (e.code() == ErrorCode::kCancelled) throw;
      answer = {};
      answer.refused = e.what();
      return;
    }
    const VisibilityMasks& oracle = entry_.truth_frame ? truth_masks_ : base.oracle;
    answer.visibility.insert(answer.visibility.end(), reply.visibility.begin(),
                             reply.visibility.begin() + static_cast<std::ptrdiff_t>(points));
    answer.has_masks = !reply.masks.words.empty();
    if (answer.has_masks) {
      answer.wrong_bits += differing_bits(reply.masks, oracle, points);
      answer.bits += points * oracle.sample_count;
    }
    answer.ms += reply.ms;
    answer.bytes = std::max(answer.bytes, reply.stats.bytes);
    answer.details = reply.stats.details;
    if (!entry_.temporal) return;
    if (frame_ > 0) count_flips(reply, before_[c], oracle, oracle_before_, points, answer);
    before_[c] = {std::move(reply.masks), std::move(reply.visibility)};
  }

  /// Runs of the hard and of the easy frame in turn, so that whatever slows the machine meets both.
  void compare_with_easy(std::size_t k, const AtlasFrame& frame) {
    const AtlasFrame easy = entry_.easy(k);
    for (std::size_t c = 0; c < entry_.contenders.size(); ++c) {
      AtlasAnswer& answer = measures_.answers[c];
      const AtlasContender& contender = entry_.contenders[c];
      if (!answer.refused.empty() || contender.textbook) continue;
      const Question hard_question = make_question(frame, contender.config);
      const Question easy_question = make_question(easy, contender.config);
      std::vector<double> hard_ms, easy_ms;
      for (int run = 0; run < kTimedRuns; ++run) {
        hard_ms.push_back(ask(contender, hard_question).ms);
        const Reply easy_reply = ask(contender, easy_question);
        easy_ms.push_back(easy_reply.ms);
        answer.easy_bytes = std::max(answer.easy_bytes, easy_reply.stats.bytes);
      }
      answer.ms = median(hard_ms), answer.easy_ms = median(easy_ms);
    }
  }

  const AtlasEntry& entry_;
  const std::function<bool(double)>& progress_;
  AtlasMeasures measures_;
  std::size_t frame_ = 0;
  std::map<std::pair<std::uint32_t, SamplePattern>, Asked> asked_;
  VisibilityMasks truth_masks_, oracle_before_;
  std::vector<Before> before_;
};

}  // namespace

AtlasMeasures measure_entry(const AtlasEntry& entry, const std::function<bool(double)>& progress) {
  return EntryMeasurement(entry, progress).run();
}

Deviation deviation(const VPicture& a, const VPicture& b) {
  Deviation result;
  if (a.empty()) return result;
  double squares = 0.0, sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double d = double{a[i]} - b[i];
    squares += d * d, sum += d, result.max = std::max(result.max, std::fabs(d));
  }
  const auto count = static_cast<double>(a.size());
  result.rmse = std::sqrt(squares / count), result.mean = sum / count;
  return result;
}

}  // namespace halfshade
