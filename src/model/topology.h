// The unchanging data of particles: their points, sizes and masses.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <pliant/base/types.h>

namespace pliant {

struct Surfaces;

/// A *point* carries a position, a velocity and a mass: the centre of a soft particle, or a vertex of a deformable one.
/// Points of particle m are offset[m] … offset[m+1]−1, in counter-clockwise order for a polygon.
/// Units: σ_avg = g = ρ = 1.
struct Topology {
  int dim = 2;
  std::vector<Index> offset{0};  ///< [particles + 1]
  std::vector<Index> particle;   ///< [points] owner
  std::vector<Index> next,
      previous;                  ///< [points] cyclic neighbours in the polygon; a soft particle is its own neighbour
  std::vector<Real> diameter;    ///< [points] contact diameter: σ_m (soft) or δ_m (deformable)
  std::vector<Real> point_mass;  ///< [particles] of each point; all points of a particle have the same
  std::vector<Real> inverse_point_mass;  ///< [particles] 0 for an inactive particle
  std::vector<Real> inertia;             ///< [particles] moment of inertia of the only point; 0 where there are more
  std::vector<Real> inverse_inertia;     ///< [particles] 0 for an inactive particle, and for one of several points
  std::vector<Real> sigma;               ///< [particles] diameter; of the disk of area a0 for a polygon
  std::vector<Real> a0;                  ///< [particles] rest area (2D) or volume (3D)
  std::vector<Real> l0;                  ///< [particles] rest length of an edge; 0 for soft particles
  std::vector<std::uint8_t> active;      ///< [particles] 0: inactive: touches nothing and does not move
  std::vector<Index> id;  ///< [particles] the particle's number for the user; its place here changes as particles are
                          ///< sorted in space and move between ranks
  Index ghosts = 0;       ///< the last particles are copies: of other ranks' particles, and images of any in a box
  /// Connectivity and rest shapes of closed surfaces (3D), of all ranks; null for other particles.
  std::shared_ptr<const Surfaces> surfaces = nullptr;
  std::vector<std::int8_t> ghost_side;  ///< [ghosts] 1 or −1 for images on opposite sides of a particle, 0 for no image

  Index particles() const { return static_cast<Index>(offset.size()) - 1; }
  Index points() const { return offset.back(); }
  Index points_of(Index m) const { return offset[m + 1] - offset[m]; }
  Index owned() const { return particles() - ghosts; }  ///< particles of this rank: 0 … owned()−1
  Index owned_points() const { return offset[owned()]; }
  Real mass(Index i) const { return point_mass[particle[i]]; }
  Real inverse_mass(Index i) const { return inverse_point_mass[particle[i]]; }
  bool deformable() const { return points() > particles(); }
  /// Particle m or n, to which pair quantities are attributed: the particle with the lower id. A particle that touches
  /// an image of itself is listed on both sides, with opposite images: one of the two counts.
  Index counts_for(Index m, Index n) const {
    if (id[m] != id[n]) return id[m] < id[n] ? m : n;
    const auto [own, ghost] = std::minmax(m, n);
    return ghost_side[ghost - owned()] > 0 ? own : ghost;
  }

  /// Makes room for so many particles and points.
  void reserve(Index particles, Index points);
  /// Appends a soft particle of diameter sigma and the given mass: a disk or a sphere, according to its moment of
  /// inertia.
  void add_soft(Real sigma_m, Real mass_m);
  /// Appends a polygon of n vertices; delta is the diameter of a vertex or the width of an edge.
  void add_polygon(Index n, Real a0_m, Real l0_m, Real delta_m, Real mass_m);
  /// Other moment of inertia, in ρ σ_avg^(dim+2), of a particle of one point.
  void set_inertia(Index m, Real value);
  /// Takes particle m out of the run.
  void deactivate(Index m);

  /// The particles `which` only, in this order.
  Topology select(std::span<const Index> which) const;

  /// Appends a copy of a particle.
  void add_ghost(Index id_m, Index n, Real delta_m, Real sigma_m, Real a0_m, Real l0_m, Real mass_m, Real inertia_m,
                 int side = 0);
  void drop_ghosts();
  /// Builds offset, particle, next and previous for particles of these numbers of points.
  void connect(const std::vector<Index>& points_of_each);

 private:
  void connect_points(Index n);
  void add_points(Index n, Real diameter_m, Real mass_m);
};

}  // namespace pliant
