// Finds vertices and faces, and pairs of edges, of different closed surfaces that are near each other.
#pragma once

#include <Eigen/Geometry>
#include <functional>
#include <span>
#include <vector>

#include <pliant/geometry/cell_grid.h>
#include <pliant/geometry/pair_search.h>
#include <pliant/geometry/walls.h>
#include <pliant/model/surface.h>
#include <pliant/model/topology.h>

namespace pliant {

/// The boxes around the active particles, in space, and which of them are near each other.
class SurfaceBoxes {
 public:
  using Bounds = Eigen::AlignedBox<Real, 3>;

  /// margin: how far beyond the contact distance particles are near each other. x [points · 3].
  void build(const Topology& topology, const Real* x, Real margin);
  /// Particle m has moved to x [points · 3].
  void move(const Topology& topology, const Real* x, Index m) { bounds_[m] = around(topology, x, m); }

  const Bounds& of(Index m) const { return bounds_[m]; }
  /// Calls visit(n) for all active particles n ≠ m whose points may be as near to particle m, in an order that depends
  /// on the positions only; perhaps twice for those among `moved`, which have moved since the boxes were built.
  template <class Visit>
  void for_each_near(const Topology& topology, Index m, std::span<const Index> moved, Visit&& visit) const {
    if (topology.active[m] == 0) return;
    const Real reach = topology.diameter[topology.offset[m]] / 2 + margin_;
    const auto look_at = [&](Index n) {
      if (n == m || topology.active[n] == 0) return;
      const Vec<3> range = Vec<3>::Constant(reach + topology.diameter[topology.offset[n]] / 2);
      if (Bounds(bounds_[m].min() - range, bounds_[m].max() + range).intersects(bounds_[n])) visit(n);
    };
    const Real radius = bounds_[m].diagonal().norm() / 2;
    std::vector<Index> near;
    grid_.for_each_near(bounds_[m].center(), radius + reach + widest_, (radius + reach) * (1 + 1e-12), near, look_at);
    for (const Index n : moved) look_at(n);
  }

 private:
  static Bounds around(const Topology& topology, const Real* x, Index m);

  Real margin_ = 0, widest_ = 0;
  std::vector<Bounds> bounds_;
  CellGrid<3> grid_;  ///< spheres around the boxes, larger by half the contact diameter
};

using FoundPair = std::function<void(const Pair&)>;

/// The pairs (vertex of n, face of m) that are nearer to each other than contact + margin. x [points · 3]. wanted(k):
/// for which faces, by their numbers in m; empty: for all.
void find_vertex_faces(const Topology& topology, const SurfaceBoxes& boxes, const Real* x, Real contact, Real margin,
                       Index n, Index m, const std::function<bool(Index)>& wanted, const FoundPair& found);
/// The pairs (edge of m, edge of n) that are as near.
void find_edge_pairs(const Topology& topology, const SurfaceBoxes& boxes, const Real* x, Real margin, Index m, Index n,
                     const FoundPair& found);

/// The edges of the active particles with points first … last−1 with a distance < δ/2 + margin from a lip at time t:
/// found(lip, edge).
void find_lip_edges(const Topology& topology, const SurfaceBoxes& boxes, const Walls<3>& walls, const Real* x, Real t,
                    Real margin, Index first, Index last, const std::function<void(Index, Index)>& found);

/// Smallest distance between two surfaces that do not pierce each other. x, y: their points [points · 3]; the first
/// surface is shifted.
Real surface_distance(const Surface& first, const Real* x, const Vec<3>& shift, const Surface& second, const Real* y);

/// Contact distance of two particles.
inline Real contact_distance(const Topology& t, Index m, Index n) {
  return (t.diameter[t.offset[m]] + t.diameter[t.offset[n]]) / 2;
}

}  // namespace pliant
