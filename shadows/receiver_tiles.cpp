#include "shadows/receiver_tiles.h"

#include "shadows/space_curve.h"

namespace halfshade {
namespace {

std::vector<LatticeBox> boxes_of_runs(const ReceiverArray& receivers, const std::vector<std::uint32_t>& order,
                                      std::size_t run) {
  std::vector<LatticeBox> boxes((order.size() + run - 1) / run);
  for (std::size_t i = 0; i < order.size(); ++i) boxes[i / run].add(receivers.position[order[i]]);
  return boxes;
}

}  // namespace

ReceiverTiles make_receiver_tiles(const ReceiverArray& receivers) {
  ReceiverTiles tiles;
  for (const vec3& p : receivers.position) tiles.box.add(p);
  tiles.order = order_along<HilbertCurve>(receivers.position, [](std::uint32_t) { return true; });
  tiles.tiles = boxes_of_runs(receivers, tiles.order, ReceiverTiles::kTile);
  tiles.blocks = boxes_of_runs(receivers, tiles.order, ReceiverTiles::kBlock);
  return tiles;
}

}  // namespace halfshade
