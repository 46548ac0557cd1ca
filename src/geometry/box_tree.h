// Finds objects in the plane near a point; the cost grows with the number of near objects.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <pliant/base/types.h>

namespace pliant {

/// Rectangle with sides along the axes; may be infinite.
struct Box2 {
  Vec<2> low, high;

  Vec<2> to(const Vec<2>& p) const { return (low - p).cwiseMax(p - high).cwiseMax(Vec<2>::Zero()); }
};

/// Tree of bounding boxes of n objects in the plane. A tree of a few objects has no boxes: all objects are near every
/// point.
class BoxTree {
 public:
  static constexpr Index few = 8;

  BoxTree() = default;
  /// boxes [n].
  explicit BoxTree(std::span<const Box2> boxes);

  /// Calls visit(k) for each object whose leaf is within `radius` of p: all objects within this distance, and some
  /// others. Returns the number of boxes compared with p.
  template <class Visit>
  std::int64_t for_each_near(const Vec<2>& p, Real radius, Visit&& visit) const {
    std::int64_t compared = 0;
    for (std::size_t i = 0; i < nodes_.size();) {
      const Node& node = nodes_[i];
      if (nodes_.size() > 1) {
        ++compared;
        if (!(node.box.to(p).squaredNorm() <= radius * radius)) {
          i = node.next;
          continue;
        }
      }
      for (Index k = node.first; k < node.last; ++k) visit(order_[k]);
      ++i;
    }
    return compared;
  }
  /// Whether objects are visited in ascending order.
  bool ordered() const { return nodes_.size() <= 1; }

 private:
  struct Node {
    Box2 box;
    Index first, last;  ///< range of a leaf in the order; empty for inner nodes
    std::size_t next;   ///< next node after all nodes inside this node
  };
  void build(std::span<const Box2> boxes, Index first, Index last);

  std::vector<Node> nodes_;
  std::vector<Index> order_;
};

}  // namespace pliant
