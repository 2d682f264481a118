// The real scenes, where they are at hand, against the triangle counts of their table.
#include <fstream>
#include <map>
#include <sstream>

#include "rasterizer/io/obj_scene.h"
#include "rasterizer/io/view_file.h"
#include "scratch.h"

namespace halfshade {
namespace {

namespace fs = std::filesystem;

// Rows "| name | triangles | ..." of the table.
std::map<std::string, std::size_t> read_counts(const fs::path& readme) {
  std::map<std::string, std::size_t> counts;
  std::ifstream stream(readme);
  for (std::string line; std::getline(stream, line);) {
    std::istringstream row(line);
    std::string bar, name, bar2;
    std::size_t count = 0;
    if (row >> bar >> name >> bar2 >> count && bar == "|" && bar2 == "|") counts[name] = count;
  }
  return counts;
}

TEST_CASE("the shared scenes load with the triangle counts of their table") {
  const fs::path scenes = HALFSHADE_SHARED_SCENES;
  if (!fs::exists(scenes / "README.md")) {
    MESSAGE("skipped: the shared scenes are not here");
    return;
  }
  const auto counts = read_counts(scenes / "README.md");
  CHECK(counts.size() >= 11);
  for (const auto& [name, count] : counts) {
    CAPTURE(name);
    ObjLoadReport report;
    Scene scene;
    const auto outcome = test::outcome_of([&] { scene = load_obj(scenes / name / (name + ".obj"), {}, report); });
    CAPTURE(outcome.message);
    CHECK_FALSE(outcome.threw);
    CHECK(scene.triangles.size() == count);
    CHECK(scene.triangle_materials.size() == count);
    CHECK(report.warnings.empty());
    MESSAGE(name << ": " << outcome.seconds << " s, " << scene.positions.size() << " positions, "
                 << report.zero_area_triangles << " zero-area triangles, " << scene.color_maps.size() << " colour and "
                 << scene.alpha_maps.size() << " alpha maps");
    CHECK(load_view(scenes / name / (name + ".view.json")).lights.size() == 1);
  }
}

}  // namespace
}  // namespace halfshade
