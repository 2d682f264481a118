// A host with a rasterizer of its own: a z-buffer in a few lines finds what the camera sees, halfshade says how much of
// the light each of these points sees, and the host shades. Writes a PPM; its name may be given.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "halfshade/halfshade.h"

using namespace halfshade;

namespace {

constexpr int kWidth = 512, kHeight = 384;

struct Mesh {
  std::vector<vec3> positions;
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

/// A torus around the y axis, moved to `center`, on a floor.
Mesh make_mesh(const vec3& center, float ring, float tube) {
  constexpr std::uint32_t kAround = 64, kAcross = 24;
  Mesh mesh;
  for (std::uint32_t i = 0; i < kAround * kAcross; ++i) {
    const float a = static_cast<float>(i / kAcross) * 6.2831853f / kAround;
    const float b = static_cast<float>(i % kAcross) * 6.2831853f / kAcross;
    const float r = ring + tube * std::cos(b);
    mesh.positions.push_back(center + vec3(r * std::cos(a), tube * std::sin(b), r * std::sin(a)));
    const std::uint32_t row = i / kAcross * kAcross, next_row = (row + kAcross) % (kAround * kAcross);
    const std::uint32_t at = i % kAcross, next = (at + 1) % kAcross;
    mesh.triangles.push_back({row + at, row + next, next_row + next});
    mesh.triangles.push_back({row + at, next_row + next, next_row + at});
  }
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  for (const vec3& corner : {vec3(-6, 0, -6), vec3(-6, 0, 6), vec3(6, 0, 6), vec3(6, 0, -6)}) {
    mesh.positions.push_back(corner);
  }
  mesh.triangles.push_back({first, first + 1, first + 2});
  mesh.triangles.push_back({first, first + 2, first + 3});
  return mesh;
}

/// What one pixel shows.
struct Pixel {
  double depth = std::numeric_limits<double>::infinity();
  dvec3 position{0.0}, normal{0.0};
  std::uint32_t triangle = kNone;
};

struct Eye {
  dvec3 at, right, up, forward;
  double pixels;  // per unit of slope
};

Eye look(const dvec3& from, const dvec3& to, double fov_y) {
  const dvec3 forward = glm::normalize(to - from), right = glm::normalize(glm::cross(forward, dvec3(0, 1, 0)));
  return {from, right, glm::cross(right, forward), forward, kHeight * 0.5 / std::tan(fov_y * 0.5)};
}

/// Draws one triangle that lies wholly before the eye: edge functions at pixel centres, nearest depth wins.
void draw(const Mesh& mesh, std::uint32_t triangle, const Eye& eye, std::vector<Pixel>& picture) {
  dvec3 world[3], screen[3];  // x, y in pixels, 1 / depth
  for (int k = 0; k < 3; ++k) {
    world[k] = dvec3(mesh.positions[mesh.triangles[triangle][static_cast<std::size_t>(k)]]);
    const dvec3 d = world[k] - eye.at;
    const double w = 1.0 / glm::dot(d, eye.forward);
    screen[k] = {kWidth * 0.5 + glm::dot(d, eye.right) * w * eye.pixels,
                 kHeight * 0.5 - glm::dot(d, eye.up) * w * eye.pixels, w};
  }
  const auto edge = [](const dvec3& a, const dvec3& b, double x, double y) {
    return (b.x - a.x) * (y - a.y) - (b.y - a.y) * (x - a.x);
  };
  const double area = edge(screen[0], screen[1], screen[2].x, screen[2].y);
  if (area == 0.0) return;
  dvec3 normal = glm::normalize(glm::cross(world[1] - world[0], world[2] - world[0]));
  if (glm::dot(normal, eye.at - world[0]) < 0.0) normal = -normal;
  const auto [left, right] = std::minmax({screen[0].x, screen[1].x, screen[2].x});
  const auto [top, bottom] = std::minmax({screen[0].y, screen[1].y, screen[2].y});
  for (int y = std::max(0, static_cast<int>(top)); y <= std::min(kHeight - 1.0, bottom); ++y) {
    for (int x = std::max(0, static_cast<int>(left)); x <= std::min(kWidth - 1.0, right); ++x) {
      const double a = edge(screen[1], screen[2], x + 0.5, y + 0.5) / area * screen[0].z;
      const double b = edge(screen[2], screen[0], x + 0.5, y + 0.5) / area * screen[1].z;
      const double c = edge(screen[0], screen[1], x + 0.5, y + 0.5) / area * screen[2].z;
      if (a < 0.0 || b < 0.0 || c < 0.0) continue;
      const double depth = 1.0 / (a + b + c);
      Pixel& pixel = picture[static_cast<std::size_t>(y * kWidth + x)];
      if (depth >= pixel.depth) continue;
      pixel = {depth, (world[0] * a + world[1] * b + world[2] * c) * depth, normal, triangle};
    }
  }
}

bool write_ppm(const char* name, const std::vector<float>& grey) {
  std::FILE* file = std::fopen(name, "wb");
  if (file == nullptr) return false;
  std::fprintf(file, "P6\n%d %d\n255\n", kWidth, kHeight);
  for (const float value : grey) {
    const int byte = static_cast<int>(std::pow(std::clamp(value, 0.0f, 1.0f), 1.0f / 2.2f) * 255.0f + 0.5f);
    for (int channel = 0; channel < 3; ++channel) std::fputc(byte, file);
  }
  const bool written = std::ferror(file) == 0;
  return std::fclose(file) == 0 && written;
}

}  // namespace

int main(int argc, char** argv) {
  const char* name = argc > 1 ? argv[1] : "tiny_rasterizer_host.ppm";
  const Mesh mesh = make_mesh({0, 1.4f, 0}, 1.5f, 0.5f);
  std::vector<Pixel> picture(kWidth * kHeight);
  const Eye eye = look({2, 5, 7}, {0, 0.6, 0}, 0.7);
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) draw(mesh, t, eye, picture);

  // The visible points become receivers, each with its normal and the triangle it lies on.
  std::vector<dvec3> positions, normals;
  std::vector<std::uint32_t> triangles, pixels;
  for (std::uint32_t i = 0; i < picture.size(); ++i) {
    if (picture[i].triangle == kNone) continue;
    positions.push_back(picture[i].position);
    normals.push_back(picture[i].normal);
    triangles.push_back(picture[i].triangle);
    pixels.push_back(i);
  }
  const std::vector<std::uint32_t> meshes(pixels.size(), 0);

  Light light;
  light.center = {1.5, 6, 1};
  light.u = {2, 0, 0};
  light.v = {0, 0, 2};
  ShadowScene scene;
  MeshView view;
  view.positions = mesh.positions;
  view.triangles = mesh.triangles;
  scene.add_mesh(view);
  scene.extend(light);
  scene.commit();
  ReceiverView receivers;
  receivers.positions = positions;
  receivers.normals = normals;
  receivers.meshes = meshes;
  receivers.triangles = triangles;
  std::vector<float> visibility(pixels.size());
  ShadowOutput output;
  output.visibility = visibility;
  Workspace workspace;
  ShadowSolver().solve(scene, receivers, light, workspace, output);

  std::vector<float> grey(picture.size(), 0.02f);
  double umbra = 0.0, penumbra = 0.0;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const double cosine = std::max(0.0, glm::dot(normals[i], glm::normalize(light.center - positions[i])));
    grey[pixels[i]] = static_cast<float>(0.05 + 0.75 * visibility[i] * cosine);
    umbra += visibility[i] == 0.0f;
    penumbra += visibility[i] > 0.0f && visibility[i] < 1.0f;
  }
  std::printf("%zu receivers: %.1f %% in umbra, %.1f %% in penumbra\n", pixels.size(),
              100.0 * umbra / static_cast<double>(pixels.size()),
              100.0 * penumbra / static_cast<double>(pixels.size()));
  if (!write_ppm(name, grey)) {
    std::fprintf(stderr, "%s could not be written\n", name);
    return 5;
  }
  return penumbra > 0.0 && umbra > 0.0 ? 0 : 1;
}
