// Maps of depth seen from a point of the light (Williams 1978), drawn by the camera's rasterizer; with more than one
// layer by depth peeling (Everitt 2001). And the oldest of the methods that look into them.
#pragma once

#include <algorithm>
#include <string>

#include "halfshade/shadows.h"
#include "rasterizer/camera_frame.h"
#include "shadows/receivers.h"

namespace halfshade {

/// 1/w of what the centre of each lexel sees, w = distance along the camera's axis, local frame units.
struct DepthMap {
  CameraFrame camera;
  std::uint32_t width = 0, height = 0;     // lexels; 0: there is no map
  std::vector<std::vector<float>> layers;  // [layer][row][column], 0 = nothing; falling from layer to layer

  bool empty() const { return width == 0; }
  /// The lexel that holds a place in the map, or the nearest one.
  int column(double x_px) const { return lexel(x_px, width); }
  int row(double y_px) const { return lexel(y_px, height); }

 private:
  static int lexel(double px, std::uint32_t count) {
    return static_cast<int>(px <= 0.0 ? 0.0 : std::min(px, count - 1.0));
  }
};

/// Draws up to `layer_limit` layers of the mesh into `map`, whose camera and size are set; stops before an empty one,
/// except the first. Layer k + 1 shows what is nearest beyond layer k. Both sides of triangles are drawn; texels below
/// the alpha cutoff, read at the lexel's centre, are holes. Parallel; the order of triangles changes no bit.
void draw_depth_map(const LatticeMesh& mesh, std::uint32_t layer_limit, DepthMap& map);

/// A receiver as one map sees it, with the biases worked in.
struct MapReceiver {
  const DepthMap* map = nullptr;  // null: the receiver lies at the light's point and nothing hides it
  double x_px = 0.0, y_px = 0.0;  // where it falls into the map
  double w = 0.0;                 // its distance along the map's axis
  double nearest_w = 0.0;         // w without the bias
  dvec3 tangent{0.0};             // height above the tangent plane along the ray through (x, y), per unit of w:
  double height = 0.0;            //   tangent.x x + tangent.y y + tangent.z, starting from this height without bias

  /// Does what a lexel's centre sees at 1/w hide the receiver, or part of the light from it? It lies nearer to the
  /// light and on the light's side of the tangent plane.
  bool hidden_by(double x_center_px, double y_center_px, float inverse_w) const {
    return inverse_w * nearest_w > 1.0 &&
           tangent.x * x_center_px + tangent.y * y_center_px + tangent.z + height * inverse_w > 0.0;
  }
  /// The same for a lexel of a layer; what lies outside of the map hides nothing.
  bool hidden_by(int column, int row, std::size_t layer = 0) const {
    return inverse_w(column, row, layer) > 0.0f && hidden_by(column + 0.5, row + 0.5, inverse_w(column, row, layer));
  }
  /// The same for the lexel that the receiver falls into.
  bool hidden_at_own_lexel() const { return hidden_by(map->column(x_px), map->row(y_px)); }
  /// 0 outside of the map, too.
  float inverse_w(int column, int row, std::size_t layer = 0) const {
    if (column < 0 || row < 0 || static_cast<std::uint32_t>(column) >= map->width ||
        static_cast<std::uint32_t>(row) >= map->height) {
      return 0.0f;
    }
    return map->layers[layer][static_cast<std::size_t>(row) * map->width + static_cast<std::size_t>(column)];
  }
};

/// A receiver without a normal gets the tangent plane across the map's axis.
MapReceiver place_in_map(const DepthMap& map, const vec3& position, const vec3& normal,
                         const ShadowMapOptions& options);

/// Throws Error{kUsage} naming the first option out of range.
void check_shadow_map_options(const ShadowMapOptions& options);

/// Five digits.
std::string short_number(double x);

/// "the centre of a lexel answers for all of it; bias ..": what every method takes for granted that compares with
/// lexels.
std::string assumptions_of_lookups(const ShadowMapOptions& options);

/// One map from the light's centre, one comparison per receiver: lit or not.
void solve_shadow_map(const LatticeMesh& mesh, const ReceiverArray& receivers, const LightSamples& samples,
                      const ShadowConfig& config, std::vector<float>& visibility, ShadowStats& stats);

/// What it takes for granted, in one line.
std::string assumptions_of_shadow_map(const ShadowConfig& config);

}  // namespace halfshade
