// Receivers in tiles: what a shadow volume is rasterized against.
//
// A volume that is drawn with a depth test asks, tile by tile, whether any of the tile's points can lie inside, knowing
// their least and greatest depth. Nothing in that needs a picture: a tile is a bundle of receivers that lie near each
// other, with the box around them. Bundles of equal size along a space-filling curve also serve receivers that come
// from no picture, never span a depth discontinuity by accident of the pixel grid, and keep the work per tile even.
#pragma once

#include "shadows/receivers.h"
#include "shadows/soft_shadow_volume.h"

namespace halfshade {

struct ReceiverTiles {
  static constexpr std::size_t kTile = 64, kTilesPerBlock = 16, kBlock = kTile * kTilesPerBlock;  // receivers
  std::vector<std::uint32_t> order;  // receivers along the curve; tile t holds places [t * kTile, (t + 1) * kTile)
  std::vector<LatticeBox> tiles, blocks;
  LatticeBox box;  // around all
};

ReceiverTiles make_receiver_tiles(const ReceiverArray& receivers);

}  // namespace halfshade
