// Kinetic friction between touching points [H 6, 12].
#pragma once

#include <pliant/model/term.h>

namespace pliant {

/// F_i = −μ (v_i − v_j) Θ(1 − r/δ_mn), and the opposite on j: the whole relative velocity, not only its tangential
/// part. Conserves linear but not angular momentum; jumps at touch. Dissipated power μ |v_i − v_j|². μ in ρσ_avg^(D−1)
/// g t0. Elements: neighbour list of points.
template <int D>
struct PairFriction {
  Real mu;

  static constexpr Elements elements = Elements::point_pairs;
  static std::string_view name() { return "friction"; }
  bool enabled(const StateView<D>&) const { return mu > 0; }

  Real power(const StateView<D>& s, Index e) const {
    const auto [i, j] = s.neighbours.point_pairs[e];
    return touch(s, i, j) ? mu * (s.velocity(i) - s.velocity(j)).squaredNorm() : 0;
  }

  template <class F>
  void add_force(const StateView<D>& s, Index e, F& force) const {
    const auto [i, j] = s.neighbours.point_pairs[e];
    if (!touch(s, i, j)) return;
    const Vec<D> f = mu * (s.velocity(j) - s.velocity(i));
    force.add(i, f);
    force.add(j, -f);
  }

  void add_dforce_dv(const StateView<D>& s, Index e, BlockSink<D>& h) const {
    const auto [i, j] = s.neighbours.point_pairs[e];
    if (!touch(s, i, j)) return;
    const Mat<D> block = mu * Mat<D>::Identity();
    h.add(i, i, -block);
    h.add(j, j, -block);
    h.add(i, j, block);
    h.add(j, i, block);
  }

  /// A point in a dense packing of soft particles rubs against about six others, a vertex against two.
  Real max_damping(const Topology& topology) const {
    const Real contacts = topology.deformable() ? 2 : 6;
    return 2 * contacts * mu / smallest_over_points(topology, [&](Index i) { return topology.mass(i); });
  }

 private:
  static bool touch(const StateView<D>& s, Index i, Index j) {
    const Real reach = (s.topology.diameter[i] + s.topology.diameter[j]) / 2;
    return (s.position(i) - s.position(j)).squaredNorm() < square(reach);
  }
};

}  // namespace pliant
