// What a term of the model is: an energy or a dissipation, written for one element; the loops are in model.h.
#pragma once

#include <concepts>
#include <string_view>
#include <type_traits>

#include <pliant/base/multiversion.h>
#include <pliant/base/types.h>
#include <pliant/geometry/rotation.h>
#include <pliant/geometry/walls.h>
#include <pliant/kernels/prefetch.h>
#include <pliant/model/contact_history.h>
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
  Real t = 0;              ///< time, for walls that move
  Prefetch prefetch = {};  ///< what is gone through, in each chunk, after its forces; says nothing of the configuration

  const Real* angles = nullptr;             ///< [points · rotations], where the model rotates
  const Real* spins = nullptr;              ///< [points · rotations]; may be null as v may
  const ContactHistory* history = nullptr;  ///< null: nothing is known of any contact

  Vec<D> position(Index i) const { return point<D>(x, i); }
  Vec<D> velocity(Index i) const { return point<D>(v, i); }
  /// In the plane how far the particle has turned; in space the integral of its spin, which is an orientation only
  /// while the axis stays the same.
  Rotation<D> angle(Index i) const { return rotation<D>(angles, i); }
  Rotation<D> spin(Index i) const { return rotation<D>(spins, i); }
  /// Of point i, with its rotation.
  Real kinetic_energy(Index i) const {
    const Real moving = topology.mass(i) / 2 * velocity(i).squaredNorm();
    if (spins == nullptr) return moving;
    if constexpr (D == 2)
      return moving + topology.inertia[topology.particle[i]] / 2 * square(spins[i]);
    else
      return moving + topology.inertia[topology.particle[i]] / 2 * point<3>(spins, i).squaredNorm();
  }
};

/// Adds Sign × (a vector for point i) to a global array [points · D]. Energy terms hand in gradients and get Sign = −1
/// when forces are assembled: the one place where a gradient becomes a force. OwnOnly: only to points of a range, for
/// elements across the border of a chunk.
template <int D, int Sign, bool OwnOnly = false>
struct Scatter {
  Real* out;
  Range own = {};
  Real* torques = nullptr;  ///< [own points · rotations], for terms that rotate
  template <class V>
  void add(Index i, const V& vector) const {
    if (OwnOnly && !own.contains(i)) return;
    if constexpr (Sign > 0)
      point<D>(out, i) += vector;
    else
      point<D>(out, i) -= vector;
  }
  /// The same of a torque, or of an energy's derivative by an angle.
  void add_torque(Index i, const Rotation<D>& t) const {
    if (OwnOnly && !own.contains(i)) return;
    add_rotation<D>(torques, i, Rotation<D>(Real(Sign) * t));
  }
};

/// Whether a term has torques, on particles of one point: `static constexpr bool rotates = true`.
template <class T>
inline constexpr bool has_torque = requires {
  requires T::rotates;
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

/// Second derivatives are asked of terms without torques alone. A model with torques or with contact history is
/// integrated by explicit methods.
///
/// An energy: U = Σ_e energy(s, e) over its elements. An element may read everything, but its gradient is not zero only
/// for the points it is made of, the stencil of its kind (elements.h). A model has the lists that its terms' kinds
/// need. A term over listed elements may also have
///   off()    whether its coefficients switch it off for good: it needs no list then
///   range()  how far beyond the contact distance it reaches
///   edges    whether its edges are wide (as without it) or bare, also where it is off
///   check(walls)  throws an InputError for walls that it is not defined for
///   force(s, e)   of the wall, or the lip, on its points: then the wall feels the opposite
template <class T, int D>
concept EnergyTerm = requires(const T term, const StateView<D>& s, Index e, Scatter<D, 1>& g, BlockSink<D>& h) {
  { term.name() } -> std::convertible_to<std::string_view>;
  { term.enabled(s) } -> std::same_as<bool>;  // false: switched off, costs nothing
  requires ElementsIn<T::elements, D>;
  { term.energy(s, e) } -> std::same_as<Real>;
  term.add_gradient(s, e, g);                           // ∂U_e/∂x
  { term.max_rate(s.topology) } -> std::same_as<Real>;  // upper estimate of the fastest frequency ω, in 1/t0
  requires has_torque<T> || requires {
    term.add_hessian(s, e, h);  // ∂²U_e/∂x²
  };
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
  { term.max_damping(s.topology) } -> std::same_as<Real>;  // upper estimate of the fastest decay rate, in 1/t0
  requires has_torque<T> || requires { term.add_dforce_dv(s, e, h); };
};

/// A force between touching pairs, or with walls, that depends on what happened since they touched: on
/// T::history numbers that are kept for each contact (ContactHistory). Within a step a force follows from the numbers
/// at its begin, `past`, and from the state, as at every stage of a method; it has none yet of a contact that began
/// within the step. At the end of an accepted step the numbers are advanced. A force should not change by that: what
/// the integrator carries to the next step was made before. So a tangential spring keeps where it is relaxed, as a
/// place on the surfaces; forces follow from how far these have moved from there, by positions and angles, up to the
/// limit of friction, and what is advanced is the place, where it has slid. A pair is listed in any order, on both
/// sides of a border: numbers must not depend on it (in_order). Positions jump by box lengths when particles are put
/// back into a periodic box; positions of a listed pair relative to each other do not. Parts of one surface of the
/// walls have one contact with a point, which the part that carries it (Walls::carries) acts for and advances; the
/// others do not touch. A term can say by what energy becomes heat, `static constexpr std::array<std::string_view, N>
/// losses`: then advance() gets N sums as well, to which it adds the heat of the step. Where
/// off() says that its coefficients switch a term off for good, nothing is kept.
///
/// Most of what a force needs of a contact follows from positions and angles alone. A term that tells this from the
/// rest has a record of it, `Touch`, of trivial copies, and
///   find(s, e, past, touch)   fills it; false where the element does not touch. It must not read velocities.
/// It may also have
///   near(s, e)   false only where the element does not touch, by positions; costs less than find().
/// Its other functions take the record: energy(s, touch), power(s, touch), add_force(s, touch, f),
/// advance(s, touch, h, known, numbers, heat), which returns nothing, and force(s, touch). Where a step ends at the
/// positions of the last forces, as those of velocity Verlet do, contacts are not found again to be advanced.
template <class T, int D>
concept FindingTerm = requires(const T term, const StateView<D>& s, Index e, Real h, bool known,
                               std::span<const Real> past, std::span<Real> numbers, std::span<Real> heat,
                               typename T::Touch& c, Scatter<D, 1>& f) {
  requires std::is_trivially_copyable_v<typename T::Touch>;
  { term.find(s, e, past, c) } -> std::same_as<bool>;
  { term.energy(s, c) } -> std::same_as<Real>;
  { term.power(s, c) } -> std::same_as<Real>;
  term.add_force(s, c, f);
  term.advance(s, c, h, known, numbers, heat);
};

/// One that takes a range of elements together, where there is a history: for a loop over several elements at a time.
/// Beside the forces it writes what is known of the elements if the step ends there (ContactTable::Ahead), and what
/// those that count in the chunk lose (ContactTable::lost): numbers of which add_heat(lost, h, heat) makes the heat of
/// a step. Where a step ends at the positions of the last forces this is all; velocities are then those that the forces
/// were for. It can keep numbers of each element that stay the same as long as the list does, `static constexpr int
/// constants` of them.
template <class T, int D>
concept RangeTerm = FindingTerm<T, D> &&
    requires(const T term, const StateView<D>& s, Range range, Real h, const ContactTable& table, const Real* lost,
             std::span<Real> heat, const Scatter<D, 1>& f) {
  term.add_forces(s, range, table, f);
  term.add_heat(lost, h, heat);
};

template <class T, int D>
concept HistoryTerm = requires(const T term, const StateView<D>& s, Index e, Real h, bool known,
                               std::span<const Real> past, std::span<Real> numbers, std::span<Real> heat,
                               Scatter<D, 1>& f) {
  { term.name() } -> std::convertible_to<std::string_view>;  // of no other term with history
  { term.enabled(s) } -> std::same_as<bool>;
  { T::elements } -> std::convertible_to<Elements>;
  { T::history } -> std::convertible_to<int>;
  requires FindingTerm<T, D> || requires {
    term.add_force(s, e, past, f);
    { term.energy(s, e, past) } -> std::same_as<Real>;  // that is stored
    { term.power(s, e, past) } -> std::same_as<Real>;   // dissipated at present, ≥ 0
    requires requires {
      { term.advance(s, e, h, known, numbers) } -> std::same_as<bool>;  // over a step of length h; see ContactTable
    } || requires {
      { term.advance(s, e, h, known, numbers, heat) } -> std::same_as<bool>;
    };
  };
  { term.max_rate(s.topology) } -> std::same_as<Real>;
  { term.max_damping(s.topology) } -> std::same_as<Real>;
};

/// How many losses a term names.
template <class T>
constexpr std::size_t losses_of() {
  if constexpr (requires { T::losses; })
    return T::losses.size();
  else
    return 0;
}

/// visit(e, touch) for the elements of a range that touch, which find(e, past, touch) says and fills, and others(e) for
/// those that do not, but for some that are too far apart. What is found is kept where there is a history, and stays
/// where it is.
template <int D, FindingTerm<D> T, class Find, class Visit, class Others>
PLIANT_INLINE void for_each_found(const T& term, const StateView<D>& s, Range range, Find&& find, Visit&& visit,
                                  Others&& others) {
  using Touch = typename T::Touch;
  if (s.history == nullptr) {
    Touch c;
    for (Index e = range.first; e < range.last; ++e) find(e, std::span<const Real>(), c) ? visit(e, c) : others(e);
    return;
  }
  const ContactTable& table = s.history->of(term.name());
  const auto past = table.template pasts<T::history>();
  auto found = table.template record<Touch>(range);
  // First which elements, without a branch that depends on them: most of a list does not touch.
  Index* const which = found.room();
  Index count = 0;
  for (Index e = range.first; e < range.last; ++e) {
    which[count] = e;
    if constexpr (requires { term.near(s, e); })
      count += term.near(s, e) | past.known(e) ? 1 : 0;
    else
      ++count;
  }
  for (Index k = 0; k < count; ++k) {
    const Index e = which[k];
    const Real* const numbers = past(e);
    const std::size_t known = numbers != nullptr ? T::history : 0;
    Touch& c = found.next();
    if (find(e, std::span<const Real>(numbers, known), c)) {
      found.touches(e);
      visit(e, c);
    } else {
      if (known > 0) found.parted(e);
      others(e);
    }
  }
  found.end();
}
/// visit(touch) for those that touch.
template <int D, FindingTerm<D> T, class Visit>
PLIANT_INLINE void for_each_touch(const T& term, const StateView<D>& s, Range range, Visit&& visit) {
  for_each_found(
      term, s, range,
      [&](Index e, std::span<const Real> past, auto& c) PLIANT_INLINE_LAMBDA { return term.find(s, e, past, c); },
      [&](Index, const auto& c) PLIANT_INLINE_LAMBDA { visit(c); }, [](Index) {});
}

/// A pair of points, that of the particle with the lower id first.
inline Pair in_order(const Topology& topology, const Pair& pair) {
  const auto id = [&](Index i) { return topology.id[topology.particle[i]]; };
  return id(pair.first) < id(pair.second) ? pair : Pair{pair.second, pair.first};
}

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
