// The model: a compile-time list of terms, and the loops over their elements.
#pragma once

#include <omp.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <numeric>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <tuple>
#include <vector>

#include <pliant/base/errors.h>
#include <pliant/kernels/finite.h>
#include <pliant/kernels/points.h>
#include <pliant/model/term_loops.h>

namespace pliant {

/// The longest steps of velocity Verlet, in t0.
struct CriticalStep {
  Real elastic = std::numeric_limits<Real>::infinity();  ///< 2/ω of the stiffest single contact, or other element
  Real damping = std::numeric_limits<Real>::infinity();  ///< 1/γ of the fastest damping of a single term
  MotionRates crowded = {};  ///< rates of all terms together, with as many contacts as fit around a point

  /// Limit for a single contact: standard steps are fractions of this limit.
  Real one_contact() const { return std::min(elastic, damping); }
  /// Part of limit() above which opening and closing contacts heat a flow (docs/reference/steps.md).
  static constexpr Real safe_part = 0.7;
  /// A standard step, shortened to the safe part of limit().
  Real standard(Real dt) const { return std::min(dt, safe_part * limit()); }

  /// The step above which a dense packing is unstable.
  Real limit() const { return std::min(limit(crowded.translation), limit(crowded.rotation)); }
  /// With predicted velocities (FixedStepVerlet) a mode of frequency ω and damping γ is stable while ω² h² + 4 γ h ≤ 4:
  /// there its factor of growth per step is −1, and so for symmetric matrices of stiffness and damping.
  static Real limit(const Rates& r) {
    const Real sum = r.damping + std::sqrt(r.damping * r.damping + r.stiffness);
    return sum > 0 ? 2 / sum : std::numeric_limits<Real>::infinity();
  }
};

/// A choice of terms: all; shape: the terms whose elements belong to one particle each, as the shape energy of
/// deformable particles; rest: all other terms.
enum class TermGroup { all, shape, rest };

/// The points that derivatives couple, in addition to each point with itself.
struct ElementCoupling {
  bool particles = false;                      ///< all points of a particle
  std::array<bool, element_kinds> stencils{};  ///< for each kind: the points of an element

  template <Elements E>
  void add(ElementKind<E>) {
    particles |= ElementKind<E>::couples == Couples::particle;
    stencils[static_cast<std::size_t>(E)] |= ElementKind<E>::couples == Couples::stencil;
  }
  template <Elements E>
  bool has(ElementKind<E>) const {
    return stencils[static_cast<std::size_t>(E)];
  }
};
/// Couplings of ∂F/∂x and of ∂F/∂v.
struct Couplings {
  ElementCoupling x, v;
};

/// Energies and forces of a configuration. One virtual call per evaluation, none per element. Arrays of forces have the
/// length of all points; only the owned points are written. If particles rotate, torques on the owned points follow the
/// forces on the owned points [points · (D + rotations)]. Sums are over the rank's share: elements inside its chunks,
/// and elements across borders that count for an owned particle (Topology::counts_for); over all ranks every element
/// counts once. Energies, powers, contacts and forces on walls count active particles only.
template <int D>
class ForceField {
 public:
  virtual ~ForceField() = default;

  /// The lists that the terms read. Errors: std::logic_error if terms need different edges.
  virtual NeighbourNeeds needs() const = 0;
  /// Errors: InputError for walls that a term is not defined for.
  virtual void check_walls(const Walls<D>& walls) const = 0;

  /// Total force, written to f [points · D].
  virtual void forces(const StateView<D>& s, Real* f) const = 0;
  /// Forces divided by the masses: 0 for inactive particles. Returns whether all are finite. workspace: gets the next
  /// contact history, for accept(); without it history is only read, as by all functions without this argument.
  virtual bool accelerations(const StateView<D>& s, Real* a, HistoryWorkspace* workspace = nullptr) const = 0;
  /// Accelerations that are not stored: done(chunk, a) gets the accelerations of the points of a chunk, numbered as in
  /// an array of all points, and is called by several threads at a time. `scratch` holds them and grows as needed.
  virtual bool accelerations(const StateView<D>& s, std::vector<Real>& scratch,
                             const std::function<void(Index, const Real*)>& done) const = 0;
  /// The accelerations by a part of the terms, written to a [points · D].
  virtual void group_accelerations(const StateView<D>& s, TermGroup group, Real* a) const = 0;
  /// ∂F/∂x and ∂F/∂v of a part of the terms: the rows of the rank's own points. Threads divide the rows: they call the
  /// sinks for different rows at the same time.
  virtual void derivatives(const StateView<D>& s, TermGroup group, BlockSink<D>& df_dx, BlockSink<D>& df_dv) const = 0;
  /// Places of the blocks of derivatives(): all elements of the terms, touching or not.
  virtual Couplings couplings(const StateView<D>& s, TermGroup group) const = 0;
  /// Total energy; if f is given, the forces of the energy terms alone are written to f.
  virtual Real energy(const StateView<D>& s, Real* f = nullptr) const = 0;
  /// Σ_elements Σ_i ∂U/∂r_i ⊗ r_i of each active energy term, in the order of the model's list, r_i the positions in
  /// the element (of images, where they belong to it). In a box that is periodic in all directions, without walls and
  /// gravity, the sum of the terms over the volume is the stress σ_ab = (1/V) ∂U/∂e_ab under r → (1 + e) r of all
  /// particles and the box: tension positive, pressure −tr σ/D. Errors: InputError for terms with contact history.
  virtual std::vector<TermVirial<D>> virials(const StateView<D>& s) const = 0;
  /// The energy of the elements that have a point of one of these particles, given by id.
  virtual Real energy_of(const StateView<D>& s, std::span<const Index> ids) const = 0;
  /// Dissipated power, ≥ 0.
  virtual Real power(const StateView<D>& s) const = 0;
  /// The forces of the dissipation terms alone, without contact history, written to f [points · D].
  virtual void dissipative_forces(const StateView<D>& s, Real* f) const = 0;
  /// Each active term by itself, in the order of the model's list; forces by the terms' plain element loops.
  virtual std::vector<TermReport> report(const StateView<D>& s) const = 0;
  /// Force of the term called `name` alone, written to f [points · D]; zero if the model has no such term.
  virtual void force_of(std::string_view name, const StateView<D>& s, Real* f) const = 0;
  /// ∂²U/∂x² of all energy terms.
  virtual void hessian(const StateView<D>& s, BlockSink<D>& h) const = 0;
  /// ∂F/∂v of all dissipations.
  virtual void damping(const StateView<D>& s, BlockSink<D>& h) const = 0;
  virtual void for_each_contact(const StateView<D>& s, const std::function<void(const Contact<D>&)>& visit) const = 0;
  /// Force on each wall by the points, added to f [walls · D]; with torques [walls · rotations], also the torque on it
  /// about the pivot of its motion, which is the origin for walls without one. `which`: walls at rest may be left out.
  virtual void add_wall_forces(const StateView<D>& s, Real* f, Real* torques = nullptr,
                               WallGroup which = WallGroup::all) const = 0;
  /// Limits of stability of velocity Verlet, of the points that are stiffest for their mass.
  virtual CriticalStep critical_step(const Topology& topology) const = 0;

  /// Whether a term has torques, so that particles have angles and spins.
  virtual bool rotates() const = 0;
  /// Contact histories of the terms.
  virtual std::vector<HistoryNeeds> history_needs() const = 0;
  /// A step of length h has been accepted, which ends at s: the next contact history becomes current. found: the last
  /// accelerations with this workspace were those at the same time, positions and angles, so that the next history need
  /// not be computed again.
  virtual void accept(const StateView<D>& s, Real h, ContactHistory& history, HistoryWorkspace& workspace,
                      bool found = false) const = 0;
};

/// Power of the moving walls on the points, as far as their forces belong to
/// the force field. For the rank's share; 0 at once if no wall moves.
template <int D>
Real wall_power(const ForceField<D>& field, const StateView<D>& s) {
  if (!s.walls.move()) return 0;
  const auto walls = static_cast<std::size_t>(s.walls.size());
  std::vector<Real> force(walls * D), torque(walls * rotations<D>);
  field.add_wall_forces(s, force.data(), torque.data(), WallGroup::moving);
  Real power = 0;
  for (Index k = 0; k < s.walls.size(); ++k) {
    const Motion<D>& motion = s.walls.motion(s.walls.body_of_wall(k));
    power -= point<D>(force.data(), k).dot(motion.drift(s.t));
    if (!motion.turns()) continue;
    if constexpr (D == 2)
      power -= torque[k] * motion.spin;
    else
      power -= point<3>(torque.data(), k).dot(motion.spin);
  }
  return power;
}

/// Terms whose forces one vectorised kernel computes in one pass:
/// Kernel::add_forces(s, chunk, f, terms…) adds their forces on the points of a chunk, or add_forces(s, workspace, …)
/// if Kernel::writes_history; where Kernel::fast() is false the plain loops are used. Energies, reports and all other
/// results use the terms' element functions, with which tests compare the kernel.
template <class Kernel, class... Terms>
struct Fused {
  std::tuple<Terms...> terms;
  explicit Fused(Terms... t) : terms(std::move(t)...) {}
};

template <class T>
inline constexpr bool is_fused = false;
template <class Kernel, class... Terms>
inline constexpr bool is_fused<Fused<Kernel, Terms...>> = true;

/// A kernel with sets_forces overwrites the force array, before other terms add to it: Kernel::set_forces.
template <class T>
inline constexpr bool sets_forces = false;
template <class Kernel, class... Terms>
inline constexpr bool sets_forces<Fused<Kernel, Terms...>> = requires {
  requires Kernel::sets_forces;
};

/// Whether a term belongs to the shape energy.
template <class T, int D>
inline constexpr bool is_shape = requires(const T term, const StateView<D>& s) {
  term.particle(s, Index());
};
template <int D, class Kernel, class... Terms>
inline constexpr bool is_shape<Fused<Kernel, Terms...>, D> = (is_shape<Terms, D> && ...);

template <class T, int D>
constexpr bool belongs_to(TermGroup group) {
  return group == TermGroup::all || is_shape<T, D> == (group == TermGroup::shape);
}

/// Whether a kernel writes the next contact history of its terms.
template <class Kernel>
inline constexpr bool writes_history = requires {
  requires Kernel::writes_history;
};

template <class T, int D>
concept ModelPart = is_fused<T> || EnergyTerm<T, D> || DissipationTerm<T, D> || HistoryTerm<T, D>;

template <int D, class... Parts>
class Model final : public ForceField<D> {
  static_assert((ModelPart<Parts, D> && ...), "a term lacks a function: see term.h");

 public:
  explicit Model(Parts... parts) : parts_(std::move(parts)...) {}

  NeighbourNeeds needs() const override {
    NeighbourNeeds needs;
    std::optional<Edges> edges;
    for_each_term([&](const auto& term) {
      using Term = std::decay_t<decltype(term)>;
      using Kind = KindOf<Term>;
      if constexpr (Kind::listed) needs.*Kind::need |= !is_off(term);
      if constexpr (requires { term.range(); }) needs.beyond_contact = std::max(needs.beyond_contact, term.range());
      if constexpr (Term::elements == Elements::vertex_edges) {
        const std::optional<Edges> own = edges_of(term);
        if (edges && own && *edges != *own)
          throw std::logic_error("terms of one model ask for wide and for bare edges, but there is one list of them");
        if (own) edges = own;
      }
    });
    needs.edges = edges.value_or(Edges::wide);
    return needs;
  }

  void check_walls(const Walls<D>& walls) const override {
    for_each_term([&](const auto& term) {
      if constexpr (requires { term.check(walls); }) term.check(walls);
    });
  }

  void forces(const StateView<D>& s, Real* f) const override {
    for_each_chunk(s, [&](Index chunk) { add_total(s, nullptr, chunk, f); });
  }

  bool accelerations(const StateView<D>& s, Real* a, HistoryWorkspace* workspace) const override {
    std::atomic<bool> finite = true;
    for_each_chunk(s, [&](Index chunk) {
      if (!set_accelerations(s, workspace, chunk, a)) finite = false;
    });
    return finite;
  }

  bool accelerations(const StateView<D>& s, std::vector<Real>& scratch,
                     const std::function<void(Index, const Real*)>& done) const override {
    Index most = 0;
    for (Index c = 0; c < s.neighbours.chunks(); ++c) most = std::max(most, s.neighbours.points(c).size());
    if constexpr (torques) throw std::logic_error("torques are not made chunk by chunk");
    // A page between them: kernels fetch ahead, to write.
    const std::size_t share = (static_cast<std::size_t>(most) * D / per_page + 2) * per_page;
    scratch.resize(share * omp_get_max_threads());
    std::atomic<bool> finite = true;
    for_each_chunk(s, [&](Index chunk) {
      // Where an array of all points would begin.
      const auto before = static_cast<std::uintptr_t>(s.neighbours.points(chunk).first) * D * sizeof(Real);
      Real* const mine = scratch.data() + share * omp_get_thread_num();
      Real* const a = reinterpret_cast<Real*>(reinterpret_cast<std::uintptr_t>(mine) - before);
      if (!set_accelerations(s, nullptr, chunk, a)) finite = false;
      done(chunk, a);
    });
    return finite;
  }

  void group_accelerations(const StateView<D>& s, TermGroup group, Real* a) const override {
    for_each_chunk(s, [&](Index chunk) {
      const auto visit = [&](auto&& add) {
        for_each_part([&](const auto& terms) {
          if (belongs_to<std::decay_t<decltype(terms)>, D>(group)) add(terms);
        });
      };
      zero(s, chunk, a);
      visit([&](const auto& terms) { set_forces(terms, s, chunk, a); });
      visit([&](const auto& terms) { add_part(terms, s, nullptr, chunk, a); });
      divide_by_masses(s, chunk, a);
    });
  }

  void derivatives(const StateView<D>& s, TermGroup group, BlockSink<D>& df_dx, BlockSink<D>& df_dv) const override {
    for_each_chunk(s, [&](Index chunk) {
      for_each_enabled(s, [&](const auto& term) {
        if (belongs_to<std::decay_t<decltype(term)>, D>(group))
          Loops<decltype(term)>::derivatives(term, s, chunk, df_dx, df_dv);
      });
    });
  }

  Couplings couplings(const StateView<D>& s, TermGroup group) const override {
    Couplings all;
    for_each_enabled(s, [&](const auto& term) {
      using Term = std::decay_t<decltype(term)>;
      if (!belongs_to<Term, D>(group)) return;
      if constexpr (EnergyTerm<Term, D>) {
        all.x.add(KindOf<Term>());
      } else {
        all.v.add(KindOf<Term>());
        if constexpr (depends_on_x<Term, D>) all.x.add(KindOf<Term>());
      }
    });
    return all;
  }

  Real energy(const StateView<D>& s, Real* f) const override {
    bool dissipative = false;
    for_each_dissipation(s, [&](const auto&) { dissipative = true; });
    for_each_history(s, [&](const auto&) { dissipative = true; });
    return sum_over_chunks(s, [&](Index chunk) {
      Real sum = 0;
      if (f != nullptr && dissipative) zero(s, chunk, f);
      for_each_energy(s, [&](const auto& term) {
        sum = Loops<decltype(term)>::add_energy(term, s, chunk, sum);
        if (f != nullptr && dissipative) Loops<decltype(term)>::add_forces(term, s, nullptr, chunk, f);
      });
      for_each_history(s, [&](const auto& term) { sum = Loops<decltype(term)>::add_energy(term, s, chunk, sum); });
      if (f != nullptr && !dissipative) add_total(s, nullptr, chunk, f);
      return sum;
    });
  }

  std::vector<TermVirial<D>> virials(const StateView<D>& s) const override {
    std::vector<TermVirial<D>> all;
    const auto add = [&](const auto& term) {
      std::array<Mat<D>, Neighbours<D>::max_chunks> part;
      for_each_chunk(s, [&](Index c) { part[c] = Loops<decltype(term)>::virial(term, s, c); });
      all.push_back({std::string(term.name()), Mat<D>::Zero()});
      for (Index c = 0; c < s.neighbours.chunks(); ++c) all.back().virial += part[c];
    };
    for_each_energy(s, add);
    for_each_history(s, add);
    return all;
  }

  Real energy_of(const StateView<D>& s, std::span<const Index> ids) const override {
    std::vector<Range> points;  // of ghosts too
    for (const Index id : ids)
      for (Index m = 0; m < s.topology.particles(); ++m)
        if (s.topology.id[m] == id) points.push_back({s.topology.offset[m], s.topology.offset[m + 1]});
    Real sum = 0;
    const auto add = [&](const auto& term) { sum = Loops<decltype(term)>::add_energy_of(term, s, points, sum); };
    for_each_energy(s, add);
    for_each_history(s, add);
    return sum;
  }

  void dissipative_forces(const StateView<D>& s, Real* f) const override {
    for_each_chunk(s, [&](Index chunk) {
      zero(s, chunk, f);
      for_each_dissipation(s, [&](const auto& term) { Loops<decltype(term)>::add_forces(term, s, nullptr, chunk, f); });
    });
  }

  Real power(const StateView<D>& s) const override {
    return sum_over_chunks(s, [&](Index chunk) {
      Real sum = 0;
      const auto add = [&](const auto& term) { sum = Loops<decltype(term)>::add_power(term, s, chunk, sum); };
      for_each_dissipation(s, add);
      for_each_history(s, add);
      return sum;
    });
  }

  std::vector<TermReport> report(const StateView<D>& s) const override {
    std::vector<TermReport> reports;
    for_each_enabled(s,
                     [&](const auto& term) { reports.push_back(Loops<decltype(term)>::report(term, s, numbers(s))); });
    return reports;
  }

  void force_of(std::string_view name, const StateView<D>& s, Real* f) const override {
    for_each_chunk(s, [&](Index chunk) {
      zero(s, chunk, f);
      for_each_enabled(s, [&](const auto& term) {
        if (term.name() == name) Loops<decltype(term)>::add_forces(term, s, nullptr, chunk, f);
      });
    });
  }

  void hessian(const StateView<D>& s, BlockSink<D>& h) const override {
    for_each_energy(s, [&](const auto& term) { Loops<decltype(term)>::add_blocks(term, s, h); });
  }

  void damping(const StateView<D>& s, BlockSink<D>& h) const override {
    for_each_dissipation(s, [&](const auto& term) { Loops<decltype(term)>::add_blocks(term, s, h); });
  }

  void for_each_contact(const StateView<D>& s, const std::function<void(const Contact<D>&)>& visit) const override {
    for_each_enabled(s, [&](const auto& term) { Loops<decltype(term)>::for_each_contact(term, s, visit); });
  }

  void add_wall_forces(const StateView<D>& s, Real* f, Real* on_pivots, WallGroup which) const override {
    for_each_enabled(s,
                     [&](const auto& term) { Loops<decltype(term)>::add_wall_forces(term, s, f, on_pivots, which); });
  }

  CriticalStep critical_step(const Topology& topology) const override {
    CriticalStep step;
    std::array<MotionRates, element_kinds> of_kind;
    for_each_term([&](const auto& term) {
      using Term = std::decay_t<decltype(term)>;
      MotionRates rates;
      if constexpr (EnergyTerm<Term, D> || HistoryTerm<Term, D>) {
        const Real rate = term.max_rate(topology);
        step.elastic = std::min(step.elastic, 2 / rate);
        rates.translation.stiffness = crowding<D, Term::elements> * square(rate);
      }
      if constexpr (DissipationTerm<Term, D> || HistoryTerm<Term, D>) {
        rates.translation.damping = term.max_damping(topology);
        step.damping = std::min(step.damping, 1 / rates.translation.damping);
      }
      if constexpr (requires { term.crowded(topology); })
        rates = term.crowded(topology);
      else if constexpr (has_torque<Term>)
        rates.rotation = rates.translation;
      of_kind[static_cast<std::size_t>(Term::elements)] += rates;
    });
    // Contacts of different kinds compete for the space around a point: a wall takes the space of half the neighbours.
    MotionRates contacts;
    for_each_kind([&]<Elements E>(ElementKind<E>) {
      const MotionRates& rates = of_kind[static_cast<std::size_t>(E)];
      if constexpr (ElementKind<E>::listed)
        contacts.raise_to(rates);
      else
        step.crowded += rates;
    });
    step.crowded += contacts;
    return step;
  }

  bool rotates() const override { return torques; }

  std::vector<HistoryNeeds> history_needs() const override {
    std::vector<HistoryNeeds> all;
    for_each_term([&](const auto& term) {
      using Term = std::decay_t<decltype(term)>;
      if constexpr (HistoryTerm<Term, D>) {
        if (is_off(term)) return;
        all.push_back({std::string(term.name()), Term::elements, Term::history});
        if constexpr (losses_of<Term>() > 0)
          for (const Loss& loss : Term::losses) all.back().losses.emplace_back(loss.name);
        if constexpr (requires { Term::constants; }) all.back().constants = Term::constants;
      }
    });
    return all;
  }

  void accept(const StateView<D>& s, Real h, ContactHistory& history, HistoryWorkspace& workspace,
              bool found) const override {
    if (!found) {
      std::vector<Real> unused(numbers(s));
      for_each_chunk(s, [&](Index chunk) {
        for_each_history(
            s, [&](const auto& term) { Loops<decltype(term)>::add_forces(term, s, &workspace, chunk, unused.data()); });
      });
    }
    for_each_history(s, [&](const auto& term) {
      using Term = std::decay_t<decltype(term)>;
      ContactTable& table = history.of(term.name());
      ContactWorkspace& own = workspace.of(term.name());
      if constexpr (losses_of<Term>() > 0) {
        std::array<Real, losses_of<Term>()> heat{};
        for (Index chunk = 0; chunk < s.neighbours.chunks(); ++chunk)
          for (const Range range : {inside<Term, D>(s, chunk), across<Term, D>(s, chunk)})
            for (std::size_t k = 0; range.size() > 0 && k < heat.size(); ++k)
              heat[k] += (Term::losses[k].per_time ? h : 1) * own.losses(range)[k];
        table.add_heat(heat);
      }
      table.accept(own);
    });
  }

 private:
  template <class T>
  struct Torques : std::bool_constant<has_torque<T>> {};
  template <class Kernel, class... Terms>
  struct Torques<Fused<Kernel, Terms...>> : std::bool_constant<(has_torque<Terms> || ...)> {};
  /// Whether particles rotate.
  static constexpr bool torques = (Torques<Parts>::value || ...);

  /// The length of an array of forces of all points, with torques.
  static std::size_t numbers(const StateView<D>& s) {
    return static_cast<std::size_t>(s.topology.points()) * (torques ? D + rotations<D> : D);
  }

  /// The loops of a term, by the type of a reference to it.
  template <class T>
  using Loops = TermLoops<D, std::decay_t<T>>;

  template <class Visit>
  void for_each_part(Visit&& visit) const {
    std::apply([&](const auto&... part) { (visit(part), ...); }, parts_);
  }
  template <class Visit>
  void for_each_term(Visit&& visit) const {
    for_each_part([&](const auto& part) {
      if constexpr (is_fused<std::decay_t<decltype(part)>>)
        std::apply([&](const auto&... term) { (visit(term), ...); }, part.terms);
      else
        visit(part);
    });
  }
  template <class Visit>
  void for_each_enabled(const StateView<D>& s, Visit&& visit) const {
    for_each_term([&](const auto& term) {
      if (term.enabled(s)) visit(term);
    });
  }
  template <class Visit>
  void for_each_energy(const StateView<D>& s, Visit&& visit) const {
    for_each_enabled(s, [&](const auto& term) {
      if constexpr (EnergyTerm<std::decay_t<decltype(term)>, D>) visit(term);
    });
  }
  template <class Visit>
  void for_each_dissipation(const StateView<D>& s, Visit&& visit) const {
    for_each_enabled(s, [&](const auto& term) {
      if constexpr (DissipationTerm<std::decay_t<decltype(term)>, D>) visit(term);
    });
  }

  template <class Visit>
  void for_each_history(const StateView<D>& s, Visit&& visit) const {
    for_each_enabled(s, [&](const auto& term) {
      if constexpr (HistoryTerm<std::decay_t<decltype(term)>, D>) visit(term);
    });
  }

  /// The chunks write to their own points only, so that any thread may compute any chunk. Errors of elements are
  /// rethrown; of several errors, the error of the first chunk.
  template <class Visit>
  static void for_each_chunk(const StateView<D>& s, Visit&& visit) {
    const Index chunks = s.neighbours.chunks();
    if (chunks == 1) return visit(0);
    Index failed = chunks;
    std::exception_ptr error;
    const auto attempt = [&](Index c) {
      try {
        visit(c);
      } catch (...) {
#pragma omp critical
        if (c < failed) {
          failed = c;
          error = std::current_exception();
        }
      }
    };
    // Each thread starts with the same share in every step, whose data are in its caches, and then helps the other
    // threads.
    std::array<Taken, most_shares> taken;
#pragma omp parallel
    {
      const Index shares = std::min<Index>(omp_get_num_threads(), most_shares);
      for (Index k = 0; k < shares; ++k) {
        const Index share = (omp_get_thread_num() + k) % shares, first = chunks * share / shares,
                    last = chunks * (share + 1) / shares;
        for (Index c = first + taken[share].count++; c < last; c = first + taken[share].count++) attempt(c);
      }
    }
    if (error) std::rethrow_exception(error);
  }

  /// Σ value(chunk), in the same order for any number of threads.
  template <class Value>
  static Real sum_over_chunks(const StateView<D>& s, Value&& value) {
    std::array<Real, Neighbours<D>::max_chunks> part;
    for_each_chunk(s, [&](Index c) { part[c] = value(c); });
    return std::accumulate(part.begin(), part.begin() + s.neighbours.chunks(), Real(0));
  }

  template <class T>
  static bool is_off(const T& term) {
    if constexpr (requires { term.off(); })
      return term.off();
    else
      return false;
  }
  /// Empty if the term has no range.
  template <class T>
  static std::optional<Edges> edges_of(const T& term) {
    if constexpr (requires { term.edges; })
      return term.edges;
    else
      return is_off(term) ? std::nullopt : std::optional(Edges::wide);
  }

  static void zero(const StateView<D>& s, Index chunk, Real* f) {
    const Range own = s.neighbours.points(chunk);
    std::fill(f + static_cast<std::size_t>(own.first) * D, f + static_cast<std::size_t>(own.last) * D, 0.0);
    if constexpr (torques) zero_torques(s, chunk, f);
  }
  static void zero_torques(const StateView<D>& s, Index chunk, Real* f) {
    const Range own = s.neighbours.points(chunk);
    std::fill_n(torques_in(s, f) + static_cast<std::size_t>(own.first) * rotations<D>,
                static_cast<std::size_t>(own.size()) * rotations<D>, 0.0);
  }

  /// The accelerations of a chunk; returns whether they are finite.
  bool set_accelerations(const StateView<D>& s, HistoryWorkspace* workspace, Index chunk, Real* a) const {
    add_total(s, workspace, chunk, a);
    return divide_by_masses(s, chunk, a);
  }

  /// Forces of a chunk to accelerations, torques with them; returns whether they are finite.
  static bool divide_by_masses(const StateView<D>& s, Index chunk, Real* a) {
    const Topology& topology = s.topology;
    const Range own = s.neighbours.particles(chunk);
    bool finite = scale_points<D>(topology.offset.data(), topology.inverse_point_mass.data(), own.first, own.last, a);
    if constexpr (torques) {
      FiniteCheck check;
      Real* alpha = torques_in(s, a) + static_cast<std::size_t>(own.first) * rotations<D>;
      for (Index m = own.first; m < own.last; ++m)  // of one point each
        for (int k = 0; k < rotations<D>; ++k) check.add(*alpha++ *= topology.inverse_inertia[m]);
      finite = finite && check.all_finite();
    }
    return finite;
  }

  /// The forces of a chunk, by kernels where there are some.
  void add_total(const StateView<D>& s, HistoryWorkspace* workspace, Index chunk, Real* f) const {
    if constexpr ((sets_forces<Parts> || ...)) {
      for_each_part([&](const auto& part) { set_forces(part, s, chunk, f); });
      if constexpr (torques) zero_torques(s, chunk, f);
    } else {
      zero(s, chunk, f);
    }
    for_each_part([&](const auto& part) { add_part(part, s, workspace, chunk, f); });
  }

  template <class P>
  static void add_part(const P& part, const StateView<D>& s, HistoryWorkspace* workspace, Index chunk, Real* f) {
    if constexpr (is_fused<P>)
      add_fused(part, s, workspace, chunk, f);
    else if (part.enabled(s))
      Loops<P>::add_forces(part, s, workspace, chunk, f);
  }

  template <class Kernel, class... Terms>
  static void set_forces(const Fused<Kernel, Terms...>& part, const StateView<D>& s, Index chunk, Real* f) {
    if constexpr (sets_forces<Fused<Kernel, Terms...>>)
      std::apply([&](const auto&... term) { Kernel::set_forces(s, chunk, f, term...); }, part.terms);
  }
  template <class T>
  static void set_forces(const T&, const StateView<D>&, Index, Real*) {}

  template <class Kernel, class... Terms>
  static void add_fused(const Fused<Kernel, Terms...>& part, const StateView<D>& s, HistoryWorkspace* workspace,
                        Index chunk, Real* f) {
    static_assert(((is_shape<Terms, D> == is_shape<Fused<Kernel, Terms...>, D>)&&...), "a kernel belongs to one part");
    std::apply(
        [&](const auto&... term) {
          if (!Kernel::fast())
            ((term.enabled(s) ? Loops<Terms>::add_forces(term, s, workspace, chunk, f) : void()), ...);
          else if constexpr (writes_history<Kernel>)
            Kernel::add_forces(s, workspace, chunk, f, term...);
          else
            Kernel::add_forces(s, chunk, f, term...);
        },
        part.terms);
  }

  static constexpr Index most_shares = 64;
  struct alignas(64) Taken {
    std::atomic<Index> count = 0;
  };
  static constexpr std::size_t per_page = 512;  ///< coordinates: each thread writes to separate pages

  std::tuple<Parts...> parts_;
};

}  // namespace pliant
