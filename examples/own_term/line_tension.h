// A user-defined energy term: line tension, which makes a polygon round.
#pragma once

#include <algorithm>
#include <cmath>

#include <pliant/geometry/distance.h>
#include <pliant/model/parameter.h>
#include <pliant/model/term.h>

/// U = γ Σ_i l_i, l_i the length of edge i; γ in ρ g σ_avg². Its gradient pulls both ends of an edge together with the
/// constant force γ. Unlike the perimeter term it has no rest length: with the area term it makes circles, inside which
/// the pressure is γ/R (Laplace). Smooth while l_i > 0. Elements: edges.
struct LineTension {
  using Real = pliant::Real;
  using Index = pliant::Index;
  using Vec = pliant::Vec<2>;
  using View = pliant::StateView<2>;

  Real gamma;

  static constexpr pliant::Elements elements = pliant::Elements::edges;
  static std::string_view name() { return "line_tension"; }
  /// Declares the option -tension.
  void read(pliant::ParameterReader& p) {
    gamma = p.number({.name = "tension",
                      .symbol = "\\gamma",
                      .unit = pliant::dimension::force,
                      .help = "line tension gamma",
                      .value = 20});
  }
  bool enabled(const View&) const { return gamma > 0; }
  static Index particle(const View& s, Index i) { return s.topology.particle[i]; }

  Real energy(const View& s, Index i) const { return gamma * edge(s, i).norm(); }

  template <class G>
  void add_gradient(const View& s, Index i, G& grad) const {
    const Vec pull = gamma * edge(s, i).normalized();
    grad.add(s.topology.next[i], pull);
    grad.add(i, -pull);
  }

  void add_hessian(const View& s, Index i, pliant::BlockSink<2>& h) const {
    const Index j = s.topology.next[i];
    const Vec l = edge(s, i);
    const Real length = l.norm();
    const pliant::Mat<2> block = gamma * pliant::distance_curvature<2>(l / length, length);
    h.add(i, i, block);
    h.add(j, j, block);
    h.add(i, j, -block);
    h.add(j, i, -block);
  }

  /// Zigzag across a straight chain of edges: ω² = 4 γ/(l0 m).
  Real max_rate(const pliant::Topology& topology) const {
    Real fastest = 0;
    for (Index m = 0; m < topology.particles(); ++m)
      fastest = std::max(fastest, 4 * gamma / (topology.l0[m] * topology.mass(topology.offset[m])));
    return std::sqrt(fastest);
  }

 private:
  static Vec edge(const View& s, Index i) { return s.position(s.topology.next[i]) - s.position(i); }
};
