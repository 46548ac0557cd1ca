// Kinetic friction between touching points [H 6, 12].
#pragma once

#include <pliant/kernels/pair_forces.h>
#include <pliant/model/friction.h>
#include <pliant/model/term.h>

namespace pliant {

/// F_i = −μ u Θ(1 − r/δ_mn), and the opposite on j: u is the whole relative velocity v_i − v_j, or its part normal to
/// r_i − r_j. Conserves linear but not angular momentum; jumps at touch. Dissipated power μ |u|². μ in ρσ_avg^(D−1) g
/// t0. Elements: neighbour list of points.
template <int D>
struct PairFriction {
  Real mu;
  Friction friction = Friction::whole;

  static constexpr Elements elements = Elements::point_pairs;
  static std::string_view name() { return "friction"; }
  void read(ParameterReader& p) { read_friction(p, mu, friction); }

  PairFrictionLaw kernel_law() const { return {mu, friction == Friction::tangential}; }
  bool enabled(const StateView<D>&) const { return mu > 0; }

  Real power(const StateView<D>& s, Index e) const {
    const auto [i, j] = s.neighbours.point_pairs[e];
    return touch(s, i, j) ? mu * slip(s, i, j).squaredNorm() : 0;
  }

  template <class F>
  void add_force(const StateView<D>& s, Index e, F& force) const {
    const auto [i, j] = s.neighbours.point_pairs[e];
    if (!touch(s, i, j)) return;
    const Vec<D> f = -mu * slip(s, i, j);
    force.add(i, f);
    force.add(j, -f);
  }

  void add_dforce_dv(const StateView<D>& s, Index e, BlockSink<D>& h) const {
    const auto [i, j] = s.neighbours.point_pairs[e];
    if (!touch(s, i, j)) return;
    add(i, j, -mu * rubbed_projector<D>(friction, s.position(i) - s.position(j)), h);
  }

  /// The normal turns.
  void add_dforce_dx(const StateView<D>& s, Index e, BlockSink<D>& h) const {
    const auto [i, j] = s.neighbours.point_pairs[e];
    if (friction == Friction::whole || !touch(s, i, j)) return;
    const Vec<D> r = s.position(i) - s.position(j);
    const Real d = r.norm();
    const Vec<D> n = direction<D>(r, d);
    add(i, j, -mu * rubbed_turn<D>(s.velocity(i) - s.velocity(j), n) * distance_curvature<D>(n, d), h);
  }

  /// A point in a dense packing of soft particles has friction with about six others, a vertex with two.
  Real max_damping(const Topology& topology) const {
    const Real contacts = topology.deformable() ? 2 : 6;
    return 2 * contacts * mu / smallest_over_points(topology, [&](Index i) { return topology.mass(i); });
  }

 private:
  static bool touch(const StateView<D>& s, Index i, Index j) {
    const Real reach = (s.topology.diameter[i] + s.topology.diameter[j]) / 2;
    return (s.position(i) - s.position(j)).squaredNorm() < square(reach);
  }
  /// The part of the relative velocity that friction opposes.
  Vec<D> slip(const StateView<D>& s, Index i, Index j) const {
    return rubbed_part<D>(friction, s.velocity(i) - s.velocity(j), s.position(i) - s.position(j));
  }
  /// block: derivative of the force on i by the relative coordinate of i and j.
  static void add(Index i, Index j, const Mat<D>& block, BlockSink<D>& h) {
    h.add(i, i, block);
    h.add(j, j, block);
    h.add(i, j, -block);
    h.add(j, i, -block);
  }
};

}  // namespace pliant
