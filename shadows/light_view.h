// Views from the light: where receivers and blockers meet on a grid (Sintorn, Eisemann, Assarsson 2008, sections
// 3, 4.3).
//
// A flat light looks along its normal; a two-sided one has a second view backwards. A volumetric light looks along the
// six faces of a cube. A view sees a point p at the slopes (x/z, y/z) from the light's centre. The grid is laid over
// warped slopes s / (1 + |s|), which stay bounded for receivers at grazing angles, and fitted to the receivers.
#pragma once

#include <algorithm>
#include <cmath>

#include <glm/mat3x3.hpp>

#include "halfshade/methods.h"
#include "shadows/receivers.h"

namespace halfshade {

/// A ball and the linear map that makes an ellipsoid of it (section 4.1: "a virtual scaling of the entire scene").
struct BallBound {
  double radius = 0.0;                      // 0: there is none
  glm::dmat3 from_ball{1.0}, to_ball{1.0};  // inverse of each other; identity for spheres

  /// Half extents of the box around the ellipsoid.
  dvec3 reach() const;
};

/// Convex bound of all samples of a light: a parallelepiped and, for spheres and ellipsoids, a ball.
struct LightBound {
  vec3 center{0.0f};               // on the lattice
  std::array<dvec3, 3> half_axes;  // orthogonal; the third is the (tiny) thickness of a flat light
  bool flat = false;
  BallBound ball;              // around the centre, axes of the local frame
  std::vector<dvec2> outline;  // flat lights: convex polygon around the samples, in units of axis_u, axis_v
};

/// `reuse` gives its memory.
LightBound make_light_bound(const Light& light, const LightSamples& samples, LightBound reuse = {});

/// The grid of one view: columns x rows cells over warped slopes.
struct LightGrid {
  std::uint32_t columns = 1, rows = 1;
  dvec2 low{0.0}, cells_per_unit{1.0};

  static double warp(double slope) { return slope / (1.0 + std::fabs(slope)); }
  static double unwarp(double w) { return w / (1.0 - std::fabs(w)); }
  std::uint32_t column(double slope) const { return cell((warp(slope) - low.x) * cells_per_unit.x, columns); }
  std::uint32_t row(double slope) const { return cell((warp(slope) - low.y) * cells_per_unit.y, rows); }
  /// Slope at the lower border of a row.
  double row_border(std::uint32_t row) const;

 private:
  static std::uint32_t cell(double x, std::uint32_t count) {
    return x <= 0.0 ? 0u : (x >= count - 1 ? count - 1 : static_cast<std::uint32_t>(x));
  }
};

struct LightView {
  dvec3 origin{0.0}, x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1};  // local frame; orthonormal, looking along +z
  std::vector<dvec3> light_points;                        // vertices of the light's bound in view coordinates
  BallBound ball;                                         // in view coordinates: if there is one, it is the bound
  std::vector<dvec2> ball_ring;                           // polygon around the unit circle, for the ball's silhouette
  InfluenceOutline outline = InfluenceOutline::kHull;
  bool flat = false;                 // light_points lie in z = 0; the samples within light_depth of it
  double light_depth = 0.0;          // max |z| of the light's bound
  double near_z = 0.0, far_z = 0.0;  // receivers on the grid have near_z <= z <= far_z
  double clip_z = 0.0;               // blockers are projected beyond this depth only; light_depth < clip_z < near_z
  bool has_receivers = false;        // on the grid; if not, the members below mean nothing
  dvec2 slope_low{0.0}, slope_high{0.0};        // of the receivers on the grid
  dvec3 receiver_low{0.0}, receiver_high{0.0};  // box of the receivers on the grid, view coordinates
  LightGrid grid;

  /// Receivers too near to the light's plane, or at too grazing an angle, to be put on the grid. near_z is 0 where all
  /// receivers lie in the plane of a point: they have no slopes.
  bool too_near(const dvec3& p) const {
    return p.z < near_z || p.z <= 0.0 || std::max(std::fabs(p.x), std::fabs(p.y)) > 1e5 * p.z;
  }

  dvec3 to_view(const dvec3& p) const {
    const dvec3 d = p - origin;
    return {glm::dot(d, x), glm::dot(d, y), glm::dot(d, z)};
  }
};

/// A view and the cell of every receiver: kNone = another view has it, grid cells, then one more cell for receivers too
/// near to the light's plane (or inside the light) to be projected: these are tested against every blocker.
struct LightViewCells {
  LightView view;
  std::vector<std::uint32_t> cell_of_receiver;
  std::uint32_t near_cell() const { return view.grid.columns * view.grid.rows; }
};

/// How the views are laid out.
struct LightViewOptions {
  InfluenceOutline outline = InfluenceOutline::kHull;
  const LatticeMesh* grid_over = nullptr;  // grid over the slopes of this mesh too, not of the receivers alone
  const LatticeMesh* far_over = nullptr;   // far plane beyond this mesh too
};

/// Views that together hold every receiver exactly once; views without receivers are left out.
/// `resolution` 0 chooses the grid from the number of receivers.
std::vector<LightViewCells> make_light_views(const LightBound& bound, const LightSamples& samples,
                                             const ReceiverArray& receivers, std::uint32_t resolution,
                                             const LightViewOptions& options = {});

}  // namespace halfshade
