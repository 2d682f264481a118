#include "shadows/receiver_hierarchy.h"

#include <algorithm>
#include <cmath>

#include <glm/common.hpp>

namespace halfshade {
namespace {

struct Box {
  vec3 low{HUGE_VALF}, high{-HUGE_VALF};
  void add(const vec3& p) { low = glm::min(low, p), high = glm::max(high, p); }
  void add(const Box& o) { low = glm::min(low, o.low), high = glm::max(high, o.high); }
  double area() const {
    const dvec3 d = dvec3(high) - dvec3(low);
    return d.x * d.y + d.y * d.z + d.z * d.x + 1e-9 * (d.x + d.y + d.z);  // of points on a line: their length
  }
};

class Builder {
 public:
  Builder(std::span<const vec3> points, const HierarchyRules& rules, ReceiverHierarchy& hierarchy)
      : points_(points), rules_(rules), h_(hierarchy) {}

  void build(std::uint32_t begin, std::uint32_t end, std::uint32_t level) {
    const std::size_t number = h_.nodes.size();
    Box box;
    for (std::uint32_t i = begin; i < end; ++i) box.add(points_[h_.order[i]]);
    h_.nodes.push_back({box.low, box.high, begin, end, 0});
    h_.depth = std::max(h_.depth, level);
    if (end - begin <= rules_.leaf || box.low == box.high || level == ReceiverHierarchy::kMostLevels) return;
    const std::uint32_t middle = split(begin, end, level, box);
    build(begin, middle, level + 1);
    h_.nodes[number].right = static_cast<std::uint32_t>(h_.nodes.size());
    build(middle, end, level + 1);
  }

 private:
  static int longest_axis(const Box& box) {
    const vec3 d = box.high - box.low;
    return d.x >= d.y && d.x >= d.z ? 0 : (d.y >= d.z ? 1 : 2);
  }

  /// Both parts are never empty: the box is tight and not a point.
  std::uint32_t split(std::uint32_t begin, std::uint32_t end, std::uint32_t level, const Box& box) {
    const int axis = longest_axis(box);
    if (level > ReceiverHierarchy::kMostLevels / 2) {
      const std::uint32_t middle = begin + (end - begin) / 2;
      std::nth_element(at(begin), at(middle), at(end), [&](std::uint32_t a, std::uint32_t b) {
        return points_[a][axis] != points_[b][axis] ? points_[a][axis] < points_[b][axis] : a < b;
      });
      return middle;
    }
    const double half = 0.5 * (static_cast<double>(box.low[axis]) + static_cast<double>(box.high[axis]));
    return end - begin > rules_.halving_above ? split_at(begin, end, axis, half) : split_by_area(begin, end, box);
  }

  std::uint32_t split_at(std::uint32_t begin, std::uint32_t end, int axis, double border) {
    const auto middle = std::partition(at(begin), at(end), [&](std::uint32_t i) { return points_[i][axis] <= border; });
    return static_cast<std::uint32_t>(middle - h_.order.begin());
  }

  struct Bin {
    Box box;
    std::uint32_t count = 0;
    void add(const Bin& o) { box.add(o.box), count += o.count; }
  };
  struct Split {
    double cost = HUGE_VAL, border = 0.0;
    int axis = 0;
  };

  double cost_of(const Bin& bin) const { return bin.box.area() * (rules_.weigh_by_points ? bin.count : 1.0); }

  /// Border between bins of equal width whose children have the least surface; of equal ones that nearest to the
  /// middle.
  void try_axis(std::uint32_t begin, std::uint32_t end, const Box& box, int axis, Split& best) const {
    const double low = box.low[axis], width = (static_cast<double>(box.high[axis]) - low) / kBins;
    if (!(width > 0.0)) return;
    std::array<Bin, kBins> bins;
    for (std::uint32_t i = begin; i < end; ++i) {
      const vec3& p = points_[h_.order[i]];
      // A point on a border belongs below it, as in split_at.
      int k = std::clamp(static_cast<int>((p[axis] - low) / width), 0, kBins - 1);
      while (k > 0 && p[axis] <= low + width * k) --k;
      while (k < kBins - 1 && p[axis] > low + width * (k + 1)) ++k;
      bins[static_cast<std::size_t>(k)].box.add(p);
      ++bins[static_cast<std::size_t>(k)].count;
    }
    std::array<double, kBins> above{};
    Bin rest;
    for (std::size_t k = kBins - 1; k > 0; --k)
      rest.add(bins[k]), above[k] = rest.count == 0 ? HUGE_VAL : cost_of(rest);
    Bin below;
    for (int k = 1; k < kBins; ++k) {
      below.add(bins[static_cast<std::size_t>(k - 1)]);
      if (below.count == 0) continue;
      const double cost = (cost_of(below) + above[static_cast<std::size_t>(k)]) *
                          (1.0 + 1e-6 * std::abs(k - kBins / 2));  // ties, on flat ground above all
      if (cost < best.cost) best = {cost, low + width * k, axis};
    }
  }

  std::uint32_t split_by_area(std::uint32_t begin, std::uint32_t end, const Box& box) {
    Split best;
    // The longest axis first: it wins ties.
    const int first = longest_axis(box);
    for (int k = 0; k < 3; ++k) try_axis(begin, end, box, (first + k) % 3, best);
    return split_at(begin, end, best.axis, best.border);
  }

  std::vector<std::uint32_t>::iterator at(std::uint32_t i) { return h_.order.begin() + i; }

  static constexpr int kBins = 16;
  std::span<const vec3> points_;
  const HierarchyRules& rules_;
  ReceiverHierarchy& h_;
};

}  // namespace

void build_receiver_hierarchy(std::span<const vec3> points, const HierarchyRules& rules, ReceiverHierarchy& hierarchy) {
  hierarchy.nodes.clear();
  hierarchy.depth = 0;
  const auto count = static_cast<std::uint32_t>(hierarchy.order.size());
  if (count != 0) Builder(points, rules, hierarchy).build(0, count, 1);
}

}  // namespace halfshade
