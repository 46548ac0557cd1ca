// Sums over the terms of a model, compiled once for all models.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include <pliant/model/force_field.h>
#include <pliant/model/term_functions.h>

namespace pliant {

/// The functions of a force field that call each term by its TermFunctions. Threads share the chunks.
template <int D>
class TermSum : public ForceField<D> {
 public:
  TermSum() = default;
  TermSum(const TermSum&) = delete;  // its TermFunctions refer to the terms of the model
  TermSum& operator=(const TermSum&) = delete;

  NeighbourNeeds needs() const final;
  void check_walls(const Walls<D>& walls) const final;
  void forces(const StateView<D>& s, Real* f) const final;
  bool accelerations(const StateView<D>& s, Real* a, HistoryWorkspace* workspace) const final;
  bool accelerations(const StateView<D>& s, std::vector<Real>& scratch,
                     const std::function<void(Index, const Real*)>& done) const final;
  void group_accelerations(const StateView<D>& s, TermGroup group, Real* a) const final;
  void derivatives(const StateView<D>& s, TermGroup group, BlockSink<D>& df_dx, BlockSink<D>& df_dv) const final;
  Couplings couplings(const StateView<D>& s, TermGroup group) const final;
  Real energy(const StateView<D>& s, Real* f) const final;
  std::vector<TermVirial<D>> virials(const StateView<D>& s) const final;
  std::vector<Mat<D>> particle_virials(const StateView<D>& s) const final;
  Real energy_of(const StateView<D>& s, std::span<const Index> ids) const final;
  Real power(const StateView<D>& s) const final;
  void dissipative_forces(const StateView<D>& s, Real* f) const final;
  std::vector<TermReport> report(const StateView<D>& s) const final;
  void force_of(std::initializer_list<std::string_view> names, const StateView<D>& s, Real* f) const final;
  void hessian(const StateView<D>& s, BlockSink<D>& h, PreStress pre_stress = PreStress::kept) const final;
  void damping(const StateView<D>& s, BlockSink<D>& h) const final;
  void for_each_contact(const StateView<D>& s, const std::function<void(const Contact<D>&)>& visit) const final;
  void for_each_pair_force(const StateView<D>& s, const std::function<void(const PairForce<D>&)>& visit) const final;
  void add_wall_forces(const StateView<D>& s, Real* f, Real* on_pivots, WallGroup which) const final;
  CriticalStep critical_step(const Topology& topology, bool walls = true) const final;
  std::vector<HistoryNeeds> history_needs() const final;
  void accept(const StateView<D>& s, Real h, ContactHistory& history, HistoryWorkspace& workspace,
              bool found) const final;

 protected:
  void add_term(std::unique_ptr<TermFunctions<D>> term) { terms_.push_back(std::move(term)); }
  /// Of all forces, and of torques if the model rotates, on the points of a chunk.
  void zero(const StateView<D>& s, Index chunk, Real* f) const;
  static void zero_torques(const StateView<D>& s, Index chunk, Real* f);

 private:
  /// The forces on the points of a chunk, by kernels if possible, written to f.
  virtual void set_total(const StateView<D>& s, HistoryWorkspace* workspace, Index chunk, Real* f) const = 0;
  /// The forces of a part of the terms, likewise.
  virtual void set_group(const StateView<D>& s, TermGroup group, Index chunk, Real* f) const = 0;
  /// The forces of the dissipation terms, likewise.
  virtual void set_dissipation(const StateView<D>& s, Index chunk, Real* f) const = 0;

  /// The accelerations of a chunk; returns whether they are finite.
  bool set_accelerations(const StateView<D>& s, HistoryWorkspace* workspace, Index chunk, Real* a) const;
  /// Forces of a chunk to accelerations, torques with them; returns whether they are finite.
  bool divide_by_masses(const StateView<D>& s, Index chunk, Real* a) const;
  /// The length of an array of forces of all points, with torques.
  std::size_t numbers(const StateView<D>& s) const;

  using Chosen = bool TermKind::*;
  /// visit(term) for enabled terms of one kind, or of all kinds.
  template <class Visit>
  void for_each_enabled(const StateView<D>& s, Visit&& visit) const;
  template <class Visit>
  void for_each(Chosen kind, const StateView<D>& s, Visit&& visit) const;

  std::vector<std::unique_ptr<TermFunctions<D>>> terms_;
};

extern template class TermSum<2>;
extern template class TermSum<3>;

}  // namespace pliant
