#include <pliant/geometry/box_tree.h>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace pliant {
namespace {

/// The only end of an endless segment.
Vec<2> middle(const Box2& box) {
  Vec<2> m;
  for (int k = 0; k < 2; ++k) m[k] = std::isfinite(box.high[k]) ? (box.low[k] + box.high[k]) / 2 : box.low[k];
  return m;
}

}  // namespace

BoxTree::BoxTree(std::span<const Box2> boxes) : order_(boxes.size()) {
  std::iota(order_.begin(), order_.end(), 0);
  if (!boxes.empty()) build(boxes, 0, static_cast<Index>(boxes.size()));
}

void BoxTree::build(std::span<const Box2> boxes, Index first, Index last) {
  const std::size_t own = nodes_.size();
  Box2 box = boxes[order_[first]], middles{middle(box), middle(box)};
  for (Index k = first; k < last; ++k) {
    const Box2& b = boxes[order_[k]];
    box = {box.low.cwiseMin(b.low), box.high.cwiseMax(b.high)};
    middles = {middles.low.cwiseMin(middle(b)), middles.high.cwiseMax(middle(b))};
  }
  nodes_.push_back({box, first, last, 0});
  if (last - first > few) {
    nodes_[own].last = first;
    const Vec<2> spread = middles.high - middles.low;
    const int axis = spread[0] >= spread[1] ? 0 : 1;
    const Index half = first + (last - first) / 2;
    std::nth_element(order_.begin() + first, order_.begin() + half, order_.begin() + last, [&](Index a, Index b) {
      const Real x = middle(boxes[a])[axis], y = middle(boxes[b])[axis];
      return x < y || (x == y && a < b);
    });
    build(boxes, first, half);
    build(boxes, half, last);
  }
  nodes_[own].next = nodes_.size();
}

}  // namespace pliant
