// When does the sun reach which place? Points on a terrain, on the walls and roofs of three buildings, and on the
// ground between them; the sun's disk over one day; the lit fraction of that disk per point and hour as CSV.
// examples/plot_solar.py draws it.
//
//   solar_shading [LATITUDE_DEG [DAY_OF_YEAR [OUT.csv]]]      default: 48 80 solar_shading.csv
//
// World: metres, x = east, y = up, z = south. Hours are solar time: the sun is due south (or north) at 12.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "halfshade/halfshade.h"

using namespace halfshade;

namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr int kCells = 80;         // of the terrain, per side
constexpr double kCellSize = 2.5;  // metres
constexpr int kStepsPerHour = 4;

/// Sun's declination in radians: the Fourier series of Spencer (1971), "Fourier series representation of the position
/// of the sun", Search 2(5), within 0.0006 radians.
double declination(int day_of_year) {
  const double g = 2.0 * kPi * (day_of_year - 1) / 365.0;
  return 0.006918 - 0.399912 * std::cos(g) + 0.070257 * std::sin(g) - 0.006758 * std::cos(2 * g) +
         0.000907 * std::sin(2 * g) - 0.002697 * std::cos(3 * g) + 0.00148 * std::sin(3 * g);
}

/// Unit vector to the sun: the hour angle turns it around the Earth's axis, which stands `latitude` above the horizon
/// in the north (Duffie and Beckman, Solar Engineering of Thermal Processes, section 1.6).
dvec3 towards_sun(double latitude, double decl, double solar_hour) {
  const double hour_angle = (solar_hour - 12.0) * kPi / 12.0;
  const double west = std::cos(decl) * std::sin(hour_angle);
  const double up = std::sin(latitude) * std::sin(decl) + std::cos(latitude) * std::cos(decl) * std::cos(hour_angle);
  const double south = std::sin(latitude) * std::cos(decl) * std::cos(hour_angle) - std::cos(latitude) * std::sin(decl);
  return {-west, up, south};
}

double ground(double x, double z) {  // a ridge in the south-west, gentle waves elsewhere
  const double ridge = (x + 70.0) * (x + 70.0) + (z - 60.0) * (z - 60.0) * 0.4;
  return 32.0 * std::exp(-ridge / 900.0) + 1.5 * std::sin(x * 0.06) * std::cos(z * 0.05);
}

/// Corners of triangles, three per triangle, as ShadowScene takes them without indices.
struct World {
  std::vector<dvec3> corners;
  void quad(const dvec3& a, const dvec3& b, const dvec3& c, const dvec3& d) {
    for (const dvec3& p : {a, b, c, a, c, d}) corners.push_back(p);
  }
};

struct Points {
  std::vector<dvec3> position, normal;
  std::vector<const char*> kind;
  void add(const dvec3& p, const dvec3& n, const char* what) {
    position.push_back(p), normal.push_back(glm::normalize(n)), kind.push_back(what);
  }
};

struct Building {
  double x0, x1, z0, z1, height;
  bool covers(double x, double z) const { return x > x0 && x < x1 && z > z0 && z < z1; }
};
constexpr Building kBuildings[] = {{-10, 8, -30, -12, 30}, {25, 60, -8, 6, 12}, {-30, -14, 18, 50, 18}};

void add_terrain(World& world, Points& points) {
  const auto at = [](int i, int j) {
    const double x = (i - kCells / 2) * kCellSize, z = (j - kCells / 2) * kCellSize;
    return dvec3(x, ground(x, z), z);
  };
  for (int j = 0; j < kCells; ++j) {
    for (int i = 0; i < kCells; ++i) {
      const dvec3 a = at(i, j), b = at(i, j + 1), c = at(i + 1, j + 1), d = at(i + 1, j);
      world.quad(a, b, c, d);
      const dvec3 p = (a + b + c) / 3.0;
      bool built_over = false;
      for (const Building& building : kBuildings) built_over |= building.covers(p.x, p.z);
      if (!built_over) points.add(p, glm::cross(b - a, c - a), "ground");
    }
  }
}

/// One wall or roof with a grid of points, two metres apart or so. u x v points outward.
void add_face(const dvec3& corner, const dvec3& u, const dvec3& v, const char* kind, World& world, Points& points) {
  world.quad(corner, corner + u, corner + u + v, corner + v);
  const int columns = static_cast<int>(glm::length(u) / 2.0), rows = static_cast<int>(glm::length(v) / 2.0);
  for (int i = 0; i < columns * rows; ++i) {
    const dvec3 p = corner + u * ((i % columns + 0.5) / columns) + v * ((i / columns + 0.5) / rows);
    if (p.y > ground(p.x, p.z) + 0.1) points.add(p, glm::cross(u, v), kind);
  }
}

void add_building(const Building& b, World& world, Points& points) {
  const double foot = -3.0;  // below the ground everywhere
  const dvec3 x(b.x1 - b.x0, 0, 0), y(0, b.height - foot, 0), z(0, 0, b.z1 - b.z0);
  add_face({b.x0, b.height, b.z1}, x, -z, "roof", world, points);
  add_face({b.x0, foot, b.z1}, x, y, "south", world, points);
  add_face({b.x1, foot, b.z0}, -x, y, "north", world, points);
  add_face({b.x1, foot, b.z1}, -z, y, "east", world, points);
  add_face({b.x0, foot, b.z0}, z, y, "west", world, points);
}

}  // namespace

int main(int argc, char** argv) {
  const double latitude = (argc > 1 ? std::atof(argv[1]) : 48.0) * kPi / 180.0;
  const int day = argc > 2 ? std::atoi(argv[2]) : 80;
  const std::string name = argc > 3 ? argv[3] : "solar_shading.csv";
  World world;
  Points points;
  add_terrain(world, points);
  for (const Building& building : kBuildings) add_building(building, world, points);

  // All suns of the day, each a disk far away in its direction. The scene must reach them.
  dvec3 low = world.corners[0], high = low;
  for (const dvec3& p : world.corners) low = glm::min(low, p), high = glm::max(high, p);
  ShadowScene scene;
  MeshView mesh;
  mesh.positions = world.corners;
  scene.add_mesh(mesh);
  std::vector<Light> suns;
  std::vector<double> hours;
  for (int step = 0; step < 24 * kStepsPerHour; ++step) {
    const double hour = static_cast<double>(step) / kStepsPerHour;
    const dvec3 direction = towards_sun(latitude, declination(day), hour);
    if (direction.y <= 0.0) continue;
    Light sun;
    sun.shape = LightShape::kSun;
    sun.normal = -direction;
    suns.push_back(place_sun(sun, low, high));
    hours.push_back(hour);
    scene.extend(suns.back());
  }
  scene.commit();

  ReceiverView receivers;
  receivers.positions = points.position;
  receivers.normals = points.normal;
  const std::size_t count = points.position.size();
  std::vector<float> lit(suns.size() * count);
  Workspace workspace;
  ShadowOutput output;
  output.visibility = lit;
  if (!suns.empty()) ShadowSolver().solve(scene, receivers, suns, workspace, output);

  std::FILE* file = std::fopen(name.c_str(), "w");
  if (file == nullptr) {
    std::fprintf(stderr, "solar_shading: %s cannot be written\n", name.c_str());
    return 5;
  }
  std::fprintf(file, "x,y,z,kind,sun_hours");
  for (const double hour : hours) std::fprintf(file, ",%05.2f", hour);
  double sum[2] = {0, 0};  // ground, buildings
  std::size_t number[2] = {0, 0};
  for (std::size_t i = 0; i < count; ++i) {
    double sun_hours = 0.0;
    for (std::size_t k = 0; k < suns.size(); ++k) sun_hours += lit[k * count + i] / kStepsPerHour;
    const dvec3& p = points.position[i];
    std::fprintf(file, "\n%.2f,%.2f,%.2f,%s,%.3f", p.x, p.y, p.z, points.kind[i], sun_hours);
    for (std::size_t k = 0; k < suns.size(); ++k) std::fprintf(file, ",%.4g", double{lit[k * count + i]});
    const bool built = std::string(points.kind[i]) != "ground";
    sum[built] += sun_hours, ++number[built];
  }
  std::fprintf(file, "\n");
  if (std::fclose(file) != 0) return 5;
  std::printf("%zu points, %zu suns; sun above the horizon for %.2f h\n", count, suns.size(),
              static_cast<double>(suns.size()) / kStepsPerHour);
  for (const int built : {0, 1}) {
    std::printf("%s: %.2f h of sun on average\n", built ? "walls and roofs" : "ground",
                sum[built] / static_cast<double>(number[built]));
  }
}
