// What a term of the model is: an energy or a dissipation, written for one element; the loops are in model.h.
#pragma once

#include <concepts>
#include <string_view>

#include <pliant/base/types.h>
#include <pliant/geometry/walls.h>
#include <pliant/kernels/prefetch.h>
#include <pliant/model/neighbours.h>
#include <pliant/model/topology.h>

namespace pliant {

/// What a term may look at. Nothing here is owned or copied.
template <int D>
struct StateView {
  const Real* x;  ///< positions [points · D]
  const Real* v;  ///< velocities [points · D]; may be null where only energies are asked for
  const Topology& topology;
  const Neighbours<D>& neighbours;
  const Walls<D>& walls;
  Real t = 0;              ///< time, for solids that move
  Prefetch prefetch = {};  ///< what is gone through, in each chunk, after its forces; says nothing of the configuration

  Vec<D> position(Index i) const { return point<D>(x, i); }
  Vec<D> velocity(Index i) const { return point<D>(v, i); }
};

/// Adds Sign × (a vector for point i) to a global array [points · D]. Energy terms hand in gradients and get Sign = −1
/// when forces are assembled: the one place where a gradient becomes a force. OwnOnly: only to points of a range, for
/// elements across the border of a chunk.
template <int D, int Sign, bool OwnOnly = false>
struct Scatter {
  Real* out;
  Range own = {};
  template <class V>
  void add(Index i, const V& vector) const {
    if (OwnOnly && !own.contains(i)) return;
    if constexpr (Sign > 0)
      point<D>(out, i) += vector;
    else
      point<D>(out, i) -= vector;
  }
};

/// Receives D × D blocks of a Hessian (or of ∂F/∂v) for points i and j.
template <int D>
struct BlockSink {
  virtual ~BlockSink() = default;
  virtual void add(Index i, Index j, const Mat<D>& block) = 0;
};

/// A touching pair, as the output and the statistics see it.
template <int D>
struct Contact {
  Index first, second;  ///< particles
  Vec<D> position;      ///< where they touch
  Vec<D> normal;        ///< unit, towards the first
  Real overlap;         ///< 1 − d/δ_mn, dimensionless
  Real reach;           ///< δ_mn: the overlap in σ_avg is overlap · reach
  Vec<D> force;         ///< elastic, on the first
};

/// An energy: U = Σ_e energy(s, e) over its elements. An element may read everything, but its gradient is not zero only
/// for the points it is made of, the stencil of its kind (elements.h). A model has the lists that its terms' kinds
/// need. A term over listed elements may also have
///   off()    whether its coefficients switch it off for good: it needs no list then
///   range()  how far beyond the contact distance it reaches
///   edges    whether its edges are wide (as without it) or bare, also where it is off
template <class T, int D>
concept EnergyTerm = requires(const T term, const StateView<D>& s, Index e, Scatter<D, 1>& g, BlockSink<D>& h) {
  { term.name() } -> std::convertible_to<std::string_view>;
  { term.enabled(s) } -> std::same_as<bool>;  // false: switched off, costs nothing
  requires ElementsIn<T::elements, D>;
  { term.energy(s, e) } -> std::same_as<Real>;
  term.add_gradient(s, e, g);                           // ∂U_e/∂x
  term.add_hessian(s, e, h);                            // ∂²U_e/∂x²
  { term.max_rate(s.topology) } -> std::same_as<Real>;  // upper estimate of the fastest frequency ω, in 1/t0
};

/// A dissipation: forces on the points of the stencil that depend on their velocities and never feed energy in. A term
/// whose force also changes smoothly with x has add_dforce_dx(s, e, h) too.
template <class T, int D>
concept DissipationTerm = requires(const T term, const StateView<D>& s, Index e, Scatter<D, 1>& f, BlockSink<D>& h) {
  { term.name() } -> std::convertible_to<std::string_view>;
  { term.enabled(s) } -> std::same_as<bool>;
  requires ElementsIn<T::elements, D>;
  { term.power(s, e) } -> std::same_as<Real>;  // dissipated, ≥ 0
  term.add_force(s, e, f);
  term.add_dforce_dv(s, e, h);
  { term.max_damping(s.topology) } -> std::same_as<Real>;  // upper estimate of the fastest decay rate, in 1/t0
};

/// A term that makes contacts which the output shows.
template <class T, int D>
concept ContactTerm = EnergyTerm<T, D> && requires(const T term, const StateView<D>& s, Index e, Contact<D>& c) {
  { term.contact(s, e, c) } -> std::same_as<bool>;  // false: not touching
};

/// Smallest of `value(i)` over the points of a topology.
template <class Value>
Real smallest_over_points(const Topology& topology, Value&& value) {
  Real least = std::numeric_limits<Real>::infinity();
  for (Index i = 0; i < topology.points(); ++i) least = std::min(least, static_cast<Real>(value(i)));
  return least;
}

}  // namespace pliant
