// The model: a compile-time list of terms. The only element loops of the code base are here.
#pragma once

#include <algorithm>
#include <array>
#include <functional>
#include <memory>
#include <string>
#include <tuple>
#include <vector>

#include <pliant/model/term.h>

namespace pliant {

/// What one term gives for one configuration.
struct TermReport {
  std::string name;
  bool is_energy;           ///< false: a dissipation, which has no energy
  Real energy = 0;          ///< of all elements
  std::vector<Real> force;  ///< [points · D]
  std::vector<Real> particle_energy =
      {};  ///< [particles] of a term whose elements belong to one particle each, else empty
};

/// Largest steps, in t0, that keep velocity Verlet stable.
struct CriticalStep {
  Real elastic = std::numeric_limits<Real>::infinity();  ///< 2/ω of the stiffest term
  Real damping = std::numeric_limits<Real>::infinity();  ///< 1/rate of the fastest damping, as velocities are predicted
  Real least() const { return std::min(elastic, damping); }
};

/// Energies and forces of a configuration. One virtual call per evaluation, none per element.
template <int D>
class ForceField {
 public:
  virtual ~ForceField() = default;

  /// Total force, written to f [points · D].
  virtual void forces(const StateView<D>& s, Real* f) const = 0;
  /// Total energy; with f, the forces of the energy terms alone are written there.
  virtual Real energy(const StateView<D>& s, Real* f = nullptr) const = 0;
  /// Dissipated power, ≥ 0.
  virtual Real power(const StateView<D>& s) const = 0;
  /// Each active term by itself, in the order of the model's list.
  virtual std::vector<TermReport> report(const StateView<D>& s) const = 0;
  /// Force of the term called `name` alone, written to f [points · D]; zero if the model has no such term.
  virtual void force_of(std::string_view name, const StateView<D>& s, Real* f) const = 0;
  /// ∂²U/∂x² of all energy terms.
  virtual void hessian(const StateView<D>& s, BlockSink<D>& h) const = 0;
  /// ∂F/∂v of all dissipations.
  virtual void damping(const StateView<D>& s, BlockSink<D>& h) const = 0;
  virtual void for_each_contact(const StateView<D>& s, const std::function<void(const Contact<D>&)>& visit) const = 0;
  /// Force on each wall by the points, added to f [walls · D].
  virtual void add_wall_forces(const StateView<D>& s, Real* f) const = 0;
  /// Limits of stability of velocity Verlet.
  virtual CriticalStep critical_step(const Topology& topology) const = 0;
};

template <int D, class... Terms>
class Model final : public ForceField<D> {
  static_assert(((EnergyTerm<Terms, D> || DissipationTerm<Terms, D>)&&...), "a term lacks a function: see term.h");

 public:
  explicit Model(Terms... terms) : terms_(std::move(terms)...) {}

  void forces(const StateView<D>& s, Real* f) const override {
    zero(s, f);
    for_each_enabled(s, [&](const auto& term) { add_forces(term, s, f); });
  }

  Real energy(const StateView<D>& s, Real* f) const override {
    if (f != nullptr) zero(s, f);
    Real sum = 0;
    for_each_energy(s, [&](const auto& term) {
      const Index n = term.size(s);
      for (Index e = 0; e < n; ++e) sum += term.energy(s, e);
      if (f != nullptr) add_forces(term, s, f);
    });
    return sum;
  }

  Real power(const StateView<D>& s) const override {
    Real sum = 0;
    for_each_dissipation(s, [&](const auto& term) {
      const Index n = term.size(s);
      for (Index e = 0; e < n; ++e) sum += term.power(s, e);
    });
    return sum;
  }

  std::vector<TermReport> report(const StateView<D>& s) const override {
    std::vector<TermReport> reports;
    for_each_enabled(s, [&](const auto& term) {
      TermReport r{std::string(term.name()), EnergyTerm<std::decay_t<decltype(term)>, D>, 0,
                   std::vector<Real>(static_cast<std::size_t>(s.topology.points()) * D)};
      if constexpr (EnergyTerm<std::decay_t<decltype(term)>, D>) {
        const Index n = term.size(s);
        for (Index e = 0; e < n; ++e) r.energy += term.energy(s, e);
        if constexpr (requires { term.particle(s, Index()); }) {
          r.particle_energy.resize(s.topology.particles());
          for (Index e = 0; e < n; ++e) r.particle_energy[term.particle(s, e)] += term.energy(s, e);
        }
      }
      add_forces(term, s, r.force.data());
      reports.push_back(std::move(r));
    });
    return reports;
  }

  void force_of(std::string_view name, const StateView<D>& s, Real* f) const override {
    zero(s, f);
    for_each_enabled(s, [&](const auto& term) {
      if (term.name() == name) add_forces(term, s, f);
    });
  }

  void hessian(const StateView<D>& s, BlockSink<D>& h) const override {
    for_each_energy(s, [&](const auto& term) {
      const Index n = term.size(s);
      for (Index e = 0; e < n; ++e) term.add_hessian(s, e, h);
    });
  }

  void damping(const StateView<D>& s, BlockSink<D>& h) const override {
    for_each_dissipation(s, [&](const auto& term) {
      const Index n = term.size(s);
      for (Index e = 0; e < n; ++e) term.add_dforce_dv(s, e, h);
    });
  }

  void for_each_contact(const StateView<D>& s, const std::function<void(const Contact<D>&)>& visit) const override {
    for_each_enabled(s, [&](const auto& term) {
      if constexpr (ContactTerm<std::decay_t<decltype(term)>, D>) {
        Contact<D> contact;
        const Index n = term.size(s);
        for (Index e = 0; e < n; ++e)
          if (term.contact(s, e, contact)) visit(contact);
      }
    });
  }

  void add_wall_forces(const StateView<D>& s, Real* f) const override {
    for_each_enabled(s, [&](const auto& term) {
      if constexpr (requires { term.wall(s, Index()); }) {
        const Index n = term.size(s);
        for (Index e = 0; e < n; ++e) point<D>(f, term.wall(s, e)) -= term.force(s, e);
      }
    });
  }

  CriticalStep critical_step(const Topology& topology) const override {
    CriticalStep step;
    for_each_term([&](const auto& term) {
      if constexpr (EnergyTerm<std::decay_t<decltype(term)>, D>)
        step.elastic = std::min(step.elastic, 2 / term.max_rate(topology));
      else
        step.damping = std::min(step.damping, 1 / term.max_damping(topology));
    });
    return step;
  }

 private:
  template <class Visit>
  void for_each_term(Visit&& visit) const {
    std::apply([&](const auto&... term) { (visit(term), ...); }, terms_);
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

  template <class T>
  static void add_forces(const T& term, const StateView<D>& s, Real* f) {
    const Index n = term.size(s);
    if constexpr (!EnergyTerm<T, D>) {
      Scatter<D, 1> scatter{f};
      if constexpr (requires { term.touches(s, n); })
        for_each_touching(term, s, [&](Index e) { term.add_force(s, e, scatter); });
      else
        for (Index e = 0; e < n; ++e) term.add_force(s, e, scatter);
    } else {
      Scatter<D, -1> scatter{f};
      if constexpr (requires { term.touches(s, n); })
        for_each_touching(term, s, [&](Index e) { term.add_gradient(s, e, scatter); });
      else
        for (Index e = 0; e < n; ++e) term.add_gradient(s, e, scatter);
    }
  }

  /// Visits the elements of a contact term that touch, in order: sieved block by block without a branch, because
  /// whether a listed pair touches is a toss-up that no processor predicts.
  template <class T, class Visit>
  static void for_each_touching(const T& term, const StateView<D>& s, Visit&& visit) {
    const Index n = term.size(s);
    std::array<Index, 256> touching;
    for (Index first = 0; first < n; first += touching.size()) {
      const Index last = std::min<Index>(n, first + touching.size());
      std::size_t count = 0;
      for (Index e = first; e < last; ++e) {
        touching[count] = e;
        count += term.touches(s, e);
      }
      for (std::size_t k = 0; k < count; ++k) visit(touching[k]);
    }
  }

  static void zero(const StateView<D>& s, Real* f) {
    std::fill_n(f, static_cast<std::size_t>(s.topology.points()) * D, 0.0);
  }

  std::tuple<Terms...> terms_;
};

}  // namespace pliant
