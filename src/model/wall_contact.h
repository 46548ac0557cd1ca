// Contact of points with walls [H 3, 10].
#pragma once

#include <pliant/kernels/contact_law.h>
#include <pliant/kernels/wall_forces.h>
#include <pliant/model/parameter.h>
#include <pliant/model/term.h>

namespace pliant {

/// The energy scale of contacts with walls, and the thickness of walls.
inline Real read_wall_energy(ParameterReader& p) {
  return p.number({.name = "e_w",
                   .symbol = "E_w",
                   .unit = dimension::energy,
                   .help = "contact energy E_w of walls",
                   .value = 1e4,
                   .min_open = true,
                   .alias = "eps_w",
                   .role = Role::wall_energy});
}
inline Real read_wall_diameter(ParameterReader& p) {
  return p.number({.name = "wall_diameter",
                   .symbol = "\\delta_w/\\sigma_{avg}",
                   .unit = dimension::length,
                   .help = "thickness of walls with rounded ends",
                   .max = 1,
                   .role = Role::wall_diameter});
}

/// U = Σ V(d_w), d_w the distance of the point to the wall and V of range (δ + δ_w)/2, δ the point's contact diameter
/// and δ_w the diameter of the walls, whose ends are then round beads, by one of the laws in contact_law.h; harmonic,
/// for walls without thickness: ε_w/2 (1 − 2 d_w/δ)² Θ(1 − 2 d_w/δ). Where segments are joined to an outline the joint
/// counts −V. Walls may move: they are at their places at the view's time. Elements: neighbour list of points and parts
/// of the walls.
template <int D>
struct WallContact {
  Real epsilon = 0;
  Real thickness = 0;  ///< δ_w, in σ_avg
  ContactLaw law = ContactLaw::harmonic;

  static constexpr Elements elements = Elements::walls;
  static std::string_view name() { return "wall"; }
  void read(ParameterReader& p) {
    epsilon = read_wall_energy(p);
    thickness = read_wall_diameter(p);
  }

  WallLaw kernel_law() const { return {epsilon, law}; }
  bool enabled(const StateView<D>& s) const { return s.walls.size() > 0; }
  Real range() const { return thickness / 2; }

  Real energy(const StateView<D>& s, Index e) const {
    const auto [i, part] = s.neighbours.walls[e];
    return s.walls.weight(part) * overlap(s, i).value(s.walls.distance(s.position(i), part, s.t));
  }

  template <class G>
  void add_gradient(const StateView<D>& s, Index e, G& grad) const {
    const auto [i, part] = s.neighbours.walls[e];
    if (s.walls.beyond(s.position(i), overlap(s, i).delta, part, s.t)) return;
    grad.add(i, Vec<D>(-force(s, e)));
  }

  void add_hessian(const StateView<D>& s, Index e, BlockSink<D>& h) const {
    const auto [i, part] = s.neighbours.walls[e];
    const WallFoot<D> foot = s.walls.foot(s.position(i), part, s.t);
    const Overlap v = overlap(s, i);
    if (!v.touches(foot.d)) return;
    h.add(
        i, i,
        s.walls.weight(part) * (v.curvature(foot.d) * foot.n * foot.n.transpose() + v.slope(foot.d) * foot.curvature));
  }

  /// Force of the wall on the point; the wall feels the opposite.
  Vec<D> force(const StateView<D>& s, Index e) const {
    const auto [i, part] = s.neighbours.walls[e];
    Real d;
    Vec<D> n;
    s.walls.nearest(s.position(i), part, s.t, d, n);
    if (d == 0 && !s.walls.solid(part, s.t)) return Vec<D>::Zero();  // a law may be infinite there
    return -s.walls.weight(part) * overlap(s, i).slope(d) * n;
  }

  /// ω² = V''/m, with the harmonic law 4 ε_w/((δ + δ_w)² m).
  Real max_rate(const Topology& topology) const {
    return std::sqrt(Overlap::stiffness(law) * epsilon / smallest_over_points(topology, [&](Index i) {
                       return Overlap::scale(law, (topology.diameter[i] + thickness) / 2) * topology.mass(i);
                     }));
  }

 private:
  Overlap overlap(const StateView<D>& s, Index i) const {
    return {law, epsilon, (s.topology.diameter[i] + thickness) / 2};
  }
};

}  // namespace pliant
