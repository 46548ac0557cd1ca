// Energies of pairs of droplets that depend on their distance alone; the laws are in separate headers.
#pragma once

#include <pliant/base/cure.h>
#include <pliant/base/errors.h>
#include <pliant/geometry/overlap.h>
#include <pliant/model/parameter.h>
#include <pliant/model/term.h>

namespace pliant {

/// U = Σ_pairs Law(r; R_i, R_j), r the distance of the centres, R half the contact diameters. A law has a name, a range
/// beyond R_i + R_j, its value with two derivatives, and max_rate. Elements: neighbour list of points. Errors:
/// NumericalError where one droplet has swallowed another, r ≤ |R_i − R_j|.
template <int D, class Law>
struct DropletPairs {
  Law law;

  static constexpr Elements elements = Elements::point_pairs;
  static std::string_view name() { return Law::name; }
  void read(ParameterReader& p) { law.read(p); }
  bool enabled(const StateView<D>&) const { return true; }
  Real range() const { return law.range(); }

  Real energy(const StateView<D>& s, Index e) const {
    Real r;
    Vec<D> n;
    return at(s, e, r, n).value;
  }

  template <class G>
  void add_gradient(const StateView<D>& s, Index e, G& grad) const {
    Real r;
    Vec<D> n;
    const Vec<D> pull = at(s, e, r, n).slope * n;
    grad.add(s.neighbours.point_pairs[e].first, pull);
    grad.add(s.neighbours.point_pairs[e].second, Vec<D>(-pull));
  }

  void add_hessian(const StateView<D>& s, Index e, BlockSink<D>& h) const {
    const auto [i, j] = s.neighbours.point_pairs[e];
    Real r;
    Vec<D> n;
    const Radial u = at(s, e, r, n);
    const Mat<D> block = u.curvature * n * n.transpose() + u.slope * distance_curvature<D>(n, r);
    h.add(i, i, block);
    h.add(j, j, block);
    h.add(i, j, -block);
    h.add(j, i, -block);
  }

  Real max_rate(const Topology& topology) const { return law.max_rate(topology); }

 protected:
  /// With the distance r and the unit vector n from the second to the first; zero, and no n, out of range.
  Radial at(const StateView<D>& s, Index e, Real& r, Vec<D>& n) const {
    const auto [i, j] = s.neighbours.point_pairs[e];
    const Real a = s.topology.diameter[i] / 2, b = s.topology.diameter[j] / 2;
    n = s.position(i) - s.position(j);
    r = n.norm();
    if (r >= a + b + law.range()) return {};
    if (!(r > std::abs(a - b)))
      throw NumericalError(
          "droplets {} and {} have run into each other: their centres are {:.3g} apart at t = {}; use {}",
          s.topology.id[s.topology.particle[i]], s.topology.id[s.topology.particle[j]], r, s.t,
          cures({Cure::shorter_step, Cure::smaller_load, Cure::less_overlap}));
    n /= r;
    return law.at(r, a, b);
  }
};

}  // namespace pliant
