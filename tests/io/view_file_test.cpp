#include "rasterizer/io/view_file.h"

#include "rasterizer/io/image.h"

#include "scratch.h"

namespace halfshade {
namespace {

using test::Scratch;

constexpr const char* kCamera = R"("camera": {"eye": [0, 1, 5], "target": [0, 1, 0]})";

test::Outcome load(const std::string& text) {
  const Scratch scratch;
  return test::outcome_of([&] { load_view(scratch.write("a.view.json", text)); });
}

View make_view() {
  View view;
  view.camera = {{0.1, 0.2, 5.3}, {1.0 / 3.0, -2.0, 0.0}, {0.0, 0.9, 0.1}, 38.7};
  view.lights.resize(8);
  for (std::size_t i = 0; i < view.lights.size(); ++i) {
    Light& light = view.lights[i];
    light.name = "light " + std::to_string(i);
    light.shape = static_cast<LightShape>(i);
    light.emission = vec3(0.1f, 2.0f, 0.3f);
    if (light.shape != LightShape::kSamples && light.shape != LightShape::kPolygon && light.shape != LightShape::kSun) {
      light.center = {0.1, 4.7, -0.3};
    }
  }
  view.lights[1].u = {0.3, 0.0, 0.1};
  view.lights[1].v = {0.0, 0.7, 0.1};
  view.lights[1].two_sided = true;
  view.lights[2].normal = {0.1, -0.9, 0.0};
  view.lights[2].radius = view.lights[3].radius = 1.0 / 7.0;
  view.lights[4].points = {{1, 2, 3}, {0.1, 0.2, 0.3}};
  view.lights[5].axes = {dvec3(0.1, 0.2, 0.3), dvec3(-1.0 / 3.0, 1, 0), dvec3(0, 0.7, 0.1)};
  view.lights[6].points = {{0, 4, 0}, {1, 4, 0}, {1.0 / 3.0, 4, 1}};
  view.lights[6].two_sided = true;
  view.lights[7].normal = {0.1, -0.9, 1.0 / 3.0};
  view.lights[7].angular_diameter_deg = 1.0 / 3.0;
  return view;
}

TEST_CASE("a view of all light types survives writing and reading to the last bit") {
  const View view = make_view();
  const Scratch scratch;
  const View back = load_view(scratch.write("a.json", view_to_json(view)));
  CHECK(back.camera.eye == view.camera.eye);
  CHECK(back.camera.target == view.camera.target);
  CHECK(back.camera.up == view.camera.up);
  CHECK(back.camera.fov_y_deg == view.camera.fov_y_deg);
  REQUIRE(back.lights.size() == view.lights.size());
  for (std::size_t i = 0; i < view.lights.size(); ++i) {
    CAPTURE(i);
    const Light &a = back.lights[i], &b = view.lights[i];
    CHECK(a.name == b.name);
    CHECK(a.shape == b.shape);
    CHECK(a.center == b.center);
    CHECK(a.u == b.u);
    CHECK(a.v == b.v);
    CHECK(a.normal == b.normal);
    CHECK(a.radius == b.radius);
    CHECK(a.angular_diameter_deg == b.angular_diameter_deg);
    CHECK(a.points == b.points);
    CHECK(a.axes == b.axes);
    CHECK(a.two_sided == b.two_sided);
    CHECK(a.emission == b.emission);
  }
  CHECK(view_to_json(back) == view_to_json(view));
}

TEST_CASE("up, fov, emission and two_sided have defaults, and emission may be one number") {
  const Scratch scratch;
  const View view = load_view(scratch.write("a.json", std::string("{") + kCamera + R"(, "lights": [
      {"type": "rectangle", "center": [0, 4, 0], "u": [1, 0, 0], "v": [0, 0, 1]},
      {"name": "b", "type": "point", "position": [0, 4, 0], "emission": 2.5}]})"));
  CHECK(view.camera.up == dvec3(0, 1, 0));
  CHECK(view.camera.fov_y_deg == 45.0);
  CHECK_FALSE(view.lights[0].two_sided);
  CHECK(view.lights[0].emission == vec3(1.0f));
  CHECK(view.lights[1].emission == vec3(2.5f));
}

TEST_CASE("a rectangle's emission may be an image beside the view file, made linear and written back by name") {
  const Scratch scratch;
  const float values[] = {1.0f, 0.0f, 0.0f, 0.2f, 0.5f, 1.0f};
  write_png(scratch.path("e.png"), 2, 1, 3, values, true, 16, {});
  const std::string light =
      R"({"type": "rectangle", "center": [0, 4, 0], "u": [1, 0, 0], "v": [0, 0, 1], "emission": )";
  const auto view_of = [&](const std::string& emission) {
    return load_view(
        scratch.write("a.json", std::string("{") + kCamera + R"(, "lights": [)" + light + emission + "}]}"));
  };
  const View view = view_of("\"e.png\"");
  const EmissionImage& image = view.lights[0].emission_image;
  CHECK(image.width == 2);
  CHECK(image.height == 1);
  for (int k = 0; k < 6; ++k) CHECK(image.rgb[k / 3][k % 3] == doctest::Approx(values[k]).epsilon(1e-4));
  CHECK(view_to_json(view).find("\"emission\": \"e.png\"") != std::string::npos);
  CHECK(test::outcome_of([&] { view_of("\"../e.png\""); }).has("/lights/0/emission: "));
  CHECK(test::outcome_of([&] { view_of("\"missing.png\""); }).code == ErrorCode::kBadInput);
  scratch.write("e.png", "no picture");
  CHECK(test::outcome_of([&] { view_of("\"e.png\""); }).code == ErrorCode::kBadInput);
  const ImageChannel grey{"Y", ImageChannel::Type::kFloat, values};
  const float negative = -1.0f;
  const ImageChannel dark{"Y", ImageChannel::Type::kFloat, &negative};
  write_exr(scratch.path("e.exr"), 2, 1, {&grey, 1}, {});
  CHECK(view_of("\"e.exr\"").lights[0].emission_image.rgb[0] == vec3(1.0f));
  write_exr(scratch.path("e.exr"), 1, 1, {&dark, 1}, {});
  CHECK(test::outcome_of([&] { view_of("\"e.exr\""); }).has("emission -1"));
}

TEST_CASE("wrong cameras are refused with file, place, value and what is allowed") {
  const std::pair<const char*, const char*> cameras[] = {
      {R"({"eye": [0, 0, 1]})", "/camera: key 'target' is missing"},
      {R"({"eye": [0, 0], "target": [0, 0, 0]})", "/camera/eye: '[0,0]', allowed three numbers"},
      {R"({"eye": [0, 0, "x"], "target": [0, 0, 0]})", "/camera/eye/2: '\"x\"', allowed a number"},
      {R"({"eye": [0, 0, 1e39], "target": [0, 0, 0]})", "/camera/eye/2: '1e+39', allowed a number"},
      {R"({"eye": [0, 0, 1], "target": [0, 0, 1]})", "/camera/target: '[0,0,1]', allowed a point other than the eye"},
      {R"({"eye": [0, 0, 1], "target": [0, 0, 0], "up": [0, 0, 3]})", "'up' is parallel"},
      {R"({"eye": [0, 0, 1], "target": [0, 0, 0], "up": [0, 0, 0]})", "/camera/up"},
      {R"({"eye": [0, 0, 1], "target": [0, 0, 0], "fov_y_deg": 180})",
       "/camera/fov_y_deg: '180', allowed a number between 0 and 180"},
      {R"({"eye": [0, 0, 1], "target": [0, 0, 0], "fov_y_deg": 0})", "/camera/fov_y_deg: '0'"},
      {R"({"eye": [0, 0, 1], "target": [0, 0, 0], "fov": 40})",
       "/camera: unknown key 'fov', allowed eye, target, up, fov_y_deg"},
      {R"(3)", "/camera: '3', allowed an object"}};
  for (const auto& [camera, expected] : cameras) {
    const auto outcome = load(std::string(R"({"lights": [], "camera": )") + camera + "}");
    CAPTURE(outcome.message);
    CHECK(outcome.code == ErrorCode::kBadInput);
    CHECK(outcome.has("a.view.json: "));
    CHECK(outcome.has(expected));
  }
}

TEST_CASE("wrong lights are refused with file, place, value and what is allowed") {
  const std::pair<const char*, const char*> lights[] = {
      {R"({"type": "moon", "direction": [0, -1, 0]})",
       "/lights/0/type: '\"moon\"', allowed one of point, rectangle, disk, sphere, samples, ellipsoid, polygon, sun"},
      {R"({"type": "sun", "direction": [0, 0, 0]})", "/lights/0/direction"},
      {R"({"type": "sun", "direction": [0, -1, 0], "angular_diameter_deg": 61})",
       "/lights/0/angular_diameter_deg: '61', allowed a number above 0, up to 60"},
      {R"({"type": "sun", "direction": [0, -1, 0], "center": [0, 4, 0]})", "unknown key 'center'"},
      {R"({"type": "polygon", "vertices": [[0, 4, 0], [1, 4, 0]]})", "/lights/0/vertices: 2 points, allowed 3..64"},
      {R"({"type": "ellipsoid", "center": [0, 4, 0], "axes": [[1, 0, 0], [0, 1, 0]]})",
       "/lights/0/axes: '[[1,0,0],[0,1,0]]', allowed three vectors"},
      {R"({"type": "ellipsoid", "center": [0, 4, 0], "axes": [[1, 0, 0], [0, 1, 0], [0, 0, 0]]})", "/lights/0/axes/2"},
      {R"({"center": [0, 4, 0]})", "/lights/0: key 'type' is missing"},
      {R"({"type": "rectangle", "center": [0, 4, 0], "u": [1, 0, 0], "v": [2, 0, 0]})",
       "/lights/0/v: '[2,0,0]', allowed a vector that is not parallel to u"},
      {R"({"type": "rectangle", "center": [0, 4, 0], "u": [0, 0, 0], "v": [2, 0, 0]})", "/lights/0/u"},
      {R"({"type": "rectangle", "center": [0, 4, 0], "u": [1, 0, 0], "v": [0, 0, 1], "twosided": true})",
       "unknown key 'twosided'"},
      {R"({"type": "rectangle", "center": [0, 4, 0], "u": [1, 0, 0], "v": [0, 0, 1], "two_sided": 1})",
       "/lights/0/two_sided: '1', allowed true or false"},
      {R"({"type": "disk", "center": [0, 4, 0], "normal": [0, -1, 0], "radius": 0})",
       "/lights/0/radius: '0', allowed a number > 0"},
      {R"({"type": "disk", "center": [0, 4, 0], "normal": [0, 0, 0], "radius": 1})", "/lights/0/normal"},
      {R"({"type": "sphere", "center": [0, 4, 0], "radius": -1})", "/lights/0/radius: '-1'"},
      {R"({"type": "sphere", "center": [0, 4, 0], "radius": 1, "two_sided": true})", "unknown key 'two_sided'"},
      {R"({"type": "point", "position": [0, 4, 0], "emission": [1, -1, 1]})",
       "/lights/0/emission: '[1,-1,1]', allowed numbers >= 0"},
      {R"({"type": "point", "position": [0, 4, 0], "emission": "a.png"})", "/lights/0/emission"},
      {R"({"type": "point", "position": [0, 4, 0], "name": "a/b"})", "/lights/0/name"},
      {R"({"type": "samples", "points": []})", "/lights/0/points: 0 points, allowed 1..4096"},
      {R"({"type": "samples", "points": [[0, 1]]})", "/lights/0/points/0"},
      {R"({"type": "point", "position": [0, 4, 0]}, {"type": "point", "position": [0, 5, 0]})",
       "/lights/1: second light with the name 'light'"}};
  for (const auto& [light, expected] : lights) {
    const auto outcome = load(std::string("{") + kCamera + R"(, "lights": [)" + light + "]}");
    CAPTURE(outcome.message);
    CHECK(outcome.code == ErrorCode::kBadInput);
    CHECK(outcome.has(expected));
  }
}

// The message would show the value, and showing nested values recurses.
TEST_CASE("values nested without end are refused") {
  for (const std::size_t depth : {30u, 1000u, 1000000u}) {
    CAPTURE(depth);
    const std::string nested = std::string(depth, '[') + std::string(depth, ']');
    const auto outcome = load(R"({"lights": [], "camera": )" + nested + "}");
    CHECK(outcome.code == ErrorCode::kBadInput);
    CHECK(outcome.has(depth == 30 ? "allowed an object" : "a.view.json: nested more than 32 deep"));
  }
}

TEST_CASE("files that are not JSON, or not of this form, are refused") {
  for (const char* text : {"", "{", "nonsense", "{\"camera\": 1e999}", "\xff\xfe", "{\"camera\": NaN}"}) {
    CHECK(load(text).has("a.view.json: not JSON"));
  }
  for (const char* text : {"[]", "{}", "null", "{\"cameras\": {}}"}) {
    const auto outcome = load(text);
    CHECK(outcome.code == ErrorCode::kBadInput);
    CHECK(outcome.has("a.view.json: /: "));
  }
  CHECK(load(std::string(100000, '[')).threw);
}

}  // namespace
}  // namespace halfshade
