// Area term of the shape energy [H 8].
#pragma once

#include <pliant/kernels/shape_forces.h>
#include <pliant/model/parameter.h>
#include <pliant/model/polygon.h>
#include <pliant/model/term.h>

namespace pliant {

enum class AreaEnergy {
  absolute,  ///< k_a/2 (a − a0)²
  relative   ///< k_a a0/2 (a/a0 − 1)²: a pressure k_a (a/a0 − 1), the same modulus for all sizes
};

/// U = K/2 (a − a0)², K = k_a or k_a/a0, a the signed area by the shoelace formula (positive for counter-clockwise).
/// Smooth. ∂a/∂r_i = ½ (y_{i+1} − y_{i−1}, x_{i−1} − x_{i+1}); the Hessian is dense in a particle: K ∇a ∇aᵀ + K (a −
/// a0) ∇²a. Elements: particles.
struct Area {
  Real k_a;
  AreaEnergy form = AreaEnergy::absolute;

  static constexpr Elements elements = Elements::particles;
  static std::string_view name() { return "area"; }
  void read(ParameterReader& p) {
    k_a = p.number({.name = "k_a",
                    .symbol = "K_a",
                    .unit = {1, -3, 0},
                    .help = "area stiffness K_a",
                    .value = 2e4,
                    .alias = "ka",
                    .role = Role::area});
    form = p.choice(
        {.name = "area_energy", .help = "area energy: K_a/2 (a - a0)^2 [H 8], or relative: K_a a0/2 (a/a0 - 1)^2"},
        named<AreaEnergy>({{"absolute", AreaEnergy::absolute}, {"relative", AreaEnergy::relative}}));
  }

  AreaLaw kernel_law() const { return {k_a, form == AreaEnergy::relative}; }
  bool enabled(const StateView<2>&) const { return k_a > 0; }
  static Index particle(const StateView<2>&, Index m) { return m; }

  Real energy(const StateView<2>& s, Index m) const {
    return stiffness(s.topology, m) / 2 * square(polygon_area(s.x, s.topology, m) - s.topology.a0[m]);
  }

  template <class G>
  void add_gradient(const StateView<2>& s, Index m, G& grad) const {
    const Real pressure = stiffness(s.topology, m) * (polygon_area(s.x, s.topology, m) - s.topology.a0[m]);
    for (Index i = s.topology.offset[m]; i < s.topology.offset[m + 1]; ++i)
      grad.add(i, Vec<2>(pressure * area_gradient(s.x, s.topology, i)));
  }

  void add_hessian(const StateView<2>& s, Index m, BlockSink<2>& h, PreStress pre_stress = PreStress::kept) const {
    const Real pressure =
        slope_factor(pre_stress) * stiffness(s.topology, m) * (polygon_area(s.x, s.topology, m) - s.topology.a0[m]);
    const Index first = s.topology.offset[m], last = s.topology.offset[m + 1];
    for (Index i = first; i < last; ++i) {
      const Vec<2> gi = area_gradient(s.x, s.topology, i);
      for (Index j = first; j < last; ++j)
        h.add(i, j, stiffness(s.topology, m) * gi * area_gradient(s.x, s.topology, j).transpose());
      const Mat<2> turn{{0, 0.5}, {-0.5, 0}};  // ∂²a/∂r_i∂r_{i+1}
      const Index j = s.topology.next[i];
      h.add(i, j, pressure * turn);
      h.add(j, i, pressure * turn.transpose());
    }
  }

  /// Breathing mode: ω² = K |∇a|²/m, with |∇a|² ≤ Σ l0² for a regular polygon.
  Real max_rate(const Topology& topology) const {
    Real fastest = 0;
    for (Index m = 0; m < topology.particles(); ++m)
      fastest = std::max(fastest, stiffness(topology, m) * topology.points_of(m) * square(topology.l0[m]) /
                                      topology.mass(topology.offset[m]));
    return std::sqrt(fastest);
  }

 private:
  Real stiffness(const Topology& topology, Index m) const {
    return form == AreaEnergy::absolute ? k_a : k_a / topology.a0[m];
  }
};

}  // namespace pliant
