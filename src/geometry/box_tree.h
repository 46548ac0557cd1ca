// Finds things of the plane that are near a point at the price of those that are near.
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

/// Boxes within boxes, each around some of n things of the plane. A few things have no boxes, and are always near.
class BoxTree {
 public:
  static constexpr Index few = 8;

  BoxTree() = default;
  /// boxes [n].
  explicit BoxTree(std::span<const Box2> boxes);

  /// Calls visit(k) for each thing whose leaf is within `radius` of p: all that are that near, and some others. Returns
  /// how many boxes it has compared with p.
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
  /// Whether it visits things in ascending order.
  bool ordered() const { return nodes_.size() <= 1; }

 private:
  struct Node {
    Box2 box;
    Index first, last;  ///< of a leaf: its part of the order; else none
    std::size_t next;   ///< node after all that are inside this one
  };
  void build(std::span<const Box2> boxes, Index first, Index last);

  std::vector<Node> nodes_;
  std::vector<Index> order_;
};

}  // namespace pliant
