// Terms of a model: a term is an energy or a dissipation, written for one element; the loops are in term_loops.h.
#pragma once

#include <algorithm>
#include <array>
#include <concepts>
#include <span>
#include <string_view>

#include <pliant/base/multiversion.h>
#include <pliant/base/types.h>
#include <pliant/geometry/box.h>
#include <pliant/geometry/rotation.h>
#include <pliant/geometry/walls.h>
#include <pliant/kernels/prefetch.h>
#include <pliant/model/contact_history.h>
#include <pliant/model/neighbours.h>
#include <pliant/model/topology.h>

namespace pliant {

/// The configuration that terms read. Nothing here is owned, copied or written. Force evaluations of an integrator
/// write contact history to a HistoryWorkspace, which they get next to the view.
template <int D>
struct StateView {
  const Real* x;  ///< positions [points · D]
  const Real* v;  ///< velocities [points · D]; may be null if only energies are needed
  const Topology& topology;
  const Neighbours<D>& neighbours;
  const Walls<D>& walls;
  Real t = 0;              ///< time, for walls that move
  Prefetch prefetch = {};  ///< arrays read after the forces of each chunk; not part of the configuration

  const Real* angles = nullptr;             ///< [points · rotations], where the model rotates
  const Real* spins = nullptr;              ///< [points · rotations]; may be null as v may
  const ContactHistory* history = nullptr;  ///< the current one; null: no contact has a history
  const Real* turns = nullptr;  ///< in space, with a history: change of the angles since the last accepted step

  ShearFlow<D> flow = {};  ///< of the box, and of the fluid around the particles

  /// If true, interactions of a particle with a ghost add forces to the ghost, too. The flag needs one chunk, because
  /// threads of several chunks would write to the same ghost.
  bool ghosts_feel = false;

  /// The points that receive forces from interactions across the border of a chunk: all points, ghosts included, with
  /// ghosts_feel, else the points of the chunk.
  Range pushed(Index chunk) const { return ghosts_feel ? Range{0, topology.points()} : neighbours.points(chunk); }
  Vec<D> position(Index i) const { return point<D>(x, i); }
  Vec<D> velocity(Index i) const { return point<D>(v, i); }
  /// In the plane the rotation angle of the particle; in space the integral of its spin, which is an orientation only
  /// if the axis is constant.
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

/// Of the own points, with their rotations.
template <int D>
Real kinetic_energy(const StateView<D>& s);

/// The point at which an element across the border of a chunk counts, in the chunk that has it: the first one of the
/// particle that Topology::counts_for names.
template <Elements E, int D>
Index counts_at(const StateView<D>& s, Index e) {
  const Pair pair = ElementKind<E>::points_of_both((s.neighbours.*ElementKind<E>::list)[e]);
  const Topology& topology = s.topology;
  return topology.offset[topology.counts_for(topology.particle[pair.first], topology.particle[pair.second])];
}

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
  /// Adds a torque, or the derivative of an energy with respect to an angle.
  void add_torque(Index i, const Rotation<D>& t) const {
    if (OwnOnly && !own.contains(i)) return;
    add_rotation<D>(torques, i, Rotation<D>(Real(Sign) * t));
  }
  /// Whether the element counts in this range.
  template <Elements E>
  bool counts(const StateView<D>& s, Index e) const {
    if constexpr (OwnOnly) return own.contains(counts_at<E>(s, e));
    return true;
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

/// Second derivatives V''(q) ∇q ∇qᵀ + V'(q) ∇²q of an energy V of a length, an angle or an area q: both parts, or
/// without the second part (the pre-stress), as if each element were at rest.
enum class PreStress { kept, dropped };

/// Factor of the second part.
inline Real slope_factor(PreStress pre_stress) { return pre_stress == PreStress::kept ? 1 : 0; }

/// A touching pair, as the output and the statistics see it.
template <int D>
struct Contact {
  Index first, second;  ///< particles
  Vec<D> position;      ///< where they touch
  Vec<D> normal;        ///< unit, towards the first
  Real overlap;         ///< 1 − d/δ_mn, dimensionless
  Real reach;           ///< δ_mn: the overlap in σ_avg is overlap · reach
  Vec<D> force;         ///< elastic, on the first

  // Set by the loop over the elements of the term.
  Elements elements;  ///< kind of the term's elements
  Index element;      ///< in the list of this kind
  Index point;        ///< point of the first particle (ElementKind::points_of_both)
};

/// The force between two particles by one element of a term.
template <int D>
struct PairForce {
  Elements elements;
  Index element;  ///< in the list of this kind
  bool elastic;   ///< the term is an energy; else friction or damping
  Pair points;    ///< a point of each particle (ElementKind::points_of_both)
  Vec<D> force;   ///< on all points of the first particle together
};

/// Upper bounds of how fast forces change the motion.
struct Rates {
  Real stiffness = 0;  ///< ω², the largest eigenvalue of ∂²U/∂x² over the masses, in 1/t0²
  Real damping = 0;    ///< γ, the largest eigenvalue of −∂F/∂v over the masses, in 1/t0
  Rates& operator+=(const Rates& other) {
    stiffness += other.stiffness, damping += other.damping;
    return *this;
  }
  Rates& raise_to(const Rates& other) {
    stiffness = std::max(stiffness, other.stiffness), damping = std::max(damping, other.damping);
    return *this;
  }
};

/// Rates of positions and of angles. Eigenvalues of sums are at most the sums of eigenvalues: rates of terms add.
struct MotionRates {
  Rates translation, rotation;
  MotionRates& operator+=(const MotionRates& other) {
    translation += other.translation, rotation += other.rotation;
    return *this;
  }
  MotionRates& raise_to(const MotionRates& other) {
    translation.raise_to(other.translation), rotation.raise_to(other.rotation);
    return *this;
  }
};

/// ω² of a point with all contacts that fit around it, over ω² of one contact (max_rate). A contact k (n·(u_i − u_j))²
/// is at most 2k ((n·u_i)² + (n·u_j)²), so two like points i, j give a point 2k Σ n nᵀ/m, the sum over its contacts:
/// six in the plane have Σ n nᵀ = 3, twelve in space 4, and the triangular and the fcc lattice have modes that reach
/// it. Two walls press a point from both sides, and so do two lips. Two outlines that press each other face to face are
/// not stiffer than two vertices that meet head on; at a corner between three outlines the stiffness is 1.5 times as
/// large.
template <int D, Elements E>
inline constexpr Real crowding = E == Elements::point_pairs                    ? (D == 2 ? 3 : 4)
                                 : E == Elements::vertex_edges                 ? 1.5
                                 : E == Elements::walls || E == Elements::lips ? 2
                                                                               : 1;

/// Only terms without torques have second derivatives. A model with torques or with contact history is integrated by
/// explicit methods.
///
/// An energy: U = Σ_e energy(s, e) over its elements. An element may read all data, but its gradient must vanish except
/// for its points, the stencil of its kind (elements.h). A model has the lists that its terms' kinds need. A term over
/// listed elements may also have
///   off()    whether its coefficients switch it off for good, so that no list is needed
///   range()  how far beyond the contact distance it reaches
///   edges    whether its edges are wide (as without it) or bare, also where it is off
///   check(walls)  throws an InputError for walls that it is not defined for
///   force(s, e)   of the wall, or the lip, on its points: then the wall feels the opposite
///   add_hessian(s, e, h, pre_stress)  without pre-stress too
///   crowded(topology)   MotionRates with as many contacts as fit around a point, where that is not crowding times
///                       max_rate², or where angles count
template <class T, int D>
concept EnergyTerm = requires(const T term, const StateView<D>& s, Index e, Scatter<D, 1>& g, BlockSink<D>& h) {
  { term.name() } -> std::convertible_to<std::string_view>;
  { term.enabled(s) } -> std::same_as<bool>;  // false: switched off, costs nothing
  requires ElementsIn<T::elements, D>;
  { term.energy(s, e) } -> std::same_as<Real>;
  term.add_gradient(s, e, g);                           // ∂U_e/∂x
  { term.max_rate(s.topology) } -> std::same_as<Real>;  // ω of one element, at most, in 1/t0
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

/// A way in which a term turns energy into heat. Losses are counted per time, or else per step.
struct Loss {
  std::string_view name;
  bool per_time;
};

/// Number of losses that a term names, `static constexpr std::array<Loss, N> losses`.
template <class T>
constexpr std::size_t losses_of() {
  if constexpr (requires { T::losses; })
    return T::losses.size();
  else
    return 0;
}

/// Whether a term takes a range of elements together: see RangeTerm.
template <class T, int D>
concept TakesRanges = requires(const T term, const StateView<D>& s, Range range, const ContactTable& table,
                               ContactWorkspace& workspace, const Scatter<D, 1>& f) {
  term.add_forces(s, range, table, workspace, f);
};

/// A force between touching pairs, or with walls, that depends on the history of the contact: on T::history numbers
/// that are stored for each contact (ContactHistory). Within a step, a force is a function of the history at the begin
/// of the step, `current`, and of the state, at every stage of a method. A contact that began within the step has no
/// history yet. A force evaluation with a workspace also writes the next history, which is valid if the step ends
/// there; an accepted step makes the next history of the last such evaluation the current one. This must not change the
/// force, because the integrator carries forces to the next step that were computed before. Therefore a tangential
/// spring stores its relaxed state as a place on the surfaces. Forces follow from the displacement of the surfaces from
/// this place, given by positions and angles, up to the limit of friction; sliding moves the place. A pair may be
/// listed in either order, on both sides of a border: the history must not depend on the order (in_order). Positions
/// jump by box lengths when a periodic box wraps particles; relative positions of a listed pair do not. The parts of
/// one surface of the walls have one contact with a point. The part that carries the contact (Walls::carries) computes
/// it; the other parts do not touch. A term that its coefficients switch off for good (off()) has no history.
///
/// Most data of a contact depend on positions and angles only: a term has a record of these data, `Touch`, and
///   find(s, e, current, touch)   fills it; false where the element does not touch. It must not read velocities.
///                                `current` is empty where nothing was known
///   near(s, e)        may be there: false only where the element does not touch; costs less than find()
///   force(s, touch)   may be there: of the wall
///   keep(s, touch, current, next, lost)   writes the next history [history], and adds the losses of the contact
///   [losses]
template <class T, int D>
concept HistoryTerm = requires(const T term, const StateView<D>& s, Index e, std::span<const Real> current,
                               typename T::Touch& c, Scatter<D, 1>& f) {
  { term.name() } -> std::convertible_to<std::string_view>;  // unique among terms with history
  { term.enabled(s) } -> std::same_as<bool>;
  { T::elements } -> std::convertible_to<Elements>;
  { T::history } -> std::convertible_to<int>;
  { term.find(s, e, current, c) } -> std::same_as<bool>;
  { term.energy(s, c) } -> std::same_as<Real>;  // stored energy
  { term.power(s, c) } -> std::same_as<Real>;   // dissipated, ≥ 0
  term.add_force(s, c, f);
  { term.max_rate(s.topology) } -> std::same_as<Real>;
  { term.max_damping(s.topology) } -> std::same_as<Real>;
  requires TakesRanges<T, D> || requires(Real * next, Real * lost) { term.keep(s, c, current, next, lost); };
};

/// A term with history that computes a range of elements together, by a vectorised loop. In addition to the forces it
/// writes the next history (ContactWorkspace::Next), and the losses of the elements that count in the chunk
/// (ContactWorkspace::losses). It may store `static constexpr int constants` numbers per element, which are valid until
/// the list changes.
template <class T, int D>
concept RangeTerm = HistoryTerm<T, D> && TakesRanges<T, D>;

/// Current history of the elements of a term, of which nothing may be known.
class CurrentHistory {
 public:
  template <int D, class T>
  CurrentHistory(const StateView<D>& s, const T& term)
      : table_(s.history != nullptr ? &s.history->of(term.name()) : nullptr) {}
  std::span<const Real> operator()(Index e) const {
    return table_ != nullptr ? table_->current(e) : std::span<const Real>();
  }

 private:
  const ContactTable* table_;
};

/// The term's find(), compiled once for all loops that no step needs.
template <int D, HistoryTerm<D> T>
[[gnu::noinline]] bool find_touch(const T& term, const StateView<D>& s, Index e, std::span<const Real> current,
                                  typename T::Touch& c) {
  return term.find(s, e, current, c);
}

/// Calls visit(touch) for the elements of a range that touch, and others(e) for elements that do not, except some that
/// are too far apart. With a workspace this is an evaluation of forces, which visit() adds to `force`: the call writes
/// the next history and the losses. For a RangeTerm, add_forces() writes them instead.
template <int D, HistoryTerm<D> T, int Sign, bool OwnOnly, class Visit, class Others>
PLIANT_INLINE void for_each_touch(const T& term, const StateView<D>& s, HistoryWorkspace* workspace, Range range,
                                  const Scatter<D, Sign, OwnOnly>& force, Visit&& visit, Others&& others) {
  typename T::Touch c;
  if constexpr (!RangeTerm<T, D>)
    if (workspace != nullptr && range.size() > 0) {
      const ContactTable& table = s.history->of(term.name());
      ContactWorkspace& own = workspace->of(term.name());
      const ContactTable::Current<T::history> current(table);
      const ContactWorkspace::Next<T::history, T::elements == Elements::walls> next(table, own);
      next.clear(range);
      // First which elements, without a branch that depends on them: most of a list does not touch.
      Index* const which = own.indices(range);
      Index count = 0;
      for (Index e = range.first; e < range.last; ++e) {
        which[count] = e;
        if constexpr (requires { term.near(s, e); })
          count += term.near(s, e) ? 1 : 0;
        else
          ++count;
      }
      std::array<Real, losses_of<T>()> lost{}, elsewhere{};
      for (Index k = 0; k < count; ++k) {
        const Index e = which[k];
        const Real* const numbers = current(e);
        const std::span<const Real> known(numbers, numbers != nullptr ? T::history : 0);
        if (!term.find(s, e, known, c)) {
          others(e);
          continue;
        }
        visit(c);
        term.keep(s, c, known, next.set(e), force.template counts<T::elements>(s, e) ? lost.data() : elsewhere.data());
      }
      std::ranges::copy(lost, own.losses(range));
      return;
    }
  const CurrentHistory current(s, term);
  for (Index e = range.first; e < range.last; ++e)
    if (find_touch(term, s, e, current(e), c))
      visit(c);
    else
      others(e);
}
template <int D, HistoryTerm<D> T, int Sign, bool OwnOnly, class Visit>
PLIANT_INLINE void for_each_touch(const T& term, const StateView<D>& s, HistoryWorkspace* workspace, Range range,
                                  const Scatter<D, Sign, OwnOnly>& force, Visit&& visit) {
  for_each_touch(term, s, workspace, range, force, visit, [](Index) {});
}

/// A pair of points; the point of the particle with the lower id comes first.
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
