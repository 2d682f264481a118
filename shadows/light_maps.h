// The maps around one point of the light: where they look, how large they are, and which one holds a receiver.
//
// One map along the light's axis where that sees every receiver at a slope of at most 2, else the six faces of a cube,
// without those that hold no receiver. Every map is fitted to the slopes of its receivers plus a margin, so that no
// receiver falls outside.
#pragma once

#include <algorithm>
#include <optional>

#include "rasterizer/core/parallel.h"
#include "shadows/shadow_map.h"
#include "shadows/solver.h"

namespace halfshade {

/// Orthonormal directions of the maps, local frame; z first.
struct MapAxes {
  dvec3 x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1};
};

/// Flat lights look along their normal; others from their centre towards the mean of the directions to the receivers.
MapAxes make_map_axes(const LightSamples& samples, const ReceiverArray& receivers);

struct LightMaps {
  dvec3 eye{0.0};
  MapAxes axes;
  bool cube = false;              // six faces: +z -z +x -x +y -y; otherwise +z alone
  std::array<DepthMap, 6> faces;  // empty where there are no receivers

  /// The map that holds the receiver at p, or null at the light's point itself (nearer than the near plane).
  const DepthMap* map_of(const dvec3& p) const;
  std::uint64_t maps() const;
  std::uint64_t lexels() const;  // of all maps and layers
  std::uint64_t bytes() const { return lexels() * sizeof(float); }
};

/// What the maps of one point have to hold.
struct MapRequest {
  dvec3 eye{0.0};
  MapAxes axes;
  double margin = 0.0;                       // around the receivers, in slopes
  std::uint32_t border = 0;                  // and in lexels, as far as half of the resolution allows
  std::uint32_t resolution = 1024;           // lexels along the longer side
  std::uint32_t layers = 1;                  // drawn at most
  std::span<const std::uint32_t> receivers;  // those that will be looked up
};

/// Fits and draws. `maps` may hold earlier ones, whose memory is used again.
void make_light_maps(const LatticeMesh& mesh, const ReceiverArray& receivers, const MapRequest& request,
                     LightMaps& maps);

/// The maps of one point light at the light's centre, for lookups up to `border` lexels around each receiver; noted.
void make_center_maps(const LatticeMesh& mesh, const ReceiverArray& receivers, const LightSamples& samples,
                      std::uint32_t border, const ShadowMapOptions& options, LightMaps& maps, ShadowStats& stats);

/// Receiver i in the map that holds it; nothing at the maps' own point.
std::optional<MapReceiver> place_in_maps(const LightMaps& maps, const ReceiverArray& receivers, std::size_t i,
                                         const ShadowMapOptions& options);

/// 0, 1 ... for all receivers, or those that use one set of light samples.
std::vector<std::uint32_t> all_receivers(const ReceiverArray& receivers);
std::vector<std::uint32_t> receivers_of_set(const ReceiverArray& receivers, std::uint32_t set);

/// Radius in world units of the sphere, or of the disk across the map's axis, that stands for the light: its own for
/// disks and spheres; that of the disk of equal area for rectangles and polygons; the root mean square of the half axes
/// of ellipsoids and of the distances of explicit samples from their box's centre; 0 for points.
double equivalent_radius(const Light& light);

/// "a sphere of radius .. in place of the rectangle"
std::string assumptions_of_equivalent_light(const Light& light);

/// Maps for methods that search a kernel around each receiver for what may hide a light of that radius (local units).
struct SearchMaps {
  LightMaps maps;
  double plane = 0.0;  // nothing that counts lies nearer to the light along a map's axis; infinite without casters
  std::uint64_t before_plane = 0;  // lexels that show something nearer than that; it is ignored or underestimated
};

/// The plane is at `plane` if that is positive, else at the nearest depth that a coarse map shows, but no nearer than
/// one radius: the search then stays below 45 degrees.
SearchMaps make_search_maps(const LatticeMesh& mesh, const ReceiverArray& receivers, const LightSamples& samples,
                            double radius, double plane, std::uint32_t layers, const ShadowMapOptions& options);

/// visit(i) for all receivers, in parallel, with reports of progress in between.
template <class Visit>
void for_each_receiver(const ReceiverArray& receivers, const ShadowConfig& config, const Visit& visit) {
  constexpr std::size_t kRound = 32768;
  for (std::size_t first = 0; first < receivers.size(); first += kRound) {
    report_progress(config, static_cast<double>(first) / static_cast<double>(receivers.size()));
    parallel_ranges(std::min(kRound, receivers.size() - first), 256, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = first + begin; i != first + end; ++i) visit(i);
    });
  }
}

/// Notes the number of maps and lexels.
void note_maps(const LightMaps& maps, ShadowStats& stats);

}  // namespace halfshade
