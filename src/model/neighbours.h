// Neighbour lists of a run, divided into chunks of particles, with one rule for when they are stale.
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
  bool solids = false;
  Real beyond_contact = 0;    ///< range of forces beyond the contact distance, for points and for solids
  Edges edges = Edges::wide;  ///< in vertex–edge contacts
};

/// What a term has one element of.
enum class Elements { particles, points, point_pairs, vertex_edges, walls, lips, solids };

/// first … last−1.
struct Range {
  Index first = 0, last = 0;
  Index size() const { return last - first; }
  bool contains(Index i) const { return first <= i && i < last; }
};

/// A list whose pairs are grouped by chunk: first those inside each chunk, then those across the border of each. A pair
/// across a border is listed by the chunks on both sides, each of which works on its own points only.
struct PairList {
  std::vector<Pair> pairs;
  std::vector<Real> reach;   ///< contact distance of each pair; empty for walls, lips and solids
  std::vector<Index> start;  ///< [2 chunks + 1]

  Index size() const { return static_cast<Index>(pairs.size()); }
  bool empty() const { return pairs.empty(); }
  const Pair& operator[](Index e) const { return pairs[e]; }
  /// Drops all pairs for which unwanted(pair) is true.
  template <class Unwanted>
  void erase(Unwanted&& unwanted);
  /// Adds a pair at the end of a chunk's part; a list without reaches takes none.
  void insert(Index chunk, bool across_border, const Pair& pair, Real contact = 0);
  auto begin() const { return pairs.begin(); }
  auto end() const { return pairs.end(); }
  Index chunks() const { return static_cast<Index>(start.size()) / 2; }
  Range inside(Index chunk) const { return {start[chunk], start[chunk + 1]}; }
  Range across(Index chunk) const { return inside(chunks() + chunk); }
  void clear() { pairs.clear(), reach.clear(), start.assign(1, 0); }
};

/// Lists of everything closer than the reach of its forces + skin at the reference positions. They hold all that is
/// within reach until some point or solid has moved by skin/2 from there; `ensure` rebuilds them then, at whatever
/// positions the forces are asked for, so that no step, stage or trial state ever sees a list that lacks a contact. A
/// rebuilt list changes a force only by the order of its sum.
///
/// The rank's own particles are divided into chunks, the units of work of threads: runs of particles in storage order,
/// of about the same number of points. What a chunk holds, and the order of its lists, depends on the configuration
/// only, not on the number of threads. Ghosts belong to no chunk.
template <int D>
class Neighbours {
 public:
  static constexpr Index max_chunks = 1024;

  Neighbours(NeighbourNeeds needs, Real skin) : needs_(needs), skin_(skin) {}

  const NeighbourNeeds& needs() const { return needs_; }

  PairList point_pairs;   ///< (point, point); across a border the chunk's own point comes first
  PairList vertex_edges;  ///< (vertex, first vertex of the edge)
  PairList walls;         ///< (point, wall)
  PairList lips;          ///< (lip, first vertex of the edge)
  PairList solids;        ///< (point, solid)

  /// Those of vertex_edges that can touch, in their order: all, or since narrow() those that could touch before points
  /// have gone range/2 from where they were then. What is left out adds nothing to a force.
  const PairList& near_edges() const { return narrowed_ ? near_edges_ : vertex_edges; }
  void narrow(const Topology& topology, const Real* x, Real range) requires(D == 2);
  void widen() { narrowed_ = false; }
  bool narrowed() const { return narrowed_; }

  /// How far the point or solid has moved that has moved farthest from where it was when the lists were built; infinite
  /// for NaN, and where there are no lists. x [points · D]. Solids may have moved, but not have become others.
  Real farthest(const Walls<D>& wall, const Real* x, Real t = 0) const;
  /// Up to where the lists hold every contact.
  Real limit() const { return skin_ / 2; }
  bool valid(const Walls<D>& wall, const Real* x, Real t = 0) const { return farthest(wall, x, t) <= limit(); }

  /// Makes the lists valid for positions x [points · D] at time t. Errors: NumericalError for a position that is not
  /// finite.
  void ensure(const Topology& topology, const Walls<D>& wall, const Real* x, Real t = 0) {
    if (!valid(wall, x, t)) rebuild(topology, wall, x, t);
  }

  /// Builds the lists from x at time t, which become the reference: the same x and t give the same lists, which a
  /// restart relies on.
  void rebuild(const Topology& topology, const Walls<D>& wall, const Real* x, Real t = 0);

  /// Lists particle m of this rank, which was put somewhere else, at its new place in x. Costs little, unlike a
  /// rebuild. The lists must be valid for the other particles.
  void relist(const Topology& topology, const Walls<D>& wall, const Real* x, Index m);

  /// After a change of the topology: the next `ensure` rebuilds.
  void invalidate() {
    built_ = false;
    widen();
    reference_.clear();
  }

  /// How the lists came about: positions of all points at the last rebuild, then particles that were relisted.
  struct History {
    std::vector<Real> reference;
    std::vector<Index> relisted;
    std::vector<Real> places;  ///< coordinates of the points of each
    Real time = 0;             ///< of the last rebuild; matters where solids move
  };
  History history(const Topology& topology) const;
  /// Builds the same lists, in the same order.
  void replay(const Topology& topology, const Walls<D>& wall, const History& history);

  Index chunks() const { return static_cast<Index>(chunk_.size()) - 1; }
  Range particles(Index chunk) const { return {chunk_[chunk], chunk_[chunk + 1]}; }
  Range points(Index chunk) const { return {chunk_point_[chunk], chunk_point_[chunk + 1]}; }
  Range inside(Elements elements, Index chunk) const;
  Range across(Elements elements, Index chunk) const;

  /// Where the lists were built: positions of the own points at the last rebuild, of relisted ones where they were
  /// put; empty if there are no lists.
  const std::vector<Real>& reference() const { return reference_; }
  std::int64_t rebuilds() const { return rebuilds_; }
  /// Another number whenever the lists hold other pairs.
  std::int64_t version() const { return version_; }
  /// Pairs of points; of vertices and edges where points meet none.
  std::int64_t pairs() const { return needs_.point_pairs ? point_pairs.size() : vertex_edges.size(); }
  /// Entries in all lists: what one force evaluation visits.
  std::size_t size() const {
    return static_cast<std::size_t>(point_pairs.size()) + vertex_edges.size() + walls.size() + lips.size() +
           solids.size();
  }
  Real skin() const { return skin_; }
  /// How far beyond the contact distance the lists go.
  Real margin() const { return needs_.beyond_contact + skin_; }
  /// For the next rebuild.
  void set_skin(Real skin) {
    skin_ = skin;
    invalidate();
  }

 private:
  struct Found {
    Pair pair;
    Real reach;
  };
  void divide(const Topology& topology);
  Index chunk_of(Index i) const;
  template <class Search>
  void build(PairList& list, bool searcher_first, Index all_points, Search&& search);
  void build_from_points(const Topology& topology, const PointCloud& cloud) requires(D == 2);
  template <class Search>
  void build_own(PairList& list, Search&& search);

  NeighbourNeeds needs_;
  Real skin_;
  PairList near_edges_;
  bool narrowed_ = false;
  bool built_ = false;  ///< and not invalid; a rank without particles has no reference
  std::vector<Real> reference_;
  Real time_ = 0;  ///< of the last rebuild
  std::int64_t rebuilds_ = 0, version_ = 0;
  std::vector<Index> chunk_{0}, chunk_point_{0};
  Real widest_ = 0, longest_ = 0;  ///< diameter of a point, edge
  CellGrid<D> grid_;
  std::vector<Index> relisted_;            ///< since the last rebuild
  std::vector<Real> old_places_, places_;  ///< references of their points, before and after
  std::vector<Found> near_;
};

extern template class Neighbours<2>;
extern template class Neighbours<3>;

}  // namespace pliant
