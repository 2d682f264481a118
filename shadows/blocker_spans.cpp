#include "shadows/blocker_spans.h"

#include <algorithm>
#include <cmath>

#include <glm/vector_relational.hpp>

namespace halfshade {
namespace {

/// Bound on the rounding errors of a plane's value in double, as a multiple of the product of the 1-norms of its three
/// vectors: differences of lattice points are exact, the cross product adds 3 units of 2^-53, the dot product 3 more.
constexpr double kPlaneError = 16.0 * 0x1p-53;
/// Depths in a view carry rounding errors of a few 2^-53 (coordinates are below 2).
constexpr double kDepthError = 1e-13;

double norm1(const dvec3& v) { return std::fabs(v.x) + std::fabs(v.y) + std::fabs(v.z); }

/// What the blocker's plane, its component and the stencil say about tiles.
class TileFilter {
 public:
  TileFilter(const BlockerView& view, std::uint32_t triangle, bool settled)
      : view_(view), settled_(settled), facing_(view.facing->of_triangle[triangle]) {
    const auto corners = view.mesh->corners(triangle);
    corner_ = dvec3(corners[0]);
    const dvec3 e = dvec3(corners[1]) - corner_, f = dvec3(corners[2]) - corner_;
    normal_ = glm::cross(e, f);
    error_ = kPlaneError * norm1(e) * norm1(f);
    const ClosedComponents* closed = view.samples->closed;
    if (closed != nullptr && closed->of_triangle[triangle] != kNone &&
        view.samples->closed_usable[closed->of_triangle[triangle]] != 0) {
      component_ = closed->of_triangle[triangle];
      box_ = closed->boxes[component_];
    }
    stencil_ = view.stencils->has(component_);
  }

  bool stencil() const { return stencil_; }

  bool wanted(std::size_t index, double nearest) const {
    const ReceiverTile& tile = view_.lists->tiles[index];
    if (view_.options.skip_empty && tile.deepest < nearest - kDepthError) return false;
    const bool outside = component_ != kNone && (glm::any(glm::greaterThan(tile.low, box_.high)) ||
                                                 glm::any(glm::lessThan(tile.high, box_.low)));
    if (stencil_ && view_.stencils->penumbra(component_, index) == settled_) return false;
    return faces(tile, outside && !settled_);
  }

 private:
  /// Receivers behind the plane (along the normal) can lose samples before it, and the other way round; outside its
  /// component's box a certified triangle casts only the former kind of shadow (decision 0002).
  bool faces(const ReceiverTile& tile, bool outside) const {
    bool behind = facing_ >= 0, before = facing_ <= 0;
    if (!view_.options.cull_back_facing) behind = before = true;
    if (outside && view_.options.cull_back_facing) before = false;
    if (!view_.options.plane_cut || !(behind || before)) return behind || before;
    if (facing_ > 0) before = false;
    if (facing_ < 0) behind = false;
    const dvec3 low(tile.low), high(tile.high), half = 0.5 * (high - low), to_center = 0.5 * (low + high) - corner_;
    const double value = glm::dot(normal_, to_center), reach = glm::dot(glm::abs(normal_), half);
    const double slack = reach + error_ * (norm1(to_center) + norm1(half));
    return (behind && value - slack <= 0.0) || (before && value + slack >= 0.0);
  }

  const BlockerView& view_;
  bool settled_, stencil_ = false;
  std::int8_t facing_;
  std::uint32_t component_ = kNone;
  ClosedComponents::Box box_;
  dvec3 corner_{0.0}, normal_{0.0};
  double error_ = 0.0;
};

void add_span(std::vector<BlockerSpan>& spans, const BlockerSpan& span) {
  if (span.begin != span.end) spans.push_back(span);
}

/// Cells first..last of a row, less the tiles that the filter leaves out.
void add_run(const LightLists& lists, const TileFilter& filter, std::uint32_t triangle, double nearest,
             std::uint32_t row, std::uint32_t first, std::uint32_t last, PartSpans& part) {
  constexpr std::uint32_t kCells = ReceiverTile::kCells;
  const std::uint32_t* offsets = lists.zbuffer.offsets.data() + std::size_t{row} * lists.view.grid.columns;
  std::vector<BlockerSpan>& spans = part.of_block[lists.block_of_row[row]];
  part.cells += last - first + 1;
  std::uint32_t begin = kNone;  // first receiver of the run of wanted tiles
  for (std::uint32_t tile = first / kCells; tile <= last / kCells; ++tile) {
    const std::size_t index = lists.tile_index(row, tile * kCells);
    if (lists.tiles[index].empty()) continue;
    const std::uint32_t start = offsets[std::max(first, tile * kCells)];
    if (filter.wanted(index, nearest)) {
      if (begin == kNone) begin = start;
      continue;
    }
    ++part.tiles_skipped;
    if (begin != kNone) add_span(spans, {triangle, begin, start});
    begin = kNone;
  }
  if (begin != kNone) add_span(spans, {triangle, begin, offsets[last + 1]});
}

void add_region(const BlockerView& view, const TileFilter& filter, std::uint32_t triangle, PartSpans& part) {
  const auto& index = view.mesh->triangles[triangle];
  const std::vector<dvec3>& p = *view.positions;
  const double nearest = std::min({p[index[0]].z, p[index[1]].z, p[index[2]].z});
  for_each_run(view.lists->view, part.region, [&](std::uint32_t row, std::uint32_t first, std::uint32_t last) {
    add_run(*view.lists, filter, triangle, nearest, row, first, last, part);
  });
}

std::array<dvec3, 3> corners_in_view(const BlockerView& view, std::size_t triangle) {
  const auto& index = view.mesh->triangles[triangle];
  return {(*view.positions)[index[0]], (*view.positions)[index[1]], (*view.positions)[index[2]]};
}

void clear(const BlockerView& view, PartSpans& part) {
  part.of_block.resize(view.lists->blocks.size());
  for (auto& spans : part.of_block) spans.clear();
}

}  // namespace

void find_spans(const BlockerView& view, std::size_t begin, std::size_t end, PartSpans& part) {
  clear(view, part);
  const std::vector<RowBlock>& blocks = view.lists->blocks;
  for (std::size_t t = begin; t != end; ++t) {
    const auto triangle = static_cast<std::uint32_t>(t);
    if (view.lists->view.has_receivers) {
      find_influence_region(view.lists->view, corners_in_view(view, t), part.region);
      part.everywhere += part.region.kind == InfluenceRegion::Kind::kEverywhere;
      if (part.region.kind != InfluenceRegion::Kind::kNowhere) {
        add_region(view, TileFilter(view, triangle, false), triangle, part);
      }
    }
    add_span(part.of_block.back(), {triangle, blocks.back().list_begin, blocks.back().list_end});
  }
}

void find_settled_spans(const BlockerView& view, const dvec3& one_sample, std::size_t begin, std::size_t end,
                        PartSpans& part) {
  clear(view, part);
  if (!view.lists->view.has_receivers) return;
  LightView from_sample = view.lists->view;
  from_sample.light_points = {one_sample};
  from_sample.ball = {};
  from_sample.flat = false;
  for (std::size_t t = begin; t != end; ++t) {
    const TileFilter filter(view, static_cast<std::uint32_t>(t), true);
    if (!filter.stencil()) continue;
    find_influence_region(from_sample, corners_in_view(view, t), part.region);
    add_region(view, filter, static_cast<std::uint32_t>(t), part);
  }
}

}  // namespace halfshade
