// The blockers of a scene divided among MPI ranks: every rank finds what its own triangles hide, and the masks are
// joined by MPI_BOR. Blocked bits combine by OR, so the result has the bits of a single process, whatever the number of
// ranks. Run: mpirun -n 2 example_mpi_masks
#include <mpi.h>

#include <algorithm>
#include <cstdio>

#include "halfshade/halfshade.h"

using namespace halfshade;

namespace {

/// A grid of small leaning plates above a floor.
Scene make_scene(int side) {
  Scene scene;
  scene.materials.resize(1);
  for (int i = 0; i < side * side; ++i) {
    const double x = i % side - 0.5 * side, z = i / side - 0.5 * side, y = 1.0 + 0.1 * (i % 7);
    const auto first = static_cast<std::uint32_t>(scene.positions.size());
    scene.positions.insert(scene.positions.end(),
                           {{x, y, z}, {x + 0.8, y + 0.3, z}, {x + 0.7, y + 0.2, z + 0.6}, {x - 0.1, y, z + 0.7}});
    scene.triangles.push_back({first, first + 1, first + 2});
    scene.triangles.push_back({first, first + 2, first + 3});
  }
  scene.triangle_materials.assign(scene.triangles.size(), 0);
  return scene;
}

std::vector<Receiver> make_receivers(int side) {
  std::vector<Receiver> receivers;
  for (int i = 0; i < side * side; ++i)
    receivers.push_back({dvec3(i % side * 20.0 / side - 10.0, 0, i / side * 20.0 / side - 10.0), kNone});
  return receivers;
}

/// Share `rank` of the triangles. All positions stay, so that every rank rounds to the lattice of the same box.
/// Receivers that lie on triangles would need their numbers shifted as well; these lie on none.
Scene share_of(const Scene& scene, std::size_t rank, std::size_t ranks) {
  Scene share = scene;
  const std::size_t count = scene.triangles.size(), begin = count * rank / ranks, end = count * (rank + 1) / ranks;
  share.triangles.assign(scene.triangles.begin() + static_cast<std::ptrdiff_t>(begin),
                         scene.triangles.begin() + static_cast<std::ptrdiff_t>(end));
  share.triangle_materials.assign(share.triangles.size(), 0);
  return share;
}

/// On rank 0, the masks of all ranks together.
void reduce_masks(VisibilityMasks& masks, int rank) {
  constexpr std::size_t kMost = std::size_t{1} << 30;  // counts are ints
  for (std::size_t first = 0; first < masks.words.size(); first += kMost) {
    const int count = static_cast<int>(std::min(kMost, masks.words.size() - first));
    std::uint64_t* const words = masks.words.data() + first;
    if (rank == 0)
      MPI_Reduce(MPI_IN_PLACE, words, count, MPI_UINT64_T, MPI_BOR, 0, MPI_COMM_WORLD);
    else
      MPI_Reduce(words, nullptr, count, MPI_UINT64_T, MPI_BOR, 0, MPI_COMM_WORLD);
  }
}

int run(int rank, int ranks) {
  const Scene scene = make_scene(20);
  const std::vector<Receiver> receivers = make_receivers(100);
  Light light;
  light.center = {2, 8, 1};
  light.u = {3, 0, 0};
  light.v = {0, 0, 3};
  const ShadowConfig config{.light_sample_count = 256};

  VisibilityMasks masks;
  solve_shadows(share_of(scene, static_cast<std::size_t>(rank), static_cast<std::size_t>(ranks)), receivers, light,
                config, masks);
  std::printf("rank %d of %d: %s\n", rank, ranks, masks.hash().c_str());
  reduce_masks(masks, rank);
  if (rank != 0) return 0;

  VisibilityMasks whole;
  solve_shadows(scene, receivers, light, config, whole);
  const bool equal = masks.hash() == whole.hash();
  std::printf("together:    %s, %s\n", masks.hash().c_str(), equal ? "as in one process" : "NOT as in one process");
  return equal ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  MPI_Init(&argc, &argv);
  int rank = 0, ranks = 1;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  MPI_Comm_size(MPI_COMM_WORLD, &ranks);
  const int code = run(rank, ranks);
  MPI_Finalize();
  return code;
}
