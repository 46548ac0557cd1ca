#include <pliant/run/energy_audit.h>

#include <fmt/format.h>

#include <array>
#include <limits>
#include <stdexcept>

#include <pliant/kernels/arrays.h>

namespace pliant {

Real EnergyBudget::scale() const {
  constexpr Real small_part = 1e-4;
  return std::max({std::abs(work), std::abs(heat), std::abs(change), largest, small_part * std::abs(energy), rounding});
}

Real EnergyBudget::certain_error() const {
  constexpr Real errors = 3;
  // More than an error of the heat explains, as heat is never negative.
  const Real gain = change - work - errors * uncertainty_of_work;
  const Real certain = std::max(std::abs(error()) - errors * uncertainty, gain);
  return certain > 0 ? certain / scale() : 0;
}

nlohmann::ordered_json EnergyBudget::json() const {
  return {{"work", work},
          {"heat", heat},
          {"change", change},
          {"error", error()},
          {"relative_error", relative_error()},
          {"uncertainty", std::isfinite(uncertainty) ? nlohmann::ordered_json(uncertainty / scale()) : nullptr}};
}

std::string EnergyBudget::text() const {
  const std::string deviation =
      std::isfinite(uncertainty) && uncertainty != 0
          ? fmt::format("{:.2g} ± {:.2g} %", 100 * relative_error(), 100 * uncertainty / scale())
          : fmt::format("{:.2g} %", 100 * relative_error());
  return fmt::format("energy: change {:.4g}, work {:.4g}, heat {:.4g}; error {}{}", change, work, heat, deviation,
                     std::isfinite(uncertainty) ? "" : " (uncertainty unknown: too few samples of the heat)");
}

void check_energy(const EnergyBudget& budget) {
  constexpr Real limit = 0.1;
  if (!(budget.certain_error() > limit)) return;
  throw NumericalError(
      "{}: energy is not conserved; use shorter steps (-dt, or -ts_adapt_dt_max) or lower tolerances, or accept it "
      "with "
      "-allow_energy_error",
      budget.text());
}

std::string energy_warning(const EnergyBudget& budget) {
  constexpr Real noticeable = 0.01;
  const Real error = budget.certain_error();
  if (!(error > noticeable)) return {};
  return fmt::format("energy is conserved to {:.2g} % only: compare with a shorter step (-dt) or lower tolerances",
                     100 * error);
}

void SampledIntegral::add(Real t, Real value) {
  if (count_ > 0) sum_ += (t - last_.first) * (value + last_.second) / 2;
  if (count_ > 1) {
    // Deviation of a value from the line between its neighbours; for independent values its variance is 3/2 of theirs.
    const Real span = t - before_.first, part = (last_.first - before_.first) / span;
    squares_ += square(span / 2 * (last_.second - (1 - part) * before_.second - part * value)) / 1.5;
  }
  before_ = last_;
  last_ = {t, value};
  ++count_;
}

Real SampledIntegral::error() const {
  if (count_ < fewest) return sum_ == 0 ? 0 : std::numeric_limits<Real>::infinity();
  return std::sqrt(squares_);
}

void SampledIntegral::visit(Archive& a, const std::string& name) {
  std::vector<Real> values{sum_, squares_, last_.first, last_.second, before_.first, before_.second};
  a.number(name + "_count", count_);
  a.array(name, values, values.size());
  sum_ = values[0];
  squares_ = values[1];
  last_ = {values[2], values[3]};
  before_ = {values[4], values[5]};
}

template <int D>
void EnergyAudit<D>::start() {
  if (!started_) {
    started_ = true;
    start_energy_ = energy();
    power_ = wall_power(At::anywhere);
    power_at_ = simulation_->state().t;
    if (inertia()) sample(At::anywhere);
  }
  prepare(false);
}

template <int D>
void EnergyAudit<D>::prepare(bool changed) {
  predicted_.clear();
  const Integrator& integrator = simulation_->integrator();
  if (changed || !integrator.carries() || !due(simulation_->state().step + 1)) return;
  predicted_.assign(integrator.carried().begin(), integrator.carried().end());
}

template <int D>
void EnergyAudit<D>::follow(const std::pair<Real, Real>& outer) {
  if (!inertia()) return;
  const State& s = simulation_->state();
  if (outer != std::pair<Real, Real>(0, 0)) work_ += (outer.first + outer.second) / 2 * (s.t - power_at_);
  if (simulation_->particles().walls().move()) {
    const Real power = wall_power(At::end_of_step);
    work_ += (power_ + power) / 2 * (s.t - power_at_);
    power_ = power;
  }
  power_at_ = s.t;
  if (due(s.step)) sample(At::end_of_step);
}

template <int D>
void EnergyAudit<D>::disturb(Change what) {
  if (!started_) return;
  if (!undisturbed_) {
    undisturbed_.emplace(Energies{kinetic_energy(), {}});
    if (inertia() && heat_.last_time() != simulation_->state().t)
      heat_.add(simulation_->state().t, rates(At::anywhere).heat);
  }
  if (what == Change::all && !undisturbed_->potential) undisturbed_->potential = potential_energy();
}

template <int D>
void EnergyAudit<D>::settle() {
  if (!undisturbed_) return;
  const Energies before = *undisturbed_;
  undisturbed_.reset();
  const Real kinetic = kinetic_energy();
  brought_ += kinetic - before.kinetic;
  if (kinetic != before.kinetic) kicked();
  if (before.potential) brought_ += potential_energy() - *before.potential;
  if (!inertia()) return;
  predicted_.clear();
  power_ = wall_power(At::anywhere);
  const Rates now = rates(At::anywhere);
  heat_.jump(now.heat);
  largest_ = std::max(largest_, now.kinetic_energy);
}

template <int D>
StateView<D> EnergyAudit<D>::view(const Real* v, At at) {
  State& s = simulation_->state();
  ParticleSystem<D>& particles = simulation_->particles();
  return at == At::end_of_step && simulation_->integrator().carries() ? particles.last_view(s.x().data(), v, s.t)
                                                                      : particles.view(s.x().data(), v, s.t);
}

template <int D>
Real EnergyAudit<D>::kinetic_energy(const StateView<D>& s) const {
  return inertia() ? pliant::kinetic_energy(s) : 0;
}

template <int D>
Real EnergyAudit<D>::kinetic_energy() {
  if (!inertia()) return 0;
  return simulation_->ranks().sum(kinetic_energy(view(simulation_->state().v().data(), At::anywhere)));
}

template <int D>
Real EnergyAudit<D>::potential_energy() {
  const StateView<D> s = view(simulation_->state().v().data(), At::anywhere);
  return simulation_->ranks().sum(simulation_->particles().field().energy(s));
}

template <int D>
Real EnergyAudit<D>::energy() {
  const StateView<D> s = view(simulation_->state().v().data(), At::anywhere);
  return simulation_->ranks().sum(kinetic_energy(s) + simulation_->particles().field().energy(s));
}

template <int D>
Real EnergyAudit<D>::energy_of(std::span<const Index> ids) {
  const StateView<D> s = view(simulation_->state().v().data(), At::anywhere);
  Real sum = simulation_->particles().field().energy_of(s, ids);
  if (inertia())
    for (const Index id : ids)
      for (Index m = 0; m < s.topology.owned(); ++m)
        if (s.topology.id[m] == id)
          for (Index i = s.topology.offset[m]; i < s.topology.offset[m + 1]; ++i) sum += s.kinetic_energy(i);
  return simulation_->ranks().sum(sum);
}

template <int D>
Real EnergyAudit<D>::wall_power(At at) {
  if (!simulation_->particles().walls().move()) return 0;
  const StateView<D> s = view(simulation_->state().v().data(), at);
  return simulation_->ranks().sum(pliant::wall_power(simulation_->particles().field(), s));
}

template <int D>
typename EnergyAudit<D>::Rates EnergyAudit<D>::rates(At at) {
  const ParticleSystem<D>& particles = simulation_->particles();
  const State& state = simulation_->state();
  const std::size_t n = state.size();
  const bool known = predicted_.size() == n;
  const StateView<D> s = view(known ? predicted_.data() : state.v().data(), at);
  force_.resize(static_cast<std::size_t>(s.topology.points()) *
                static_cast<std::size_t>(particles.coordinates().all()));
  particles.field().dissipative_forces(s, force_.data());
  StateView<D> own = s;
  own.v = state.v().data();
  if (own.spins != nullptr) own.spins = particles.rotations_in(state.v()).data();
  std::array<Real, 2> sums{-dot(force_.data(), state.v().data(), n), kinetic_energy(own)};
  simulation_->ranks().sum(sums);
  return {sums[0], sums[1]};
}

template <int D>
void EnergyAudit<D>::sample(At at) {
  const Rates now = rates(at);
  heat_.add(simulation_->state().t, now.heat);
  largest_ = std::max(largest_, now.kinetic_energy);
}

template <int D>
std::pair<SampledIntegral, Real> EnergyAudit<D>::until_now() {
  std::pair all{heat_, largest_};
  if (heat_.last_time() == simulation_->state().t) return all;
  const Rates now = rates(At::anywhere);
  all.first.add(simulation_->state().t, now.heat);
  all.second = std::max(largest_, now.kinetic_energy);
  return all;
}

/// Energy of contacts compressed by 1e-9 of a radius.
template <int D>
Real EnergyAudit<D>::rounding() const {
  const Topology& own = simulation_->topology();
  const Real elastic = simulation_->particles().field().critical_step(own).elastic;
  Real sum = 0;
  for (Index m = 0; m < own.owned(); ++m)
    sum += own.point_mass[m] * own.points_of(m) * square(1e-9 * own.sigma[m] / elastic);
  return simulation_->ranks().sum(sum);
}

template <int D>
Real EnergyAudit<D>::integrated(std::string_view name) const {
  const auto& all = simulation_->overdamped()->quantities();
  const auto found = std::ranges::find(all, name, &IntegratedQuantity<D>::name);
  if (found == all.end()) throw std::logic_error("the system integrates no " + std::string(name));
  const auto k = static_cast<std::size_t>(found - all.begin());
  return simulation_->ranks().broadcast(simulation_->ranks().root() ? simulation_->state().extra.at(k) : 0);
}

template <int D>
Real EnergyAudit<D>::work() const {
  return (inertia() ? work_ : integrated("work")) + brought_;
}

template <int D>
Real EnergyAudit<D>::contact_heat() const {
  Real sum = 0;
  for (const ContactTable& table : simulation_->particles().history().tables())
    for (const Real lost : table.heat()) sum += lost;
  return simulation_->ranks().sum(sum);
}

template <int D>
Real EnergyAudit<D>::heat() {
  return inertia() ? contact_heat() + sampled_heat() : integrated("dissipated");
}

template <int D>
EnergyBudget EnergyAudit<D>::budget() {
  EnergyBudget b;
  if (inertia()) {
    const auto [heat, largest] = until_now();
    b.heat = contact_heat() + heat.value();
    b.uncertainty = heat.error();
    b.largest = largest;
    b.rounding = rounding();
  } else {
    b.heat = integrated("dissipated");
  }
  b.energy = energy();
  b.change = b.energy - start_energy_;
  b.work = work();
  return b;
}

template <int D>
void EnergyAudit<D>::visit(Archive& a) {
  a.flag("audit_started", started_);
  a.number("audit_start_energy", start_energy_);
  a.number("audit_brought", brought_);
  a.number("audit_work", work_);
  a.number("audit_power", power_);
  a.number("audit_power_at", power_at_, 0, a.t());
  a.number("audit_largest", largest_, 0);
  heat_.visit(a, "audit_heat");
  if (a.reads() || kicked_at_ >= 0) a.newer("audit_kicked_at", kicked_at_);
}

template class EnergyAudit<2>;
template class EnergyAudit<3>;

}  // namespace pliant
