// Drag of a background fluid [H 5, 11].
#pragma once

#include <pliant/model/parameter.h>
#include <pliant/model/term.h>

namespace pliant {

/// Particle to which the drag coefficient ζ refers.
enum class DragLaw {
  per_particle,  ///< each particle, of any size
  per_mass       ///< a particle of diameter σ_avg; the drag of other particles is proportional to their mass
};

/// Mass of a particle of diameter σ_avg.
template <int D>
inline constexpr Real average_mass = D == 2 ? pi / 4 : pi / 6;

/// Number of points, like the points of particle m, that share ζ.
template <int D>
Real drag_shares(DragLaw law, const Topology& topology, Index m) {
  return law == DragLaw::per_mass ? average_mass<D> / topology.point_mass[m] : topology.points_of(m);
}

/// F_i = −(ζ/n) (v_i − u_i) on each of the n points of a particle (n = 1 for soft particles); the same ζ for all sizes,
/// or in proportion to their masses. u_i: velocity of the fluid at the point, zero unless the box is sheared at a rate
/// (StateView::flow). Dissipated power (ζ/n) (v − u)². ζ in ρσ_avg^(D−1) g t0. Elements: points.
template <int D>
struct Drag {
  Real zeta;
  DragLaw law = DragLaw::per_particle;

  static constexpr Elements elements = Elements::points;
  static std::string_view name() { return "drag"; }
  void read(ParameterReader& p) {
    zeta = p.number({.name = "zeta",
                     .symbol = "\\zeta/\\zeta_0",
                     .unit = dimension::drag,
                     .help = "drag coefficient zeta",
                     .role = Role::drag});
    law = p.choice(
        {.name = "drag", .help = "zeta: the same for all particles [H 5, 11], or proportional to mass (per_mass)"},
        named<DragLaw>({{"per_particle", DragLaw::per_particle}, {"per_mass", DragLaw::per_mass}}));
  }

  bool enabled(const StateView<D>&) const { return zeta > 0; }
  Real power(const StateView<D>& s, Index i) const { return coefficient(s.topology, i) * slip(s, i).squaredNorm(); }
  template <class F>
  void add_force(const StateView<D>& s, Index i, F& force) const {
    force.add(i, Vec<D>(-coefficient(s.topology, i) * slip(s, i)));
  }
  void add_dforce_dv(const StateView<D>& s, Index i, BlockSink<D>& h) const {
    h.add(i, i, -coefficient(s.topology, i) * Mat<D>::Identity());
  }
  void add_dforce_dx(const StateView<D>& s, Index i, BlockSink<D>& h) const {
    if (!s.flow.flows()) return;
    Mat<D> block = Mat<D>::Zero();
    block(0, 1) = coefficient(s.topology, i) * s.flow.rate;
    h.add(i, i, block);
  }
  Real max_damping(const Topology& topology) const {
    return zeta / smallest_over_points(topology, [&](Index i) { return dragged_mass(topology, i); });
  }
  /// γ of the point that drag damps least.
  Real min_damping(const Topology& topology) const {
    return zeta * smallest_over_points(topology, [&](Index i) { return 1 / dragged_mass(topology, i); });
  }

  /// Velocity of point i relative to the fluid.
  static Vec<D> slip(const StateView<D>& s, Index i) {
    if (!s.flow.flows()) return s.velocity(i);
    return s.velocity(i) - s.flow.at(s.position(i));
  }

 private:
  /// Mass of a point and of the points that share ζ with it.
  Real dragged_mass(const Topology& topology, Index i) const {
    return topology.mass(i) * drag_shares<D>(law, topology, topology.particle[i]);
  }
  Real coefficient(const Topology& topology, Index i) const {
    return zeta / drag_shares<D>(law, topology, topology.particle[i]);
  }
};

}  // namespace pliant
