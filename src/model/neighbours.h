// Neighbour lists of a run, with one rule for when they are stale.
#pragma once

#include <cstdint>
#include <vector>

#include <pliant/geometry/pair_search.h>
#include <pliant/model/topology.h>

namespace pliant {

/// Which lists a model needs.
struct NeighbourNeeds {
  bool point_pairs = false;
  bool vertex_edges = false;
  bool walls = false;
  bool lips = false;
};

/// Lists of everything closer than contact + skin at the reference positions. They hold every contact until some point
/// has moved by skin/2 from there; `ensure` rebuilds them then, at whatever positions the forces are asked for, so that
/// no step, stage or trial state ever sees a list that lacks a contact. A rebuilt list changes a force only by the
/// order of its sum.
template <int D>
class Neighbours {
 public:
  Neighbours(NeighbourNeeds needs, Real skin) : needs_(needs), skin_(skin) {}

  std::vector<Pair> point_pairs;   ///< (larger point, smaller point)
  std::vector<Pair> vertex_edges;  ///< (vertex, first vertex of the edge)
  std::vector<Pair> walls;         ///< (point, wall)
  std::vector<Pair> lips;          ///< (lip, first vertex of the edge)

  /// Makes the lists valid for positions x [points · D]. Errors: NumericalError for a position that is not finite.
  void ensure(const Topology& topology, const Walls<D>& wall, const Real* x) {
    if (!valid(x)) rebuild(topology, wall, x);
  }

  /// Builds the lists from x, which becomes the reference: the same x gives the same lists, which a restart relies on.
  void rebuild(const Topology& topology, const Walls<D>& wall, const Real* x);

  /// After a change of the topology: the next `ensure` rebuilds.
  void invalidate() { reference_.clear(); }

  /// Positions of the last rebuild, empty if there was none.
  const std::vector<Real>& reference() const { return reference_; }
  std::int64_t rebuilds() const { return rebuilds_; }
  /// Entries in all lists: what one force evaluation visits.
  std::size_t size() const { return point_pairs.size() + vertex_edges.size() + walls.size() + lips.size(); }
  Real skin() const { return skin_; }

 private:
  bool valid(const Real* x) const;

  NeighbourNeeds needs_;
  Real skin_;
  std::vector<Real> reference_;
  std::int64_t rebuilds_ = 0;
  CellGrid<D> grid_;
};

extern template class Neighbours<2>;
extern template class Neighbours<3>;

}  // namespace pliant
