// Perimeter term of the shape energy [H 8].
#pragma once

#include <pliant/kernels/shape_forces.h>
#include <pliant/model/parameter.h>
#include <pliant/model/term.h>

namespace pliant {

/// U = Σ_i k_l Nv/2 (l_i − l0)², l_i the length of edge i. Smooth while l_i > 0. Elements: edges.
struct Perimeter {
  Real k_l;

  static constexpr Elements elements = Elements::edges;
  static std::string_view name() { return "perimeter"; }
  void read(ParameterReader& p) {
    k_l = p.number({.name = "k_l",
                    .symbol = "K_l",
                    .unit = {1, -1, 0},
                    .help = "perimeter stiffness K_l",
                    .value = 10,
                    .alias = "kl",
                    .role = Role::perimeter});
  }

  PerimeterLaw kernel_law() const { return {k_l}; }
  bool enabled(const StateView<2>&) const { return k_l > 0; }
  static Index particle(const StateView<2>& s, Index i) { return s.topology.particle[i]; }

  Real energy(const StateView<2>& s, Index i) const {
    const Index m = s.topology.particle[i];
    return spring(s, m) / 2 * square(edge(s, i).norm() - s.topology.l0[m]);
  }

  template <class G>
  void add_gradient(const StateView<2>& s, Index i, G& grad) const {
    const Index m = s.topology.particle[i];
    const Vec<2> l = edge(s, i);
    const Vec<2> tension = spring(s, m) * (1 - s.topology.l0[m] / l.norm()) * l;
    grad.add(s.topology.next[i], tension);
    grad.add(i, -tension);
  }

  void add_hessian(const StateView<2>& s, Index i, BlockSink<2>& h, PreStress pre_stress = PreStress::kept) const {
    const Index m = s.topology.particle[i], j = s.topology.next[i];
    const Vec<2> l = edge(s, i);
    const Real length = l.norm();
    const Vec<2> n = l / length;
    const Mat<2> block = spring(s, m) * (n * n.transpose() + slope_factor(pre_stress) * (length - s.topology.l0[m]) *
                                                                 distance_curvature<2>(n, length));
    h.add(i, i, block);
    h.add(j, j, block);
    h.add(i, j, -block);
    h.add(j, i, -block);
  }

  /// Zigzag of a chain of springs: ω² = 4 k_l Nv/m.
  Real max_rate(const Topology& topology) const {
    Real fastest = 0;
    for (Index m = 0; m < topology.particles(); ++m)
      fastest = std::max(fastest, 4 * k_l * topology.points_of(m) / topology.mass(topology.offset[m]));
    return std::sqrt(fastest);
  }

 private:
  Real spring(const StateView<2>& s, Index m) const { return k_l * s.topology.points_of(m); }
  static Vec<2> edge(const StateView<2>& s, Index i) { return s.position(s.topology.next[i]) - s.position(i); }
};

}  // namespace pliant
