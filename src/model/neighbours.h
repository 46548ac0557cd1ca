// Neighbour lists of a run, divided into chunks of particles, with one rule for when they are stale.
#pragma once

#include <cstdint>
#include <vector>

#include <pliant/model/elements.h>

namespace pliant {

/// Lists of all elements closer than the cutoff + skin at the reference positions. The lists contain every contact
/// until a point or wall has moved by skin/2 from there. `ensure` then rebuilds them at the positions of the force
/// evaluation, so that no step, stage or trial state lacks a contact. A rebuilt list changes a force only by the order
/// of its sum.
///
/// The rank's own particles are divided into chunks, the units of work of threads: runs of particles in storage order,
/// of about the same number of points. The content of a chunk, and the order of its lists, depends on the configuration
/// only, not on the number of threads. Ghosts belong to no chunk.
template <int D>
class Neighbours : public NeighbourLists {
 public:
  static constexpr Index max_chunks = 1024;

  Neighbours(NeighbourNeeds needs, Real skin) : needs_(needs), skin_(skin) {}

  const NeighbourNeeds& needs() const { return needs_; }

  /// Finds the elements of outlines and surfaces that can touch before a point has moved by range/2 from its position
  /// at this call. The other elements do not contribute to forces until then, or until widen().
  void narrow(const Topology& topology, const Real* x, Real range);
  void widen() { narrowed_ = false; }
  bool narrowed() const { return narrowed_; }
  /// The pairs of vertex_edges that can touch, in their order; all pairs if the lists are not narrowed.
  const PairList& near_edges() const { return narrowed_ ? near_edges_ : vertex_edges; }
  /// The elements of vertex_faces and of edge_pairs that can touch, in their order, if the lists are narrowed.
  const NearSimplices& near_vertex_faces() const { return near_vertex_faces_; }
  const NearSimplices& near_edge_pairs() const { return near_edge_pairs_; }

  /// Largest displacement of a point or wall since the lists were built; infinite for NaN, and without lists. x [points
  /// · D]. Walls may have moved, but must be the same walls.
  Real farthest(const Walls<D>& wall, const Real* x, Real t = 0) const;
  /// Largest displacement of a wall, without points. Walls must not turn without end. The same on every rank.
  Real farthest_wall(const Walls<D>& wall, Real t) const;
  /// Displacement up to which the lists contain every contact; negative where they may lack one anyway.
  Real limit() const { return skin_ / 2 - shortened_; }
  /// All points, ghosts too, have followed r → origin + F (r − origin). Displacements count from the deformed reference
  /// positions. The lists stay valid as long as F since the rebuild shortens no distance by more than the skin. widest:
  /// diameter of the widest point of all ranks, so that limit() is the same on every rank.
  void deform(const Vec<D>& origin, const Mat<D>& f, Real widest) { set_deformation(origin, f * deformation_, widest); }
  /// As deform(), where F is the deformation since the rebuild.
  void set_deformation(const Vec<D>& origin, const Mat<D>& f, Real widest);
  bool valid(const Walls<D>& wall, const Real* x, Real t = 0) const { return farthest(wall, x, t) <= limit(); }

  /// Makes the lists valid for positions x [points · D] at time t. Errors: NumericalError for a position that is not
  /// finite.
  void ensure(const Topology& topology, const Walls<D>& wall, const Real* x, Real t = 0) {
    if (!valid(wall, x, t)) rebuild(topology, wall, x, t);
  }

  /// Builds the lists from x at time t, which become the reference: the same x and t give the same lists, which a
  /// restart relies on.
  void rebuild(const Topology& topology, const Walls<D>& wall, const Real* x, Real t = 0);

  /// Lists particle m of this rank again after it was moved to another place in x. Much cheaper than a rebuild. The
  /// lists must be valid for the other particles.
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
    Real time = 0;             ///< time of the last rebuild; matters for moving walls and boxes
  };
  History history(const Topology& topology) const;
  /// Builds the same lists, in the same order.
  void replay(const Topology& topology, const Walls<D>& wall, const History& history);

  Index chunks() const { return static_cast<Index>(chunk_.size()) - 1; }
  Range particles(Index chunk) const { return {chunk_[chunk], chunk_[chunk + 1]}; }
  Range points(Index chunk) const { return {chunk_point_[chunk], chunk_point_[chunk + 1]}; }

  /// Reference positions of the owned points at the last rebuild, for relisted particles at their new places; empty if
  /// there are no lists.
  const std::vector<Real>& reference() const { return reference_; }
  std::int64_t rebuilds() const { return rebuilds_; }
  Real time_of_rebuild() const { return time_; }
  /// Another number whenever the lists hold other pairs.
  std::int64_t version() const { return version_; }
  /// Pairs of points; of vertices, edges and faces where points meet none.
  std::int64_t pairs() const {
    return needs_.point_pairs ? point_pairs.size() : vertex_edges.size() + vertex_faces.size() + edge_pairs.size();
  }
  /// Entries in all lists, visited by one force evaluation.
  std::size_t size() const {
    std::size_t sum = 0;
    for_each_list([&]<class Kind>(Kind) { sum += (this->*Kind::list).pairs.size(); });
    return sum;
  }
  Real skin() const { return skin_; }
  /// Range of the lists beyond the contact distance.
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
  Real farthest_from_deformed(Index points, const Real* x, const Real* reference) const;
  void divide(const Topology& topology);
  Index chunk_of(Index i) const;
  /// Calls visit(kind) for the kinds that are found by a search.
  template <class Visit>
  static void for_each_list(Visit&& visit) {
    for_each_kind([&]<class Kind>(Kind kind) {
      if constexpr (Kind::listed)
        if constexpr (Kind::template in<D>) visit(kind);
    });
  }
  SearchSpace<D> search_space(const Topology& topology, const Walls<D>& wall, const Real* x) const;
  static void append(PairList& list, const std::vector<Found>& part);
  template <class Kind>
  void build_pairs(const SearchSpace<D>& space);
  template <class Kind>
  void build_own(const SearchSpace<D>& space);
  template <class Kind, class Add>
  void narrow_simplices(const Topology& topology, const Real* x, Real range, Add&& add_near, NearSimplices& near);
  /// Elements inside each chunk, and across the border of each chunk.
  struct FoundParts {
    std::vector<std::vector<Found>> inside, across;
  };
  template <class Add>
  FoundParts from_points(Add&& add) const;
  void add_to(FoundParts& parts, Index i, Index j, const Found& found) const;
  static void fill(PairList& list, const FoundParts& parts);
  void build_bare_edges(const Topology& topology, const PointCloud& cloud) requires(D == 2);
  void build_bare_faces(const Topology& topology, const Real* x) requires(D == 3);

  NeighbourNeeds needs_;
  Real skin_;
  PairList near_edges_;
  NearSimplices near_vertex_faces_, near_edge_pairs_;
  bool narrowed_ = false;
  bool built_ = false;  ///< and not invalid; a rank without particles has no reference
  std::vector<Real> reference_;
  Mat<D> deformation_ = Mat<D>::Identity();  ///< since the last rebuild, about origin_
  Vec<D> origin_ = Vec<D>::Zero();
  Real shortened_ = 0;  ///< half of the length by which the deformation shortens distances at most
  Real time_ = 0;       ///< of the last rebuild
  std::int64_t rebuilds_ = 0, version_ = 0;
  std::vector<Index> chunk_{0}, chunk_point_{0};
  Real widest_ = 0, longest_ = 0;  ///< diameter of a point, edge
  CellGrid<D> grid_;
  SurfaceBoxes boxes_;
  std::vector<Index> relisted_;            ///< since the last rebuild
  std::vector<Real> old_places_, places_;  ///< references of their points, before and after
  std::vector<Found> near_;
};

extern template class Neighbours<2>;
extern template class Neighbours<3>;

}  // namespace pliant
