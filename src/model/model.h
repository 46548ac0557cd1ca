// The model: a compile-time list of terms, and the kernels that compute their forces.
#pragma once

#include <memory>
#include <tuple>
#include <type_traits>
#include <utility>

#include <pliant/model/term_functions.h>
#include <pliant/model/term_loops.h>
#include <pliant/model/term_sum.h>

namespace pliant {

/// Terms whose forces one vectorised kernel computes in one pass:
/// Kernel::add_forces(s, chunk, f, terms…) adds their forces on the points of a chunk, or add_forces(s, workspace, …)
/// if Kernel::writes_history; where Kernel::fast() is false the plain loops are used. Kernel::add_dissipation, where
/// there is one, adds the forces of those terms that are dissipations. Energies, reports and all other
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

/// Whether all terms of a kernel belong to the shape energy.
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

/// Only the forces of kernels and terms, chunk by chunk, are compiled for each model; see TermSum for all other
/// functions.
template <int D, class... Parts>
class Model final : public TermSum<D> {
  static_assert((ModelPart<Parts, D> && ...), "a term lacks a function: see term.h");

 public:
  explicit Model(Parts... parts) : parts_(std::move(parts)...) {
    for_each_part([&](const auto& part) { list(part); });
  }

  bool rotates() const override { return torques; }

 private:
  template <class T>
  struct Torques : std::bool_constant<has_torque<T>> {};
  template <class Kernel, class... Terms>
  struct Torques<Fused<Kernel, Terms...>> : std::bool_constant<(has_torque<Terms> || ...)> {};
  /// Whether particles rotate.
  static constexpr bool torques = (Torques<Parts>::value || ...);

  template <class T>
  void list(const T& term) {
    this->add_term(std::make_unique<TermFunctionsOf<D, T>>(term));
  }
  template <class Kernel, class... Terms>
  void list(const Fused<Kernel, Terms...>& part) {
    static_assert(((is_shape<Terms, D> == is_shape<Fused<Kernel, Terms...>, D>)&&...), "a kernel belongs to one part");
    std::apply([&](const auto&... term) { (list(term), ...); }, part.terms);
  }

  template <class Visit>
  void for_each_part(Visit&& visit) const {
    std::apply([&](const auto&... part) { (visit(part), ...); }, parts_);
  }

  void set_total(const StateView<D>& s, HistoryWorkspace* workspace, Index chunk, Real* f) const override {
    if constexpr ((sets_forces<Parts> || ...)) {
      for_each_part([&](const auto& part) { set_forces(part, s, chunk, f); });
      if constexpr (torques) this->zero_torques(s, chunk, f);
    } else {
      this->zero(s, chunk, f);
    }
    for_each_part([&](const auto& part) { add_part(part, s, workspace, chunk, f); });
  }

  void set_group(const StateView<D>& s, TermGroup group, Index chunk, Real* f) const override {
    const auto visit = [&](auto&& add) {
      for_each_part([&](const auto& part) {
        if (belongs_to<std::decay_t<decltype(part)>, D>(group)) add(part);
      });
    };
    this->zero(s, chunk, f);
    visit([&](const auto& part) { set_forces(part, s, chunk, f); });
    visit([&](const auto& part) { add_part(part, s, nullptr, chunk, f); });
  }

  void set_dissipation(const StateView<D>& s, Index chunk, Real* f) const override {
    this->zero(s, chunk, f);
    for_each_part([&](const auto& part) { add_dissipation(part, s, chunk, f); });
  }

  template <class T>
  static void add_dissipation(const T& term, const StateView<D>& s, Index chunk, Real* f) {
    if constexpr (DissipationTerm<T, D>) add_part(term, s, nullptr, chunk, f);
  }
  template <class Kernel, class... Terms>
  static void add_dissipation(const Fused<Kernel, Terms...>& part, const StateView<D>& s, Index chunk, Real* f) {
    std::apply(
        [&](const auto&... term) {
          if constexpr (requires { Kernel::add_dissipation(s, chunk, f, term...); })
            if (Kernel::fast()) return Kernel::add_dissipation(s, chunk, f, term...);
          (add_dissipation(term, s, chunk, f), ...);
        },
        part.terms);
  }

  template <class T>
  static void add_part(const T& term, const StateView<D>& s, HistoryWorkspace* workspace, Index chunk, Real* f) {
    if (term.enabled(s)) TermLoops<D, T>::add_forces(term, s, workspace, chunk, f);
  }
  template <class Kernel, class... Terms>
  static void add_part(const Fused<Kernel, Terms...>& part, const StateView<D>& s, HistoryWorkspace* workspace,
                       Index chunk, Real* f) {
    std::apply(
        [&](const auto&... term) {
          if (!Kernel::fast())
            (add_part(term, s, workspace, chunk, f), ...);
          else if constexpr (writes_history<Kernel>)
            Kernel::add_forces(s, workspace, chunk, f, term...);
          else
            Kernel::add_forces(s, chunk, f, term...);
        },
        part.terms);
  }

  template <class Kernel, class... Terms>
  static void set_forces(const Fused<Kernel, Terms...>& part, const StateView<D>& s, Index chunk, Real* f) {
    if constexpr (sets_forces<Fused<Kernel, Terms...>>)
      std::apply([&](const auto&... term) { Kernel::set_forces(s, chunk, f, term...); }, part.terms);
  }
  template <class T>
  static void set_forces(const T&, const StateView<D>&, Index, Real*) {}

  std::tuple<Parts...> parts_;
};

}  // namespace pliant
