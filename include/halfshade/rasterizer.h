// What a camera sees of a scene: the receivers of a picture.
#pragma once

#include "halfshade/light.h"
#include "halfshade/shadow_scene.h"

namespace halfshade {

/// Which state of which scene a G-buffer shows: rasterize() notes it, ShadowSolver::solve compares it.
struct DrawnState {
  std::shared_ptr<const int> scene;  // tells scenes apart, moved ones are still the same; null: nobody knows
  std::uint64_t version = 0;         // of the scene's surfaces: a commit that adds, removes or moves meshes changes it

  bool operator==(const DrawnState&) const = default;
};

/// Geometry buffer: one entry per sample of `window`, row-major, row 0 = top. With spp = k*k subsamples per pixel the
/// buffer is simply a k times finer picture: sample (x, y) belongs to pixel (x / k, y / k).
/// Entries whose triangle is kNone show the background; their other values are zero.
struct GBuffer {
  std::uint32_t width = 0, height = 0;  // the whole picture, in samples
  PixelWindow window;                   // the part held here, in samples
  double reach = 1.0;                   // power of two, at least every |coordinate| of what was drawn; local frame
  std::vector<std::uint32_t> triangle;  // visible triangle, or kNone
  std::vector<dvec3> position;          // local frame, interpolated in double, not snapped
  std::vector<vec3> geometric_normal;   // unit, on the camera's side of the triangle
  std::vector<vec3>
      shading_normal;        // unit, interpolated, flipped to the camera's side; = geometric where the scene has none
  std::vector<vec3> albedo;  // linear RGB
  std::vector<float> depth;  // distance along the camera's axis, local frame units
  /// Of what rasterize() drew. To be left empty, or emptied, by those who fill a G-buffer themselves: then it is for
  /// them to see that it belongs to the scene.
  DrawnState drawn;

  std::size_t size() const { return triangle.size(); }  // number of entries
};

/// Which picture is wanted.
struct RasterConfig {
  /// Whole picture in samples (pixels times subsamples per axis); 1..16384 each.
  std::uint32_t width = 512, height = 512;
  PixelWindow window;  // part to render, in samples; all zero = whole picture
  /// Moves the centres of all samples: sample (x, y) looks through (x + 0.5, y + 0.5) + offset. In samples, each axis
  /// in [-1, 1]. Another offset in every frame, averaged, smooths edges (box filter for offsets all over
  /// [-0.5, 0.5)^2).
  dvec2 subpixel_offset{0.0};
};

/// Element `frame` of a low-discrepancy sequence of offsets in [-0.5, 0.5)^2; element 0 is (0, 0).
HALFSHADE_API dvec2 subpixel_jitter(std::uint32_t frame);

/// Draws the scene as seen from `camera` (world space) into `gbuffer`. Triangles are numbered through the scene:
/// ShadowScene::triangle_of. Equal inputs give equal bits for any number of threads, any executor, any instruction set
/// and any window. Throws Error{kUsage} for a scene that is not committed, a size or window out of range or a
/// degenerate camera; Error{kCancelled}; std::bad_alloc; what `execution` throws. A call that throws leaves the
/// G-buffer as it was or empty.
HALFSHADE_API void rasterize(const ShadowScene& scene, const Camera& camera, const RasterConfig& config,
                             GBuffer& gbuffer, const Execution& execution = {});

}  // namespace halfshade
