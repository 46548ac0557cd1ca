// Weight: U = −Σ_i m_i g·r_i [H 4]. For a polygon this is −M g times the mean of its vertices, which have equal masses.
#pragma once

#include <pliant/model/term.h>

namespace pliant {

/// Elements: points. Linear in r: no Hessian.
template <int D>
struct Gravity {
  Vec<D> g = Vec<D>::Zero();  ///< acceleration in units of g

  static constexpr Elements elements = Elements::points;
  static std::string_view name() { return "gravity"; }
  bool enabled(const StateView<D>&) const { return !g.isZero(0); }
  Real energy(const StateView<D>& s, Index i) const { return -s.topology.mass(i) * g.dot(s.position(i)); }
  template <class G>
  void add_gradient(const StateView<D>& s, Index i, G& grad) const {
    grad.add(i, -s.topology.mass(i) * g);
  }
  void add_hessian(const StateView<D>&, Index, BlockSink<D>&) const {}
  Real max_rate(const Topology&) const { return 0; }
};

}  // namespace pliant
