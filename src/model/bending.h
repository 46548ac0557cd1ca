// Bending term of the shape energy [H 8].
#pragma once

#include <array>

#include <pliant/kernels/shape_forces.h>
#include <pliant/model/parameter.h>
#include <pliant/model/term.h>

namespace pliant {

/// The vectors along the edges in the bending energy.
enum class EdgeVectors {
  unit,  ///< directions l̂
  full   ///< l/l0, which are those where edges have their rest length
};

/// U = Σ_i k_b/(2 Nv) |(l̂_i − l̂_{i+1})/l0|², l̂ the unit edge vectors. Smooth while all edges have a length.
/// With c = k_b/(2 Nv l0²) and û, ŵ the two directions U_i = 2c (1 − û·ŵ). With full vectors U_i = c |u − w|²/l0²,
/// which is quadratic. Elements: corners.
struct Bending {
  Real k_b;
  EdgeVectors edges = EdgeVectors::unit;

  static constexpr Elements elements = Elements::corners;
  static std::string_view name() { return "bending"; }
  void read(ParameterReader& p) {
    k_b = p.number({.name = "k_b",
                    .symbol = "K_b",
                    .unit = {1, 3, 0},
                    .help = "bending stiffness K_b",
                    .value = 0.1,
                    .alias = "kb",
                    .role = Role::bending});
    edges = p.choice({.name = "bending_edges",
                      .help = "bending from unit edge vectors [H 8], or from edge vectors / rest length",
                      .role = Role::bending_form},
                     named<EdgeVectors>({{"unit", EdgeVectors::unit}, {"full", EdgeVectors::full}}));
  }

  BendingLaw kernel_law() const { return {k_b, edges == EdgeVectors::full}; }
  bool enabled(const StateView<2>&) const { return k_b > 0; }
  static Index particle(const StateView<2>& s, Index i) { return s.topology.particle[i]; }

  Real energy(const StateView<2>& s, Index i) const {
    const Corner k = corner(s, i);
    return k.c * (k.u - k.w).squaredNorm();
  }

  template <class G>
  void add_gradient(const StateView<2>& s, Index i, G& grad) const {
    const Corner k = corner(s, i);
    if (edges == EdgeVectors::full) {
      const Vec<2> g = 2 * k.c * (k.u - k.w);  // gradient with respect to u; opposite for w
      grad.add(i, -g);
      grad.add(k.middle, Vec<2>(2 * g));
      grad.add(k.last, -g);
      return;
    }
    const Real cosine = k.u.dot(k.w);
    const Vec<2> gu = 2 * k.c * k.inverse_u * (cosine * k.u - k.w), gw = 2 * k.c * k.inverse_w * (cosine * k.w - k.u);
    grad.add(i, -gu);
    grad.add(k.middle, Vec<2>(gu - gw));
    grad.add(k.last, gw);
  }

  /// Without pre-stress the energy of unit vectors counts as a function of the angle between them; the energy of full
  /// vectors, which is quadratic, has no pre-stress.
  void add_hessian(const StateView<2>& s, Index i, BlockSink<2>& h, PreStress pre_stress = PreStress::kept) const {
    const Corner k = corner(s, i);
    Mat<2> uu, ww, uw;
    if (edges == EdgeVectors::full) {
      uu = ww = 2 * k.c * Mat<2>::Identity();
      uw = -uu;
    } else if (pre_stress == PreStress::dropped) {
      const Real curvature = 2 * k.c * k.u.dot(k.w);
      const Vec<2> du = k.inverse_u * Vec<2>(k.u[1], -k.u[0]), dw = k.inverse_w * Vec<2>(-k.w[1], k.w[0]);
      uu = curvature * du * du.transpose();
      ww = curvature * dw * dw.transpose();
      uw = curvature * du * dw.transpose();
    } else {
      uu = 2 * k.c * square(k.inverse_u) * same_edge(k.u, k.w);
      ww = 2 * k.c * square(k.inverse_w) * same_edge(k.w, k.u);
      uw = -2 * k.c * k.inverse_u * k.inverse_w * (Mat<2>::Identity() - k.u * k.u.transpose()) *
           (Mat<2>::Identity() - k.w * k.w.transpose());
    }
    // ∂l_i = (−1, 1, 0), ∂l_{i+1} = (0, −1, 1) for the three vertices.
    const std::array<Index, 3> points{i, k.middle, k.last};
    const std::array<Real, 3> du{-1, 1, 0}, dw{0, -1, 1};
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b)
        h.add(points[a], points[b],
              du[a] * du[b] * uu + dw[a] * dw[b] * ww + du[a] * dw[b] * uw + dw[a] * du[b] * uw.transpose());
  }

  /// Zigzag of a straight chain at rest: ω² = 16 k_b/(Nv l0⁴ m). With unit vectors ω grows as 1/l when the edges shrink
  /// to the length l.
  Real max_rate(const Topology& topology) const {
    Real fastest = 0;
    for (Index m = 0; m < topology.particles(); ++m)
      fastest = std::max(
          fastest,
          16 * k_b / (topology.points_of(m) * square(square(topology.l0[m])) * topology.mass(topology.offset[m])));
    return std::sqrt(fastest);
  }

 private:
  struct Corner {
    Index middle, last;
    Vec<2> u, w;  ///< of length 1, or full
    Real inverse_u = 0, inverse_w = 0, c;
  };

  Corner corner(const StateView<2>& s, Index i) const {
    Corner k;
    k.middle = s.topology.next[i];
    k.last = s.topology.next[k.middle];
    const Vec<2> r = s.position(k.middle);
    k.u = r - s.position(i);
    k.w = s.position(k.last) - r;
    const Index m = s.topology.particle[i];
    k.c = k_b / (2 * s.topology.points_of(m) * square(s.topology.l0[m]));
    if (edges == EdgeVectors::full) {
      k.c /= square(s.topology.l0[m]);
      return k;
    }
    k.inverse_u = 1 / k.u.norm();
    k.inverse_w = 1 / k.w.norm();
    k.u *= k.inverse_u;
    k.w *= k.inverse_w;
    return k;
  }

  /// Second derivative of −û·ŵ with respect to u, times |u|².
  static Mat<2> same_edge(const Vec<2>& u, const Vec<2>& w) {
    const Real cosine = u.dot(w);
    return w * u.transpose() + u * w.transpose() + cosine * (Mat<2>::Identity() - 3 * u * u.transpose());
  }
};

}  // namespace pliant
