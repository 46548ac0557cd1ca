// The functions of a term of any type, so that code that uses them is compiled once and not for each model.
#pragma once

#include <algorithm>
#include <array>
#include <functional>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include <pliant/model/force_field.h>
#include <pliant/model/term_loops.h>

namespace pliant {

/// Whether a term belongs to the shape energy.
template <class T, int D>
inline constexpr bool is_shape = requires(const T term, const StateView<D>& s) {
  term.particle(s, Index());
};

/// Upper bounds of how fast the forces of one term change the motion.
struct TermRates {
  std::optional<Real> elastic = {};  ///< ω of one element; of terms with energy or history
  std::optional<Real> damping = {};  ///< γ of one element; of dissipations and terms with history
  MotionRates crowded = {};          ///< with as many contacts as fit around a point
};

/// The kind of a term.
struct TermKind {
  bool energy, dissipation, history;
  bool shape;  ///< belongs to the shape energy
  Elements elements;
};

/// The functions of one term; TermLoops explains the loops. One virtual call per chunk or per evaluation, none per
/// element.
template <int D>
class TermFunctions {
 public:
  explicit TermFunctions(TermKind which) : kind(which) {}
  TermFunctions(const TermFunctions&) = delete;
  TermFunctions& operator=(const TermFunctions&) = delete;
  virtual ~TermFunctions() = default;

  const TermKind kind;

  virtual std::string_view name() const = 0;
  virtual bool enabled(const StateView<D>& s) const = 0;
  /// edges: the edges that earlier terms need. Errors: std::logic_error if this term needs other edges.
  virtual void add_needs(NeighbourNeeds& needs, std::optional<Edges>& edges) const = 0;
  virtual void check_walls(const Walls<D>& walls) const = 0;
  virtual void add_couplings(Couplings& all) const = 0;
  virtual TermRates rates(const Topology& topology) const = 0;
  /// Empty for a term without history, or one that is off.
  virtual std::optional<HistoryNeeds> history_needs() const = 0;

  virtual void add_forces(const StateView<D>& s, HistoryWorkspace* workspace, Index chunk, Real* f) const = 0;
  virtual Real add_energy(const StateView<D>& s, Index chunk, Real sum) const = 0;
  virtual Real add_energy_of(const StateView<D>& s, std::span<const Range> points, Real sum) const = 0;
  virtual Real add_power(const StateView<D>& s, Index chunk, Real sum) const = 0;
  virtual Mat<D> virial(const StateView<D>& s, Index chunk) const = 0;
  virtual void add_particle_virials(const StateView<D>& s, Index chunk, Mat<D>* sums) const = 0;
  virtual TermReport report(const StateView<D>& s, std::size_t numbers) const = 0;
  virtual void derivatives(const StateView<D>& s, Index chunk, BlockSink<D>& df_dx, BlockSink<D>& df_dv) const = 0;
  virtual void add_blocks(const StateView<D>& s, BlockSink<D>& h, PreStress pre_stress) const = 0;
  virtual void for_each_contact(const StateView<D>& s, const std::function<void(const Contact<D>&)>& visit) const = 0;
  virtual void for_each_pair_force(const StateView<D>& s,
                                   const std::function<void(const PairForce<D>&)>& visit) const = 0;
  virtual void add_wall_forces(const StateView<D>& s, Real* f, Real* on_pivots, WallGroup which) const = 0;
  /// The next history becomes current after a step of length h, and the losses of the step are added.
  virtual void accept(const StateView<D>& s, Real h, ContactHistory& history, HistoryWorkspace& workspace) const = 0;
};

/// The functions of a term of type T, which must outlive this object.
template <int D, class T>
class TermFunctionsOf final : public TermFunctions<D> {
  using Loops = TermLoops<D, T>;
  using Kind = KindOf<T>;
  using Of = ElementLoops<D, T::elements>;
  static constexpr bool is_energy = EnergyTerm<T, D>, has_history = HistoryTerm<T, D>,
                        is_dissipation = DissipationTerm<T, D>;

 public:
  explicit TermFunctionsOf(const T& term)
      : TermFunctions<D>({is_energy, is_dissipation, has_history, is_shape<T, D>, T::elements}), term_(term) {}

  std::string_view name() const override { return term_.name(); }
  bool enabled(const StateView<D>& s) const override { return term_.enabled(s); }

  void add_needs(NeighbourNeeds& needs, std::optional<Edges>& edges) const override {
    if constexpr (Kind::listed) needs.*Kind::need |= !is_off();
    if constexpr (requires { term_.range(); }) needs.beyond_contact = std::max(needs.beyond_contact, term_.range());
    if constexpr (T::elements == Elements::vertex_edges || T::elements == Elements::vertex_faces) {
      const std::optional<Edges> own = this->edges();
      if (edges && own && *edges != *own)
        throw std::logic_error("terms of one model ask for wide and for bare edges, but there is one list of them");
      if (own) edges = own;
    }
  }
  void check_walls(const Walls<D>& walls) const override {
    if constexpr (requires { term_.check(walls); }) term_.check(walls);
  }
  void add_couplings(Couplings& all) const override {
    if constexpr (is_energy) {
      all.x.add(Kind());
    } else {
      all.v.add(Kind());
      if constexpr (depends_on_x<T, D>) all.x.add(Kind());
    }
  }
  TermRates rates(const Topology& topology) const override {
    TermRates rates;
    MotionRates& all = rates.crowded;
    if constexpr (is_energy || has_history) {
      rates.elastic = term_.max_rate(topology);
      all.translation.stiffness = crowding<D, T::elements> * square(*rates.elastic);
    }
    if constexpr (is_dissipation || has_history) rates.damping = all.translation.damping = term_.max_damping(topology);
    if constexpr (requires { term_.crowded(topology); })
      all = term_.crowded(topology);
    else if constexpr (has_torque<T>)
      all.rotation = all.translation;
    return rates;
  }
  std::optional<HistoryNeeds> history_needs() const override {
    if constexpr (has_history) {
      if (is_off()) return {};
      HistoryNeeds needs{std::string(term_.name()), T::elements, T::history};
      if constexpr (losses_of<T>() > 0)
        for (const Loss& loss : T::losses) needs.losses.emplace_back(loss.name);
      if constexpr (requires { T::constants; }) needs.constants = T::constants;
      return needs;
    } else {
      return {};
    }
  }

  void add_forces(const StateView<D>& s, HistoryWorkspace* workspace, Index chunk, Real* f) const override {
    Loops::add_forces(term_, s, workspace, chunk, f);
  }
  Real add_energy(const StateView<D>& s, Index chunk, Real sum) const override {
    if constexpr (is_energy || has_history)
      return Loops::add_energy(term_, s, chunk, sum);
    else
      return sum;
  }
  Real add_energy_of(const StateView<D>& s, std::span<const Range> points, Real sum) const override {
    if constexpr (is_energy || has_history)
      return Loops::add_energy_of(term_, s, points, sum);
    else
      return sum;
  }
  Real add_power(const StateView<D>& s, Index chunk, Real sum) const override {
    if constexpr (is_dissipation || has_history)
      return Loops::add_power(term_, s, chunk, sum);
    else
      return sum;
  }
  Mat<D> virial(const StateView<D>& s, Index chunk) const override { return Loops::virial(term_, s, chunk); }
  void add_particle_virials(const StateView<D>& s, Index chunk, Mat<D>* sums) const override {
    Loops::add_particle_virials(term_, s, chunk, sums);
  }
  TermReport report(const StateView<D>& s, std::size_t numbers) const override {
    return Loops::report(term_, s, numbers);
  }
  void derivatives(const StateView<D>& s, Index chunk, BlockSink<D>& df_dx, BlockSink<D>& df_dv) const override {
    Loops::derivatives(term_, s, chunk, df_dx, df_dv);
  }
  void add_blocks(const StateView<D>& s, BlockSink<D>& h, PreStress pre_stress) const override {
    Loops::add_blocks(term_, s, h, pre_stress);
  }
  void for_each_contact(const StateView<D>& s, const std::function<void(const Contact<D>&)>& visit) const override {
    Loops::for_each_contact(term_, s, visit);
  }
  void for_each_pair_force(const StateView<D>& s,
                           const std::function<void(const PairForce<D>&)>& visit) const override {
    Loops::for_each_pair_force(term_, s, visit);
  }
  void add_wall_forces(const StateView<D>& s, Real* f, Real* on_pivots, WallGroup which) const override {
    Loops::add_wall_forces(term_, s, f, on_pivots, which);
  }
  void accept(const StateView<D>& s, Real h, ContactHistory& history, HistoryWorkspace& workspace) const override {
    if constexpr (has_history) {
      ContactTable& table = history.of(term_.name());
      ContactWorkspace& own = workspace.of(term_.name());
      if constexpr (losses_of<T>() > 0) {
        std::array<Real, losses_of<T>()> heat{};
        for (Index chunk = 0; chunk < s.neighbours.chunks(); ++chunk)
          for (const Range range : {Of::inside(s, chunk), Of::across(s, chunk)})
            for (std::size_t k = 0; range.size() > 0 && k < heat.size(); ++k)
              heat[k] += (T::losses[k].per_time ? h : 1) * own.losses(range)[k];
        table.add_heat(heat);
      }
      table.accept(own);
    }
  }

 private:
  bool is_off() const {
    if constexpr (requires { term_.off(); })
      return term_.off();
    else
      return false;
  }
  /// Empty if the term has no range.
  std::optional<Edges> edges() const {
    if constexpr (requires { term_.edges; })
      return term_.edges;
    else
      return is_off() ? std::nullopt : std::optional(Edges::wide);
  }

  const T& term_;
};

}  // namespace pliant
