// The scenes of the failure atlas. Letters and numbers in brackets are those of the failure classes in docs/atlas.md.
#include <fmt/format.h>

#include <cmath>

#include "atlas_entry.h"
#include "rasterizer/scenes/hard_cases.h"

namespace halfshade {
namespace {

using cases::frame_light;
using cases::scene_of;

/// Centres of a grid of `side` x `side` cells over [low, high] x [low.y, high.y] on y = 0, rows along z.
std::vector<dvec3> floor_patch(const dvec2& low, const dvec2& high, std::uint32_t side) {
  std::vector<dvec3> points;
  const dvec2 step = (high - low) / double(side);
  for (std::uint32_t row = 0; row < side; ++row) {
    for (std::uint32_t column = 0; column < side; ++column) {
      points.emplace_back(low.x + (column + 0.5) * step.x, 0.0, low.y + (row + 0.5) * step.y);
    }
  }
  return points;
}

/// The same on z = 4, rows along -y, for the accumulation cases.
std::vector<dvec3> wall_patch(double reach, std::uint32_t side) {
  std::vector<dvec3> points = floor_patch({-reach, -reach}, {reach, reach}, side);
  for (dvec3& p : points) p = {p.x, -p.z, 4.0};
  return points;
}

std::vector<dvec3> line(double begin, double end, double z, std::uint32_t count) {
  std::vector<dvec3> points;
  for (std::uint32_t i = 0; i < count; ++i) points.emplace_back(begin + (i + 0.5) * (end - begin) / count, 0.0, z);
  return points;
}

AtlasEntry picture_entry(const std::string& id, const std::string& title, std::uint32_t side, AtlasFrame frame) {
  AtlasEntry entry;
  entry.id = id;
  entry.title = title;
  entry.width = side;
  entry.contenders = standard_contenders();
  entry.frame = [frame](std::size_t) { return frame; };
  return entry;
}

AtlasFrame on_floor(Scene scene, const dvec2& low, const dvec2& high, std::uint32_t side) {
  return {std::move(scene), frame_light(), floor_patch(low, high, side), {}};
}

AtlasFrame on_wall(const cases::Triangles& triangles, double reach, std::uint32_t side) {
  return {scene_of(triangles), cases::accumulation_light(), wall_patch(reach, side), {}, {0.0f, 0.0f, -1.0f}};
}

constexpr double kWireWidths[] = {0.01, 0.05, 0.0625, 0.1};

/// Rows are shifted against each other: what that does is `why`.
void add_shifted_rows(AtlasEntry& entry, const std::string& why) {
  AtlasContender rows = entry.contenders.front();
  rows.id = "exact, pattern rows";
  rows.config.pattern = SamplePattern::kRows;
  rows.why = "Rows are shifted against each other: " + why;
  entry.contenders.push_back(std::move(rows));
}

AtlasEntry thin_wire(std::uint32_t side) {
  AtlasEntry entry;
  entry.id = "wire";
  entry.title = "Thin wire sweep (D2)";
  entry.what =
      "A wire halfway to the light passes by, from top to bottom 0.01, 0.05, 0.0625 and 0.1 wide. Twice as wide on the "
      "light, it lies between the samples (0.125 apart) or over them, and V jumps where it should not change at all.";
  entry.parameters = {{"wire_widths", kWireWidths}, {"sample_spacing", 0.125}};
  entry.width = side * 2;
  entry.repeat = std::max(1u, side / 4);
  entry.frame_count = std::size(kWireWidths);
  entry.frame = [side](std::size_t k) {
    return AtlasFrame{scene_of(cases::wire(kWireWidths[k])), frame_light(), line(0.0, 0.5, 0.013, side * 2), {}};
  };
  entry.truth = [](std::size_t k, const dvec3&) { return 1.0 - kWireWidths[k]; };
  entry.truth_is = "closed form, 1 - width";
  entry.low = 0.8f;
  entry.error_range = 0.0625f;
  entry.across = "x of the receiver", entry.down = "width of the wire";
  entry.curve_frame = 1;
  entry.curve_begin = 0.25 / (side * 2), entry.curve_step = 0.5 / (side * 2);
  entry.contenders = standard_contenders();
  entry.explain({"exact", "afsm", "hpc", "gears", "stsv", "raytrace robust", "raytrace fast", "shadow-maps"},
                "No bit is wrong, but 16 columns of samples see all or nothing of a wire narrower than 1/16: an error "
                "of up to one column, 1/16.");
  for (const std::uint32_t n : {16u, 1024u}) {
    AtlasContender contender = entry.contenders.front();
    contender.id = fmt::format("exact, {} samples", n);
    contender.config.light_sample_count = n;
    contender.why = fmt::format("The same with {0} columns: up to 1/{0}.", n == 16 ? 4 : 32);
    entry.contenders.push_back(contender);
  }
  add_shifted_rows(entry, "16 different places per column, and no jump larger than a few bits.");
  return entry;
}

AtlasEntry both_sides_lit(std::uint32_t side) {
  AtlasEntry entry = picture_entry("both_sides", "Both sides of a triangle are lit (B1)", side,
                                   on_floor(scene_of(cases::both_sides_lit()), {-3, -3}, {3, 3}, side));
  entry.what =
      "An upright triangle in x = 0, the plane that holds the light's centre. Each side sees one half of the light and "
      "is shadowed from the other.";
  entry.explain({"shadow-map", "pcf", "pcss", "accumulation bits", "accumulation bits, 8 layers", "accumulation sum"},
                "Seen from the light's centre the triangle is a line: the map does not hold it.");
  entry.add_textbook(TextbookForm::kCenterVolumes,
                     "A volume oriented from the light's centre has no inside when the centre lies in the plane: no "
                     "shadow on either side.");
  return entry;
}

AtlasEntry winding(std::uint32_t side) {
  cases::Triangles plates = cases::plate(2.0);
  for (cases::Triangle& t : plates) {
    for (dvec3& p : t) p.x -= 1.4;
  }
  cases::Triangles up = cases::plate(2.0);
  for (cases::Triangle& t : up) {
    for (dvec3& p : t) p.x += 1.4;
    std::swap(t[1], t[2]);
  }
  AtlasEntry entry = picture_entry("winding", "Open meshes of either winding (A1)", side,
                                   on_floor(scene_of(cases::joined(plates, up)), {-5, -5}, {5, 5}, side));
  entry.what = "Two open squares; the left one is wound to face the floor, the right one to face the light.";
  entry.add_textbook(TextbookForm::kBackFacesOnly,
                     "Casting by back faces alone is right for closed meshes; an open square that faces the light is "
                     "lost.");
  return entry;
}

AtlasEntry double_cover(std::uint32_t side) {
  AtlasEntry entry = picture_entry("double_cover", "Two blockers hide the same half (B8)", side,
                                   on_floor(scene_of(cases::double_cover()), {-1.5, -1.5}, {1.5, 1.5}, side));
  entry.what = "Two half-planes, one above the other: what the second hides, the first hides already.";
  entry.explain({"accumulation sum"}, "The map shows one layer, but its lexels overlap as seen from the receiver.");
  entry.add_textbook(TextbookForm::kAddedCoverage,
                     "Shares hidden by each triangle are added as if they never overlapped: V falls to 0 where half of "
                     "the light is seen.");
  return entry;
}

AtlasEntry hidden_card(std::uint32_t side) {
  AtlasEntry entry =
      picture_entry("hidden_layer", "A caster behind another one (E1)", side, on_wall(cases::hidden_card(), 1.2, side));
  entry.what =
      "Disk light at z = 0, wall at z = 4. A small card at z = 1 hides a larger one at z = 3 from the light's centre "
      "exactly; the middle of the wall is in full shadow of the larger.";
  entry.across = "x", entry.down = "y";
  entry.explain({"accumulation bits", "accumulation sum", "pcss", "pcf", "shadow-map"},
                "The larger card is not in the map of one layer: the middle of the shadow is lit.");
  entry.explain({"accumulation bits, 8 layers"}, "Peeled layers hold both cards; what is left is the size of lexels.");
  return entry;
}

AtlasEntry overlapping_cards(std::uint32_t side) {
  AtlasEntry entry =
      picture_entry("overlap", "Overlapping layers (E2)", side, on_wall(cases::overlapping_cards(0.6), 2.0, side));
  entry.what =
      "One card at z = 1 hides the left half of the light and more, one at z = 3 the right half and more; together all "
      "of it from the middle of the wall.";
  entry.across = "x", entry.down = "y";
  entry.add_variant("accumulation sum, K = 5", "accumulation sum", {"shadow-accumulation.kernel=5"});
  entry.add_variant("accumulation sum, K = 32", "accumulation sum", {"shadow-accumulation.kernel=32"});
  entry.add_variant("accumulation sum, K = 32, as printed", "accumulation sum",
                    {"shadow-accumulation.kernel=32", "shadow-accumulation.refine=off", "shadow-accumulation.plane=1"});
  return entry;
}

AtlasEntry few_lexels(std::uint32_t side) {
  AtlasEntry entry = picture_entry("few_lexels", "An opaque square near the wall (E3)", side,
                                   on_wall(cases::card(3, -1, 1, 1), 2.0, side));
  entry.what =
      "A card at z = 3, map plane at one light radius: each lexel is seen 21 times enlarged, and the middle of the "
      "wall "
      "is in full shadow.";
  entry.across = "x", entry.down = "y";
  for (AtlasContender& c : entry.contenders) {
    if (c.config.method == ShadowMethod::kShadowAccumulation) c.config.shadow_map.plane = 1.0f;
  }
  entry.explain({"accumulation sum"},
                "K = 10: all enlarged lexels miss the light's middle, so that full shadow is fully lit.");
  entry.add_variant("accumulation sum, K = 5", "accumulation sum", {"shadow-accumulation.kernel=5"},
                    "K = 5: one enlarged lexel counts 22 lights' worth; clamped.");
  entry.add_variant("accumulation sum, K = 32", "accumulation sum", {"shadow-accumulation.kernel=32"},
                    "K = 32: sums of 2.2, clamped.");
  return entry;
}

AtlasEntry piercing_light(std::uint32_t side) {
  AtlasEntry entry = picture_entry("light_in_triangle", "A triangle passes through the light (C1)", side,
                                   on_floor(scene_of(cases::piercing_light()), {-8, -8}, {8, 8}, side));
  entry.what =
      "The triangle's plane cuts the light; the part above the light's plane hides nothing, the part below does.";
  entry.explain({"shadow-map", "pcf", "pcss", "accumulation bits", "accumulation bits, 8 layers", "accumulation sum",
                 "shadow-maps"},
                "What lies nearer than the map's near plane, or passes through the eye, is cut away or smeared.");
  return entry;
}

AtlasEntry through_light_plane(std::uint32_t side) {
  AtlasEntry entry = picture_entry("behind_light", "A corner behind the light's plane (A5, D1)", side,
                                   on_floor(scene_of(cases::through_light_plane()), {2, -14}, {34, 18}, side));
  entry.what = "A triangle reaches from below to above the light's plane: its shadow goes on for ever, here to x = 34.";
  entry.add_textbook(
      TextbookForm::kFarPlane,
      "Corners above the light's plane project to the wrong side: the box ends at x = 11, and everything "
      "beyond leaks.");
  return entry;
}

/// V behind cases::bars(): the share of the light that bars, all of them opaque below half of their period, leave.
double bars_truth(double x) {
  constexpr double kToBars = 3.5 / 4.0;  // share of the way to the light
  const auto phase = [&](double light_x) { return 64.0 * (x + kToBars * (light_x - x) + 16.0); };
  const auto opaque_until = [](double p) { return 0.5 * std::floor(p) + std::min(p - std::floor(p), 0.5); };
  return 1.0 - (opaque_until(phase(1.0)) - opaque_until(phase(-1.0))) / (phase(1.0) - phase(-1.0));
}

AtlasEntry fence(std::uint32_t side) {
  AtlasEntry entry = picture_entry("fence", "A fence finer than the samples (B6)", side,
                                   on_floor(cases::bars(), {0, 0}, {0.5, 0.5}, side));
  entry.what =
      "Opaque bars of half of a period of 1/64, half a unit below the light: 112 periods across the light, 16 columns "
      "of samples, 7 periods apart. V is 1/2 everywhere.";
  entry.parameters = {{"period", 1.0 / 64.0}};
  entry.truth = [](std::size_t, const dvec3& r) { return bars_truth(r.x); };
  entry.truth_is = "closed form";
  entry.curve_frame = 0;
  entry.curve_begin = 0.25 / side, entry.curve_step = 0.5 / side;
  entry.explain({"exact", "afsm", "hpc", "gears", "stsv", "raytrace robust", "raytrace fast", "afsm-lut"},
                "Every bit is the texel under its segment, but all 16 columns meet the bars at the same phase: V "
                "swings between 0 and 1 instead of "
                "staying at 1/2.");
  entry.explain({"shadow-map", "pcf", "pcss", "shadow-maps", "accumulation bits", "accumulation bits, 8 layers",
                 "accumulation sum"},
                "A lexel is wider than a bar: each shows whichever texel its centre meets.");
  AtlasContender filtered = entry.contenders.front();
  filtered.id = "stsv, filtered";
  filtered.config.method = ShadowMethod::kSoftTexturedShadowVolumes;
  filtered.config.stsv.filter = OpacityFilter::kFiltered;
  filtered.why = "Opacity averaged over each sample's share of the light: no masks, and no swing.";
  entry.contenders.push_back(filtered);
  add_shifted_rows(entry, "they meet the bars at 16 different phases.");
  return entry;
}

AtlasEntry t_junctions(std::uint32_t side) {
  // Points and samples are moved apart by the same offset in opposite directions: midpoints, where the blockers'
  // corners are, stay where they were, but products of the coordinates no longer fit into floats.
  const dvec3 offset = dvec3(31847, 20719, 43019) * 0x1p-19;
  const double reach = side / 32.0 + 1.0 / 16.0 * 9.0;
  AtlasFrame frame{scene_of(cases::t_junctions(reach)), frame_light(), {}, {}};
  frame.light.center -= offset;
  frame.points = floor_patch({-(side / 16.0), -(side / 16.0)}, {side / 16.0, side / 16.0}, side);
  for (dvec3& p : frame.points) p += offset;
  AtlasEntry entry = picture_entry("t_junctions", "T-junctions, aimed at (S01, S02)", side, std::move(frame));
  entry.what =
      "A ceiling of quads whose corners lie on their neighbours' edges. Every segment from a receiver to a sample goes "
      "through a corner or a point of an edge, exactly; nothing gets through.";
  entry.error_range = 0.5f;
  entry.explain({"raytrace fast", "raytrace robust"},
                "In single precision the segment may pass between two triangles that it touches at the same point.");
  entry.explain({"shadow-maps", "shadow-map", "pcf", "pcss", "afsm-lut", "accumulation bits",
                 "accumulation bits, 8 layers", "accumulation sum"},
                "");
  return entry;
}

AtlasEntry far_origin(std::uint32_t side) {
  const cases::Triangles triangles = cases::joined(cases::half_plane(), cases::scattered(6, 60));
  const auto moved = [triangles, side](double distance) {
    AtlasFrame frame = on_floor(scene_of(triangles), {-2, -2}, {2, 2}, side);
    const dvec3 offset(distance, -distance, 2.0 * distance);
    for (dvec3& p : frame.scene.positions) p += offset;
    for (dvec3& p : frame.points) p += offset;
    frame.light.center += offset;
    return frame;
  };
  AtlasEntry entry = picture_entry("far_origin", "A million units from the origin (C5, S06)", side, {});
  entry.what =
      "A half-plane and 60 triangles, and all of it moved by (10^6, -10^6, 2 * 10^6), where floats are 1/16 to 1/8 "
      "apart. Doubles still hold every coordinate exactly.";
  entry.parameters = {{"offset", {1e6, -1e6, 2e6}}};
  entry.frame = [moved](std::size_t) { return moved(1e6); };
  entry.truth_frame = [moved](std::size_t) { return moved(0.0); };
  entry.truth_is = "oracle at the origin, the same light samples";
  entry.add_textbook(TextbookForm::kFloatRays,
                     "World coordinates in floats: blockers, receivers and samples snap to a grid of 1/16 to 1/8.");
  return entry;
}

AtlasEntry hot_cell(const AtlasSize& size) {
  const std::uint32_t side = size.side / 2;
  const auto below = [=](double depth) {
    cases::Triangles swarm = cases::swarm_at_light(25, static_cast<int>(size.triangles));
    for (cases::Triangle& t : swarm) {
      for (dvec3& p : t) p.y -= depth;
    }
    return on_floor(scene_of(swarm), {-5, -5}, {5, 5}, side);
  };
  AtlasEntry entry = picture_entry("hot_cell", "A swarm at the light (D3)", side, {});
  entry.what = fmt::format(
      "{} triangles of 0.001 within 0.01 of the light: each may matter to every receiver, so lists of (triangle, cell) "
      "pairs explode. The ratio compares the time with that of the same swarm two units farther down.",
      size.triangles);
  entry.parameters = {{"triangles", size.triangles}, {"gears.grid", 128}};
  entry.frame = [below](std::size_t) { return below(0.0); };
  entry.easy = [below](std::size_t) { return below(2.0); };
  entry.contenders = standard_contenders(16);
  for (AtlasContender& c : entry.contenders) c.config.gears.grid = 128;
  entry.error_range = 0.25f;
  entry.explain(
      {"gears"},
      "Right, and within its budget of pairs: with one pair per cell it would hold all of gears.assignments.");
  entry.explain({"shadow-map", "pcf", "pcss", "shadow-maps", "accumulation bits", "accumulation bits, 8 layers",
                 "accumulation sum"},
                "Nearer than the map's near plane, or finer than its lexels: seen by chance.");
  return entry;
}

AtlasEntry crowd(std::uint32_t side) {
  const cases::Triangles block = cases::box({-1, 0, -1}, {1, 0.05, 1});
  const auto with = [block, side](bool far) {
    AtlasFrame frame = on_floor(scene_of(block), {0.98, -0.04}, {1.06, 0.04}, side);
    if (far) frame.others.emplace_back(6.9, 0.0, 0.0);
    return frame;
  };
  AtlasEntry entry = picture_entry("crowd", "All receivers in one cell, one far away (A3, A9)", side, {});
  entry.what =
      "The edge of a plate 0.05 thick that lies on the floor, 0.08 units of it, and one more receiver 6 units away: "
      "what "
      "is fitted to all receivers is far too coarse for the crowd. The ratio compares the time with that without the "
      "far "
      "one.";
  entry.frame = [with](std::size_t) { return with(true); };
  entry.easy = [with](std::size_t) { return with(false); };
  entry.explain(
      {"shadow-map", "pcf", "pcss", "shadow-maps", "accumulation bits", "accumulation bits, 8 layers",
       "accumulation sum"},
      "The map reaches to the far receiver: the crowd gets a few lexels of it, and the contact lies within the "
      "bias.");
  return entry;
}

AtlasEntry small_light(const char* id, const char* title, std::uint32_t side, const Light& light) {
  const auto triangles = cases::joined(cases::plate(2), cases::box({-2, 0.5, -2}, {-1, 1.0, 2}));
  AtlasFrame frame = on_floor(scene_of(triangles), {-4.5, -4.5}, {4.5, 4.5}, side);
  frame.light = light;
  return picture_entry(id, title, side, std::move(frame));
}

AtlasEntry needle_light(std::uint32_t side) {
  Light needle = frame_light();
  needle.u = {2e-4, 0, 0};
  AtlasEntry entry = small_light("needle_light", "A needle as light (A7)", side, needle);
  entry.what = "The light is 0.0002 wide and 2 long: shadows are sharp along x and soft along z.";
  entry.explain({"pcss", "accumulation bits", "accumulation bits, 8 layers", "accumulation sum"},
                "Takes the needle for a disk of the same area: too sharp along z.");
  return entry;
}

AtlasEntry point_light(std::uint32_t side) {
  Light point = frame_light();
  point.shape = LightShape::kPoint;
  AtlasEntry entry = small_light("point_light", "A point as light (C2, D6)", side, point);
  entry.what = "No extent at all: one sample, hard shadows; what divides by the light's size divides by zero.";
  entry.explain(
      {"shadow-map", "shadow-maps", "pcss", "accumulation bits", "accumulation bits, 8 layers", "accumulation sum"},
      "Right up to the width of a lexel.");
  return entry;
}

AtlasEntry half_plane_table(std::uint32_t side) {
  AtlasFrame frame = on_floor(scene_of(cases::scattered(4, 40)), {-4, -4}, {4, 4}, side);
  frame.light.shape = LightShape::kSphere;
  frame.light.radius = 1.0;
  AtlasEntry entry = picture_entry("table", "Planes from a table (A4)", side, std::move(frame));
  entry.what =
      "40 triangles before a sphere of radius 1. The table holds planes by two angles and a distance, 128 steps each "
      "by default.";
  entry.error_range = 0.0625f;
  for (const char* steps : {"8", "32"}) {
    const std::string option = std::string("afsm.table=") + steps;
    entry.add_variant(fmt::format("afsm-lut, {} steps", steps), "afsm-lut", {option.c_str()});
  }
  return entry;
}

AtlasEntry bias(std::uint32_t side) {
  const dvec3 up = glm::normalize(dvec3(-0.8, 1.0, 0.0));
  const auto card = cases::quad({-0.6, -0.48, -0.5}, {-0.6, -0.48, 0.5}, {-0.6, -0.08, 0.5}, {-0.6, -0.08, -0.5});
  const cases::Triangles plane = {{dvec3(-32, -25.6, -32), dvec3(-32, -25.6, 96), dvec3(32, 25.6, -32)}};
  AtlasFrame frame = on_floor(scene_of(cases::joined(plane, card)), {-1.2, -1.2}, {1.2, 1.2}, side);
  for (dvec3& p : frame.points) p += dvec3(0.0, 0.8 * p.x, 0.0) + 1e-4 * up;
  frame.normal = vec3(0.0f);
  frame.own_triangle = 0;
  AtlasEntry entry = picture_entry("bias", "Bias: acne or a gap (E5)", side, std::move(frame));
  entry.what =
      "A card stands on a slope. The slope hides nothing of itself, and the shadow begins at the card's foot. The "
      "receivers come without normals, so that a bias alone has to tell the slope from what stands on it.";
  const auto none = {"map.bias=0", "map.slope-bias=0"}, much = {"map.bias=16", "map.slope-bias=16"};
  for (const char* base : {"shadow-map", "pcf", "pcss", "shadow-maps", "accumulation bits"}) {
    entry.add_variant(std::string(base) + ", bias 0", base, none,
                      "Without bias half of the slope lies behind its own lexels: acne.");
  }
  entry.add_variant("shadow-map, bias 16", "shadow-map", much,
                    "With a bias of 16 lexels the shadow begins a gap away from the foot.");
  return entry;
}

AtlasEntry moving_light(const AtlasSize& size) {
  constexpr double kStep = 0.125 / 512.0;
  AtlasEntry entry;
  entry.id = "moving_light";
  entry.title = "Moving light (S23)";
  entry.what = fmt::format(
      "A line of receivers behind a slanted half-plane; time runs downwards, {} frames. Per frame the light moves by "
      "1/512 of the distance between samples. Maps show the second difference of V in time.",
      size.frames);
  entry.parameters = {{"frames", size.frames}, {"step", kStep}};
  entry.width = size.side;
  entry.frame_count = size.frames;
  entry.frame = [side = size.side](std::size_t k) {
    AtlasFrame frame{scene_of(cases::half_plane(0.317)), frame_light(), line(-1.6, 1.55, 0.25, side), {}};
    frame.light.center.x += static_cast<double>(k) * kStep;
    return frame;
  };
  entry.temporal = true;
  entry.down = "time";
  entry.error_range = 0.0625f;
  entry.contenders = standard_contenders();
  for (AtlasContender& c : entry.contenders) {
    if (c.config.method == ShadowMethod::kShadowMapPerSample) c.config.shadow_map.resolution = 128;
  }
  entry.explain({"shadow-map", "pcf", "pcss", "accumulation bits", "accumulation bits, 8 layers", "accumulation sum",
                 "shadow-maps"},
                "Lexels slide along under the edge: V jumps when an edge passes a lexel's centre, not when it passes a "
                "sample.");
  entry.explain({"afsm-lut"}, "Edges jump from one plane of the table to the next.");
  return entry;
}

AtlasEntry moving_camera(const AtlasSize& size) {
  const std::uint32_t frames = std::max(4u, size.frames / 4);
  AtlasEntry entry;
  entry.id = "moving_camera";
  entry.title = "Moving camera";
  entry.what = fmt::format(
      "The same line of receivers while nothing moves but the camera, whose window of other receivers slides over the "
      "floor; time runs downwards, {} frames. No bit has a reason to change: what changes is crawling.",
      frames);
  entry.parameters = {{"frames", frames}, {"step", {0.011, 0.007}}};
  entry.width = size.side;
  entry.repeat = 4;
  entry.frame_count = frames;
  entry.frame = [side = size.side](std::size_t k) {
    const dvec2 at(-2.0 + 0.011 * static_cast<double>(k), -2.0 + 0.007 * static_cast<double>(k));
    return AtlasFrame{scene_of(cases::half_plane(0.317)), frame_light(), line(-1.6, 1.55, 0.25, side),
                      floor_patch(at, at + 4.0, 20)};
  };
  entry.temporal = true;
  entry.down = "time";
  entry.error_range = 0.0625f;
  entry.contenders = standard_contenders();
  for (AtlasContender& c : entry.contenders) {
    if (c.config.method == ShadowMethod::kShadowMapPerSample) c.config.shadow_map.resolution = 128;
  }
  entry.explain({"shadow-map", "pcf", "pcss", "accumulation bits", "accumulation bits, 8 layers", "accumulation sum",
                 "shadow-maps"},
                "Maps are fitted to the receivers of the frame: lexels lie elsewhere in every frame.");
  entry.explain({"afsm-lut", "raytrace fast", "raytrace robust"}, "");
  return entry;
}

}  // namespace

std::vector<AtlasEntry> atlas_entries(const AtlasSize& size) {
  return {thin_wire(size.side),
          both_sides_lit(size.side),
          winding(size.side),
          double_cover(size.side),
          hidden_card(size.side),
          overlapping_cards(size.side),
          few_lexels(size.side),
          piercing_light(size.side),
          through_light_plane(size.side),
          fence(size.side),
          t_junctions(size.side / 4),
          far_origin(size.side),
          hot_cell(size),
          crowd(size.side),
          needle_light(size.side),
          point_light(size.side),
          half_plane_table(size.side / 2),
          bias(size.side),
          moving_light(size),
          moving_camera(size)};
}

}  // namespace halfshade
