// What the failure atlas shows: scenes that break shadow methods, and who is asked there.
#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <optional>

#include "halfshade/shadows.h"
#include "textbook.h"

namespace halfshade {

/// One method with its options, or a textbook form.
struct AtlasContender {
  std::string id;  // "afsm", "accumulation sum", "textbook: float rays"
  ShadowConfig config;
  std::optional<TextbookForm> textbook;
  std::string why;  // one sentence: how it fails in this entry, or in general
};

/// One solve. `points` are those of the picture, row by row; `others` are receivers that the methods see as well, but
/// that are not part of it. All lie on one surface.
struct AtlasFrame {
  Scene scene;
  Light light;
  std::vector<dvec3> points, others;
  vec3 normal{0.0f, 1.0f, 0.0f};
  std::uint32_t own_triangle = kNone;
};

struct AtlasEntry {
  std::string id, title;
  std::string what;  // one or two sentences: the scene, and what is hard about it
  nlohmann::ordered_json parameters = nlohmann::ordered_json::object();
  std::uint32_t width = 0;      // points per row
  std::uint32_t repeat = 1;     // rows of the picture that a row of points fills
  std::size_t frame_count = 1;  // their pictures stand one below the other
  std::function<AtlasFrame(std::size_t frame)> frame;
  std::function<AtlasFrame(std::size_t frame)>
      easy;  // the same amount of work without the difficulty: for time and memory
  std::function<AtlasFrame(std::size_t frame)> truth_frame;            // whose oracle is the truth; empty: `frame`
  std::function<double(std::size_t frame, const dvec3& point)> truth;  // V where it is known better than by the oracle
  std::string truth_is = "oracle, the same light samples";
  std::vector<AtlasContender> contenders;
  float low = 0.0f, high = 1.0f;  // V that pictures show as black and white
  float error_range = 1.0f;       // difference that error maps show in full colour
  bool temporal = false;          // frames follow each other in time: flips and flicker are counted
  std::string across = "x", down = "z";
  std::optional<std::size_t> curve_frame;  // V along the first row of this frame as a curve
  double curve_begin = 0.0, curve_step = 1.0;

  /// Why the contenders with these ids fail here; those that are absent are passed over.
  void explain(std::initializer_list<const char*> ids, const std::string& why);
  /// Adds one more, `base` under another name with options "name=value".
  void add_variant(const std::string& name, const char* base, std::initializer_list<const char*> options,
                   const std::string& why = {});
  void add_textbook(TextbookForm form, const std::string& why);
};

struct AtlasSize {
  std::uint32_t side;       // points per axis of ordinary pictures
  std::uint32_t frames;     // of moving lights and cameras
  std::uint32_t triangles;  // of the swarm
};

/// All but the terminator, which is about shading (atlas_terminator.h).
std::vector<AtlasEntry> atlas_entries(const AtlasSize& size);

/// Every method with default options (maps of 512 lexels) for 256 uniform samples; raytrace where Embree is there.
std::vector<AtlasContender> standard_contenders(std::uint32_t samples = 256);

}  // namespace halfshade
