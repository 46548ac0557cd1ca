// The forces of a simulation that Python drives: of a model whose coefficients may change, and of a function.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include <pliant/model/force_field.h>

namespace pliant::python {

/// All but the sums of forces comes from the model: energies, contacts and derivatives do not include the function.
template <int D>
class ChangeableField final : public ForceField<D> {
 public:
  /// Writes a force on each own point [own points · D].
  using Function = std::function<void(const StateView<D>& s, Real* f)>;

  /// walls: whether the simulation has any.
  ChangeableField(std::unique_ptr<ForceField<D>> field, bool walls) : field_(std::move(field)), walls_(walls) {}

  /// Whether another model may replace the present one without other lists or another history.
  bool fits(const ChangeableField& other) const {
    if (!(needs() == other.needs()) || rotates() != other.rotates()) return false;
    const std::vector<HistoryNeeds> own = history_needs(), others = other.history_needs();
    return std::ranges::equal(own, others, [](const HistoryNeeds& a, const HistoryNeeds& b) {
      return a.name == b.name && a.width == b.width && a.constants == b.constants;
    });
  }
  void take_model(ChangeableField&& other) { field_ = std::move(other.field_); }
  void set_function(Function function) { function_ = std::move(function); }

  /// Power of the forces that the function returned last, at velocities v [own points · D]; 0 without a function.
  Real function_power(const Real* v) const {
    Real power = 0;
    if (!function_) return power;
    for (std::size_t k = 0; k < force_.size(); ++k) power += force_[k] * v[k];
    return power;
  }
  /// Power of the first forces since start_power(), at the velocities of that evaluation.
  Real first_power() const { return first_power_.value_or(0); }
  void start_power() { first_power_.reset(); }
  /// Calls the function, for function_power().
  void find_function(const StateView<D>& s) const {
    if (!function_) return;
    force_.assign(static_cast<std::size_t>(s.topology.owned_points()) * D, 0);
    function_(s, force_.data());
    if (!first_power_ && s.v != nullptr) first_power_ = function_power(s.v);
  }

  NeighbourNeeds needs() const override { return field_->needs(); }
  void check_walls(const Walls<D>& walls) const override { field_->check_walls(walls); }
  void forces(const StateView<D>& s, Real* f) const override {
    field_->forces(s, f);
    add_function(s, f, [](Index) { return Real(1); });
  }
  bool accelerations(const StateView<D>& s, Real* a, HistoryWorkspace* workspace = nullptr) const override {
    const bool finite = field_->accelerations(s, a, workspace);
    add_accelerations(s, a);
    return finite;
  }
  bool accelerations(const StateView<D>& s, std::vector<Real>& scratch,
                     const std::function<void(Index, const Real*)>& done) const override {
    if (!function_) return field_->accelerations(s, scratch, done);
    scratch.resize(static_cast<std::size_t>(s.topology.points()) * (D + rotations<D>));
    const bool finite = accelerations(s, scratch.data());
    for (Index chunk = 0; chunk < s.neighbours.chunks(); ++chunk) done(chunk, scratch.data());
    return finite;
  }
  void group_accelerations(const StateView<D>& s, TermGroup group, Real* a) const override {
    field_->group_accelerations(s, group, a);
    if (group != TermGroup::shape) add_accelerations(s, a);
  }
  void derivatives(const StateView<D>& s, TermGroup group, BlockSink<D>& df_dx, BlockSink<D>& df_dv) const override {
    field_->derivatives(s, group, df_dx, df_dv);
  }
  Couplings couplings(const StateView<D>& s, TermGroup group) const override { return field_->couplings(s, group); }
  Real energy(const StateView<D>& s, Real* f = nullptr) const override { return field_->energy(s, f); }
  std::vector<TermVirial<D>> virials(const StateView<D>& s) const override { return field_->virials(s); }
  std::vector<Mat<D>> particle_virials(const StateView<D>& s) const override { return field_->particle_virials(s); }
  Real energy_of(const StateView<D>& s, std::span<const Index> ids) const override { return field_->energy_of(s, ids); }
  Real power(const StateView<D>& s) const override { return field_->power(s); }
  void dissipative_forces(const StateView<D>& s, Real* f) const override { field_->dissipative_forces(s, f); }
  std::vector<TermReport> report(const StateView<D>& s) const override { return field_->report(s); }
  void force_of(std::initializer_list<std::string_view> names, const StateView<D>& s, Real* f) const override {
    field_->force_of(names, s, f);
  }
  void hessian(const StateView<D>& s, BlockSink<D>& h, PreStress pre_stress = PreStress::kept) const override {
    field_->hessian(s, h, pre_stress);
  }
  void damping(const StateView<D>& s, BlockSink<D>& h) const override { field_->damping(s, h); }
  void for_each_contact(const StateView<D>& s, const std::function<void(const Contact<D>&)>& visit) const override {
    field_->for_each_contact(s, visit);
  }
  void for_each_pair_force(const StateView<D>& s,
                           const std::function<void(const PairForce<D>&)>& visit) const override {
    field_->for_each_pair_force(s, visit);
  }
  void add_wall_forces(const StateView<D>& s, Real* f, Real* torques = nullptr,
                       WallGroup which = WallGroup::all) const override {
    field_->add_wall_forces(s, f, torques, which);
  }
  CriticalStep critical_step(const Topology& topology, bool walls = true) const override {
    return field_->critical_step(topology, walls && walls_);
  }
  bool rotates() const override { return field_->rotates(); }
  std::vector<HistoryNeeds> history_needs() const override { return field_->history_needs(); }
  void accept(const StateView<D>& s, Real h, ContactHistory& history, HistoryWorkspace& workspace,
              bool found = false) const override {
    field_->accept(s, h, history, workspace, found);
  }

 private:
  template <class Factor>
  void add_function(const StateView<D>& s, Real* f, Factor&& factor) const {
    if (!function_) return;
    find_function(s);
    for (Index i = 0; i < s.topology.owned_points(); ++i)
      point<D>(f, i) += factor(i) * point<D>(static_cast<const Real*>(force_.data()), i);
  }
  void add_accelerations(const StateView<D>& s, Real* a) const {
    add_function(s, a, [&](Index i) { return s.topology.inverse_mass(i); });
  }

  std::unique_ptr<ForceField<D>> field_;
  bool walls_;
  Function function_;
  mutable std::vector<Real> force_;
  mutable std::optional<Real> first_power_;
};

}  // namespace pliant::python
